//! The lenses of COLMAP's camera models.

use super::colmap_model::ColmapCamera;
use crate::camera::Pinhole;
use crate::capture::lens::{Distortion, Lens, Tilt};

/// Intrinsics and distortion of a camera, or what is wrong with them; parameter orders are COLMAP's.
pub(super) fn lens(camera: &ColmapCamera) -> Result<Lens, String> {
    let size =
        |value: u64, what: &str| u32::try_from(value).map_err(|_| format!("its {what} is {value} pixels"));
    let Some(model) = camera.model.as_ref().ok().filter(|model| model.is_supported) else {
        return Err("its model is not supported".to_owned());
    };
    let p = &camera.params;
    let shared_focal = matches!(model.number, 0 | 2 | 3 | 8 | 9 | 12 | 14);
    let (fx_px, fy_px, rest) = if shared_focal { (p[0], p[0], 1) } else { (p[0], p[1], 2) };
    let d = &p[rest + 2..];
    let radial = |k: &[f64], p: [f64; 2]| {
        let mut all = [0.0; 6];
        all[..k.len()].copy_from_slice(k);
        Distortion::Radial { k: all, p }
    };
    let fisheye = |k: &[f64], tilt| {
        let mut all = [0.0; 6];
        all[..k.len()].copy_from_slice(k);
        Distortion::Fisheye { k: all, tilt }
    };
    let distortion = match model.number {
        2 | 3 => radial(d, [0.0; 2]),
        4 => radial(&d[..2], [d[2], d[3]]),
        6 => radial(&[d[0], d[1], d[4], d[5], d[6], d[7]], [d[2], d[3]]),
        5 | 8 | 9 | 14 | 15 => fisheye(d, Tilt::None),
        // Even in omega.
        7 => Distortion::FieldOfView { omega: d[0].abs() },
        10 => {
            let tilt = Tilt::BeforeRadial { p: [d[2], d[3]], s: [d[6], d[7]] };
            fisheye(&[d[0], d[1], d[4], d[5]], tilt)
        }
        11 => {
            let tilt = Tilt::AfterRadial { p: [d[6], d[7]], s: [d[8], d[9], d[10], d[11]] };
            fisheye(&d[..6], tilt)
        }
        12 | 13 => Distortion::Division { k: d[0] },
        16 => Distortion::Unified { alpha: d[0], beta: d[1] },
        _ => Distortion::None,
    };
    let lens = Lens {
        pinhole: Pinhole {
            width_px: size(camera.width, "width")?,
            height_px: size(camera.height, "height")?,
            fx_px,
            fy_px,
            cx_px: p[rest],
            cy_px: p[rest + 1],
        },
        distortion,
    };
    lens.checked()
}
