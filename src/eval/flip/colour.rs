//! Colours of FLIP: the opponent space in which an image is blurred, and the perceptual space in which colours are
//! compared.

use glam::{DMat3, DVec2, DVec3, Mat3, Vec3};

/// Chromaticities x, y of the primaries of sRGB (IEC 61966-2-1).
const PRIMARIES_XY: [DVec2; 3] = [DVec2::new(0.64, 0.33), DVec2::new(0.30, 0.60), DVec2::new(0.15, 0.06)];
/// Chromaticity of its white, D65, to the digits that make the matrix of the paper's authors.
const WHITE_XY: DVec2 = DVec2::new(0.312_71, 0.329_02);

/// Y is 116 times the luminance, less 16.
pub(super) const OPPONENT_Y_PER_LUMINANCE: f32 = 116.0;

/// Exponent of colour differences (paper, 4.1.3).
const DIFFERENCE_EXPONENT: f32 = 0.7;
/// Differences up to this share of the largest take up most of the range ... (paper, 4.1.3)
const KNEE: f32 = 0.4;
/// ... namely this share of it.
const KNEE_ERROR: f32 = 0.95;

/// Conversions between linear sRGB, the opponent space YCxCz and L*a*b*.
pub(super) struct ColourSpaces {
    /// CIE XYZ divided by that of white.
    xyz_from_rgb: Mat3,
    rgb_from_xyz: Mat3,
    /// Linear value of each code value of sRGB.
    linear_from_code: [f32; 256],
    /// Difference of the most different colours, green and blue, after the exponent.
    largest: f32,
}

impl ColourSpaces {
    pub fn new() -> Self {
        let xyz = |xy: DVec2| DVec3::new(xy.x, xy.y, 1.0 - xy.x - xy.y) / xy.y;
        let [red, green, blue] = PRIMARIES_XY.map(xyz);
        let primaries = DMat3::from_cols(red, green, blue);
        let white = xyz(WHITE_XY);
        // The primaries add up to white.
        let xyz_from_rgb = primaries * DMat3::from_diagonal(primaries.inverse() * white);
        let xyz_from_rgb = DMat3::from_diagonal(white.recip()) * xyz_from_rgb;
        let mut spaces = Self {
            xyz_from_rgb: xyz_from_rgb.as_mat3(),
            rgb_from_xyz: xyz_from_rgb.inverse().as_mat3(),
            linear_from_code: std::array::from_fn(|code| linear(code as f64 / 255.0) as f32),
            largest: 1.0,
        };
        let [green, blue] = [Vec3::Y, Vec3::Z].map(|rgb| spaces.lab(spaces.opponent(rgb)));
        spaces.largest = hyab(green, blue).powf(DIFFERENCE_EXPONENT);
        spaces
    }

    /// Y (0 to 100), Cx and Cz of a colour in sRGB.
    pub fn opponent_of_codes(&self, [r, g, b]: [u8; 3]) -> Vec3 {
        self.opponent(Vec3::from([r, g, b].map(|code| self.linear_from_code[usize::from(code)])))
    }

    fn opponent(&self, rgb: Vec3) -> Vec3 {
        let xyz = self.xyz_from_rgb * rgb;
        Vec3::new(116.0 * xyz.y - 16.0, 500.0 * (xyz.x - xyz.y), 200.0 * (xyz.y - xyz.z))
    }

    /// L*a*b* with a* and b* in proportion to the lightness, as dark colours look less colourful (Hunt), of a colour in
    /// opponent space, clipped to the range of the screen.
    pub fn lab(&self, opponent: Vec3) -> Vec3 {
        let y = (opponent.x + 16.0) / 116.0;
        let xyz = Vec3::new(y + opponent.y / 500.0, y, y - opponent.z / 200.0);
        let rgb = (self.rgb_from_xyz * xyz).clamp(Vec3::ZERO, Vec3::ONE);
        let xyz = self.xyz_from_rgb * rgb;
        let [x, y, z] = [xyz.x, xyz.y, xyz.z].map(lab_curve);
        let lightness = 116.0 * y - 16.0;
        Vec3::new(lightness, 5.0 * (x - y) * lightness, 2.0 * (y - z) * lightness)
    }

    /// Difference of two colours of [`Self::lab`], 0 to 1: small ones take up most of the range.
    pub fn difference(&self, a: Vec3, b: Vec3) -> f32 {
        let difference = hyab(a, b).powf(DIFFERENCE_EXPONENT);
        let knee = KNEE * self.largest;
        if difference < knee {
            difference * KNEE_ERROR / knee
        } else {
            KNEE_ERROR + (difference - knee) / (self.largest - knee) * (1.0 - KNEE_ERROR)
        }
    }
}

/// The inverse of the transfer curve of sRGB.
fn linear(encoded: f64) -> f64 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The compression of L*a*b* (CIE 1976).
fn lab_curve(t: f32) -> f32 {
    const D: f32 = 6.0 / 29.0;
    if t > D * D * D { t.cbrt() } else { t / (3.0 * D * D) + 4.0 / 29.0 }
}

/// Distance in lightness plus that in a* and b*, which suits large differences.
fn hyab(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x.abs() + d.y.hypot(d.z)
}
