//! The nearest neighbours in a point cloud, by a balanced k-d tree. Points may coincide.

use rayon::prelude::*;

/// Points in a leaf; comparing this few is faster than descending further.
const LEAF: usize = 8;

struct Tree<'a> {
    points: &'a [[f32; 3]],
    /// Indices of points. Every subtree is a range; its middle element splits it.
    order: Vec<u32>,
    /// Axis along which the middle element at this index splits its range.
    axes: Vec<u8>,
    /// Points compared by all searches.
    #[cfg(test)]
    compared: std::sync::atomic::AtomicU64,
}

/// The nearest points found so far and their squared distances, ascending.
type Best<const K: usize> = [(f32, u32); K];

impl<'a> Tree<'a> {
    fn new(points: &'a [[f32; 3]]) -> Self {
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let mut axes = vec![0; points.len()];
        split(points, &mut order, &mut axes);
        Self {
            points,
            order,
            axes,
            #[cfg(test)]
            compared: 0.into(),
        }
    }

    fn search<const K: usize>(&self, range: std::ops::Range<usize>, own: u32, best: &mut Best<K>) {
        let query = self.points[own as usize];
        if range.len() <= LEAF {
            self.order[range].iter().for_each(|&other| self.visit(own, other, best));
            return;
        }
        let middle = range.start + range.len() / 2;
        let axis = usize::from(self.axes[middle]);
        let pivot = self.order[middle];
        self.visit(own, pivot, best);
        let offset = query[axis] - self.points[pivot as usize][axis];
        let (lower, upper) = (range.start..middle, middle + 1..range.end);
        let (near, far) = if offset < 0.0 { (lower, upper) } else { (upper, lower) };
        self.search(near, own, best);
        if offset * offset < best[K - 1].0 {
            self.search(far, own, best);
        }
    }

    fn visit<const K: usize>(&self, own: u32, other: u32, best: &mut Best<K>) {
        #[cfg(test)]
        self.compared.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        if other == own {
            return;
        }
        let (a, b) = (self.points[own as usize], self.points[other as usize]);
        let distance: f32 = (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum();
        let mut found = (distance, other);
        for slot in best {
            if found.0 < slot.0 {
                std::mem::swap(slot, &mut found);
            }
        }
    }
}

/// Sorts a range of indices into a subtree.
fn split(points: &[[f32; 3]], order: &mut [u32], axes: &mut [u8]) {
    if order.len() <= LEAF {
        return;
    }
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for &index in order.iter() {
        for i in 0..3 {
            low[i] = low[i].min(points[index as usize][i]);
            high[i] = high[i].max(points[index as usize][i]);
        }
    }
    let width = |i: usize| high[i] - low[i];
    let axis = (1..3).fold(0, |best, i| if width(i) > width(best) { i } else { best });
    let middle = order.len() / 2;
    // Ties go by index, so that the tree is the same on every machine.
    order.select_nth_unstable_by(middle, |&a, &b| {
        let key = |i: u32| points[i as usize][axis];
        key(a).total_cmp(&key(b)).then(a.cmp(&b))
    });
    axes[middle] = axis as u8;
    let (lower, rest) = order.split_at_mut(middle);
    let (axes_lower, axes_rest) = axes.split_at_mut(middle);
    split(points, lower, axes_lower);
    split(points, &mut rest[1..], &mut axes_rest[1..]);
}

/// The `K` nearest other points of each point and their squared distances, the nearest first; infinitely far where there are
/// fewer. All points must be finite.
pub fn nearest<const K: usize>(points: &[[f32; 3]]) -> Vec<[(f32, u32); K]> {
    let tree = Tree::new(points);
    let found = (0..points.len() as u32)
        .into_par_iter()
        .map(|own| {
            let mut best = [(f32::INFINITY, own); K];
            tree.search(0..points.len(), own, &mut best);
            best
        })
        .collect();
    #[cfg(test)]
    tests::COMPARED.set(tests::COMPARED.get() + tree.compared.into_inner());
    found
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use std::cell::Cell;

    thread_local! {
        /// Points compared by all searches that this thread asked for.
        pub static COMPARED: Cell<u64> = const { Cell::new(0) };
    }

    fn squared_distance(points: &[[f32; 3]], a: usize, b: usize) -> f32 {
        (0..3).map(|axis| (points[a][axis] - points[b][axis]).powi(2)).sum()
    }

    fn brute_force(points: &[[f32; 3]]) -> Vec<[f32; 3]> {
        (0..points.len())
            .map(|i| {
                let others = (0..points.len()).filter(|&j| j != i);
                let mut all: Vec<f32> = others.map(|j| squared_distance(points, i, j)).collect();
                all.sort_by(f32::total_cmp);
                [0, 1, 2].map(|k| all.get(k).copied().unwrap_or(f32::INFINITY))
            })
            .collect()
    }

    fn cloud(count: usize, levels: u32) -> Vec<[f32; 3]> {
        let mut state = 7_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((state >> 8) % levels) as f32
        };
        (0..count).map(|_| [next(), 2.0 * next(), 0.1 * next()]).collect()
    }

    #[test]
    fn neighbours_match_comparing_all_pairs() {
        for (count, levels) in [(0, 9), (1, 9), (2, 9), (3, 9), (500, 10_000), (500, 4), (300, 1)] {
            let points = cloud(count, levels);
            let found = nearest::<3>(&points);
            let distances: Vec<_> = found.iter().map(|best| best.map(|(distance, _)| distance)).collect();
            assert_eq!(distances, brute_force(&points), "{count} {levels}");
            for (own, best) in found.iter().enumerate() {
                for &(distance, other) in best.iter().filter(|best| best.0.is_finite()) {
                    assert_ne!(own, other as usize);
                    assert_eq!(distance, squared_distance(&points, own, other as usize));
                }
            }
        }
    }
}
