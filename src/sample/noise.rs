//! Hashed lattice noise, for irregular surfaces in the sample scene.

use glam::DVec2;

/// A seeded noise function.
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    seed: u32,
}

impl Noise {
    /// Folds the seed to 32 bits.
    pub fn new(seed: u64) -> Self {
        Self { seed: (seed ^ (seed >> 32)) as u32 }
    }

    /// White noise: one uniform number in [0, 1) per lattice cell.
    pub fn cell(&self, x: i64, y: i64) -> f64 {
        // Finaliser of MurmurHash3. Cells 2^32 apart coincide, which is harmless.
        let mut h = self.seed ^ (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77);
        h ^= h >> 16;
        h = h.wrapping_mul(0x85EB_CA6B);
        h ^= h >> 13;
        h = h.wrapping_mul(0xC2B2_AE35);
        h ^= h >> 16;
        f64::from(h) / 4_294_967_296.0
    }

    /// Smooth value noise in [0, 1), one feature per unit.
    pub fn value(&self, at: DVec2) -> f64 {
        let base = at.floor();
        let f = at - base;
        let f = f * f * (DVec2::splat(3.0) - 2.0 * f);
        let (x, y) = (base.x as i64, base.y as i64);
        let row = |y| self.cell(x, y) * (1.0 - f.x) + self.cell(x + 1, y) * f.x;
        row(y) * (1.0 - f.y) + row(y + 1) * f.y
    }

    /// Three octaves of value noise in [0, 1).
    pub fn fractal(&self, at: DVec2) -> f64 {
        (4.0 * self.value(at) + 2.0 * self.value(2.03 * at + 17.1) + self.value(4.1 * at + 5.3)) / 7.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_within_bounds_and_continuous() {
        let noise = Noise::new(3);
        for i in 0..2000 {
            let at = DVec2::new(f64::from(i) * 0.173 - 100.0, f64::from(i) * -0.091);
            let v = noise.fractal(at);
            assert!((0.0..1.0).contains(&v));
            assert!((noise.value(at) - noise.value(at + 1e-7)).abs() < 1e-6);
        }
        assert_ne!(noise.cell(1, 2), noise.cell(2, 1));
        assert_ne!(noise.cell(1, 2), Noise::new(4).cell(1, 2));
    }
}
