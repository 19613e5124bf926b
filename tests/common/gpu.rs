//! Backends on the software drivers that are installed.

use litetex_gs::gpu::{AdapterChoice, GpuBackend, GpuDevice, GpuOptions, LimitChoice, list_adapters};

/// Software drivers: `LITETEX_REQUIRE_GPU` says how many there must be; where there is none, says so.
pub fn drivers() -> Vec<AdapterChoice> {
    let mut software: Vec<_> = list_adapters().into_iter().filter(|a| !a.hardware).collect();
    // The faster one first, for the tests that take only one.
    software.sort_by_key(|a| a.name != "lavapipe");
    let required = std::env::var("LITETEX_REQUIRE_GPU").ok().and_then(|n| n.parse().ok()).unwrap_or(0);
    let names: Vec<&str> = software.iter().map(|a| a.name.as_str()).collect();
    assert!(
        software.len() >= required,
        "{required} software Vulkan drivers are required, there is {names:?}"
    );
    if software.is_empty() {
        println!("skipped: no software Vulkan driver is installed");
    }
    software
}

/// A backend on the first of them, within the lowest limits.
pub fn backend(options: GpuOptions) -> Option<GpuBackend> {
    let choice = drivers().into_iter().next()?;
    Some(open(&choice, LimitChoice::Downlevel, options))
}

/// Backends on all of them in turn, within the lowest limits: what fits these fits any.
pub fn backends(options: GpuOptions) -> impl Iterator<Item = GpuBackend> {
    drivers().into_iter().map(move |choice| {
        println!("{}", choice.name);
        open(&choice, LimitChoice::Downlevel, options)
    })
}

/// A backend on a driver.
pub fn open(choice: &AdapterChoice, limits: LimitChoice, options: GpuOptions) -> GpuBackend {
    GpuBackend::new(GpuDevice::open(choice, limits).unwrap(), options).unwrap()
}

/// Every driver, the first of them within the lowest limits.
pub fn drivers_and_limits() -> Vec<(AdapterChoice, LimitChoice)> {
    let limits = std::iter::once(LimitChoice::Downlevel).chain(std::iter::repeat(LimitChoice::Adapter));
    drivers().into_iter().zip(limits).collect()
}
