//! The particle field of 3D Gaussians for programs without texture support, and the rules about it.

use super::field::Field;
use super::layer::Prim;
use super::names::*;
use super::read::Opened;
use super::value::Form;
use crate::fallback::check::{wrong_dc, wrong_thickness};
use crate::fallback::ellipsoid;
use crate::files::limits::room_for_splats;
use crate::format::contents::Issues;
use crate::math::yup;
use crate::{ReadLimits, Result, SplatAsset, num_sh_coefficients};
use std::path::Path;

/// Reads what a program that supports only `ParticleField3DGaussianSplat` shows of a file: its ellipsoids as discs along
/// their two largest axes. Frame, near plane and cameras are those of [`super::read_usd`], so that both can be rendered
/// alike. `None` if the file has no such prim.
///
/// # Errors
/// As [`super::read_usd`], except about textured fields and pages, which are not read.
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

/// Ellipsoids as discs along their two largest axes.
fn flattened(path: &Path, prim: &Prim, limits: &ReadLimits) -> Result<SplatAsset> {
    let field = Field { path, prim };
    let (positions, degree) = field.splats(limits)?;
    let n = positions.len();
    let mut asset = room_for_splats(n, degree).map_err(|e| e.at(path))?;
    asset.positions.extend(positions.iter().map(|&p| yup::position(p)));
    let rotations = field.floats(ORIENTATIONS, Form::Quaternion, n)?.as_chunks::<4>().0;
    let scales = field.floats(SCALES, Form::Vec3, n)?.as_chunks::<3>().0;
    let opacities = field.floats(OPACITIES, Form::One, n)?;
    for (splat, ((&q, &scales), &opacity)) in rotations.iter().zip(scales).zip(opacities).enumerate() {
        let pushed = ellipsoid::push(&mut asset, q, scales, opacity);
        pushed.map_err(|what| invalid!(path, "particle {splat}: {what}"))?;
    }
    let num_coefficients = num_sh_coefficients(degree);
    let sh = field.floats(SH_COEFFICIENTS, Form::Vec3, n * num_coefficients)?;
    for of_splat in sh.chunks_exact(3 * num_coefficients) {
        asset.sh.extend(yup::sh(of_splat));
    }
    asset.sh_degrees.resize(n, degree as u8);
    Ok(asset)
}

/// Compares the fallbacks with the textured scene. `texel_step` is the step between codes of texels, 0 for floats.
pub(super) fn check(opened: &Opened, path: &Path, asset: &SplatAsset, texel_step: f64, issues: &mut Issues) {
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
            issues.many("LT2013", &name, wrong_dc(asset, stored, texel_step));
        }
    }
    let Some((place, prim)) = splats.clone().next() else {
        let what = format!("no {SPLAT3D_TYPE}: programs without texture support show nothing");
        return issues.warning("LT2015", textured_place, what);
    };
    let field = Field { path, prim };
    match field.floats(SCALES, Form::Vec3, n) {
        Ok(scales) => {
            let stored = scales.as_chunks::<3>().0.iter().copied();
            issues.many("LT2014", &format!("{place}.{SCALES}"), wrong_thickness(stored));
        }
        Err(_) => issues.error("LT2015", place, format!("{SCALES}: not those of the textured splats")),
    }
    for name in [POSITIONS, ORIENTATIONS, OPACITIES, SH_COEFFICIENTS] {
        if prim.value(name) != textured.value(name) {
            issues.error("LT2015", place, format!("{name}: not those of the textured splats"));
        }
    }
}
