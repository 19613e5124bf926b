//! The structures that the shaders share with Rust, and their comparison.

use super::parsed::Parsed;
use crate::gpu::layout::{self, Edit, MapChange, SortPass, SplatInfo, Status, StepUniform};
use naga::TypeInner;
use std::collections::BTreeSet;

/// Name, type and offset of a member.
type Member = (String, &'static str, u32);

/// A structure as defined in Rust.
pub(super) struct Mirror {
    pub name: &'static str,
    bytes: u32,
    /// Empty if Rust only knows the size.
    members: Vec<Member>,
}

/// WGSL type of a member. Rust uses arrays in place of vectors.
trait WgslType {
    const NAME: &'static str;
}

macro_rules! wgsl_types {
    ($($ty:ty = $name:literal),* $(,)?) => { $(impl WgslType for $ty { const NAME: &'static str = $name; })* };
}

wgsl_types![
    u32 = "u32",
    [u32; 2] = "vec2u",
    i32 = "i32",
    f32 = "f32",
    [f32; 2] = "vec2f",
    [f32; 3] = "vec3f",
    [f32; 4] = "vec4f",
    [[f32; 4]; 6] = "array of vec4f",
];

fn wgsl_type_of<T: WgslType>(_: &T) -> &'static str {
    T::NAME
}

/// Members sorted by offset; destructuring ensures that none is left out.
macro_rules! mirror {
    ($name:literal, $ty:ident { $($member:ident),* $(,)? }) => {{
        let $ty { $($member),* } = $ty::default();
        let mut members: Vec<Member> = vec![$((
            stringify!($member).to_owned(),
            wgsl_type_of(&$member),
            std::mem::offset_of!($ty, $member) as u32,
        )),*];
        members.sort_by_key(|m| m.2);
        Mirror { name: $name, bytes: size_of::<$ty>() as u32, members }
    }};
}

pub(super) fn mirrors() -> Vec<Mirror> {
    vec![
        mirror!(
            "Step",
            StepUniform {
                camera_row0,
                camera_row1,
                camera_row2,
                exposure_row0,
                exposure_row1,
                exposure_row2,
                camera_in_local,
                near,
                focal_px,
                principal_px,
                size_px,
                grid,
                background,
                num_splats,
                sh_degree,
                step,
                flushed_step,
                flags,
                status_slot,
                pair_capacity,
                partial_stride,
                loss_l1,
                loss_dssim,
                loss_mse,
                opacity_weight,
                texture_weight,
                texel_units,
                photo_offset_px,
                rate_position,
                rate_quaternion,
                rate_log_scale,
                rate_opacity,
                rate_sh_dc,
                rate_sh_rest,
                rate_texel,
                m_correction,
                last_rate_sh_dc,
                last_rate_sh_rest,
                last_rate_texel,
                v_correction_sqrt,
                loss_distortion,
                loss_normal,
                rate_texel_growth,
                rate_texel_growth_limit,
                last_rate_texel_growth,
                last_rate_texel_growth_limit,
                filter_px2,
                probe_scale,
                last_rate_position,
                last_rate_quaternion,
                last_rate_log_scale,
                last_rate_opacity,
                last_m_correction,
                last_v_correction_sqrt,
                partial_first,
                partial_capacity,
                segment_pairs,
                pad,
            }
        ),
        mirror!("SortPass", SortPass { shift, counts_pairs, identity_values, counts_next }),
        mirror!(
            "SplatInfo",
            SplatInfo { map_offset_texels, map_size, texel_sizes, map_origin, last_step, parameters }
        ),
        mirror!("MapChange", MapChange { source, kind, first_row, first_col }),
        mirror!("Edit", Edit { position, opacity_logit, log_scales, splat, pad }),
        mirror!(
            "Status",
            Status {
                done,
                needed_pairs,
                visible,
                faults,
                l1,
                dssim,
                mse,
                opacity,
                texture,
                evaluated,
                inside,
                blended,
                texel_atomics,
                distortion,
                normal,
                pad,
                colour_sums,
            }
        ),
        Mirror { name: "Projected", bytes: layout::PROJECTED_BYTES as u32, members: Vec::new() },
        Mirror { name: "Bounds", bytes: layout::BOUNDS_BYTES as u32, members: Vec::new() },
        Mirror { name: "SplatSums", bytes: layout::SPLAT_SUMS_BYTES as u32, members: Vec::new() },
    ]
}

fn wgsl_name(inner: &TypeInner) -> &'static str {
    use naga::{Scalar, VectorSize};
    match *inner {
        TypeInner::Scalar(Scalar::U32) | TypeInner::Atomic(Scalar::U32) => "u32",
        TypeInner::Scalar(Scalar::I32) => "i32",
        TypeInner::Scalar(Scalar::F32) => "f32",
        TypeInner::Vector { size: VectorSize::Bi, scalar: Scalar::U32 } => "vec2u",
        TypeInner::Vector { size: VectorSize::Bi, scalar: Scalar::F32 } => "vec2f",
        TypeInner::Vector { size: VectorSize::Tri, scalar: Scalar::F32 } => "vec3f",
        TypeInner::Vector { size: VectorSize::Quad, scalar: Scalar::F32 } => "vec4f",
        // Of how many, the size of the structure tells.
        TypeInner::Array { stride: 16, .. } => "array of vec4f",
        _ => "a type without counterpart in Rust",
    }
}

/// Structures that differ from Rust's; `seen` collects the names of those that were compared.
pub(super) fn check_structs(parsed: &Parsed, seen: &mut BTreeSet<&'static str>) -> Vec<String> {
    let mut wrong = Vec::new();
    for (handle, ty) in parsed.module.types.iter() {
        let TypeInner::Struct { members, span } = &ty.inner else { continue };
        let mirrors = mirrors();
        let Some(mirror) = mirrors.iter().find(|m| Some(m.name) == ty.name.as_deref()) else { continue };
        seen.insert(mirror.name);
        let at = parsed.at(parsed.module.types.get_span(handle));
        if *span != mirror.bytes {
            wrong.push(format!("{at}: {} has {span} bytes, in Rust {}", mirror.name, mirror.bytes));
        }
        let shader = members.iter().map(|m| {
            let name = m.name.clone().unwrap_or_default();
            (name, wgsl_name(&parsed.module.types[m.ty].inner), m.offset)
        });
        let shader: Vec<Member> = shader.collect();
        if mirror.members.is_empty() || shader == mirror.members {
            continue;
        }
        let k = shader.iter().zip(&mirror.members).take_while(|(a, b)| a == b).count();
        let (found, expected) = (shader.get(k), mirror.members.get(k));
        let at = found.map_or(at, |m| parsed.member_at(handle, &m.0));
        wrong.push(format!("{at}: {} member {k} is {found:?}, in Rust {expected:?}", mirror.name));
    }
    wrong
}
