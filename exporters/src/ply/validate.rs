//! Checks PLY files for problems. The rules are those of `plain.rs`.

use super::COMMENT_2DGS;
use super::columns::Columns;
use super::rows::Rows;
use crate::fallback::ellipsoid::{is_thick, thinnest_last};
use crate::fallback::plain::{Check, Raw, unreadable};
use crate::{Issue, Result, Severity};
use std::path::Path;

/// Checks the bytes of a file by any program; `path` is only for messages.
pub fn validate(bytes: &[u8], path: &Path) -> Vec<Issue> {
    let mut issues = Vec::new();
    let mut check = Check::default();
    if let Err(error) = look(bytes, path, &mut check, &mut issues) {
        issues.push(unreadable(&error));
    }
    issues.extend(check.issues());
    issues
}

fn look(bytes: &[u8], path: &Path, check: &mut Check, issues: &mut Vec<Issue>) -> Result<()> {
    let rows = Rows::open(bytes, path)?;
    let columns = Columns::find(rows.vertex(), path)?;
    let mut info =
        |place: &str, what: String| issues.push(Issue::new("LT4011", Severity::Info, place, &what));
    if ![0, 3].contains(&columns.stored_sh_degree) {
        let degree = columns.stored_sh_degree;
        let what = format!("SH of degree {degree}: the viewer of 3DGS reads degree 3 only");
        info("header", what);
    }
    if columns.scales.len() == 2 && !rows.header.comments.iter().any(|c| c == COMMENT_2DGS) {
        info("header", format!("no scale_2, and no comment {COMMENT_2DGS:?}: viewers consider it damaged"));
    }
    if rows.trailing_bytes() > 0 && rows.header.elements.last().is_some_and(|e| e.name == "vertex") {
        info("data", format!("{} bytes behind the last splat", rows.trailing_bytes()));
    }
    rows.for_each(&mut |values| {
        check.add(&raw(values, &columns));
        Ok(())
    })
}

fn raw(values: &[f64], columns: &Columns) -> Raw {
    let quaternion = columns.rotation.map(|c| values[c]);
    let norm = quaternion.iter().map(|v| v * v).sum::<f64>().sqrt();
    let mut scales = [0.0; 3];
    for (scale, &c) in scales.iter_mut().zip(&columns.scales) {
        *scale = values[c].exp();
    }
    let has_nan = scales.iter().any(|s| s.is_nan()) || values[columns.opacity].is_nan();
    let mut thick = false;
    if columns.scales.len() == 3 && norm > 0.0 {
        scales = thinnest_last(quaternion, scales).1;
        thick = is_thick(scales);
    }
    // Other programs read f32.
    let sh = columns.dc.iter().chain(&columns.rest);
    let is_finite = sh.chain(&columns.position).all(|&c| (values[c] as f32).is_finite());
    Raw {
        position: columns.position.map(|c| values[c]),
        norm,
        scales: [scales[0], scales[1]],
        opacity: 1.0 / (1.0 + (-values[columns.opacity]).exp()),
        is_finite: is_finite && norm.is_finite() && !has_nan,
        is_thick: thick,
    }
}
