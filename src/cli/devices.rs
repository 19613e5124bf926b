//! `litetex devices`.

use litetex_gs::console::{Table, device, print_json};

/// List the devices that can train and render
#[derive(clap::Args)]
pub struct DevicesArgs {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Prints the devices.
pub fn run(args: &DevicesArgs) -> anyhow::Result<()> {
    let devices = device::list()?;
    if args.json {
        return Ok(print_json(&devices)?);
    }
    let mut table = Table::default();
    for device in &devices {
        let mark = if device.auto { "chosen by auto: " } else { "" };
        table.row(&device.name, format!("{} ({mark}{})", device.description, device.why));
    }
    Ok(table.print()?)
}
