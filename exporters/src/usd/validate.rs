//! Checks our USD files for what the validators of OpenUSD do not check: arrays that do not fit each other, kernels,
//! numbers, extents, names of schemas, rectangles and the hash.
//!
//! | code | rule |
//! |---|---|
//! | LT2001 | the file can be read |
//! | LT2002 | arrays of a particle field have as many elements as `positions` |
//! | LT2003 | a particle field has a kernel |
//! | LT2004 | a particle field does not have several kernels |
//! | LT2005 | numbers are finite |
//! | LT2006 | the extent is there and covers the particles |
//! | LT2007 | names of applied schemas are known |
//! | LT2008 | rectangles lie on their pages and do not overlap |
//! | LT2009 | the hash agrees with the numbers |
//! | LT2010 | the stage has `upAxis`, `metersPerUnit` and `defaultPrim`, and prims |
//! | LT2011 | quaternions have length 1, opacities are in [0, 1], scales are not negative |
//! | LT2012 | images that the layer names can be read; pages are valid and have the stated sizes |
//! | LT2013 | SH of degree 0 for programs without texture support is the exact one plus the mean of the map |
//! | LT2014 | the third scale of 3D Gaussians is positive and the smallest |
//! | LT2015 | 3D Gaussians for programs without texture support are there, and agree with the textured splats |

use super::fallback;
use super::field::Field;
use super::layer::{Prim, entry, for_each_prim};
use super::names::*;
use super::numbers::half_sides;
use super::read::{Opened, PAGE_PLACE};
use super::value::{Form, Numbers, Value};
use crate::format::contents::Issues;
use crate::math::quaternion;
use crate::{Error, Issue, ReadLimits, num_sh_coefficients, quoted};
use std::collections::BTreeSet;
use std::path::Path;

/// Schemas besides [`FIELD_SCHEMAS`] that may be applied to prims of such files.
const OTHER_SCHEMAS: [&str; 12] = [
    "ParticleFieldKernelBaseAPI",
    "ParticleFieldKernelConstantSurfletAPI",
    "ParticleFieldKernelGaussianEllipsoidAPI",
    "ParticleFieldOrientationBaseAPI",
    "ParticleFieldPositionBaseAPI",
    "ParticleFieldRadianceBaseAPI",
    "GeomModelAPI",
    "MotionAPI",
    "PrimvarsAPI",
    "ModelAPI",
    "VisibilityAPI",
    "XformCommonAPI",
];

/// Share of its coordinates by which an extent may miss particles: other programs compute in f32.
const EXTENT_TOLERANCE: f64 = 1e-6;

/// Standard deviations that an extent must cover: programs cut particles off there.
const REACH: f64 = 3.0;

/// Prims whose particles or rectangles are checked; our files have two.
const FIELDS_MAX: usize = 8;

/// Checks a file; returns nothing if it is valid.
pub fn validate(path: &Path) -> Vec<Issue> {
    let limits = ReadLimits::default();
    let mut issues = Issues::default();
    match Opened::open(path, &limits) {
        Err(error) => issues.error("LT2001", "", error.text()),
        Ok(opened) => {
            check_stage(&opened, &mut issues);
            let mut num_fields = 0;
            for_each_prim(&opened.layer, &mut |place, prim| {
                check_prim(path, place, prim, &mut num_fields, &mut issues);
            });
            check_images(&opened, &limits, &mut issues);
            // What was found so far explains what reading would find.
            if !issues.has_errors() {
                check_reading(path, &opened, &limits, &mut issues);
            }
        }
    }
    issues.list
}

fn check_stage(opened: &Opened, issues: &mut Issues) {
    for name in ["upAxis", "metersPerUnit", "defaultPrim"] {
        if entry(&opened.layer.metadata, name).is_none() {
            issues.error("LT2010", "/", format!("no {name}"));
        }
    }
    let default = entry(&opened.layer.metadata, "defaultPrim").and_then(Value::as_text).unwrap_or_default();
    if !opened.layer.root_prims.iter().any(|p| p.name == default) {
        issues.error("LT2010", "/", format!("defaultPrim {}: there is no such root prim", quoted(default)));
    }
}

/// Images of our files must be there; those of other programs may lie anywhere.
fn check_images(opened: &Opened, limits: &ReadLimits, issues: &mut Issues) {
    if opened.facts().is_none() {
        return;
    }
    let mut seen = BTreeSet::new();
    for (place, prim) in opened.prims() {
        let Some(Value::Asset(name)) = prim.value("inputs:file") else { continue };
        if !seen.insert(name) {
            continue;
        }
        if let Err(error) = opened.image(name, limits.decoded_bytes) {
            issues.error("LT2012", &place, error.text());
        }
    }
}

