//! `litetex selftest`: whether a device computes what the f64 reference computes.

use litetex_gs::console::{Log, Output, device};
use litetex_gs::{Error, Result, selftest};
use serde_json::json;

/// Check a device against the reference on a small random scene
///
/// Compares rendering, gradients and a few steps with the f64 reference. Exit code 1 if a check fails.
#[derive(clap::Args)]
pub struct SelftestArgs {
    /// Device to check
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// Runs the checks and prints their results.
pub fn run(args: &SelftestArgs, log: &Log) -> Result<Output> {
    let mut backend = device::open(&args.device, log)?;
    let device = backend.device();
    let checks = selftest::run(backend.as_mut())?;
    let mut text = format!("{} ({})\n", device.name, device.description);
    text += &format!("{:<36} {:>12} {:>10}\n", "against the f64 reference", "difference", "limit");
    for check in &checks {
        let verdict = if check.passed { "pass" } else { "FAIL" };
        text +=
            &format!("{:<36} {:>12.2e} {:>10.1e}  {verdict}\n", check.name, check.difference, check.limit);
    }
    let failed = checks.iter().filter(|c| !c.passed).count();
    if failed == 0 {
        text += &format!("all {} checks passed\n", checks.len());
    }
    let failure = (failed > 0).then(|| {
        Error::CheckFailed(format!(
            "{failed} of {} checks failed: this device or its driver computes wrong results",
            checks.len()
        ))
    });
    let of_check = |c: &selftest::Check| json!({ "name": c.name, "difference": c.difference, "limit": c.limit, "passed": c.passed });
    let found = json!({
        "device": device,
        "passed": failed == 0,
        "checks": checks.iter().map(of_check).collect::<Vec<_>>(),
    });
    Ok(Output::new("litetex-selftest/1", found, text).failing(failure))
}
