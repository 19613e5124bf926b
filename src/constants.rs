//! Constants of the renderers: fixed by the version of the asset formats, shared by all renderers, and the source of
//! the shaders' prelude. Settings do not belong here.

/// A sample is drawn where `opacity * falloff` reaches this (3DGS and all its successors).
pub const ALPHA_MIN: f64 = 1.0 / 255.0;

/// Alpha of a sample is clamped to this (3DGS).
pub const ALPHA_MAX: f64 = 0.99;

/// Opacity logit up to which a splat is probed, so that no alpha is clamped and derivatives tell what the splat adds: opacity 0.985.
pub const PROBED_LOGIT_MAX: f64 = 4.18;

/// Stored texel value up to which the activation is steep enough for the derivative of a probe: a residual of 0.995.
pub const PROBED_TEXEL_MAX: f64 = 6.0;

/// A pixel stops *before* the sample that would bring its transmittance below this (3DGS).
pub const TRANSMITTANCE_MIN: f64 = 1e-4;

/// Largest half extent of a texture map, in standard deviations (CAT).
pub const MAP_SIGMA_MAX: f64 = 3.0;

/// Alpha below which a pixel has no surface normal, for the normal term.
pub const SURFACE_ALPHA_MIN: f64 = 0.5;

/// A splat is skipped if `abs(p . n) < EDGE_ON_MIN * |p|`: seen edge-on, the coefficients of its intersection
/// explode.
pub const EDGE_ON_MIN: f64 = 1e-3;

/// A sample is skipped if its denominator D is below this: the hit is behind the camera or at infinity.
pub const DENOMINATOR_MIN: f64 = 1e-4;

/// The bounds of the conic are valid where `denominator < -CONIC_MARGIN * tw_z^2`; elsewhere the disc's quad is
/// clipped at the near plane.
pub const CONIC_MARGIN: f64 = 1e-3;

/// Variance of the low-pass filter in the image (measured: method 2.5).
pub const FILTER_VARIANCE_PX2: f64 = 0.1;

/// Largest footprint of a pixel along an axis of a texture map, in texels. It bounds the work per sample: maps whose texels are
/// below a sixth of a pixel alias.
pub const FOOTPRINT_TEXELS_MAX: f64 = 8.0;

/// Extent of a capture over the largest distance of a camera from the cameras' mean (3DGS).
pub const EXTENT_MARGIN: f64 = 1.1;

/// Farthest near plane, local units.
pub const NEAR_MAX: f64 = 0.04;

/// Standard deviation of the SSIM window (Wang et al. 2004, as in 3DGS).
pub const SSIM_SIGMA_PX: f64 = 1.5;
/// Half width of the 11 x 11 SSIM window.
pub const SSIM_RADIUS_PX: usize = 5;
/// First constant of SSIM, (0.01 * peak)^2.
pub const SSIM_C1: f64 = 1e-4;
/// Second constant of SSIM, (0.03 * peak)^2.
pub const SSIM_C2: f64 = 9e-4;

/// Factor of the spherical harmonic of degree 0.
pub const SH_0: f64 = 0.282_094_791_773_878_14;
/// Factor of the spherical harmonics of degree 1 (signs and order of 3DGS).
pub const SH_1: f64 = 0.488_602_511_902_919_9;
/// Factors of the spherical harmonics of degree 2 (signs and order of 3DGS).
pub const SH_2: [f64; 5] = [
    1.092_548_430_592_079_2,
    -1.092_548_430_592_079_2,
    0.315_391_565_252_520_05,
    -1.092_548_430_592_079_2,
    0.546_274_215_296_039_6,
];
/// Factors of the spherical harmonics of degree 3 (signs and order of 3DGS).
pub const SH_3: [f64; 7] = [
    -0.590_043_589_926_643_5,
    2.890_611_442_640_554,
    -0.457_045_799_464_465_8,
    0.373_176_332_590_115_4,
    -0.457_045_799_464_465_8,
    1.445_305_721_320_277,
    -0.590_043_589_926_643_5,
];

/// Highest supported SH degree.
pub const SH_DEGREE_MAX: u32 = 3;

/// SH coefficients per colour channel up to a degree.
pub const fn sh_coefficients(degree: u32) -> usize {
    ((degree + 1) * (degree + 1)) as usize
}

/// Weights of the 11-tap Gaussian window of SSIM, which sum to 1.
pub fn ssim_window() -> [f64; 2 * SSIM_RADIUS_PX + 1] {
    let weights = std::array::from_fn(|i| {
        let d = i as f64 - SSIM_RADIUS_PX as f64;
        (-d * d / (2.0 * SSIM_SIGMA_PX * SSIM_SIGMA_PX)).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|w: f64| w / sum)
}

/// Decay of Adam's first moment (method 4.1).
pub const ADAM_BETA1: f64 = 0.9;
/// Decay of Adam's second moment (method 4.1).
pub const ADAM_BETA2: f64 = 0.999;
/// Guards Adam's division; small enough to keep the update scale-free (method 4.1).
pub const ADAM_EPSILON: f64 = 1e-15;

/// Range of log-scales: 1e-7 to 10 local units (method 8).
pub const LOG_SCALE_RANGE: (f64, f64) = (-16.118_095_650_958_32, std::f64::consts::LN_10);

/// Upper bound of base colours, far above any display-space colour, so that squares in the loss stay finite
/// (method 8).
pub const BASE_RGB_MAX: f64 = 1e4;
