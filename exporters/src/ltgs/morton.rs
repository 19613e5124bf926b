//! Morton numbers: the bits of three coordinates, interleaved.

/// The Morton number of coordinates of up to 21 bits; x has the lowest bits.
pub fn morton([x, y, z]: [u32; 3]) -> u64 {
    spread(x) | spread(y) << 1 | spread(z) << 2
}

/// The coordinates of a Morton number of 63 bits.
pub fn coordinates(morton: u64) -> [u32; 3] {
    [gather(morton), gather(morton >> 1), gather(morton >> 2)]
}

const MASKS: [(u32, u64); 5] = [
    (32, 0x001f_0000_0000_ffff),
    (16, 0x001f_0000_ff00_00ff),
    (8, 0x100f_00f0_0f00_f00f),
    (4, 0x10c3_0c30_c30c_30c3),
    (2, 0x1249_2492_4924_9249),
];

/// Moves each bit to three times its position.
fn spread(coordinate: u32) -> u64 {
    MASKS.iter().fold(u64::from(coordinate) & 0x1f_ffff, |v, (shift, mask)| (v | v << shift) & mask)
}

fn gather(spread: u64) -> u32 {
    let mut v = spread & MASKS[4].1;
    for i in (0..5).rev() {
        let mask = if i == 0 { 0x1f_ffff } else { MASKS[i - 1].1 };
        v = (v | v >> MASKS[i].0) & mask;
    }
    v as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_round_trip_through_morton_numbers() {
        assert_eq!(morton([1, 0, 0]), 1);
        assert_eq!(morton([0, 1, 0]), 2);
        assert_eq!(morton([3, 0, 2]), 0b10_1001);
        for c in [[0x1f_ffff; 3], [0x12_3456, 0x0f_edcb, 7], [0, 1 << 20, 0]] {
            assert_eq!(coordinates(morton(c)), c);
            assert!(morton(c) < 1 << 63);
        }
    }
}
