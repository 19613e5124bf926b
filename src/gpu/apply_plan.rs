//! Applies a density-control plan on the device (twin: `cpu/apply_plan.rs`): gathers splats, changes their maps
//! and moments, edits parameters.

use super::device::GpuDevice;
use super::encode::Dispatch;
use super::kernels::{Buf, KernelId};
use super::layout::{self, CHANGE_COARSER, CHANGE_FINER, CHANGE_RESAMPLE, CHANGE_SAME, FLAG_SECOND_MOMENTS};
use super::model_buffers::{self, NewBuffers, filled, splat_infos};
use super::shape::Shape;
use super::state::GpuBackend;
use super::uniform;
use crate::Result;
use crate::backend::{DensityPlan, Grid, MapChange, SplatEdit};
use crate::model::{TextureMap, TexturePool};

/// Applies a plan that has been checked.
pub(super) fn apply_plan(backend: &mut GpuBackend, plan: &DensityPlan) -> Result<()> {
    let old = &backend.shape;
    let maps = planned_maps(&old.maps, plan)?;
    let changes: Vec<layout::MapChange> = (plan.sources.iter().zip(&plan.maps).zip(&maps))
        .map(|((&source, change), new)| record_of(change, source, &old.maps[source as usize], new))
        .collect();
    let mut map_kernels = vec![KernelId::RegridMaps];
    map_kernels.extend(changes.iter().find(|c| c.kind == CHANGE_RESAMPLE).map(|_| KernelId::ResampleMaps));
    let shape = Shape { sh_degrees: plan.new_sh_degrees(&old.sh_degrees), maps, ..*old };
    model_buffers::check_floats(shape.num_splat_floats())?;
    let new = PlanBuffers::new(&backend.device, plan, &shape, &changes)?;
    // Everything is allocated: nothing can fail half-way from here on.

    // Map changes do not commute with pending lazy updates.
    backend.flush_all();
    let old_info = backend.resources.buffer(Buf::SplatInfo).clone();
    backend.resources.set(Buf::Sources, new.sources);
    backend.resources.set(Buf::MapChanges, new.changes);
    backend.resources.set(Buf::OldSplatInfo, old_info);
    backend.resources.set(Buf::SplatInfo, new.infos);
    backend.shape = shape.clone();
    for (name, values) in new.splats {
        let flags = if name == Buf::SplatV { FLAG_SECOND_MOMENTS } else { 0 };
        change_array(backend, &[KernelId::GatherSplats], flags, name, values);
    }
    if !plan.edits.is_empty() {
        backend.resources.set(Buf::Edits, new.edits);
        run(backend, &[KernelId::EditSplats], 0);
    }
    for (name, values, scales) in new.texels {
        backend.resources.set(Buf::Scales, scales);
        let flags = if name == Buf::TexelV { FLAG_SECOND_MOMENTS } else { 0 };
        change_array(backend, &map_kernels, flags, name, values);
    }
    let of_the_plan = [Buf::Sources, Buf::MapChanges, Buf::OldSplatInfo, Buf::Scales, Buf::Edits];
    for name in of_the_plan.into_iter().chain([Buf::OldValues, Buf::NewValues]) {
        backend.resources.remove(name);
    }
    new.derived.into_iter().for_each(|(name, buffer)| backend.resources.set(name, buffer));
    backend.adopt(shape, backend.clock);
    backend.device.check()
}

/// The texture maps after a plan.
fn planned_maps(old_maps: &[TextureMap], plan: &DensityPlan) -> Result<Vec<TextureMap>> {
    let new_map = |(&s, change): (&u32, &MapChange)| change.applied_to(&old_maps[s as usize]);
    Ok(TexturePool::neutral(plan.sources.iter().zip(&plan.maps).map(new_map))?.maps)
}

/// Buffers of the plan, and of the model after it.
struct PlanBuffers {
    sources: wgpu::Buffer,
    changes: wgpu::Buffer,
    edits: wgpu::Buffer,
    infos: wgpu::Buffer,
    splats: NewBuffers,
    /// New texels or moments, and the factor of each map.
    texels: Vec<(Buf, wgpu::Buffer, wgpu::Buffer)>,
    derived: NewBuffers,
}

