//! Applies a structure plan on the device (twin: `cpu/structure.rs`): gathers splats, resamples and scales
//! maps and their moments.

use super::backend::GpuBackend;
use super::encode::Dispatch;
use super::kernels::{Buf, KernelId};
use super::layout::StepUniform;
use super::model_buffers::{self, filled, splat_infos, splat_stride};
use crate::Result;
use crate::backend::{MapChange, StructurePlan};
use crate::model::{AdamState, Model, SplatArrays, TexturePool};

/// Carries out a plan that has been checked.
pub(super) fn apply_plan(backend: &mut GpuBackend, plan: &StructurePlan) -> Result<()> {
    // Resampling does not commute with the updates that are still owed.
    backend.settle_all();
    let old = &backend.shape;
    let extents = plan.sources.iter().zip(&plan.maps).map(|(&s, change)| match *change {
        MapChange::Keep => {
            let map = &old.textures.maps[s as usize];
            (map.rows, map.cols, map.texel_size)
        }
        MapChange::Resample { rows, cols, texel_size, .. } => (rows, cols, texel_size),
        MapChange::Regrid { grid, rows, cols, .. } => {
            (rows, cols, old.textures.maps[s as usize].texel_size * grid.texel_ratio())
        }
    });
    let textures = TexturePool::neutral(extents);
    let (n, degree) = (plan.sources.len(), old.splats.sh_degree);
    let shape = Model { splats: SplatArrays::zeros(n, degree), textures, ..*old };
    let clock =
        AdamState { step: backend.clock.step, rates: backend.clock.rates, ..AdamState::zeros(&shape) };

    let old_info = backend.resources.buffer(Buf::SplatInfo).clone();
    let device = &backend.device;
    let infos = filled(device, "splat records", &splat_infos(&shape.textures.maps, |_| 0))?;
    let sources = filled(device, "sources of the plan", &plan.sources)?;
    let mut new_splats = Vec::new();
    for name in [Buf::SplatP, Buf::SplatM, Buf::SplatV] {
        new_splats
            .push((name, device.buffer("splat parameters", n as u64, 4 * splat_stride(degree) as u64)?));
    }
    let mut new_texels = Vec::new();
    for (moment, name) in [Buf::TexelP, Buf::TexelM, Buf::TexelV].into_iter().enumerate() {
        let scales: Vec<f32> = plan.maps.iter().map(|change| scale_of(change, moment)).collect();
        let values = device.buffer("texel parameters", 3 * shape.num_texels() as u64, 4)?;
        new_texels.push((name, values, filled(device, "scales of the plan", &scales)?));
    }
    let derived = model_buffers::derived(device, n, shape.num_texels())?;
    // Everything is allocated: from here on nothing can fail half-way.
    backend.resources.set(Buf::Sources, sources);
    backend.resources.set(Buf::OldSplatInfo, old_info);
    backend.resources.set(Buf::SplatInfo, infos);
    backend.shape = shape.clone();
    for (name, values) in new_splats {
        run(backend, KernelId::GatherSplats, name, &values);
        backend.resources.set(name, values);
    }
    for (name, values, scales) in new_texels {
        backend.resources.set(Buf::Scales, scales);
        run(backend, KernelId::ResampleMaps, name, &values);
        backend.resources.set(name, values);
    }
    for name in [Buf::Sources, Buf::OldSplatInfo, Buf::OldValues, Buf::NewValues, Buf::Scales] {
        backend.resources.remove(name);
    }
    derived.into_iter().for_each(|(name, buffer)| backend.resources.set(name, buffer));
    backend.adopt(shape, clock);
    backend.device.check()
}

/// What a change multiplies the texels (0), their first (1) and second moments (2) by.
fn scale_of(change: &MapChange, moment: usize) -> f32 {
    match *change {
        MapChange::Keep => 1.0,
        MapChange::Resample { moment_scale, .. } | MapChange::Regrid { moment_scale, .. } => {
            [1.0, moment_scale[0], moment_scale[1]][moment]
        }
    }
}

/// One array from old to new.
fn run(backend: &mut GpuBackend, kernel: KernelId, old: Buf, new: &wgpu::Buffer) {
    let old = backend.resources.buffer(old).clone();
    backend.resources.set(Buf::OldValues, old);
    backend.resources.set(Buf::NewValues, new.clone());
    backend.arm();
    let scene = backend.scene();
    let uniform = StepUniform {
        num_splats: scene.num_splats,
        splat_stride: scene.splat_stride,
        ..StepUniform::default()
    };
    let offsets = backend.set_uniform(0, &uniform);
    backend.submit(&[Dispatch::new(kernel, offsets)]);
}
