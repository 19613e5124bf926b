//! The particle field of 3D Gaussians, as programs see it that know no textured ones, and the rules about it.

use super::field::Field;
use super::layer::Prim;
use super::names::*;
use super::read::Opened;
use super::validate::Report;
use super::value::Form;
use crate::fallback::{wrong_dc, wrong_thickness};
use crate::limits::{room_for_splats, splat_bytes};
use crate::ply::thinnest_last;
use crate::{
    AssetMap, Error, ReadLimits, Result, SPLATS_MAX, SplatAsset, num_sh_coefficients, quaternion, yup,
};
use std::path::Path;

/// A quaternion keeps its bits while its norm is within this of 1; up to [`FAR_FROM_UNIT`] it is made a unit one.
const UNIT_TOLERANCE: f64 = 1e-5;

/// See [`UNIT_TOLERANCE`].
const FAR_FROM_UNIT: f64 = 0.05;

/// What a program gets from a file that knows only `ParticleField3DGaussianSplat`: its ellipsoids as surfels along their
/// two largest axes. Frame, near plane and cameras are those of [`super::read_usd`], so that both can be drawn alike.
/// `None`: the file has no such prim.
///
/// # Errors
/// As [`super::read_usd`], but for textured fields and pages, which are not looked at.
pub fn read_fallback(path: &Path, limits: &ReadLimits) -> Result<Option<SplatAsset>> {
    let opened = Opened::open(path, limits)?;
    let prims = opened.prims();
    let Some((_, prim)) = prims.iter().find(|(_, p)| p.type_name == SPLAT3D_TYPE) else { return Ok(None) };
    let mut asset = flattened(path, prim, limits)?;
    if let Some(meta) = opened.meta()? {
        meta.store(&mut asset);
    }
    asset.validate().map_err(|e| e.at(path))?;
    Ok(Some(asset))
}

/// Ellipsoids as surfels along their two largest axes.
fn flattened(path: &Path, prim: &Prim, limits: &ReadLimits) -> Result<SplatAsset> {
    let field = Field { path, prim };
    let degree = field.sh_degree()?;
    let positions = field.positions()?.as_chunks::<3>().0;
    let n = positions.len();
    if n > SPLATS_MAX {
        return Err(Error::too_large(path, format!("{n} splats, at most {SPLATS_MAX}")));
    }
    limits.check(splat_bytes(degree) * n as u64, &format!("{n} splats"), path)?;
    let mut asset = room_for_splats(n, degree).map_err(|e| e.at(path))?;
    asset.positions.extend(positions.iter().map(|&p| yup::position(p)));
    asset.maps.resize(n, AssetMap::default());
    let rotations = field.floats(ORIENTATIONS, Form::Quaternion, n)?.as_chunks::<4>().0;
    let scales = field.floats(SCALES, Form::Vec3, n)?.as_chunks::<3>().0;
    for (splat, (q, scales)) in rotations.iter().zip(scales).enumerate() {
        let offence = |what: String| Err(Error::invalid(path, format!("particle {splat}: {what}")));
        let mut unit = q.map(f64::from);
        let norm = quaternion::norm(unit);
        if norm.is_nan() || (norm - 1.0).abs() > FAR_FROM_UNIT {
            return offence(format!("{q:?} is no unit quaternion"));
        }
        if (norm - 1.0).abs() > UNIT_TOLERANCE {
            unit = unit.map(|v| v / norm);
        }
        if !scales.iter().all(|s| *s >= 0.0 && s.is_finite()) {
            return offence(format!("scales {scales:?} are not finite and at least 0"));
        }
        let (unit, scales) = thinnest_last(unit, scales.map(f64::from));
        asset.rotations.push(yup::rotation_back(unit.map(|v| v as f32)));
        asset.scales.push([scales[0], scales[1]].map(|s| (s as f32).max(f32::MIN_POSITIVE)));
    }
    let opacities = field.floats(OPACITIES, Form::One, n)?;
    asset.opacities.extend(opacities.iter().map(|o| if *o == 0.0 { f32::MIN_POSITIVE } else { *o }));
    let num_coefficients = num_sh_coefficients(degree);
    let sh = field.floats(SH_COEFFICIENTS, Form::Vec3, n * num_coefficients)?;
    for of_splat in sh.chunks_exact(3 * num_coefficients) {
        asset.sh.extend(yup::sh(of_splat));
    }
    Ok(asset)
}

/// Compares the fallbacks with the scene that a reader of textures gets. `texel_step`: step of texels' codes, 0 for floats.
pub(super) fn check(opened: &Opened, path: &Path, asset: &SplatAsset, texel_step: f64, report: &mut Report) {
    let prims = opened.prims();
    let fields =
        prims.iter().filter(|(_, p)| p.type_name == FIELD_TYPE && p.property(LITETEX_VERSION).is_some());
    let splats = prims.iter().filter(|(_, p)| p.type_name == SPLAT3D_TYPE);
    let Some((textured_place, textured)) = fields.clone().next() else { return };
    let n = asset.num_splats();
    let num_coefficients = num_sh_coefficients(asset.sh_degree);
    for (place, prim) in fields.take(1).chain(splats.clone().take(1)) {
        let field = Field { path, prim };
        if let Ok(sh) = field.floats(SH_COEFFICIENTS, Form::Vec3, n * num_coefficients) {
            let stored = sh.as_chunks::<3>().0.iter().step_by(num_coefficients).copied();
            let name = format!("{place}.{SH_COEFFICIENTS}");
            report.many("LT2013", &name, wrong_dc(asset, stored, texel_step));
        }
    }
    let Some((place, prim)) = splats.clone().next() else {
        let what = format!("no {SPLAT3D_TYPE}: programs that know no textured splats show nothing");
        return report.warning("LT2015", textured_place, what);
    };
    let field = Field { path, prim };
    match field.floats(SCALES, Form::Vec3, n) {
        Ok(scales) => {
            let stored = scales.as_chunks::<3>().0.iter().copied();
            report.many("LT2014", &format!("{place}.{SCALES}"), wrong_thickness(stored));
        }
        Err(_) => {
            report.error("LT2015", place, format!("{SCALES}: other ones than those of the textured splats"))
        }
    }
    for name in [POSITIONS, ORIENTATIONS, OPACITIES, SH_COEFFICIENTS] {
        if prim.value(name) != textured.value(name) {
            report.error("LT2015", place, format!("{name}: other ones than those of the textured splats"));
        }
    }
}
