//! Devices by the names that `--device` takes: their list, and opening one of them.

use super::log::Log;
#[cfg(not(feature = "gpu"))]
use crate::Error;
use crate::Result;
use crate::backend::{Backend, DeviceInfo};
use crate::cpu::CpuBackend;
use serde::Serialize;

/// A device as it is listed, and whether `--device auto` chooses it.
#[derive(Serialize)]
pub struct Listed {
    /// Its name.
    pub name: String,
    /// What it is.
    pub description: String,
    /// Whether it is a hardware GPU.
    pub hardware: bool,
    /// Whether `auto` chooses it.
    pub auto: bool,
    /// Whether it can be used at all.
    pub usable: bool,
    /// Why `auto` chooses it or not.
    pub why: String,
}

/// All devices, best first, with those that cannot be used at the end.
///
/// # Errors
/// What the CPU backend reports.
pub fn list() -> Result<Vec<Listed>> {
    let cpu = open_cpu()?.device();
    let mut devices = listed(gpus(), cpu, opens);
    devices.extend(unfit());
    Ok(devices)
}

/// The names that `--device` accepts besides `auto` and `gpu`, best first: hardware GPUs, the CPU, software drivers.
/// `opens` reports whether a GPU can be used.
fn listed(gpus: &[Gpu], cpu: DeviceInfo, opens: impl Fn(&Gpu) -> Result<()>) -> Vec<Listed> {
    let mut out: Vec<Listed> = Vec::new();
    let mut taken = false;
    let (hardware, software): (Vec<&Gpu>, Vec<&Gpu>) = gpus.iter().partition(|gpu| gpu.hardware);
    let row = |gpu: &Gpu, auto, why| Listed {
        name: gpu.name.clone(),
        description: gpu.description.clone(),
        hardware: gpu.hardware,
        auto,
        usable: true,
        why,
    };
    for gpu in &hardware {
        // Once one is chosen, the others need not be opened.
        let (auto, why) = match (taken, if taken { Ok(()) } else { opens(gpu) }) {
            (true, _) => (false, "hardware, but ranked after another GPU".to_owned()),
            (false, Ok(())) => (true, "the best hardware GPU".to_owned()),
            (false, Err(e)) => (false, format!("hardware, but auto skips it: {e}")),
        };
        taken |= auto;
        out.push(row(gpu, auto, why));
    }
    let why = match (taken, hardware.is_empty()) {
        (true, _) => "used if named, or if there is no GPU",
        (false, true) => "no hardware GPU was found",
        (false, false) => "no hardware GPU can be used",
    };
    let DeviceInfo { name, description } = cpu;
    out.push(Listed { name, description, hardware: false, auto: !taken, usable: true, why: why.to_owned() });
    for gpu in software {
        let sign = gpu.software.as_deref().unwrap_or_default();
        let why = format!("runs on the CPU ({sign}), slower than \"cpu\": used only if named");
        out.push(row(gpu, false, why));
    }
    out
}

/// The row of an adapter that cannot be used; such rows follow all others.
#[cfg_attr(not(feature = "gpu"), allow(dead_code, reason = "a build without GPUs knows no adapter"))]
fn unfit_row(name: String, description: String, hardware: bool, lacks: &str) -> Listed {
    Listed {
        name,
        description,
        hardware,
        auto: false,
        usable: false,
        why: format!("cannot be used: {lacks}"),
    }
}

/// Whether an open backend, by its name, is a GPU and no software driver.
pub fn is_hardware(name: &str) -> bool {
    // Without looking for GPUs where none is in use.
    name != "cpu" && gpus().iter().any(|gpu| gpu.hardware && gpu.name == name)
}

/// Opens the backend that `--device` names.
///
/// # Errors
/// [`crate::Error::Unsupported`] for a device that does not exist, [`crate::Error::Device`] for one that cannot be
/// opened.
pub fn open(name: &str, log: &Log) -> Result<Box<dyn Backend>> {
    match name.to_lowercase().as_str() {
        "cpu" => open_cpu(),
        "auto" => {
            let hardware: Vec<&Gpu> = gpus().iter().filter(|gpu| gpu.hardware).collect();
            match first_that_opens(&hardware, open_gpu, |message| log.warn("gpu-not-used", message, 1)) {
                Some(backend) => Ok(backend),
                None => open_cpu(),
            }
        }
        _ => open_gpu(find_gpu(name)?),
    }
}