fn check_reading(path: &Path, opened: &Opened, limits: &ReadLimits, issues: &mut Issues) {
    match opened.contents(limits) {
        Err(Error::Unsupported { what, .. }) => {
            issues.info("LT2001", "", format!("not written by this program: {what}"));
        }
        Err(error) => {
            let is_of_page = matches!(&error, Error::Invalid { what, .. } if what.starts_with(PAGE_PLACE));
            issues.error(if is_of_page { "LT2012" } else { "LT2001" }, "", error.text());
        }
        Ok(contents) => {
            let is_changed = contents.hash != Some(contents.asset.hash());
            if is_changed {
                let found = contents.hash.map_or("none".to_owned(), |h| format!("{h:016x}"));
                let expected = contents.asset.hash();
                issues.error("LT2009", "/", format!("hash {found}, the numbers have {expected:016x}"));
            }
            fallback::check(opened, path, &contents.asset, opened.texel_step(), issues);
            for warning in contents.warnings.into_iter().skip(is_changed.into()) {
                issues.warning("LT2001", "/", warning);
            }
        }
    }
}

fn check_prim(path: &Path, place: &str, prim: &Prim, num_fields: &mut usize, issues: &mut Issues) {
    for name in prim.applied() {
        let is_known = FIELD_SCHEMAS.contains(&name.as_str())
            || OTHER_SCHEMAS.contains(&name.as_str())
            || name.starts_with("CollectionAPI:");
        if !is_known && name.starts_with(FIELD_TYPE) {
            issues.error("LT2007", place, format!("applied schema {} does not exist", quoted(name)));
        } else if !is_known {
            issues.warning("LT2007", place, format!("applied schema {} is not known here", quoted(name)));
        }
    }
    for property in &prim.properties {
        let is_finite = match property.value() {
            Some(Value::Floats(n)) => n.values.iter().all(|v| v.is_finite()),
            Some(Value::Doubles(n)) => n.values.iter().all(|v| v.is_finite()),
            _ => true,
        };
        if !is_finite {
            issues.error("LT2005", place, format!("{}: not all numbers are finite", quoted(&property.name)));
        }
    }
    let is_field = prim.type_name == FIELD_TYPE;
    let is_any = is_field || prim.type_name == SPLAT3D_TYPE || prim.property(RECT).is_some();
    *num_fields += usize::from(is_any);
    if *num_fields > FIELDS_MAX {
        return;
    }
    if is_field || prim.type_name == SPLAT3D_TYPE {
        check_kernels(place, prim, if is_field { 0 } else { 1 }, issues);
        check_lengths(place, prim, issues);
        check_ranges(place, prim, issues);
        check_extent(place, prim, issues);
    }
    if prim.property(RECT).is_some() {
        check_rectangles(path, place, prim, issues);
    }
}

fn check_kernels(place: &str, prim: &Prim, built_in: usize, issues: &mut Issues) {
    let applied: Vec<&String> = prim.applied().iter().filter(|s| s.starts_with(KERNEL_PREFIX)).collect();
    match applied.len() + built_in {
        0 => {
            issues.error("LT2003", place, "no kernel schema is applied: the shape of particles is undefined")
        }
        1 => {}
        n => issues.error("LT2004", place, format!("{n} kernels, expected one; applied: {applied:?}")),
    }
}

/// Number of elements of an array of numbers.
fn length(value: Option<&Value>) -> Option<usize> {
    match value? {
        Value::Ints(n) if n.is_array => Some(n.num_elements()),
        Value::Floats(n) if n.is_array => Some(n.num_elements()),
        _ => None,
    }
}

