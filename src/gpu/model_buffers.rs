//! Uploads model and optimiser state, and reads them back. On the device, the parameters of a splat are
//! contiguous: position, quaternion, log-scales, opacity, SH (`shaders/common/splat.wgsl`).

use super::device::GpuDevice;
use super::kernels::Buf;
use super::layout::{BOUNDS_BYTES, PAIR_SUMS_GEOMETRY, PROJECTED_BYTES, SPLAT_SUMS_BYTES, SplatInfo};
use super::resources::Resources;
use super::shader::GROUP;
use super::shape::{Clock, Shape, splat_floats};
use crate::model::{AdamState, Model, SplatArrays, SplatGroup};
use crate::{Error, Result};
use rayon::prelude::*;

/// Splats whose parameters a thread copies at a time.
const SPLATS_PER_TASK: usize = 4096;

/// Floats of the parameters of all splats that records can address.
pub(super) const MOST_SPLAT_FLOATS: u64 = 1 << 30;

/// Checks that records can address the parameters of all splats.
///
/// # Errors
/// [`Error::Device`] with their number.
pub(super) fn check_floats(found: usize) -> Result<()> {
    if found as u64 <= MOST_SPLAT_FLOATS {
        return Ok(());
    }
    Err(Error::Device(format!(
        "the splats hold {found} parameters without texels, at most {MOST_SPLAT_FLOATS} fit: use fewer splats, or \
         another --device"
    )))
}

/// The floats of splats `0..n`, one after the other.
fn gathered<'a>(
    n: usize,
    floats: impl Fn(usize, SplatGroup) -> &'a [f32] + Sync,
    groups: &[SplatGroup],
) -> Vec<f32> {
    let of_task = |task: usize| {
        let mut out = Vec::new();
        for splat in task * SPLATS_PER_TASK..n.min((task + 1) * SPLATS_PER_TASK) {
            groups.iter().for_each(|&group| out.extend_from_slice(floats(splat, group)));
        }
        out
    };
    (0..n.div_ceil(SPLATS_PER_TASK)).into_par_iter().map(of_task).collect::<Vec<_>>().concat()
}

/// The parameters splat by splat. `[num_splat_floats]`
fn interleaved(arrays: &SplatArrays) -> Vec<f32> {
    gathered(arrays.len(), |i, group| &arrays.group(group)[arrays.range(group, i)], &SplatGroup::ALL)
}

/// Inverse of [`interleaved`] for splats of these degrees.
fn separated(values: &[f32], sh_degrees: &[u8]) -> SplatArrays {
    let mut out = SplatArrays::zeros_of(sh_degrees.to_vec());
    let mut before = 0;
    for group in SplatGroup::ALL {
        let own = |i: usize, group: SplatGroup| {
            &values[first_float(&out, i) + before..][..out.range(group, i).len()]
        };
        let gathered = gathered(out.len(), own, &[group]);
        *out.group_mut(group) = gathered;
        before += group.width(0);
    }
    out
}

/// The first float of a splat.
fn first_float(splats: &SplatArrays, splat: usize) -> usize {
    // A splat's parameters other than SH are as many for all.
    splat * (splat_floats(0) - SplatGroup::Sh.width(0)) + splats.sh_offsets()[splat] as usize
}

pub(super) fn splat_infos(shape: &Shape, last_step: impl Fn(usize) -> u32) -> Vec<SplatInfo> {
    let mut first_float = 0;
    let mut infos = Vec::with_capacity(shape.num_splats());
    for (i, (map, &degree)) in shape.maps.iter().zip(&shape.sh_degrees).enumerate() {
        infos.push(SplatInfo {
            map_offset_texels: map.offset_texels,
            map_size: u32::from(map.rows) | u32::from(map.cols) << 16,
            texel_sizes: map.texel_sizes,
            map_origin: map.origin(),
            last_step: last_step(i),
            parameters: first_float << 2 | u32::from(degree),
        });
        first_float += splat_floats(degree.into()) as u32;
    }
    infos
}

/// A new buffer that contains `values`.
pub(super) fn filled<T: bytemuck::Pod>(device: &GpuDevice, what: &str, values: &[T]) -> Result<wgpu::Buffer> {
    let buffer = device.buffer(what, values.len() as u64, size_of::<T>() as u64)?;
    device.write(&buffer, 0, bytemuck::cast_slice(values))?;
    Ok(buffer)
}