/// The first GPU that can be used, with a warning for each before it that cannot. If there is none, `auto` falls back to
/// the CPU.
fn first_that_opens<T>(
    gpus: &[&Gpu],
    open: impl Fn(&Gpu) -> Result<T>,
    mut warn: impl FnMut(&str),
) -> Option<T> {
    gpus.iter().enumerate().find_map(|(at, gpu)| match open(gpu) {
        Ok(backend) => Some(backend),
        Err(e) => {
            let next = gpus.get(at + 1).map_or("cpu", |next| &next.name);
            warn(&format!("{e}; trying {next:?} instead (\"--device {}\" makes this an error)", gpu.name));
            None
        }
    })
}

fn open_cpu() -> Result<Box<dyn Backend>> {
    // The backend uses as many threads as rayon's pool, whose size `--threads` has set.
    Ok(Box::new(CpuBackend::new(Some(rayon::current_num_threads()))?))
}

#[cfg(feature = "gpu")]
use crate::gpu::AdapterChoice as Gpu;

/// The adapters of the machine, enumerated when a command first asks for a GPU.
#[cfg(feature = "gpu")]
fn adapters() -> &'static crate::gpu::Adapters {
    static ADAPTERS: std::sync::OnceLock<crate::gpu::Adapters> = std::sync::OnceLock::new();
    ADAPTERS.get_or_init(crate::gpu::Adapters::enumerate)
}

#[cfg(feature = "gpu")]
fn gpus() -> &'static [Gpu] {
    &adapters().usable
}

#[cfg(feature = "gpu")]
fn find_gpu(name: &str) -> Result<&'static Gpu> {
    adapters().find(name)
}

#[cfg(feature = "gpu")]
fn unfit() -> Vec<Listed> {
    let unfit = adapters().unfit.iter().cloned();
    unfit.map(|u| unfit_row(u.name, u.description, u.hardware, &u.lacks)).collect()
}

/// Whether a GPU can be opened; its kernels are not compiled.
#[cfg(feature = "gpu")]
fn opens(gpu: &Gpu) -> Result<()> {
    use crate::gpu::{GpuDevice, LimitChoice};
    GpuDevice::open(gpu, LimitChoice::Adapter).map(drop)
}

#[cfg(feature = "gpu")]
fn open_gpu(gpu: &Gpu) -> Result<Box<dyn Backend>> {
    Ok(Box::new(gpu_backend(gpu)?))
}

#[cfg(feature = "gpu")]
fn gpu_backend(gpu: &Gpu) -> Result<crate::gpu::GpuBackend> {
    use crate::gpu::{GpuBackend, GpuDevice, GpuOptions, LimitChoice};
    GpuBackend::new(GpuDevice::open(gpu, LimitChoice::Adapter)?, GpuOptions::default())
}

/// Opens a GPU by name, for measurements that the trait [`Backend`] does not offer.
///
/// # Errors
/// As [`open()`]; [`crate::Error::Usage`] for the CPU.
#[cfg(feature = "gpu")]
pub fn open_gpu_backend(name: &str) -> Result<crate::gpu::GpuBackend> {
    let name = match name.to_lowercase().as_str() {
        "auto" => "gpu",
        "cpu" => {
            return Err(crate::Error::Usage(
                "--device cpu: this command measures GPU kernels; to measure the CPU, run cargo bench --bench bench_scene"
                    .into(),
            ));
        }
        _ => name,
    };
    gpu_backend(find_gpu(name)?)
}

/// A GPU, of which a build without the feature `gpu` has none.
#[cfg(not(feature = "gpu"))]
struct Gpu {
    name: String,
    description: String,
    hardware: bool,
    software: Option<String>,
}

#[cfg(not(feature = "gpu"))]
fn gpus() -> &'static [Gpu] {
    &[]
}

#[cfg(not(feature = "gpu"))]
fn find_gpu(name: &str) -> Result<&'static Gpu> {
    Err(no_device_of_this_build(name))
}

