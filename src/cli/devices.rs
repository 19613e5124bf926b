//! `litetex devices`, and the choice of a backend by name.

use super::table::{Table, print_json};
use litetex_gs::backend::{Backend, DeviceInfo};
use litetex_gs::cpu::CpuBackend;
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
    let devices = available()?;
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
fn available() -> Result<Vec<DeviceInfo>> {
    Ok(vec![open_cpu()?.device()])
}

/// Makes the backend that `--device` names.
///
/// # Errors
/// [`Error::Unsupported`] for a device that is not there.
pub fn open(name: &str) -> Result<Box<dyn Backend>> {
    match name {
        "auto" | "cpu" => open_cpu(),
        other => {
            let known: Vec<String> = available()?.into_iter().map(|d| format!("{:?}", d.name)).collect();
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

fn open_cpu() -> Result<Box<dyn Backend>> {
    // `--threads` has set the size of rayon's pool; the backend follows it.
    Ok(Box::new(CpuBackend::new(Some(rayon::current_num_threads()))?))
}
