//! Rules about the numbers of splats.

use super::{Issues, text_of};
use crate::gltf::accessor::View;
use crate::gltf::buffer::bounds;
use crate::gltf::loaded::Loaded;
use crate::gltf::scene::Found;
use crate::gltf::{KHR, splats};
use crate::{Severity, quaternion};

/// How far the norm of a quaternion of floats may be from 1.
const UNIT_TOLERANCE: f64 = 1e-5;

/// The same where components have 8 or 16 bits.
const UNIT_TOLERANCE_STORED: f64 = 0.02;

/// Looks at every number of every attribute.
pub fn check(loaded: &Loaded<'_>, found: &Found<'_>, issues: &mut Issues) {
    let place = |name: &str| format!("{}/attributes/{name}", found.pointer);
    let mut get = |name: &str| match splats::attribute(loaded, found.primitive, name) {
        Ok(view) => Some(view),
        Err(e) => {
            issues.error("LT1007", &place(name), text_of(e));
            None
        }
    };
    let [position, rotation, scale, opacity] =
        ["POSITION".to_owned(), format!("{KHR}:ROTATION"), format!("{KHR}:SCALE"), format!("{KHR}:OPACITY")]
            .map(|name| get(&name).map(|view| (name, view)));
    // Missing coefficients are told by the structure's rules.
    let names = found.primitive.attributes.keys().filter(|name| name.starts_with(&format!("{KHR}:SH_")));
    let mut others: Vec<_> = names.filter_map(|name| Some((name.clone(), get(name)?))).collect();
    let zeroth = crate::gltf::sh_attribute(0, 0);
    if !found.primitive.attributes.contains_key(&zeroth) {
        get(&zeroth);
    }
    if let Some(&index) = found.primitive.attributes.get("COLOR_0") {
        match loaded.accessor(index, "COLOR_0") {
            Ok(view) => others.push(("COLOR_0".to_owned(), view)),
            Err(e) => issues.error("LT1007", &place("COLOR_0"), text_of(e)),
        }
    }
    let all = [&position, &rotation, &scale, &opacity].into_iter().flatten().chain(&others);
    check_counts(all, &place, issues);
    for (name, view) in others.iter().chain(&position) {
        let offences = view.rows::<4>().enumerate().filter(|(_, row)| !row.iter().all(|v| v.is_finite()));
        issues.many("LT1015", &place(name), offences.map(|(i, row)| format!("splat {i}: {row:?}")));
    }
    if let Some((name, view)) = &position {
        check_bounds(loaded, found, view, &place(name), issues);
    }
    if let Some((name, view)) = &rotation {
        check_rotations(view, &place(name), issues);
    }
    if let Some((name, view)) = &scale {
        check_scales(view, &place(name), found.splatting.texture().is_some(), issues);
    }
    if let Some((name, view)) = &opacity {
        let offends = |[o]: &[f32; 1]| !(*o > 0.0 && *o <= 1.0);
        let offences = view.rows::<1>().enumerate().filter(|(_, o)| offends(o));
        issues.many("LT1014", &place(name), offences.map(|(i, [o])| format!("splat {i}: opacity {o}")));
    }
}

fn check_counts<'a>(
    all: impl Iterator<Item = &'a (String, View<'a>)>,
    place: &impl Fn(&str) -> String,
    issues: &mut Issues,
) {
    let mut first: Option<(&String, &View<'_>)> = None;
    for (name, view) in all {
        match first {
            Some((of, other)) if other.count != view.count => {
                let what = format!("{} elements, {of} has {}", view.count, other.count);
                issues.error("LT1008", &place(name), what);
            }
            Some(_) => {}
            None => first = Some((name, view)),
        }
    }
}

fn check_bounds(loaded: &Loaded<'_>, found: &Found<'_>, view: &View<'_>, place: &str, issues: &mut Issues) {
    let index = found.primitive.attributes.get("POSITION").copied().unwrap_or_default();
    let Some(accessor) = loaded.document.accessors.get(index as usize) else {
        return;
    };
    let (low, high) = bounds(view.rows());
    let is = |told: &Option<Vec<f64>>, real: [f32; 3]| match told {
        // Other programs may round to f32 on the way.
        Some(v) => v.len() == 3 && v.iter().zip(real).all(|(v, r)| *v as f32 == r),
        None => false,
    };
    // Whole numbers have bounds of whole numbers.
    let is_float = view.component == crate::gltf::accessor::Component::F32;
    if is_float && !(is(&accessor.min, low) && is(&accessor.max, high)) {
        let what = format!("min {:?}, max {:?}, expected {low:?}, {high:?}", accessor.min, accessor.max);
        issues.error("LT1011", place, what);
    }
}

fn check_rotations(view: &View<'_>, place: &str, issues: &mut Issues) {
    let tolerance = if view.normalised { UNIT_TOLERANCE_STORED } else { UNIT_TOLERANCE };
    let offends = |q: &[f32; 4]| {
        let norm = quaternion::norm(q.map(f64::from));
        norm.is_nan() || (norm - 1.0).abs() > tolerance
    };
    let offences = view.rows::<4>().enumerate().filter(|(_, q)| offends(q));
    issues.many("LT1012", place, offences.map(|(i, q)| format!("splat {i}: {q:?} is not a unit quaternion")));
}

/// Ours need their first two positive; elsewhere zeros are allowed, but show nothing from some side.
fn check_scales(view: &View<'_>, place: &str, is_ours: bool, issues: &mut Issues) {
    let offends = |s: &[f32; 3]| {
        let finite = s.iter().all(|v| *v >= 0.0 && v.is_finite());
        !finite || is_ours && (s[0] <= 0.0 || s[1] <= 0.0)
    };
    let offences = view.rows::<3>().enumerate().filter(|(_, s)| offends(s));
    issues.many("LT1013", place, offences.map(|(i, s)| format!("splat {i}: scales {s:?}")));
    let flat = view.rows::<3>().filter(|s| s.iter().filter(|v| **v == 0.0).count() > 1).count();
    if !is_ours && flat > 0 {
        let what = format!("{flat} splats without an area");
        issues.push("LT1013", Severity::Warning, place, what);
    }
}
