//! Checks USD files for what the validators of OpenUSD do not see: arrays that do not fit each other, kernels, numbers,
//! extents, names of schemas, rectangles and the hash.
//!
//! | code | rule |
//! |---|---|
//! | LT2001 | the file can be read |
//! | LT2002 | arrays of a particle field have as many elements as `positions` |
//! | LT2003 | a particle field has a kernel |
//! | LT2004 | and not several |
//! | LT2005 | numbers are finite |
//! | LT2006 | the extent is there and covers the particles |
//! | LT2007 | names of applied schemas are known |
//! | LT2008 | rectangles lie on their pages and do not overlap |
//! | LT2009 | the hash is that of the numbers |
//! | LT2010 | the stage says `upAxis`, `metersPerUnit` and `defaultPrim`, and has prims |
//! | LT2011 | quaternions have length 1, opacities are in [0, 1], scales are not negative |
//! | LT2012 | images that the layer names can be read, pages are sound and of their size |
//! | LT2013 | SH of degree 0 for programs without textures is the exact one with the mean of the map in it |
//! | LT2014 | the third scale of 3D Gaussians is positive and the smallest |
//! | LT2015 | there are 3D Gaussians for programs without textures, where the textured ones are |

use super::fallback;
use super::field::Field;
use super::layer::{Prim, entry, for_each_prim};
use super::names::*;
use super::numbers::half_sides;
use super::read::Opened;
use super::read::read_usd;
use super::value::{Form, Numbers, Value};
use crate::{Error, Issue, ReadLimits, Severity, num_sh_coefficients, quaternion};
use std::collections::BTreeSet;
use std::path::Path;

/// Schemas that may be applied to prims of such files besides [`FIELD_SCHEMAS`].
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

/// An extent may miss particles by this share of its coordinates: other programs compute in f32.
const EXTENT_TOLERANCE: f64 = 1e-6;

/// Standard deviations that an extent must cover: where programs cut particles off.
const REACH: f64 = 3.0;

/// Overlaps are looked for on pages of at most so many texels together: a bit each.
const DRAWN_TEXELS_MAX: usize = 1 << 30;

/// Most issues; a hostile file has no end of them.
const ISSUES_MAX: usize = 1000;

/// Particle fields and rectangles whose numbers are looked at; ours have two.
const FIELDS_MAX: usize = 8;

/// Checks a file; an empty list: nothing to object to.
pub fn validate(path: &Path) -> Vec<Issue> {
    let limits = ReadLimits::default();
    let mut report = Report::default();
    match Opened::open(path, &limits) {
        Err(error) => report.error("LT2001", "", error.to_string()),
        Ok(opened) => {
            check_stage(&opened, &mut report);
            for_each_prim(&opened.layer, &mut |place, prim| check_prim(path, place, prim, &mut report));
            check_images(&opened, &limits, &mut report);
            // What was found above is the reason of what reading would find.
            if report.issues.iter().all(|i| i.severity < Severity::Error) {
                check_reading(path, &opened, &limits, &mut report);
            }
        }
    }
    report.issues
}

#[derive(Default)]
pub(super) struct Report {
    issues: Vec<Issue>,
    /// Fields that were looked at.
    num_fields: usize,
}

impl Report {
    fn add(&mut self, code: &'static str, severity: Severity, place: &str, message: String) {
        if self.issues.len() < ISSUES_MAX {
            self.issues.push(Issue { code, severity, place: place.to_owned(), message });
        }
    }

    pub(super) fn error(&mut self, code: &'static str, place: &str, message: String) {
        self.add(code, Severity::Error, place, message);
    }

    pub(super) fn warning(&mut self, code: &'static str, place: &str, message: String) {
        self.add(code, Severity::Warning, place, message);
    }

    /// Offences of many splats: the first, and the number of the rest.
    pub(super) fn many(
        &mut self,
        code: &'static str,
        place: &str,
        mut offences: impl Iterator<Item = String>,
    ) {
        if let Some(first) = offences.next() {
            let others = offences.count();
            let rest = if others > 0 { format!(", and {others} more") } else { String::new() };
            self.error(code, place, format!("{first}{rest}"));
        }
    }
}

fn check_stage(opened: &Opened, report: &mut Report) {
    for name in ["upAxis", "metersPerUnit", "defaultPrim"] {
        if entry(&opened.layer.metadata, name).is_none() {
            report.error("LT2010", "/", format!("no {name}"));
        }
    }
    let default = entry(&opened.layer.metadata, "defaultPrim").and_then(Value::as_text).unwrap_or_default();
    if !opened.layer.prims.iter().any(|p| p.name == default) {
        report.error("LT2010", "/", format!("defaultPrim {default:?}: there is no such root prim"));
    }
}