/// Buffers to be set together.
pub(super) type NewBuffers = Vec<(Buf, wgpu::Buffer)>;

/// Uploads model and optimiser state, completely or not at all, and returns the model's shape; `before` is that of the model on the
/// device. If both have the same sizes, the buffers stay.
///
/// # Errors
/// [`crate::Error::Device`] with the sizes if they do not fit.
pub(super) fn upload(
    device: &GpuDevice,
    resources: &mut Resources,
    before: &Shape,
    model: &Model,
    adam: &AdamState,
) -> Result<Shape> {
    let shape = Shape::of(model);
    check_floats(shape.num_splat_floats())?;
    device.count(|work| &work.uploads);
    if resources.has(Buf::SplatP) && before.sizes() == shape.sizes() {
        replace(device, resources, &shape, model, adam)?;
        return Ok(shape);
    }
    let mut made = derived(device, shape.num_splats(), shape.num_texels())?;
    let splats = [(Buf::SplatP, &model.splats), (Buf::SplatM, &adam.splats_m), (Buf::SplatV, &adam.splats_v)];
    for (name, arrays) in splats {
        made.push((name, filled(device, "splat parameters", &interleaved(arrays))?));
    }
    let texels =
        [(Buf::TexelP, &model.textures.texels), (Buf::TexelM, &adam.texels_m), (Buf::TexelV, &adam.texels_v)];
    for (name, values) in texels {
        made.push((name, filled(device, "texel parameters", values)?));
    }
    let infos = splat_infos(&shape, |i| adam.last_step[i]);
    made.push((Buf::SplatInfo, filled(device, "splat records", &infos)?));
    made.into_iter().for_each(|(name, buffer)| resources.set(name, buffer));
    Ok(shape)
}

/// Uploads a model and the optimiser's state into the buffers of one of the same sizes.
fn replace(
    device: &GpuDevice,
    resources: &Resources,
    shape: &Shape,
    model: &Model,
    adam: &AdamState,
) -> Result<()> {
    let splats = [&model.splats, &adam.splats_m, &adam.splats_v].map(interleaved);
    let texels = [&model.textures.texels, &adam.texels_m, &adam.texels_v];
    let infos = splat_infos(shape, |i| adam.last_step[i]);
    let floats = splats.iter().chain(texels).map(|values| bytemuck::cast_slice(values));
    let bytes = floats.chain([bytemuck::cast_slice(&infos)]);
    device.write_all(STATE.iter().map(|&name| resources.buffer(name)).zip(bytes))?;
    let derived = derived_sizes(shape.num_splats(), shape.num_texels());
    derived.iter().for_each(|(name, ..)| device.clear(resources.buffer(*name)));
    Ok(())
}

