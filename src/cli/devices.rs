//! `litetex devices`, and the choice of a backend by name.

use super::table::{Table, print_json};
#[cfg(not(feature = "gpu"))]
use litetex_gs::Error;
use litetex_gs::Result;
use litetex_gs::backend::Backend;
use litetex_gs::cpu::CpuBackend;
use serde::Serialize;

/// List where training and rendering can run
#[derive(clap::Args)]
pub struct DevicesArgs {
    /// As JSON
    #[arg(long)]
    json: bool,
}

/// A device and what `--device auto` makes of it.
#[derive(Serialize)]
struct Listed {
    name: String,
    description: String,
    auto: bool,
    /// Why `auto` takes it or not.
    why: String,
}

/// Prints the devices.
pub fn run(args: &DevicesArgs) -> anyhow::Result<()> {
    let devices = available()?;
    if args.json {
        return Ok(print_json(&devices)?);
    }
    let mut table = Table::default();
    for device in &devices {
        let mark = if device.auto { "taken by auto: " } else { "" };
        table.row(&device.name, format!("{} ({mark}{})", device.description, device.why));
    }
    Ok(table.print()?)
}

/// What `--device` accepts besides `auto` and `gpu`, best first.
fn available() -> Result<Vec<Listed>> {
    let mut out: Vec<Listed> = Vec::new();
    for gpu in gpus() {
        let auto = out.is_empty() && gpu.hardware;
        let why = match (auto, gpu.hardware) {
            (true, _) => "the best hardware GPU",
            (false, true) => "hardware, but another GPU is ranked before it",
            (false, false) => "runs on the processor, slower than \"cpu\": taken only by name",
        };
        out.push(Listed { name: gpu.name, description: gpu.description, auto, why: why.into() });
    }
    let cpu = open_cpu()?.device();
    let auto = !out.iter().any(|d| d.auto);
    let why = if auto { "no hardware GPU was found" } else { "taken by name, or where there is no GPU" };
    let at = out.iter().position(|d| !d.auto && d.why.starts_with("runs")).unwrap_or(out.len());
    out.insert(at, Listed { name: cpu.name, description: cpu.description, auto, why: why.into() });
    Ok(out)
}

/// Makes the backend that `--device` names.
///
/// # Errors
/// [`litetex_gs::Error::Unsupported`] for a device that is not there, [`litetex_gs::Error::Device`] if it cannot be opened.
pub fn open(name: &str) -> Result<Box<dyn Backend>> {
    match name {
        "cpu" => open_cpu(),
        "auto" if !gpus().iter().any(|gpu| gpu.hardware) => open_cpu(),
        "auto" => open_gpu("gpu"),
        other => open_gpu(other),
    }
}

fn open_cpu() -> Result<Box<dyn Backend>> {
    // `--threads` has set the size of rayon's pool; the backend follows it.
    Ok(Box::new(CpuBackend::new(Some(rayon::current_num_threads()))?))
}

#[cfg(feature = "gpu")]
fn gpus() -> Vec<litetex_gs::gpu::AdapterChoice> {
    litetex_gs::gpu::list_adapters()
}

#[cfg(feature = "gpu")]
fn open_gpu(name: &str) -> Result<Box<dyn Backend>> {
    Ok(Box::new(open_gpu_backend(name)?))
}

/// A GPU by name, for what the trait [`Backend`] does not offer.
///
/// # Errors
/// As [`open`]; the processor is not a GPU.
#[cfg(feature = "gpu")]
pub fn open_gpu_backend(name: &str) -> Result<litetex_gs::gpu::GpuBackend> {
    use litetex_gs::gpu::{GpuBackend, GpuDevice, GpuOptions, Limits, find_adapter};
    let device = GpuDevice::open(&find_adapter(name)?, Limits::Adapter)?;
    GpuBackend::new(device, GpuOptions::default())
}

/// A build without GPUs knows none.
#[cfg(not(feature = "gpu"))]
struct NoGpu {
    name: String,
    description: String,
    hardware: bool,
}

#[cfg(not(feature = "gpu"))]
fn gpus() -> Vec<NoGpu> {
    Vec::new()
}

#[cfg(not(feature = "gpu"))]
fn open_gpu(name: &str) -> Result<Box<dyn Backend>> {
    Err(Error::unsupported(
        "--device",
        format!("{name:?} is not a device of this build, which has no GPUs; there is \"auto\" and \"cpu\""),
    ))
}
