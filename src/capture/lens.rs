//! Lenses as pose files describe them: pinhole intrinsics and distortion. The rest of the program knows
//! pinholes only; `warp.rs` resamples distorted photos when they are decoded.

use crate::camera::Pinhole;
use glam::DVec2;

/// How image positions deviate from those of a pinhole, on the plane z = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Distortion {
    /// None: a pinhole.
    None,
    /// OpenCV's rational radial and tangential model; radial factor
    /// `(1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)`.
    Radial {
        /// k1 to k6.
        k: [f64; 6],
        /// Tangential p1, p2.
        p: [f64; 2],
    },
    /// Brown's model (Brown 1971) as photogrammetry programs write it; radial factor
    /// `1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8`. Without k4 and shear it is OpenCV's.
    Brown {
        /// k1 to k4.
        k: [f64; 4],
        /// Tangential p1, p2, in OpenCV's order.
        p: [f64; 2],
        /// What x gains for each unit of the distorted y: rows of pixels that are not at a right angle to columns.
        shear: f64,
    },
    /// OpenCV's fisheye (Kannala-Brandt): `theta (1 + k1 theta^2 + k2 theta^4 + ...)`.
    Fisheye {
        /// k1 to k6.
        k: [f64; 6],
        /// Terms of lenses whose elements are tilted.
        tilt: Tilt,
    },
    /// Undistorted radius `r / (1 + k r^2)` for the distorted radius r (Fitzgibbon 2001).
    Division { k: f64 },
    /// Distorted radius `atan(2 r tan(omega / 2)) / omega` (Devernay and Faugeras 2001).
    FieldOfView { omega: f64 },
    /// Enhanced unified model: `r / (alpha sqrt(beta r^2 + 1) + 1 - alpha)` (Khomutenko et al. 2016).
    Unified { alpha: f64, beta: f64 },
}

/// Tangential and thin-prism terms that COLMAP's fisheye models add on the equidistant plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Tilt {
    None,
    /// THIN_PRISM_FISHEYE: p1 and p2 as in OpenCV; of prisms sx1 and sy1; of the position without radial terms.
    BeforeRadial {
        p: [f64; 2],
        s: [f64; 2],
    },
    /// RAD_TAN_THIN_PRISM_FISHEYE: p0 along x and p1 along y; of prisms s0 to s3; of the position with radial terms.
    AfterRadial {
        p: [f64; 2],
        s: [f64; 4],
    },
}

/// A lens: intrinsics at the size that the pose file states, and distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lens {
    pub pinhole: Pinhole,
    pub distortion: Distortion,
}

impl Lens {
    /// The lens if its numbers make sense, else what is wrong.
    pub fn checked(self) -> Result<Self, String> {
        self.problem().map_or(Ok(self), Err)
    }

    /// The first number that makes no sense, if any.
    pub fn problem(&self) -> Option<String> {
        let c = &self.pinhole;
        if c.width_px == 0 || c.height_px == 0 {
            return Some(format!("the size is {}x{}", c.width_px, c.height_px));
        }
        for (name, value) in [("x", c.fx_px), ("y", c.fy_px)] {
            if !(value.is_finite() && value > 0.0) {
                return Some(format!("the focal length along {name} is {value:?}"));
            }
        }
        if !(c.cx_px.is_finite() && c.cy_px.is_finite()) {
            return Some(format!("the principal point is {}, {}", c.cx_px, c.cy_px));
        }
        let coefficients: Vec<f64> = match self.distortion {
            Distortion::None => Vec::new(),
            Distortion::Radial { k, p } => [&k[..], &p].concat(),
            Distortion::Brown { k, p, shear } => [&k[..], &p, &[shear]].concat(),
            Distortion::Fisheye { k, tilt: Tilt::None } => k.to_vec(),
            Distortion::Fisheye { k, tilt: Tilt::BeforeRadial { p, s } } => [&k[..], &p, &s].concat(),
            Distortion::Fisheye { k, tilt: Tilt::AfterRadial { p, s } } => [&k[..], &p, &s].concat(),
            Distortion::Division { k } => vec![k],
            Distortion::FieldOfView { omega } => vec![omega],
            Distortion::Unified { alpha, beta } => vec![alpha, beta],
        };
        if let Some(value) = coefficients.iter().find(|v| !v.is_finite()) {
            return Some(format!("a coefficient of the distortion is {value}"));
        }
        match self.distortion {
            Distortion::FieldOfView { omega } if !(0.0..std::f64::consts::PI).contains(&omega) => {
                Some(format!("omega of the distortion is {omega}, expected 0 to 3.14 (radians)"))
            }
            Distortion::Unified { alpha, beta } if !(0.0..=1.0).contains(&alpha) || beta <= 0.0 => {
                Some(format!(
                    "alpha and beta of the distortion are {alpha} and {beta}, expected 0 to 1 and above 0"
                ))
            }
            _ => None,
        }
    }

