//! `litetex devices`, and the choice of a backend by name.

use super::table::{Table, print_json};
use litetex_gs::backend::{Backend, DeviceInfo};
use litetex_gs::{Error, Result};

/// List where training and rendering can run
#[derive(clap::Args)]
pub struct DevicesArgs {
    /// As JSON
    #[arg(long)]
    json: bool,
}

/// Prints the devices.
pub fn run(args: &DevicesArgs) -> anyhow::Result<()> {
    let devices = available();
    if args.json {
        return Ok(print_json(&devices)?);
    }
    let mut table = Table::default();
    for device in &devices {
        table.row(&device.name, &device.description);
    }
    Ok(table.print()?)
}

/// What `--device` accepts besides `auto`; the first is what `auto` takes.
fn available() -> Vec<DeviceInfo> {
    vec![cpu_info()]
}

/// Makes the backend that `--device` names.
///
/// # Errors
/// [`Error::Unsupported`] for a device that is not there.
pub fn open(name: &str) -> Result<Box<dyn Backend>> {
    match name {
        "auto" | "cpu" => open_cpu(),
        other => {
            let known: Vec<String> = available().into_iter().map(|d| format!("{:?}", d.name)).collect();
            Err(Error::unsupported(
                "--device",
                format!(
                    "{other:?} is not a device of this build; there is \"auto\", {}; see \"litetex devices\"",
                    known.join(", ")
                ),
            ))
        }
    }
}

/// Stands in for `CpuBackend::new()` until that is there.
fn open_cpu() -> Result<Box<dyn Backend>> {
    Err(Error::Device("the cpu backend is not there yet".to_owned()))
}

fn cpu_info() -> DeviceInfo {
    DeviceInfo {
        name: "cpu".to_owned(),
        description: format!("{}, {} threads", instruction_set(), rayon::current_num_threads()),
    }
}

fn instruction_set() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        return "x86-64 with AVX2 and FMA";
    }
    std::env::consts::ARCH
}
