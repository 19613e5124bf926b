//! Lenses of a `transforms.json`: intrinsics of the whole file or of one frame, in pixels of the size that they state.

use super::json::Number;
use crate::Result;
use crate::camera::Pinhole;
use crate::capture::lens::{Distortion, Lens, Tilt};
use crate::capture::photos::photo_size;
use crate::text::quoted;
use serde::Deserialize;
use std::path::Path;

/// Intrinsics, of the whole file or of one frame.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Intrinsics {
    camera_model: Option<String>,
    is_fisheye: Option<bool>,
    camera_angle_x: Option<Number>,
    camera_angle_y: Option<Number>,
    fl_x: Option<Number>,
    fl_y: Option<Number>,
    cx: Option<Number>,
    cy: Option<Number>,
    // Some tools write sizes as 1920.0.
    w: Option<Number>,
    h: Option<Number>,
    k1: Option<Number>,
    k2: Option<Number>,
    k3: Option<Number>,
    k4: Option<Number>,
    k5: Option<Number>,
    k6: Option<Number>,
    p1: Option<Number>,
    p2: Option<Number>,
}

impl Intrinsics {
    /// These, completed by those of the whole file.
    pub(super) fn or(&self, all: &Self) -> Self {
        Self {
            camera_model: self.camera_model.clone().or_else(|| all.camera_model.clone()),
            is_fisheye: self.is_fisheye.or(all.is_fisheye),
            camera_angle_x: self.camera_angle_x.or(all.camera_angle_x),
            camera_angle_y: self.camera_angle_y.or(all.camera_angle_y),
            fl_x: self.fl_x.or(all.fl_x),
            fl_y: self.fl_y.or(all.fl_y),
            cx: self.cx.or(all.cx),
            cy: self.cy.or(all.cy),
            w: self.w.or(all.w),
            h: self.h.or(all.h),
            k1: self.k1.or(all.k1),
            k2: self.k2.or(all.k2),
            k3: self.k3.or(all.k3),
            k4: self.k4.or(all.k4),
            k5: self.k5.or(all.k5),
            k6: self.k6.or(all.k6),
            p1: self.p1.or(all.p1),
            p2: self.p2.or(all.p2),
        }
    }

    /// The lens of a photo, or what is wrong with its numbers.
    ///
    /// # Errors
    /// [`crate::Error::Unsupported`] for another model, and if the size of the photo is needed and cannot be read.
    pub(super) fn lens(&self, path: &Path, element: &str, photo: &Path) -> Result<Result<Lens, String>> {
        let (width_px, height_px) = match (self.w, self.h) {
            (Some(Number(w)), Some(Number(h))) => {
                let whole = |v: f64| ((1.0..=1e6).contains(&v) && v.fract() == 0.0).then_some(v as u32);
                match (whole(w), whole(h)) {
                    (Some(w), Some(h)) => (w, h),
                    _ => return Ok(Err(format!("the size (w, h) is {:?}", (w, h)))),
                }
            }
            _ => photo_size(photo)?,
        };
        let (w, h) = (f64::from(width_px), f64::from(height_px));
        let from_angle = |side: f64, angle: f64| 0.5 * side / (0.5 * angle).tan();
        let number = |value: Option<Number>| value.map(|Number(value)| value);
        let fx_px = number(self.fl_x).or_else(|| self.camera_angle_x.map(|Number(a)| from_angle(w, a)));
        let Some(fx_px) = fx_px else {
            return Ok(Err("no fl_x and no camera_angle_x, neither here nor for the file".to_owned()));
        };
        let fy_px = number(self.fl_y).or_else(|| self.camera_angle_y.map(|Number(a)| from_angle(h, a)));
        let lens = Lens {
            pinhole: Pinhole {
                width_px,
                height_px,
                fx_px,
                fy_px: fy_px.unwrap_or(fx_px),
                cx_px: number(self.cx).unwrap_or(0.5 * w),
                cy_px: number(self.cy).unwrap_or(0.5 * h),
            },
            distortion: self.distortion(path, element)?,
        };
        Ok(lens.checked())
    }

    fn distortion(&self, path: &Path, element: &str) -> Result<Distortion> {
        let k = [self.k1, self.k2, self.k3, self.k4, self.k5, self.k6].map(|v| v.map_or(0.0, |v| v.0));
        let p = [self.p1, self.p2].map(|v| v.map_or(0.0, |v| v.0));
        let fisheye = Distortion::Fisheye { k: [k[0], k[1], k[2], k[3], 0.0, 0.0], tilt: Tilt::None };
        match self.camera_model.as_deref() {
            Some("OPENCV_FISHEYE") => return Ok(fisheye),
            Some("SIMPLE_PINHOLE" | "PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV" | "FULL_OPENCV")
            | None => {}
            Some(other) => {
                return Err(unsupported!(
                    path,
                    "{element}: camera_model {}; supported: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, \
                     OPENCV, FULL_OPENCV, OPENCV_FISHEYE; undistort the photos with another tool",
                    quoted(other)
                ));
            }
        }
        if self.is_fisheye == Some(true) {
            return Ok(fisheye);
        }
        // Of these names only FULL_OPENCV stands for OpenCV's model with eight coefficients; k4 without the two that belong
        // to it there comes from converters of programs that know Brown's model only.
        if self.camera_model.as_deref() != Some("FULL_OPENCV") && k[3] != 0.0 && k[4..] == [0.0; 2] {
            return Ok(Distortion::Brown { k: [k[0], k[1], k[2], k[3]], p, shear: 0.0 });
        }
        let any = k.iter().chain(&p).any(|&v| v != 0.0);
        Ok(if any { Distortion::Radial { k, p } } else { Distortion::None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distortion(json: &str) -> Distortion {
        let intrinsics: Intrinsics = serde_json::from_str(json).unwrap();
        intrinsics.distortion(Path::new("transforms.json"), "frames[0]").unwrap()
    }

    #[test]
    fn k4_is_browns_unless_the_denominator_is_whole_or_the_model_says_so() {
        let brown = Distortion::Brown { k: [0.1, 0.0, 0.0, 0.2], p: [0.0; 2], shear: 0.0 };
        for model in
            ["", r#""camera_model": "OPENCV", "#, r#""camera_model": "OPENCV", "k5": 0, "k6": 0.0, "#]
        {
            assert_eq!(distortion(&format!(r#"{{{model}"k1": 0.1, "k4": 0.2}}"#)), brown, "{model}");
        }
        for (rest, k) in [
            (r#""k4": 0.2, "k5": 0.3"#, [0.1, 0.0, 0.0, 0.2, 0.3, 0.0]),
            (r#""k4": 0.2, "camera_model": "FULL_OPENCV""#, [0.1, 0.0, 0.0, 0.2, 0.0, 0.0]),
            (r#""k4": 0"#, [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ] {
            let taken = distortion(&format!(r#"{{"k1": 0.1, {rest}}}"#));
            assert_eq!(taken, Distortion::Radial { k, p: [0.0; 2] }, "negative control: {rest}");
        }
        let fisheye = distortion(r#"{"k1": 0.1, "k4": 0.2, "camera_model": "OPENCV_FISHEYE"}"#);
        assert!(matches!(fisheye, Distortion::Fisheye { .. }));
    }
}