/// Every image is there; in files of other programs they may be anywhere.
fn check_images(opened: &Opened, limits: &ReadLimits, report: &mut Report) {
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
            report.error("LT2012", &place, error.to_string());
        }
    }
}

fn check_reading(path: &Path, opened: &Opened, limits: &ReadLimits, report: &mut Report) {
    match read_usd(path, limits) {
        Err(Error::Unsupported { what, .. }) => {
            report.add("LT2001", Severity::Info, "", format!("not a file of this program: {what}"));
        }
        Err(error) => {
            let is_of_page = matches!(&error, Error::Invalid { what, .. } if what.starts_with("page @"));
            report.error(if is_of_page { "LT2012" } else { "LT2001" }, "", error.to_string());
        }
        Ok(contents) => {
            let is_changed = contents.hash != Some(contents.asset.hash());
            if is_changed {
                let found = contents.hash.map_or("none".to_owned(), |h| format!("{h:016x}"));
                let expected = contents.asset.hash();
                report.error("LT2009", "/", format!("hash {found}, the numbers have {expected:016x}"));
            }
            fallback::check(opened, path, &contents.asset, opened.texel_step(), report);
            for warning in contents.warnings.into_iter().skip(is_changed.into()) {
                report.warning("LT2001", "/", warning);
            }
        }
    }
}

fn check_prim(path: &Path, place: &str, prim: &Prim, report: &mut Report) {
    for name in prim.applied() {
        let is_known = FIELD_SCHEMAS.contains(&name.as_str())
            || OTHER_SCHEMAS.contains(&name.as_str())
            || name.starts_with("CollectionAPI:");
        if !is_known && name.starts_with(FIELD_TYPE) {
            report.error("LT2007", place, format!("applied schema {name:?} does not exist"));
        } else if !is_known {
            report.warning("LT2007", place, format!("applied schema {name:?} is not known here"));
        }
    }
    for property in &prim.properties {
        let is_finite = match property.value() {
            Some(Value::Floats(n)) => n.values.iter().all(|v| v.is_finite()),
            Some(Value::Doubles(n)) => n.values.iter().all(|v| v.is_finite()),
            _ => true,
        };
        if !is_finite {
            report.error("LT2005", place, format!("{}: not all numbers are finite", property.name));
        }
    }
    let is_field = prim.type_name == FIELD_TYPE;
    let is_any = is_field || prim.type_name == SPLAT3D_TYPE || prim.property(RECT).is_some();
    report.num_fields += usize::from(is_any);
    if report.num_fields > FIELDS_MAX {
        return;
    }
    if is_field || prim.type_name == SPLAT3D_TYPE {
        check_kernels(place, prim, if is_field { 0 } else { 1 }, report);
        check_lengths(place, prim, report);
        check_ranges(place, prim, report);
        check_extent(place, prim, report);
    }
    if prim.property(RECT).is_some() {
        check_rectangles(path, place, prim, report);
    }
}

fn check_kernels(place: &str, prim: &Prim, built_in: usize, report: &mut Report) {
    let applied: Vec<&String> = prim.applied().iter().filter(|s| s.starts_with(KERNEL_PREFIX)).collect();
    match applied.len() + built_in {
        0 => report.error(
            "LT2003",
            place,
            "no kernel schema is applied: nothing says what a particle is".to_owned(),
        ),
        1 => {}
        n => report.error("LT2004", place, format!("{n} kernels, expected one; applied: {applied:?}")),
    }
}

/// Elements of an array of numbers.
fn length(value: Option<&Value>) -> Option<usize> {
    match value? {
        Value::Ints(n) if n.is_array => Some(n.num_elements()),
        Value::Floats(n) if n.is_array => Some(n.num_elements()),
        _ => None,
    }
}

fn check_lengths(place: &str, prim: &Prim, report: &mut Report) {
    let Some(n) = length(prim.value(POSITIONS)) else {
        report.error("LT2002", place, format!("no array {POSITIONS}"));
        return;
    };
    let degree = prim.value(SH_DEGREE).and_then(Value::as_int).unwrap_or(3);
    let coefficients = num_sh_coefficients(degree.clamp(0, 3) as u32);
    let is_textured = prim.property(LITETEX_VERSION).is_some();
    let required = [(ORIENTATIONS, 1), (SCALES, 1), (OPACITIES, 1), (SH_COEFFICIENTS, coefficients)];
    let ours = [(RECT, 1), (PAGE, 1), (TEXEL_SIZE, 1), (SH0, 1)];
    for (name, each) in required.into_iter().chain(ours.into_iter().filter(|_| is_textured)) {
        let expected = n * each;
        match length(prim.value(name)) {
            None => report.error("LT2002", place, format!("no array {name}")),
            Some(found) if found < expected => {
                report.error(
                    "LT2002",
                    place,
                    format!("{name}: {found} elements for {n} particles, expected {expected}"),
                );
            }
            Some(found) if found > expected => {
                report.warning(
                    "LT2002",
                    place,
                    format!("{name}: {found} elements, {expected} of them are used"),
                );
            }
            Some(_) => {}
        }
    }
}

