//! Unit quaternions in 32 bits: three components, from which the largest follows. In versions 1 and 2, 24 bits.

/// Bound of the three smaller components.
const MOST: f64 = std::f64::consts::FRAC_1_SQRT_2;
const STEPS: f64 = 511.0;

/// Encodes a unit quaternion **xyzw**.
pub fn encode(q: [f64; 4]) -> u32 {
    let largest = (1..4).fold(0, |best, i| if q[i].abs() > q[best].abs() { i } else { best });
    let negative = q[largest] < 0.0;
    let mut code = largest as u32;
    for (i, v) in q.iter().enumerate().filter(|&(i, _)| i != largest) {
        debug_assert!(i < 4);
        let sign = u32::from((*v < 0.0) != negative);
        let size = (STEPS * (v.abs() / MOST) + 0.5).min(STEPS) as u32;
        code = code << 10 | sign << 9 | size;
    }
    code
}

/// Decodes a unit quaternion **xyzw**.
pub fn decode(code: u32) -> [f64; 4] {
    let largest = (code >> 30) as usize;
    let mut q = [0.0; 4];
    let (mut rest, mut squares) = (code, 0.0);
    for i in (0..4).rev().filter(|&i| i != largest) {
        let size = MOST * f64::from(rest & 511) / STEPS;
        q[i] = if rest >> 9 & 1 == 1 { -size } else { size };
        squares += size * size;
        rest >>= 10;
    }
    q[largest] = (1.0 - squares).max(0.0).sqrt();
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    q.map(|v| v / norm)
}

/// Decodes the x, y and z of 8 bits of a unit quaternion **xyzw** whose w is not negative.
pub fn decode_bytes(bytes: [u8; 3]) -> [f64; 4] {
    let [x, y, z] = bytes.map(|b| f64::from(b) / 127.5 - 1.0);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let norm = (x * x + y * y + z * z + w * w).sqrt();
    [x, y, z, w].map(|v| v / norm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_round_trip_within_a_step_and_every_code_is_valid() {
        let mut below = crate::asset::tests::random(1);
        let mut random = || below(1 << 24) as f64 / 8_388_608.0 - 1.0;
        let mut worst = 0.0_f64;
        for _ in 0..10_000 {
            let q: [f64; 4] = std::array::from_fn(|_| random());
            let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
            let q = q.map(|v| v / norm);
            let found = decode(encode(q));
            let cosine: f64 = (0..4).map(|i| q[i] * found[i]).sum();
            worst = worst.max(2.0 * (1.0 - cosine.abs().min(1.0)).sqrt());
            let any = decode((random() * 2e9) as i32 as u32);
            assert!((any.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-12);
        }
        assert!(worst < 5e-3, "{worst}"); // radians; needed 2.7e-3
        let [x, y, z, w] = decode_bytes([255, 127, 128]);
        assert!(
            x > 0.999 && y.abs().max(z.abs()) < 0.005 && w >= 0.0,
            "half a turn about x, as others write it"
        );
        let [.., w] = decode_bytes([127, 128, 127]);
        assert!(w > 0.999, "the identity");
        assert_eq!(decode(encode([0.0, 0.0, 0.0, -1.0])), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(encode([0.0, 0.0, 0.0, 1.0]), 0xC000_0000, "the identity as others write it");
    }
}
