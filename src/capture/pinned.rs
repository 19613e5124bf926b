//! Which photos stay in the image cache when not all fit. Training draws each view once in an epoch, in an order that is new each
//! time: whatever photos were used last, they are no likelier to come next than others. So a fixed set of photos stays, and is
//! found as often as it is large, while those used last would be found half as often (of a cache for 71 % of the photos, 71 % of
//! the draws instead of 35 %).

/// An eighth of the cache at most is for photos that are decoded ahead.
const PASSING_SHARE: u64 = 8;

/// Photos decoded ahead that are enough: those of two batches of steps on a GPU, of which each holds 16 at most if not all
/// photos stay.
const PASSING_PHOTOS: u64 = 32;

/// How a cache is shared out.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shares {
    /// Whether a photo stays once it is decoded. `[views]`
    pub pinned: Vec<bool>,
    /// Bytes for all others.
    pub passing_bytes: u64,
}

impl Shares {
    /// The shares of a cache for photos of these sizes, of which those that are `first` are preferred. All stay if all fit.
    pub fn new(sizes_bytes: &[u64], first: impl Fn(usize) -> bool, budget_bytes: u64) -> Self {
        let all = sizes_bytes.iter().sum::<u64>();
        if all <= budget_bytes {
            return Self { pinned: vec![true; sizes_bytes.len()], passing_bytes: budget_bytes - all };
        }
        let largest = sizes_bytes.iter().max().copied().unwrap_or(0);
        let passing = (PASSING_PHOTOS * largest).min((budget_bytes / PASSING_SHARE).max(2 * largest));
        let mut room = budget_bytes - passing.min(budget_bytes);
        let mut pinned = vec![false; sizes_bytes.len()];
        let (preferred, others): (Vec<usize>, Vec<usize>) =
            (0..sizes_bytes.len()).partition(|&view| first(view));
        for view in preferred.into_iter().chain(others) {
            if sizes_bytes[view] <= room {
                room -= sizes_bytes[view];
                pinned[view] = true;
            }
        }
        let kept: u64 =
            sizes_bytes.iter().zip(&pinned).filter(|(_, pinned)| **pinned).map(|(size, _)| size).sum();
        Self { pinned, passing_bytes: budget_bytes - kept }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_leaves_room_beside_the_photos_that_stay() {
        let shares = |sizes: &[u64], budget| Shares::new(sizes, |view| view != 0, budget);
        assert_eq!(shares(&[10; 4], 45), Shares { pinned: vec![true; 4], passing_bytes: 5 });
        // Two photos at least, and an eighth at most; the first view is not preferred.
        assert_eq!(
            shares(&[10; 4], 35),
            Shares { pinned: vec![false, true, false, false], passing_bytes: 25 }
        );
        let many = shares(&[10; 100], 800);
        assert_eq!((many.passing_bytes, many.pinned.iter().filter(|&&p| p).count()), (100, 70));
        let more = shares(&[10; 1_000], 8_000);
        assert_eq!((more.passing_bytes, more.pinned[0], more.pinned[1]), (320, false, true));
        assert_eq!(shares(&[10, 10], 7), Shares { pinned: vec![false; 2], passing_bytes: 7 });
    }
}