/// Numbers of an array of floats; none if it is not there.
fn floats<'a>(prim: &'a Prim, name: &str, form: Form) -> &'a [f32] {
    match prim.value(name) {
        Some(Value::Floats(n)) if n.form == form => &n.values,
        _ => &[],
    }
}

fn check_ranges(place: &str, prim: &Prim, report: &mut Report) {
    let quaternions = floats(prim, ORIENTATIONS, Form::Quaternion).as_chunks::<4>().0;
    let is_unit = |q: &[f32; 4]| (quaternion::norm(q.map(f64::from)) - 1.0).abs() <= 1e-5;
    if let Some(i) = quaternions.iter().position(|q| !is_unit(q)) {
        report.error(
            "LT2011",
            place,
            format!("{ORIENTATIONS}[{i}]: {:?} is no unit quaternion", quaternions[i]),
        );
    }
    let opacities = floats(prim, OPACITIES, Form::One);
    if let Some(i) = opacities.iter().position(|o| !(0.0..=1.0).contains(o)) {
        report.error("LT2011", place, format!("{OPACITIES}[{i}]: {} is not in [0, 1]", opacities[i]));
    }
    let scales = floats(prim, SCALES, Form::Vec3);
    if let Some(i) = scales.iter().position(|s| *s < 0.0) {
        report.error("LT2011", place, format!("{SCALES}[{}]: {} is negative", i / 3, scales[i]));
    }
}

fn check_extent(place: &str, prim: &Prim, report: &mut Report) {
    let &[x0, y0, z0, x1, y1, z1] = floats(prim, EXTENT, Form::Vec3) else {
        report.error("LT2006", place, format!("no {EXTENT} of two points"));
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
            report.error("LT2006", place, format!("{EXTENT} does not cover particle {i} at {p:?}"));
            return;
        }
    }
}

fn check_rectangles(path: &Path, place: &str, prim: &Prim, report: &mut Report) {
    let field = Field { path, prim };
    let Some(Value::Ints(Numbers { form: Form::Vec4, values, .. })) = prim.value(RECT) else {
        report.error("LT2008", place, format!("{RECT} is no array of four integers"));
        return;
    };
    let rects = values.as_chunks::<4>().0;
    let (sizes, places) = match (field.page_sizes(), field.placements(rects.len())) {
        (Ok(sizes), Ok(places)) => (sizes, places),
        (sizes, places) => {
            for error in [sizes.err(), places.err()].into_iter().flatten() {
                report.error("LT2008", place, error.to_string());
            }
            return;
        }
    };
    let texels = |s: &[u16; 2]| usize::from(s[0]) * usize::from(s[1]);
    let mut taken: Vec<Vec<u64>> = Vec::new();
    if sizes.iter().map(texels).sum::<usize>() <= DRAWN_TEXELS_MAX {
        taken.extend(sizes.iter().map(|s| vec![0; texels(s).div_ceil(64)]));
    }
    for (splat, (&[x, y, cols, rows], at)) in rects.iter().zip(&places).enumerate() {
        if cols == 0 && rows == 0 {
            continue;
        }
        let [width, height] = sizes.get(usize::from(at.page)).copied().unwrap_or_default().map(i64::from);
        let [left, top, across, down] = [x, y, cols, rows].map(i64::from);
        if across <= 0 || down <= 0 || left + across > width || top + down > height {
            let what = format!(
                "{RECT}[{splat}]: {cols} x {rows} at column {x}, row {y} of page {}, which has {width} x {height}",
                at.page
            );
            report.error("LT2008", place, what);
            return;
        }
        let Some(page) = taken.get_mut(usize::from(at.page)) else { continue };
        for row in top..top + down {
            let first = (row * width + left) as usize;
            for texel in first..first + across as usize {
                // It lies on the page, as was seen above.
                let Some(word) = page.get_mut(texel / 64) else { continue };
                if *word >> (texel % 64) & 1 == 1 {
                    report.error("LT2008", place, format!("{RECT}[{splat}] overlaps another"));
                    return;
                }
                *word |= 1 << (texel % 64);
            }
        }
    }
}