fn check_lengths(place: &str, prim: &Prim, issues: &mut Issues) {
    let Some(n) = length(prim.value(POSITIONS)) else {
        issues.error("LT2002", place, format!("no array {POSITIONS}"));
        return;
    };
    let degree = prim.value(SH_DEGREE).and_then(Value::as_int).unwrap_or(3);
    let coefficients = num_sh_coefficients(degree.clamp(0, 3) as u32);
    let is_textured = prim.property(LITETEX_VERSION).is_some();
    let required = [(ORIENTATIONS, 1), (SCALES, 1), (OPACITIES, 1), (SH_COEFFICIENTS, coefficients)];
    let ours = [(RECT, 1), (PAGE, 1), (TEXEL_SIZE, 1), (SH0, 1)];
    let optional =
        [(SHIFT, 1), (OWN_SH_DEGREE, 1)].into_iter().filter(|(name, _)| prim.property(name).is_some());
    let ours = ours.into_iter().chain(optional).filter(|_| is_textured);
    for (name, each) in required.into_iter().chain(ours) {
        let expected = n * each;
        match length(prim.value(name)) {
            None => issues.error("LT2002", place, format!("no array {name}")),
            Some(found) if found < expected => {
                let what = format!("{name}: {found} elements for {n} particles, expected {expected}");
                issues.error("LT2002", place, what);
            }
            Some(found) if found > expected => {
                let what = format!("{name}: {found} elements, {expected} of them are used");
                issues.warning("LT2002", place, what);
            }
            Some(_) => {}
        }
    }
}

/// Numbers of an array of floats; empty if it is not there.
fn floats<'a>(prim: &'a Prim, name: &str, form: Form) -> &'a [f32] {
    match prim.value(name) {
        Some(Value::Floats(n)) if n.form == form => &n.values,
        _ => &[],
    }
}

fn check_ranges(place: &str, prim: &Prim, issues: &mut Issues) {
    let quaternions = floats(prim, ORIENTATIONS, Form::Quaternion).as_chunks::<4>().0;
    let is_unit = |q: &[f32; 4]| (quaternion::norm(q.map(f64::from)) - 1.0).abs() <= 1e-5;
    if let Some(i) = quaternions.iter().position(|q| !is_unit(q)) {
        let what = format!("{ORIENTATIONS}[{i}]: {:?} is not a unit quaternion", quaternions[i]);
        issues.error("LT2011", place, what);
    }
    let opacities = floats(prim, OPACITIES, Form::One);
    if let Some(i) = opacities.iter().position(|o| !(0.0..=1.0).contains(o)) {
        issues.error("LT2011", place, format!("{OPACITIES}[{i}]: {} is not in [0, 1]", opacities[i]));
    }
    let scales = floats(prim, SCALES, Form::Vec3);
    if let Some(i) = scales.iter().position(|s| *s < 0.0) {
        issues.error("LT2011", place, format!("{SCALES}[{}]: {} is negative", i / 3, scales[i]));
    }
}

fn check_extent(place: &str, prim: &Prim, issues: &mut Issues) {
    let &[x0, y0, z0, x1, y1, z1] = floats(prim, EXTENT, Form::Vec3) else {
        issues.error("LT2006", place, format!("no {EXTENT} of two points"));
        return;
    };
    let (low, high) = ([x0, y0, z0].map(f64::from), [x1, y1, z1].map(f64::from));
    let slack: [f64; 3] = std::array::from_fn(|i| low[i].abs().max(high[i].abs()) * EXTENT_TOLERANCE);
    let positions = floats(prim, POSITIONS, Form::Vec3).as_chunks::<3>().0;
    let rotations = floats(prim, ORIENTATIONS, Form::Quaternion).as_chunks::<4>().0;
    let scales = floats(prim, SCALES, Form::Vec3).as_chunks::<3>().0;
    for (i, ((p, q), &[u, v, _])) in positions.iter().zip(rotations).zip(scales).enumerate() {
        let half = half_sides(q.map(f64::from), [u, v].map(f64::from), REACH);
        let is_inside = (0..3).all(|axis| {
            let p = f64::from(p[axis]);
            p - half[axis] >= low[axis] - slack[axis] && p + half[axis] <= high[axis] + slack[axis]
        });
        if !is_inside {
            issues.error("LT2006", place, format!("{EXTENT} does not cover particle {i} at {p:?}"));
            return;
        }
    }
}

fn check_rectangles(path: &Path, place: &str, prim: &Prim, issues: &mut Issues) {
    let Some(Value::Ints(Numbers { form: Form::Vec4, values, .. })) = prim.value(RECT) else {
        return issues.error("LT2008", place, format!("{RECT} is not an array of four integers"));
    };
    let (field, n) = (Field { path, prim }, values.len() / 4);
    let laid = field.maps(n).and_then(|maps| {
        let atlas = field.atlas(n)?;
        atlas.check(&maps)?;
        Ok((atlas, maps))
    });
    match laid {
        Err(error) => issues.error("LT2008", place, error.text()),
        Ok((atlas, maps)) => {
            if let Some(splat) = atlas.first_overlap(&maps) {
                issues.error("LT2008", place, format!("{RECT}[{splat}] overlaps another"));
            }
        }
    }
}
