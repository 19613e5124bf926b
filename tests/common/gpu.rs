//! Backends on the installed software drivers.

use litetex_gs::gpu::{AdapterChoice, Adapters, GpuBackend, GpuDevice, GpuOptions, LimitChoice};

/// All software drivers; without any, prints that the test is skipped. `LITETEX_REQUIRE_GPU` is the number that must
/// exist.
pub fn drivers() -> Vec<AdapterChoice> {
    let mut software: Vec<_> = Adapters::enumerate().usable.into_iter().filter(|a| !a.hardware).collect();
    // The faster one first, for tests that use only one.
    software.sort_by_key(|a| a.name != "lavapipe");
    let required = std::env::var("LITETEX_REQUIRE_GPU").ok().and_then(|n| n.parse().ok()).unwrap_or(0);
    let names: Vec<&str> = software.iter().map(|a| a.name.as_str()).collect();
    assert!(software.len() >= required, "{required} software Vulkan drivers required, found {names:?}");
    if software.is_empty() {
        println!("skipped: no software Vulkan driver is installed");
    }
    software
}

/// A backend on the first of [`drivers`], within the minimum limits.
pub fn backend(options: GpuOptions) -> Option<GpuBackend> {
    let choice = drivers().into_iter().next()?;
    Some(open(&choice, LimitChoice::Downlevel, options))
}

/// A backend on each of [`drivers`] in turn, within the minimum limits, which every device has.
pub fn backends(options: GpuOptions) -> impl Iterator<Item = GpuBackend> {
    drivers().into_iter().map(move |choice| {
        println!("{}", choice.name);
        open(&choice, LimitChoice::Downlevel, options)
    })
}

/// A backend on a driver, whose kernels clamp indices unless all limits are used or `LITETEX_UNCHECKED_INDICES` is set.
pub fn open(choice: &AdapterChoice, limits: LimitChoice, options: GpuOptions) -> GpuBackend {
    let unchecked = limits == LimitChoice::Adapter || std::env::var_os("LITETEX_UNCHECKED_INDICES").is_some();
    let unchecked_indices = options.unchecked_indices.or(Some(unchecked));
    let options = GpuOptions { unchecked_indices, ..options };
    GpuBackend::new(GpuDevice::open(choice, limits).unwrap(), options).unwrap()
}

/// Every driver, the first with the minimum limits and the others with all that they offer.
pub fn drivers_and_limits() -> Vec<(AdapterChoice, LimitChoice)> {
    let limits = std::iter::once(LimitChoice::Downlevel).chain(std::iter::repeat(LimitChoice::Adapter));
    drivers().into_iter().zip(limits).collect()
}
