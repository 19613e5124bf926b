//! The order in which views are drawn. Each epoch is a permutation of the training views that depends only on
//! the seed and the number of the epoch.

use super::random::RandomStream;
use super::state::TrainState;
use rand::seq::SliceRandom as _;

/// A position in the endless sequence of views. It is a copy of the position in a [`TrainState`], so that
/// views can be drawn ahead; [`ViewOrder::store`] moves the state on once their steps are done.
pub(super) struct ViewOrder<'a> {
    seed: u64,
    train_views: &'a [usize],
    order: Vec<u32>,
    used: u32,
    epochs: u32,
}

impl<'a> ViewOrder<'a> {
    /// The position after the steps of `state`; `train_views` must not be empty.
    pub fn after(state: &TrainState, seed: u64, train_views: &'a [usize]) -> Self {
        let order = state.epoch_order.clone();
        Self { seed, train_views, order, used: state.epoch_used, epochs: state.epochs }
    }

    /// Steps to the end of the current epoch, or of the next one if that is used up.
    pub fn left_in_epoch(&self) -> usize {
        match self.order.len() - self.used as usize {
            0 => self.train_views.len(),
            left => left,
        }
    }

    /// Moves `state` to this position.
    pub fn store(self, state: &mut TrainState) {
        (state.epoch_order, state.epoch_used, state.epochs) = (self.order, self.used, self.epochs);
    }
}

impl Iterator for ViewOrder<'_> {
    type Item = usize;

    /// Never ends.
    fn next(&mut self) -> Option<usize> {
        if self.used as usize >= self.order.len() {
            self.order = self.train_views.iter().map(|&v| v as u32).collect();
            self.order.shuffle(&mut RandomStream::ViewOrder.at(self.seed, self.epochs));
            self.epochs += 1;
            self.used = 0;
        }
        let view = self.order[self.used as usize] as usize;
        self.used += 1;
        Some(view)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selftest::{SceneOptions, random_scene};

    #[test]
    fn prefetching_does_not_change_the_order_of_views() {
        let scene = random_scene(&SceneOptions { num_splats: 1, ..SceneOptions::default() });
        let fresh = TrainState::fresh(scene.model);
        let views = [1, 2, 4, 7, 8];
        let draw = |state: &TrainState, seed, count| -> Vec<usize> {
            ViewOrder::after(state, seed, &views).take(count).collect()
        };
        let whole = draw(&fresh, 42, 23);
        for epoch in whole.chunks_exact(5) {
            let mut sorted = epoch.to_vec();
            sorted.sort_unstable();
            assert_eq!(sorted, views, "an epoch has every view once");
        }
        assert_ne!(whole[..5], whole[5..10], "epochs differ");
        // At 5, 10 and 15 one epoch is used up and the next has not begun.
        for done in 0..=16 {
            let mut state = fresh.clone();
            let mut order = ViewOrder::after(&state, 42, &views);
            order.by_ref().take(done).for_each(drop);
            order.store(&mut state);
            assert_eq!(draw(&state, 42, 7), whole[done..done + 7], "after {done}");
        }
        // Negative control: another seed.
        assert_ne!(draw(&fresh, 43, 23), whole);
    }
}
