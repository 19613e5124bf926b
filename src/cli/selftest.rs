//! `litetex selftest`: whether a device computes what the f64 reference computes.

use litetex_gs::console::Log;
use litetex_gs::console::device;
use litetex_gs::{Error, selftest};
use std::io::Write as _;

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
pub fn run(args: &SelftestArgs, log: &Log) -> anyhow::Result<()> {
    let mut backend = device::open(&args.device, log)?;
    let device = backend.device();
    let checks = selftest::run(backend.as_mut())?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "{} ({})", device.name, device.description)?;
    writeln!(out, "{:<36} {:>12} {:>10}", "against the f64 reference", "difference", "limit")?;
    for check in &checks {
        let verdict = if check.passed { "pass" } else { "FAIL" };
        writeln!(out, "{:<36} {:>12.2e} {:>10.1e}  {verdict}", check.name, check.difference, check.limit)?;
    }
    let failed = checks.iter().filter(|c| !c.passed).count();
    if failed > 0 {
        let what = format!(
            "{failed} of {} checks failed: this device or its driver computes wrong results",
            checks.len()
        );
        return Err(Error::CheckFailed(what).into());
    }
    writeln!(out, "all {} checks passed", checks.len())?;
    Ok(())
}