/// The other buffers whose size depends on the numbers of splats and texels: name, content, number and bytes of elements.
fn derived_sizes(num_splats: usize, num_texels: usize) -> [(Buf, &'static str, u64, u64); 8] {
    let (n, t) = (num_splats as u64, num_texels as u64);
    [
        (Buf::TexelGrad, "texel gradients", 3 * t, 4),
        (Buf::TexelValues, "activated texels", t, 16),
        (Buf::Statistics, "window statistics", n, 16),
        (Buf::Projected, "projected splats", n, PROJECTED_BYTES),
        (Buf::Bounds, "splat bounds", n, BOUNDS_BYTES),
        (Buf::Visible, "visible splats", n + 1, 4),
        (Buf::SplatTotals, "sums over the pairs of splats", n, 4 * u64::from(PAIR_SUMS_GEOMETRY)),
        (Buf::SplatSums, "sums over splats", n.div_ceil(GROUP.into()), SPLAT_SUMS_BYTES),
    ]
}

/// These buffers, all zero.
///
/// # Errors
/// As [`upload`].
pub(super) fn derived(device: &GpuDevice, num_splats: usize, num_texels: usize) -> Result<NewBuffers> {
    let made = |(name, what, count, bytes)| Ok((name, device.buffer(what, count, bytes)?));
    derived_sizes(num_splats, num_texels).into_iter().map(made).collect()
}

/// Drops all buffers that depend on the numbers of splats and texels, and waits until their memory is free.
///
/// # Errors
/// [`Error::Device`] if the device was lost.
pub(super) fn forget(device: &GpuDevice, resources: &mut Resources) -> Result<()> {
    let derived = derived_sizes(0, 0).map(|(name, ..)| name);
    STATE.into_iter().chain(derived).for_each(|name| resources.remove(name));
    device.wait_for(device.queue.submit([]))
}

/// Buffers of the model and the optimiser's state; all others follow from them.
pub(super) const STATE: [Buf; 7] =
    [Buf::SplatP, Buf::SplatM, Buf::SplatV, Buf::TexelP, Buf::TexelM, Buf::TexelV, Buf::SplatInfo];

/// Copies of buffers, which are complete once the device has done what was submitted.
///
/// # Errors
/// [`Error::Device`] if they cannot be allocated.
pub(super) fn copies(device: &GpuDevice, buffers: &NewBuffers) -> Result<NewBuffers> {
    let copy = |(name, buffer): &(Buf, wgpu::Buffer)| -> Result<(Buf, wgpu::Buffer)> {
        Ok((*name, device.buffer("copy of the state", buffer.size() / 16, 16)?))
    };
    let copies: NewBuffers = buffers.iter().map(copy).collect::<Result<_>>()?;
    device.copy_all(buffers.iter().zip(&copies).map(|((_, from), (_, to))| (from, to)));
    Ok(copies)
}

/// Reads the model. Works after a failed step too, unless the device was lost.
///
/// # Errors
/// [`Error::Device`] if the device was lost.
pub(super) fn read_model(device: &GpuDevice, resources: &Resources, shape: &Shape) -> Result<Model> {
    let floats = [(Buf::SplatP, shape.num_splat_floats()), (Buf::TexelP, 3 * shape.num_texels())];
    let parts = floats.map(|(name, floats)| (resources.buffer(name), 4 * floats as u64));
    let mut read = device.rescue_all(&parts)?.into_iter();
    let mut next = || read.next().unwrap_or_default();
    Ok(shape.with(separated(&next(), &shape.sh_degrees), next()))
}

/// As [`read_model`], with the optimiser's state.
///
/// # Errors
/// As [`read_model`].
pub(super) fn read_back(
    device: &GpuDevice,
    resources: &Resources,
    shape: &Shape,
    clock: Clock,
) -> Result<(Model, AdamState)> {
    let [splats, texels] = [shape.num_splat_floats(), 3 * shape.num_texels()];
    let bytes = [splats, splats, splats, texels, texels, texels].map(|floats| 4 * floats as u64);
    let infos = (shape.num_splats() * size_of::<SplatInfo>()) as u64;
    let parts: Vec<_> = STATE
        .iter()
        .zip(bytes.into_iter().chain([infos]))
        .map(|(&name, bytes)| (resources.buffer(name), bytes))
        .collect();
    let mut read = device.rescue_all(&parts)?.into_iter();
    let mut next = || read.next().unwrap_or_default();
    let [splats, splats_m, splats_v] = [(); 3].map(|()| separated(&next(), &shape.sh_degrees));
    let [texels, texels_m, texels_v] = [(); 3].map(|()| next());
    let infos: Vec<SplatInfo> = bytemuck::pod_collect_to_vec(&next());
    let last_step = infos.iter().map(|info| info.last_step).collect();
    let Clock { step, rates } = clock;
    let adam = AdamState { splats_m, splats_v, texels_m, texels_v, last_step, step, rates };
    Ok((shape.with(splats, texels), adam))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selftest::{SceneOptions, random_scene};

    #[test]
    fn interleaved_splats_round_trip() {
        for sh_degree in [0, 2, 3] {
            let options = SceneOptions { num_splats: 7, sh_degree, ..SceneOptions::default() };
            let model = random_scene(&options).model;
            let (splats, values) = (&model.splats, interleaved(&model.splats));
            assert_eq!(
                values.len(),
                splats.sh_degrees().iter().map(|&d| splat_floats(d.into())).sum::<usize>()
            );
            assert_eq!(&separated(&values, splats.sh_degrees()), splats);
            // The records point to the first float of each.
            for (i, info) in splat_infos(&Shape::of(&model), |_| 0).iter().enumerate() {
                assert_eq!(values[(info.parameters >> 2) as usize], splats.positions[3 * i]);
                assert_eq!(info.parameters & 3, u32::from(splats.sh_degrees()[i]));
            }
        }
    }
}
