//! `litetex devices`.

use litetex_gs::Result;
use litetex_gs::console::{Output, Table, device};
use serde_json::json;

/// Lists the devices.
pub fn run() -> Result<Output> {
    let devices = device::list()?;
    let mut table = Table::default();
    for device in &devices {
        let mark = if device.auto { "chosen by auto: " } else { "" };
        table.row(&device.name, format!("{} ({mark}{})", device.description, device.why));
    }
    Ok(Output::new("litetex-devices/1", json!({ "devices": devices }), table))
}
