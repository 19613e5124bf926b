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
    /// OpenCV's fisheye (Kannala-Brandt): `theta (1 + k1 theta^2 + k2 theta^4 + ...)`.
    Fisheye {
        /// k1 to k4.
        k: [f64; 4],
    },
}

/// A lens: intrinsics at the size that the pose file states, and distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lens {
    pub pinhole: Pinhole,
    pub distortion: Distortion,
}

impl Lens {
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
            return Some(format!("the principal point is {:?}", (c.cx_px, c.cy_px)));
        }
        let finite = match &self.distortion {
            Distortion::None => true,
            Distortion::Radial { k, p } => k.iter().chain(p).all(|v| v.is_finite()),
            Distortion::Fisheye { k } => k.iter().all(|v| v.is_finite()),
        };
        (!finite).then(|| format!("the distortion is {:?}", self.distortion))
    }

    /// Whether photos must be resampled.
    pub fn is_distorted(&self) -> bool {
        match &self.distortion {
            Distortion::None => false,
            Distortion::Radial { k, p } => k.iter().chain(p).any(|&v| v != 0.0),
            Distortion::Fisheye { .. } => true,
        }
    }
}

impl Distortion {
    /// Where the lens images the direction `(x, y, 1)`, on the plane z = 1.
    pub fn distort(&self, undistorted: DVec2) -> DVec2 {
        let r2 = undistorted.length_squared();
        match self {
            Self::None => undistorted,
            Self::Radial { p, .. } => {
                let DVec2 { x, y } = undistorted;
                let tangential = DVec2::new(
                    2.0 * p[0] * x * y + p[1] * (r2 + 2.0 * x * x),
                    p[0] * (r2 + 2.0 * y * y) + 2.0 * p[1] * x * y,
                );
                undistorted * self.radial_factor(r2) + tangential
            }
            Self::Fisheye { .. } => undistorted * self.radial_factor(r2),
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
            Self::Fisheye { k } => {
                let r = r2.sqrt();
                if r < 1e-9 {
                    return 1.0;
                }
                let theta = r.atan();
                let t2 = theta * theta;
                let series = 1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])));
                theta * series / r
            }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distortion_matches_the_opencv_formulas_term_by_term() {
        let d = Distortion::Radial { k: [0.1, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.01, 0.02] };
        let got = d.distort(DVec2::new(0.5, -0.25));
        let r2 = 0.3125;
        let x = 0.5 * (1.0 + 0.1 * r2) + 2.0 * 0.01 * 0.5 * -0.25 + 0.02 * (r2 + 2.0 * 0.25);
        let y = -0.25 * (1.0 + 0.1 * r2) + 0.01 * (r2 + 2.0 * 0.0625) + 2.0 * 0.02 * 0.5 * -0.25;
        assert!((got - DVec2::new(x, y)).length() < 1e-15);
        let f = Distortion::Fisheye { k: [0.0; 4] };
        let at_45_deg = f.distort(DVec2::new(1.0, 0.0));
        assert!((at_45_deg.x - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
    }

    #[test]
    fn barrel_distortion_is_valid_only_up_to_its_fold() {
        let d = Distortion::Radial { k: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
        let fold = (1.0_f64 / 0.9).sqrt();
        assert!((d.monotonic_radius(3.0) - fold).abs() < 2e-3);
        assert_eq!(d.monotonic_radius(1.0), 1.0);
    }
}
