//! Encodes dispatches: in one compute pass, or if kernels are timed, each in its own pass between timestamps.

use super::device::{GpuDevice, Pipeline};
use super::kernels::{Buf, Groups, KernelId};
use super::layout::DispatchArgs;
use super::resources::{Resources, UniformOffsets};
use super::timing::Timer;
use std::collections::BTreeMap;

#[derive(Clone, Copy, Debug)]
pub(super) struct Dispatch {
    pub kernel: KernelId,
    pub groups: Groups,
    /// Whether input and output of the sort are exchanged.
    pub swapped: bool,
    pub offsets: UniformOffsets,
}

impl Dispatch {
    pub(super) fn new(kernel: KernelId, offsets: UniformOffsets) -> Self {
        Self { kernel, groups: kernel.kernel().groups, swapped: false, offsets }
    }
}

/// Byte offset of an entry in the table of indirect dispatches.
pub(super) fn args_offset(groups: Groups) -> u64 {
    groups as u64 * size_of::<DispatchArgs>() as u64
}

/// Encodes dispatches in order; with a timer, each in its own pass between two timestamps.
pub(super) fn encode(
    device: &GpuDevice,
    encoder: &mut wgpu::CommandEncoder,
    resources: &mut Resources,
    pipelines: &BTreeMap<KernelId, Pipeline>,
    dispatches: &[Dispatch],
    timer: Option<&Timer>,
) {
    let args = resources.buffer(Buf::Args).clone();
    let mut one = |pass: &mut wgpu::ComputePass<'_>, dispatch: &Dispatch| {
        device.count_dispatch();
        let kernel = dispatch.kernel.kernel();
        let Some(pipeline) = pipelines.get(&dispatch.kernel) else {
            unreachable!("{:?} has not been compiled", dispatch.kernel);
        };
        let offsets = [dispatch.offsets.step, dispatch.offsets.sort_pass];
        let group = resources.group(device, dispatch.kernel, pipeline, dispatch.swapped);
        pass.set_pipeline(&pipeline.pipeline);
        pass.set_bind_group(0, group, &offsets[..1 + usize::from(kernel.has_sort_pass())]);
        if kernel.is_direct() {
            pass.dispatch_workgroups(1, 1, 1);
        } else {
            pass.dispatch_workgroups_indirect(&args, args_offset(dispatch.groups));
        }
    };
    let descriptor = wgpu::ComputePassDescriptor::default();
    let Some(timer) = timer else {
        let mut pass = encoder.begin_compute_pass(&descriptor);
        dispatches.iter().for_each(|dispatch| one(&mut pass, dispatch));
        return;
    };
    for (index, dispatch) in (0..).zip(dispatches) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                query_set: &timer.queries,
                beginning_of_pass_write_index: Some(2 * index),
                end_of_pass_write_index: Some(2 * index + 1),
            }),
            ..descriptor.clone()
        });
        one(&mut pass, dispatch);
    }
    timer.resolve(encoder, dispatches.len());
}
