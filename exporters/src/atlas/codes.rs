//! Texels as 8-bit codes: `texel = code * scale + bias`, computed in f64 and rounded to f32.

/// The code of a texel of exactly 0.
pub const ZERO: u8 = 127;

/// Converts between codes and texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelDecode {
    /// Difference between the texels of consecutive codes.
    pub scale: f64,
    /// The texel of code 0.
    pub bias: f64,
}

impl TexelDecode {
    /// The finest codes that cover all texels.
    pub fn finest(texels: &[f32]) -> Self {
        let largest = texels.iter().fold(0.0_f32, |a, t| a.max(t.abs()));
        let scale = f64::from(largest.max(f32::MIN_POSITIVE)) / 127.0;
        Self { scale, bias: -127.0 * scale }
    }

    /// The texel of a code, clamped to [-1, 1].
    pub fn texel(&self, code: u8) -> f32 {
        ((f64::from(code) * self.scale + self.bias) as f32).clamp(-1.0, 1.0)
    }

    /// The texels of all codes.
    pub fn table(&self) -> [f32; 256] {
        std::array::from_fn(|code| self.texel(code as u8))
    }

    /// The code whose texel is nearest.
    pub fn code(&self, texel: f32) -> u8 {
        ((f64::from(texel) - self.bias) / self.scale).round().clamp(0.0, 254.0) as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_to_the_nearest_code_and_keeps_zero_exact() {
        let texels = [-0.73_f32, 0.0, 0.1, 0.42];
        let decode = TexelDecode::finest(&texels);
        assert_eq!(decode.texel(decode.code(0.0)), 0.0);
        assert_eq!(decode.texel(decode.code(-0.73)), -0.73);
        for t in texels {
            assert!(f64::from((decode.texel(decode.code(t)) - t).abs()) <= 0.5001 * decode.scale);
        }
        let extreme = TexelDecode::finest(&[1.0, -1.0]);
        assert_eq!([0, 127, 254].map(|c| extreme.texel(c)), [-1.0, 0.0, 1.0]);
        assert_eq!(TexelDecode::finest(&[]).texel(127), 0.0);
    }
}
