//! Which photos are compared with which.

/// Photos up to this number are compared each with each.
pub const EXHAUSTIVE_MAX: usize = 200;

/// A frame is compared with this many that follow.
pub const NEXT: usize = 10;

/// Of this many frames, one is compared with all others like it, so that a path that comes back is closed.
pub const EVERY: usize = 10;

/// Pairs of photos by index, the smaller first: each with each, or, for the frames of a video (`is_sequence`) and for more
/// than [`EXHAUSTIVE_MAX`] photos, each with those that follow and every tenth with every tenth.
pub fn pairs(count: usize, is_sequence: bool) -> Vec<[usize; 2]> {
    let all = !is_sequence && count <= EXHAUSTIVE_MAX;
    let is_pair =
        |a: usize, b: usize| all || b - a <= NEXT || a.is_multiple_of(EVERY) && b.is_multiple_of(EVERY);
    (0..count).flat_map(|a| (a + 1..count).filter(move |b| is_pair(a, *b)).map(move |b| [a, b])).collect()
}

/// The list that COLMAP reads: a pair of names on each line.
pub fn list(names: &[String], pairs: &[[usize; 2]]) -> String {
    pairs.iter().map(|[a, b]| format!("{} {}\n", names[*a], names[*b])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn videos_and_many_photos_are_compared_in_order_and_every_tenth_with_every_tenth() {
        assert_eq!(pairs(50, false).len(), 1225);
        assert_eq!(pairs(200, false).len(), 19_900);
        // 240 frames: 10 that follow, less those beyond the end, and 24 tenths, less those that follow directly.
        assert_eq!(pairs(240, true).len(), 240 * 10 - 55 + 24 * 23 / 2 - 23);
        assert_eq!(pairs(240, true), pairs(240, false));
        let some = pairs(31, true);
        assert!(some.contains(&[0, 30]) && some.contains(&[7, 17]), "{some:?}");
        assert!(!some.contains(&[0, 29]) && !some.contains(&[7, 18]), "negative control");
        let names = ["a.jpg", "b.jpg"].map(str::to_owned);
        assert_eq!(list(&names, &pairs(2, true)), "a.jpg b.jpg\n");
    }
}
