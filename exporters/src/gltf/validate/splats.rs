//! Rules of `KHR_gaussian_splatting` about the numbers of splats.

use crate::format::contents::Issues;
use crate::gltf::accessor::View;
use crate::gltf::loaded::Loaded;
use crate::gltf::scene::Found;
use crate::gltf::{KHR, sh_attribute, splats};
use crate::math::quaternion;

/// How far the norm of a quaternion of floats may be from 1.
const UNIT_TOLERANCE: f64 = 1e-5;

/// The same where components have 8 or 16 bits.
const STORED_UNIT_TOLERANCE: f64 = 0.02;

/// Checks the types of all attributes, and the numbers of those that have a range.
pub fn check(loaded: &Loaded<'_>, found: &Found<'_>, issues: &mut Issues) {
    let place = |name: &str| format!("{}/attributes/{name}", found.pointer);
    let mut get = |name: &str| match splats::attribute(loaded, found.primitive, name) {
        Ok(view) => Some(view),
        Err(e) => {
            issues.error("LT1007", &place(name), e.text());
            None
        }
    };
    get("POSITION");
    let [rotation, scale, opacity] =
        ["ROTATION", "SCALE", "OPACITY"].map(|name| get(&format!("{KHR}:{name}")));
    let attributes = found.primitive.attributes.keys();
    let sh = attributes.filter(|name| name.starts_with(KHR) && name.contains(":SH_")).cloned();
    let zeroth = sh_attribute(0, 0);
    // Others that are missing were found before.
    for name in sh.chain([zeroth.clone()].into_iter().filter(|z| !found.primitive.attributes.contains_key(z)))
    {
        get(&name);
    }
    let place = |name: &str| format!("{}/attributes/{KHR}:{name}", found.pointer);
    if let Some(view) = rotation {
        let tolerance = if view.normalised { STORED_UNIT_TOLERANCE } else { UNIT_TOLERANCE };
        let is_unit = |q: &[f32; 4]| (quaternion::norm(q.map(f64::from)) - 1.0).abs() <= tolerance;
        let offences = view.rows::<4>().enumerate().filter(|(_, q)| !is_unit(q));
        let text = |(i, q)| format!("splat {i}: {q:?} is not a unit quaternion");
        issues.many("LT1012", &place("ROTATION"), offences.map(text));
    }
    if let Some(view) = scale {
        check_scales(&view, &place("SCALE"), found.splatting.texture().is_some(), issues);
    }
    if let Some(view) = opacity {
        let offences = view.rows::<1>().enumerate().filter(|(_, [o])| !(*o > 0.0 && *o <= 1.0));
        issues.many("LT1014", &place("OPACITY"), offences.map(|(i, [o])| format!("splat {i}: opacity {o}")));
    }
}

/// Our files need their first two positive; elsewhere zeros are allowed, but show nothing from some side.
fn check_scales(view: &View<'_>, place: &str, is_ours: bool, issues: &mut Issues) {
    let is_sound = |s: &[f32; 3]| {
        let is_finite = s.iter().all(|v| *v >= 0.0 && v.is_finite());
        is_finite && !(is_ours && (s[0] <= 0.0 || s[1] <= 0.0))
    };
    let offences = view.rows::<3>().enumerate().filter(|(_, s)| !is_sound(s));
    issues.many("LT1013", place, offences.map(|(i, s)| format!("splat {i}: scales {s:?}")));
    let flat = view.rows::<3>().filter(|s| s.iter().filter(|v| **v == 0.0).count() > 1).count();
    if !is_ours && flat > 0 {
        issues.warning("LT1013", place, format!("{flat} splats without an area"));
    }
}