impl PlanBuffers {
    /// Buffers for a model of the given shape.
    fn new(
        device: &GpuDevice,
        plan: &DensityPlan,
        shape: &Shape,
        changes: &[layout::MapChange],
    ) -> Result<Self> {
        let (n, num_texels) = (shape.num_splats(), shape.num_texels());
        let splat_floats = shape.num_splat_floats() as u64;
        let edits: Vec<layout::Edit> = plan.edits.iter().map(edit_of).collect();
        let mut splats = Vec::new();
        for name in [Buf::SplatP, Buf::SplatM, Buf::SplatV] {
            splats.push((name, device.buffer("splat parameters", splat_floats, 4)?));
        }
        let mut texels = Vec::new();
        for (moment, name) in [Buf::TexelP, Buf::TexelM, Buf::TexelV].into_iter().enumerate() {
            let scales: Vec<f32> = plan.maps.iter().map(|change| scale_of(change, moment)).collect();
            let values = device.buffer("texel parameters", 3 * num_texels as u64, 4)?;
            texels.push((name, values, filled(device, "scales of the plan", &scales)?));
        }
        Ok(Self {
            sources: filled(device, "sources of the plan", &plan.sources)?,
            changes: filled(device, "map changes of the plan", changes)?,
            edits: filled(device, "edits of the plan", &edits)?,
            infos: filled(device, "splat records", &splat_infos(shape, |_| 0))?,
            splats,
            texels,
            derived: model_buffers::derived(device, n, num_texels)?,
        })
    }
}

/// Farther from a map than any window reaches, yet too small to overflow when added to a row or column.
const FAR: i32 = 1 << 18;

fn record_of(change: &MapChange, source: u32, old: &TextureMap, new: &TextureMap) -> layout::MapChange {
    let record = |[kind_u, kind_v]: [u32; 2], first_row: i32, first_col: i32| layout::MapChange {
        source,
        kind: kind_u | kind_v << 8,
        first_row: first_row.clamp(-FAR, FAR),
        first_col: first_col.clamp(-FAR, FAR),
    };
    // Resampling to the same grid copies the map.
    let same = TextureMap { offset_texels: 0, ..*old } == TextureMap { offset_texels: 0, ..*new };
    match *change {
        MapChange::Resample { shift_texels, .. } if !same || shift_texels != [0.0; 2] => {
            let origin = [0, 1].map(|k| (old.origin()[k] + shift_texels[k]).to_bits().cast_signed());
            layout::MapChange { source, kind: CHANGE_RESAMPLE, first_row: origin[0], first_col: origin[1] }
        }
        MapChange::Keep | MapChange::Resample { .. } => record([CHANGE_SAME; 2], 0, 0),
        MapChange::Regrid { grids, first_row, first_col, .. } => {
            let kinds = grids.map(|grid| match grid {
                Grid::Same => CHANGE_SAME,
                Grid::Finer => CHANGE_FINER,
                Grid::Coarser => CHANGE_COARSER,
            });
            record(kinds, first_row, first_col)
        }
    }
}

/// Factor of a change for the texels (0), their first (1) and their second moments (2).
fn scale_of(change: &MapChange, moment: usize) -> f32 {
    match *change {
        MapChange::Keep => 1.0,
        MapChange::Resample { moment_scale, .. } | MapChange::Regrid { moment_scale, .. } => {
            [1.0, moment_scale[0], moment_scale[1]][moment]
        }
    }
}

fn edit_of(edit: &SplatEdit) -> layout::Edit {
    let SplatEdit { splat, position, log_scales, opacity_logit } = *edit;
    layout::Edit { position, opacity_logit, log_scales, splat, pad: 0 }
}

/// Computes a new array from the old one with `kernels`, and replaces it.
fn change_array(backend: &mut GpuBackend, kernels: &[KernelId], flags: u32, name: Buf, new: wgpu::Buffer) {
    let old = backend.resources.buffer(name).clone();
    backend.resources.set(Buf::OldValues, old);
    backend.resources.set(Buf::NewValues, new.clone());
    run(backend, kernels, flags);
    backend.resources.set(name, new);
}

fn run(backend: &mut GpuBackend, kernels: &[KernelId], flags: u32) {
    backend.arm();
    let uniform = uniform::without_view(&backend.uniform_inputs(), flags);
    let offsets = backend.set_uniform(0, &uniform);
    let dispatches: Vec<Dispatch> = kernels.iter().map(|&kernel| Dispatch::new(kernel, offsets)).collect();
    backend.submit(&dispatches);
}
