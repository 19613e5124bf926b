//! Measures how fast a device sorts.

use crate::Result;
use crate::gpu::device::{GpuDevice, UNIFORM_STRIDE};
use crate::gpu::encode::encode;
use crate::gpu::kernels::{Buf, KernelId};
use crate::gpu::layout::{Status, StepUniform};
use crate::gpu::model_buffers::filled;
use crate::gpu::resources::{Resources, UniformOffsets};
use crate::gpu::shader::DEPTH_KEY_BITS;
use crate::gpu::sort::{depth_sort, first_counts, sort_args, sort_passes};
use serde::Serialize;
use std::time::Instant;

/// Sorts per submission.
const RUNS: u32 = 4;

/// Throughput of the sort by depth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SortThroughput {
    /// Number of keys, each with a value.
    pub keys: usize,
    /// Bits of a key.
    pub bits: u32,
    /// Wall time of a sort.
    pub secs: f64,
    /// Keys per second of wall time.
    pub keys_per_sec: f64,
    /// Whether the result equals that of a stable sort in Rust.
    pub sorted: bool,
}

/// Sorts pseudo-random keys several times, after a warm-up; keys, values and the counts of the first digits are copied in before
/// each sort.
///
/// # Errors
/// [`crate::Error::Device`] if allocation or the device fails.
pub fn sort_throughput(device: &GpuDevice, keys: usize) -> Result<SortThroughput> {
    let kernels = [KernelId::SortScan, KernelId::SortScatter];
    let pipelines = device.pipelines(&kernels, &[], true)?;
    let passes = sort_passes();
    let mut resources =
        Resources::new(device.uniforms("steps", 1)?, device.uniforms("sort passes", passes.len() as u64)?);
    for (at, pass) in (0..).step_by(UNIFORM_STRIDE as usize).zip(&passes) {
        device.queue.write_buffer(resources.sort_passes(), at, bytemuck::bytes_of(pass));
    }
    device.queue.write_buffer(resources.steps(), 0, bytemuck::bytes_of(&StepUniform::default()));
    let mask = (1_u32 << DEPTH_KEY_BITS) - 1;
    // Hashed indices: all digits occur, few keys are equal.
    let values: Vec<u32> = (0..keys as u32)
        .map(|i| (i ^ (i >> 7)).wrapping_mul(0x9e37_79b1).rotate_left(13).wrapping_mul(0x85eb_ca6b) & mask)
        .collect();
    let indices: Vec<u32> = (0..keys as u32).collect();
    let counts = first_counts(&values);
    let inputs = [
        (Buf::KeysA, Buf::KeysB, filled(device, "sort keys", &values)?),
        (Buf::ValuesA, Buf::ValuesB, filled(device, "sort keys", &indices)?),
        (Buf::HistogramA, Buf::HistogramB, filled(device, "sort histograms", &counts)?),
    ];
    for (a, b, input) in &inputs {
        resources.set(*a, device.buffer("sort buffers", input.size() / 4, 4)?);
        resources.set(*b, device.buffer("sort buffers", input.size() / 4, 4)?);
    }
    let status = Status { visible: keys as u32, ..Status::default() };
    resources.set(Buf::Status, filled(device, "status", &[status])?);
    resources.set(Buf::Args, filled(device, "dispatches", &sort_args(keys as u32))?);

    let mut run = |runs: u32| -> Result<f64> {
        let start = Instant::now();
        let mut encoder = device.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for _ in 0..runs {
            for (to, _, input) in &inputs {
                encoder.copy_buffer_to_buffer(input, 0, resources.buffer(*to), 0, input.size());
            }
            let dispatches = depth_sort(UniformOffsets::default());
            encode(device, &mut encoder, &mut resources, &pipelines, &dispatches, None);
        }
        device.submit(encoder);
        device.read::<u32>(resources.buffer(Buf::Status), 1)?;
        Ok(start.elapsed().as_secs_f64() / f64::from(runs))
    };
    run(1)?;
    let secs = run(RUNS)?.max(1e-9);
    let mut order = indices;
    order.sort_by_key(|&i| values[i as usize]);
    let sorted = device.read::<u32>(resources.buffer(Buf::ValuesA), keys)? == order;
    Ok(SortThroughput { keys, bits: DEPTH_KEY_BITS, secs, keys_per_sec: keys as f64 / secs, sorted })
}
