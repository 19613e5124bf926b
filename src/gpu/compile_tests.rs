//! Every kernel compiles on the driver at hand.
use super::adapter::list_adapters;
use super::device::{GpuDevice, Limits};
use super::kernels::KERNELS;

#[test]
fn every_kernel_compiles_within_the_lowest_limits() {
    let Some(choice) = list_adapters().into_iter().next() else { return };
    let device = GpuDevice::open(&choice, Limits::Downlevel).unwrap();
    for (id, _) in KERNELS {
        if let Err(e) = device.pipelines(&[*id], &[]) {
            panic!("{id:?}: {e}");
        }
    }
}