    /// Whether photos must be resampled.
    pub fn is_distorted(&self) -> bool {
        match &self.distortion {
            Distortion::None => false,
            Distortion::Radial { k, p } => k.iter().chain(p).any(|&v| v != 0.0),
            Distortion::Brown { k, p, shear } => k.iter().chain(p).chain([shear]).any(|&v| v != 0.0),
            Distortion::Fisheye { .. } => true,
            Distortion::Division { k } => *k != 0.0,
            Distortion::FieldOfView { omega } => *omega != 0.0,
            Distortion::Unified { alpha, .. } => *alpha != 0.0,
        }
    }
}

impl Distortion {
    /// Where the lens images the direction `(x, y, 1)`, on the plane z = 1.
    pub fn distort(&self, undistorted: DVec2) -> DVec2 {
        let r2 = undistorted.length_squared();
        let at = undistorted * self.radial_factor(r2);
        match self {
            Self::Radial { p, .. } => at + tangential(undistorted, *p),
            Self::Brown { p, shear, .. } => {
                let at = at + tangential(undistorted, *p);
                DVec2::new(at.x + shear * at.y, at.y)
            }
            Self::Fisheye { tilt: Tilt::BeforeRadial { p, s }, .. } => {
                let before = undistorted * equidistant_factor(r2);
                at + tangential(before, *p) + DVec2::from(*s) * before.length_squared()
            }
            Self::Fisheye { tilt: Tilt::AfterRadial { p, s }, .. } => {
                let r2 = at.length_squared();
                let prism = DVec2::new(s[0] + s[1] * r2, s[2] + s[3] * r2) * r2;
                at + tangential(at, [p[1], p[0]]) + prism
            }
            _ => at,
        }
    }

    /// Distorted over undistorted radius.
    fn radial_factor(&self, r2: f64) -> f64 {
        match self {
            Self::None => 1.0,
            Self::Radial { k, .. } => {
                let numerator = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]));
                let denominator = 1.0 + r2 * (k[3] + r2 * (k[4] + r2 * k[5]));
                numerator / denominator
            }
            Self::Brown { k, .. } => 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * (k[2] + r2 * k[3]))),
            Self::Fisheye { k, .. } => {
                let factor = equidistant_factor(r2);
                let t2 = factor * factor * r2;
                factor * (1.0 + k.iter().rev().fold(0.0, |sum, k| t2 * (k + sum)))
            }
            Self::Division { k } => 2.0 / (1.0 + (1.0 - 4.0 * k * r2).sqrt()),
            Self::FieldOfView { omega } => {
                let r = r2.sqrt();
                let stretch = 2.0 * (0.5 * omega).tan();
                match r * omega {
                    angle if angle < 1e-9 => {
                        if *omega == 0.0 {
                            1.0
                        } else {
                            stretch / omega
                        }
                    }
                    angle => (r * stretch).atan() / angle,
                }
            }
            Self::Unified { alpha, beta } => 1.0 / (alpha * (beta * r2 + 1.0).sqrt() + 1.0 - alpha),
        }
    }

    /// Undistorted radius up to which the distorted radius rises. Beyond it, the polynomial folds back and
    /// would show the same pixels twice. Searched up to `limit`.
    pub fn monotonic_radius(&self, limit: f64) -> f64 {
        // Fine enough to see any fold that spans a pixel of a 4000 pixel image.
        const STEPS: u32 = 4096;
        let mut previous = 0.0;
        for step in 1..=STEPS {
            let r = limit * f64::from(step) / f64::from(STEPS);
            let distorted = r * self.radial_factor(r * r);
            if distorted.is_nan() || distorted <= previous {
                return limit * f64::from(step - 1) / f64::from(STEPS);
            }
            previous = distorted;
        }
        limit
    }
}

/// `theta / r` of the direction at radius r on z = 1.
fn equidistant_factor(r2: f64) -> f64 {
    let r = r2.sqrt();
    if r < 1e-9 { 1.0 } else { r.atan() / r }
}

