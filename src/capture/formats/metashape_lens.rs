//! Lenses of Metashape: the calibration of a sensor, in pixels of the size that it states.
//!
//! "Camera models" in the appendix of the Metashape manual: with x, y on the plane z = 1 and r their length,
//! `x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + p1 (r^2 + 2 x^2) + 2 p2 x y`, y' likewise with p2 and p1,
//! `u = w / 2 + cx + x' f + x' b1 + y' b2` and `v = h / 2 + cy + y' f`; the centre of the first pixel is at 0.5, 0.5.
//! So p1 and p2 are OpenCV's p2 and p1. Parameters that were not estimated are missing. PhotoScan before 1.2 wrote fx, fy
//! and skew, the principal point from the corner, and p1, p2 as OpenCV has them (manual of Agisoft Lens 0.4).

use super::xml::{child, numbers, text_of};
use crate::camera::Pinhole;
use crate::capture::lens::{Distortion, Lens};
use crate::text::quoted;
use crate::{Report, Result};
use roxmltree::Node;
use std::path::Path;

/// The lens of a sensor, or what is wrong with its calibration.
///
/// # Errors
/// [`crate::Error::Unsupported`] for lenses other than `frame`.
pub(super) fn lens(path: &Path, sensor: Node<'_, '_>, report: &mut Report) -> Result<Result<Lens, String>> {
    let label = quoted(sensor.attribute("label").unwrap_or_default());
    let calibration = adjusted(sensor);
    let kind = calibration.and_then(|c| c.attribute("type")).or(sensor.attribute("type")).unwrap_or("frame");
    if kind != "frame" {
        return Err(unsupported!(
            path,
            "sensor {label} has a lens of type {}; supported: frame; let Metashape undistort the photos (Export, \
             Undistort Photos) and export the cameras of these",
            quoted(kind)
        ));
    }
    let Some(calibration) = calibration else {
        return Ok(Err(format!("its sensor {label} has no calibration")));
    };
    Ok(of_calibration(calibration, sensor, report).map_err(|what| format!("its sensor {label}: {what}")))
}

/// The calibration that the alignment has found, or the one that it started from.
fn adjusted<'a, 'input>(sensor: Node<'a, 'input>) -> Option<Node<'a, 'input>> {
    let all = || sensor.children().filter(|c| c.has_tag_name("calibration"));
    all().find(|c| c.attribute("class") == Some("adjusted")).or_else(|| all().next())
}

fn of_calibration(
    calibration: Node<'_, '_>,
    sensor: Node<'_, '_>,
    report: &mut Report,
) -> Result<Lens, String> {
    let number = |name: &str| -> Result<Option<f64>, String> {
        let text = child(calibration, name).map(text_of);
        text.map(|text| numbers::<1>(text).map(|[v]| v).map_err(|e| format!("{name}: {e}"))).transpose()
    };
    let or_zero = |name: &str| number(name).map(|value| value.unwrap_or(0.0));
    let resolution = child(calibration, "resolution").or(child(sensor, "resolution"));
    let side = |name: &str| {
        let text = resolution.and_then(|r| r.attribute(name)).unwrap_or_default();
        text.parse().map_err(|_| format!("the {name} of its resolution is {}", quoted(text)))
    };
    let (width_px, height_px): (u32, u32) = (side("width")?, side("height")?);
    let [p1, p2] = [or_zero("p1")?, or_zero("p2")?];
    let (fx_px, fy_px, centre, p, skew) = match (number("f")?, number("fx")?, number("fy")?) {
        (Some(f), _, _) => {
            let centre = (0.5 * f64::from(width_px), 0.5 * f64::from(height_px));
            (f + or_zero("b1")?, f, centre, [p2, p1], or_zero("b2")?)
        }
        (None, Some(fx), Some(fy)) => (fx, fy, (0.0, 0.0), [p1, p2], or_zero("skew")?),
        _ => return Err("no f; expected a calibration of Metashape".to_owned()),
    };
    if or_zero("p3")? != 0.0 || or_zero("p4")? != 0.0 {
        report.warn("lens-term-dropped", 1, "p3 and p4 of a lens of Metashape are not supported and ignored");
    }
    let k = [or_zero("k1")?, or_zero("k2")?, or_zero("k3")?, or_zero("k4")?];
    let pinhole = Pinhole {
        width_px,
        height_px,
        fx_px,
        fy_px,
        cx_px: centre.0 + or_zero("cx")?,
        cy_px: centre.1 + or_zero("cy")?,
    };
    let mut lens = Lens { pinhole, distortion: Distortion::Brown { k, p, shear: skew / fx_px } };
    if !lens.is_distorted() {
        lens.distortion = Distortion::None;
    }
    lens.checked()
}