#[cfg(not(feature = "gpu"))]
fn no_device_of_this_build(name: &str) -> Error {
    let what =
        "is not a device of this build, which was compiled without GPU support; expected \"auto\" or \"cpu\"";
    unsupported!("--device", "{name:?} {what}")
}

#[cfg(not(feature = "gpu"))]
fn unfit() -> Vec<Listed> {
    Vec::new()
}

#[cfg(not(feature = "gpu"))]
fn opens(_gpu: &Gpu) -> Result<()> {
    Ok(())
}

#[cfg(not(feature = "gpu"))]
fn open_gpu(gpu: &Gpu) -> Result<Box<dyn Backend>> {
    Err(no_device_of_this_build(&gpu.name))
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use super::*;
    use crate::Error;

    fn of_this_machine(name: &str, hardware: bool) -> Option<Gpu> {
        let mut gpu = gpus().first()?.clone();
        gpu.software = (!hardware).then(|| "by its name".to_owned());
        (gpu.name, gpu.hardware) = (name.to_owned(), hardware);
        Some(gpu)
    }

    fn refuses(names: &'static [&'static str]) -> impl Fn(&Gpu) -> Result<String> {
        move |gpu| match names.contains(&gpu.name.as_str()) {
            true => Err(Error::Device(format!("{}: cannot be opened", gpu.name))),
            false => Ok(gpu.name.clone()),
        }
    }

    #[test]
    fn auto_falls_back_to_the_next_gpu_then_the_cpu_with_a_warning() {
        let Some(first) = of_this_machine("first", true) else {
            println!("skipped: no Vulkan driver is installed");
            return;
        };
        let [second, software] =
            [("second", true), ("software", false)].map(|(n, h)| of_this_machine(n, h).unwrap());
        let gpus = [first, second];
        for (refused, taken, warnings) in
            [(&[][..], Some("first"), 0), (&["first"], Some("second"), 1), (&["first", "second"], None, 2)]
        {
            let mut said = Vec::new();
            let opened =
                first_that_opens(&[&gpus[0], &gpus[1]], refuses(refused), |m| said.push(m.to_owned()));
            assert_eq!((opened.as_deref(), said.len()), (taken, warnings), "{said:?}");
            assert!(said.last().is_none_or(|m| m.contains("cannot be opened")));
            // The list agrees with what `auto` does.
            let all = [&gpus[..], std::slice::from_ref(&software)].concat();
            let cpu = DeviceInfo { name: "cpu".into(), description: String::new() };
            let list = listed(&all, cpu, |gpu| refuses(refused)(gpu).map(drop));
            let autos: Vec<&str> = list.iter().filter(|d| d.auto).map(|d| d.name.as_str()).collect();
            assert_eq!(autos, [taken.unwrap_or("cpu")]);
            assert_eq!(list.last().unwrap().name, "software");
            assert!(list.last().unwrap().why.contains("by its name"));
            for name in refused {
                let device = list.iter().find(|d| d.name == *name).unwrap();
                assert!(device.why.contains("cannot be opened"), "{}", device.why);
            }
        }
    }

    #[test]
    fn device_names_are_case_insensitive() {
        let log = Log::new(super::super::log::LogFormat::Text, true, 0);
        assert_eq!(open("CPU", &log).map(|b| b.device().name).unwrap(), "cpu");
        let refusal = |name: &str| open_gpu_backend(name).map(|_| ()).unwrap_err().to_string();
        assert!(refusal("Cpu").contains("measures GPU kernels"));
        // Without hardware, "gpu" says so in any case; it is not the name of a device.
        if !gpus().iter().any(|gpu| gpu.hardware) {
            assert_eq!(open("AUTO", &log).map(|b| b.device().name).unwrap(), "cpu");
            assert_eq!(refusal("GPU"), refusal("gpu"));
            assert_ne!(refusal("GPUs"), refusal("gpu"));
        }
    }

    #[test]
    fn unusable_adapters_are_listed_with_the_reason() {
        let row =
            unfit_row("old".into(), "Old, GL".into(), true, "4 storage buffers of a kernel, 8 are needed");
        assert!(!row.usable && !row.auto && row.why.contains("4 storage buffers of a kernel, 8 are needed"));
    }
}