/// OpenCV's tangential distortion.
fn tangential(at: DVec2, p: [f64; 2]) -> DVec2 {
    let DVec2 { x, y } = at;
    let r2 = at.length_squared();
    DVec2::new(2.0 * p[0] * x * y + p[1] * (r2 + 2.0 * x * x), p[0] * (r2 + 2.0 * y * y) + 2.0 * p[1] * x * y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_that_make_no_sense_are_named() {
        let pinhole = Pinhole { width_px: 9, height_px: 9, fx_px: 9.0, fy_px: 9.0, cx_px: 4.5, cy_px: 4.5 };
        let problem = |distortion| Lens { pinhole, distortion }.problem();
        for good in [
            Distortion::Radial { k: [0.1; 6], p: [0.0; 2] },
            Distortion::FieldOfView { omega: 3.0 },
            Distortion::Unified { alpha: 1.0, beta: 0.5 },
        ] {
            assert_eq!(problem(good), None, "negative control");
        }
        let tilt = Tilt::BeforeRadial { p: [0.0; 2], s: [0.0, f64::INFINITY] };
        for (bad, what) in [
            (
                Distortion::Radial { k: [0.0; 6], p: [0.0, f64::NAN] },
                "a coefficient of the distortion is NaN",
            ),
            (Distortion::Fisheye { k: [0.0; 6], tilt }, "a coefficient of the distortion is inf"),
            (
                Distortion::FieldOfView { omega: 4.0 },
                "omega of the distortion is 4, expected 0 to 3.14 (radians)",
            ),
            (
                Distortion::Unified { alpha: 0.5, beta: 0.0 },
                "alpha and beta of the distortion are 0.5 and 0, expected 0 to 1 and above 0",
            ),
        ] {
            assert_eq!(problem(bad).as_deref(), Some(what));
        }
    }

    #[test]
    fn distortion_matches_the_opencv_formulas_term_by_term() {
        let d = Distortion::Radial { k: [0.1, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.01, 0.02] };
        let got = d.distort(DVec2::new(0.5, -0.25));
        let r2 = 0.3125;
        let x = 0.5 * (1.0 + 0.1 * r2) + 2.0 * 0.01 * 0.5 * -0.25 + 0.02 * (r2 + 2.0 * 0.25);
        let y = -0.25 * (1.0 + 0.1 * r2) + 0.01 * (r2 + 2.0 * 0.0625) + 2.0 * 0.02 * 0.5 * -0.25;
        assert!((got - DVec2::new(x, y)).length() < 1e-15);
        let f = Distortion::Fisheye { k: [0.0; 6], tilt: Tilt::None };
        let at_45_deg = f.distort(DVec2::new(1.0, 0.0));
        assert!((at_45_deg.x - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
    }

    #[test]
    fn browns_model_has_a_polynomial_of_four_radial_terms_and_a_shear() {
        let d = Distortion::Brown { k: [0.1, 0.02, 0.03, 0.04], p: [0.01, 0.02], shear: 0.005 };
        let r2 = 0.3125_f64;
        let radial = 1.0 + 0.1 * r2 + 0.02 * r2.powi(2) + 0.03 * r2.powi(3) + 0.04 * r2.powi(4);
        let x = 0.5 * radial + 2.0 * 0.01 * 0.5 * -0.25 + 0.02 * (r2 + 2.0 * 0.25);
        let y = -0.25 * radial + 0.01 * (r2 + 2.0 * 0.0625) + 2.0 * 0.02 * 0.5 * -0.25;
        assert!((d.distort(DVec2::new(0.5, -0.25)) - DVec2::new(x + 0.005 * y, y)).length() < 1e-15);
        // Without k4 and shear it is OpenCV's, whose k4 stands in a denominator.
        let at = DVec2::new(0.6, 0.3);
        let brown = |k4| Distortion::Brown { k: [0.1, 0.02, 0.03, k4], p: [0.01, 0.02], shear: 0.0 };
        let opencv = |k4| Distortion::Radial { k: [0.1, 0.02, 0.03, k4, 0.0, 0.0], p: [0.01, 0.02] };
        assert!((brown(0.0).distort(at) - opencv(0.0).distort(at)).length() < 1e-15);
        assert!((brown(0.1).distort(at) - opencv(0.1).distort(at)).length() > 1e-2, "negative control");
    }

    #[test]
    fn browns_fourth_coefficient_is_no_denominator() {
        // Of the sample capture at 320 x 240: focal lengths, principal point, and a corner. A lens as Metashape fits it.
        let (focal_px, corner) = (304.0, DVec2::new(160.0, 120.0) / 304.0);
        let [k1, k2, k3, k4] = [-0.05, 0.02, -0.01, 0.10];
        let truth = Distortion::Brown { k: [k1, k2, k3, k4], p: [0.0; 2], shear: 0.0 };
        let r2 = corner.length_squared();
        let series = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3) + k4 * r2.powi(4);
        assert!((truth.distort(corner) - corner * series).length() < 1e-15);
        let off_px = |taken: Distortion| (taken.distort(corner) - truth.distort(corner)).length() * focal_px;
        let denominator = off_px(Distortion::Radial { k: [k1, k2, k3, k4, 0.0, 0.0], p: [0.0; 2] });
        let dropped = off_px(Distortion::Radial { k: [k1, k2, k3, 0.0, 0.0, 0.0], p: [0.0; 2] });
        assert!(
            (denominator - 8.84).abs() < 0.01 && (dropped - 0.70).abs() < 0.01,
            "{denominator} {dropped}"
        );
    }

    #[test]
    fn tilted_fisheye_lenses_match_the_formulas_of_colmap_term_by_term() {
        let at = DVec2::new(0.5, -0.25);
        let r = at.length();
        let (theta, direction) = (r.atan(), at / r);
        let t2 = theta * theta;
        // The tilt before the radial terms: p1, p2 in OpenCV's order.
        let k = [0.1, 0.02, 0.03, 0.04, 0.0, 0.0];
        let d = Distortion::Fisheye { k, tilt: Tilt::BeforeRadial { p: [0.01, 0.02], s: [0.003, 0.004] } };
        let DVec2 { x, y } = direction * theta;
        let radial = 0.1 * t2 + 0.02 * t2.powi(2) + 0.03 * t2.powi(3) + 0.04 * t2.powi(4);
        let expected = DVec2::new(
            x + x * radial + 2.0 * 0.01 * x * y + 0.02 * (t2 + 2.0 * x * x) + 0.003 * t2,
            y + y * radial + 0.01 * (t2 + 2.0 * y * y) + 2.0 * 0.02 * x * y + 0.004 * t2,
        );
        assert!((d.distort(at) - expected).length() < 1e-15);
        // After them, with six radial terms: p0 belongs to x.
        let k = [0.1, 0.02, 0.03, 0.04, 0.05, 0.06];
        let tilt = Tilt::AfterRadial { p: [0.01, 0.02], s: [0.003, 0.004, 0.005, 0.006] };
        let series = 1.0 + (0..6).map(|i| k[i] * t2.powi(i as i32 + 1)).sum::<f64>();
        let DVec2 { x, y } = direction * theta * series;
        let r2 = x * x + y * y;
        let expected = DVec2::new(
            x + 0.01 * (r2 + 2.0 * x * x) + 2.0 * 0.02 * x * y + 0.003 * r2 + 0.004 * r2 * r2,
            y + 0.02 * (r2 + 2.0 * y * y) + 2.0 * 0.01 * x * y + 0.005 * r2 + 0.006 * r2 * r2,
        );
        assert!((Distortion::Fisheye { k, tilt }.distort(at) - expected).length() < 1e-15);
    }

    #[test]
    fn other_radial_models_match_their_definitions() {
        let at = DVec2::new(0.6, 0.8);
        // Radius 1: the distorted radius d solves d / (1 + k d^2) = 1.
        let d = Distortion::Division { k: -0.2 }.distort(at).length();
        assert!((d / (1.0 - 0.2 * d * d) - 1.0).abs() < 1e-15);
        let beyond = Distortion::Division { k: 0.3 };
        assert!((beyond.monotonic_radius(2.0) - (1.0_f64 / 1.2).sqrt()).abs() < 1e-3, "no such direction");
        // omega is the angle that the unit circle's diameter spans.
        let half_wide = std::f64::consts::FRAC_PI_2;
        let d = Distortion::FieldOfView { omega: half_wide }.distort(at).length();
        assert!((d - 2.0_f64.atan() / half_wide).abs() < 1e-15);
        let small = DVec2::new(1e-12, 0.0);
        let slope = Distortion::FieldOfView { omega: half_wide }.distort(small).x / small.x;
        assert!((slope - 2.0 / half_wide).abs() < 1e-9);
        assert_eq!(Distortion::FieldOfView { omega: 0.0 }.distort(at), at);
        let unified = Distortion::Unified { alpha: 0.6, beta: 3.0 };
        assert!((unified.distort(at).length() - 1.0 / (0.6 * 2.0 + 0.4)).abs() < 1e-15);
        // With alpha 1/2 and beta 1 it is the projection of a sphere from its surface: 2 tan(theta / 2).
        let sphere = Distortion::Unified { alpha: 0.5, beta: 1.0 }.distort(at).length();
        assert!((sphere - 2.0 * (std::f64::consts::FRAC_PI_8).tan()).abs() < 1e-15);
    }

    #[test]
    fn barrel_distortion_is_valid_only_up_to_its_fold() {
        let d = Distortion::Radial { k: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
        let fold = (1.0_f64 / 0.9).sqrt();
        assert!((d.monotonic_radius(3.0) - fold).abs() < 2e-3);
        assert_eq!(d.monotonic_radius(1.0), 1.0);
    }
}
