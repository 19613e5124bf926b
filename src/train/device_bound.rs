//! What a run keeps to once it has outgrown its device: its model no longer grows, and if a step still does not fit, its images
//! stay smaller. The run goes on.

use super::density::{Budget, DensityCounts};
use super::size_figures::SizeFigures;
use crate::backend::{DeviceLimits, RasterCounters, pairs_of, reach_of, splats_of};
use crate::text::format_count;

/// Share of the device's pairs that growth may use: splats move and widen until they are counted again.
const PAIRS_SHARE: f64 = 0.8;

/// Factor by which images become smaller when a step does not fit, along each side: 2^(1/4).
const SMALLER: f64 = 1.189_207_115;

/// Code of the warning that growth ended at what the device holds.
pub const GROWTH_ENDED: &str = "growth-ended-by-device";
/// Code of the warning that images stay smaller, because a step on larger ones does not fit.
pub const SMALLER_IMAGES: &str = "images-reduced-for-device";

/// The bound that a run met on its device; part of its state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceBound {
    /// Bound of the model, besides the user's; no bound before the device was outgrown.
    pub budget: Budget,
    /// Step after which growth ended, 1 if it was the start; 0: it has not.
    pub ended_step: u32,
    /// Smallest render scale; 1 unless a step did not fit.
    pub least_scale: f64,
    /// Most pairs of a step since the last density-control step, or since images changed their size; 0: unknown.
    pub pairs: u64,
    /// Visible splats of that step.
    pub visible: u64,
}

impl Default for DeviceBound {
    fn default() -> Self {
        Self { budget: Budget::default(), ended_step: 0, least_scale: 1.0, pairs: 0, visible: 0 }
    }
}

impl DeviceBound {
    /// Takes in the work of a step.
    pub fn observe(&mut self, work: &RasterCounters) {
        if work.tile_pairs > self.pairs {
            (self.pairs, self.visible) = (work.tile_pairs, work.visible_splats);
        }
    }

    /// Forgets the steps, as their splats or their images are others now.
    pub fn forget(&mut self) {
        (self.pairs, self.visible) = (0, 0);
    }

    /// Reach of the visible splats on the largest images of the run, from that at a render scale.
    fn reach(&self, render_scale: f64) -> f64 {
        reach_of(self.visible as f64, self.pairs as f64) * (render_scale / self.least_scale).max(1.0)
    }

    /// Pairs that a step on the largest images of the run is expected to need.
    fn expected_pairs(&self, render_scale: f64) -> u64 {
        pairs_of(self.visible as f64, self.reach(render_scale)).round() as u64
    }

    /// Splats whose pairs are expected to fit on the device.
    pub fn fitting_splats(&self, device: &DeviceLimits, splats: usize, render_scale: f64) -> usize {
        if self.visible == 0 {
            return usize::MAX;
        }
        let visible = splats_of(PAIRS_SHARE * device.max_pairs as f64, self.reach(render_scale));
        (splats as f64 * visible / self.visible as f64) as usize
    }

    /// The bounds of the user and of the device, for a model of this many splats. Pairs beyond the device's remove no splats.
    pub fn within(&self, budget: &Budget, device: &DeviceLimits, splats: usize, render_scale: f64) -> Budget {
        let fitting = self.fitting_splats(device, splats, render_scale).max(splats);
        let pairs = Budget { max_splats: Some(fitting), ..Budget::default() };
        budget.within(device).and(&pairs).and(&self.budget)
    }

    /// Ends growth: the model stays within its present size. Returns whether it had not ended before.
    pub fn end_growth(&mut self, size: SizeFigures, step: u32) -> bool {
        let present = Budget {
            max_splats: Some(size.splats),
            max_texels: Some(size.texels),
            max_params: Some(size.params),
        };
        self.budget = self.budget.and(&present);
        let is_first = self.ended_step == 0;
        self.ended_step = if is_first { step.max(1) } else { self.ended_step };
        is_first
    }

    /// What the device has no more room for after a density-control step, if growth ended there: the model is at a bound of the
    /// device.
    pub fn reached(
        &self,
        device: &DeviceLimits,
        size: SizeFigures,
        fitting_splats: usize,
        counts: &DensityCounts,
        render_scale: f64,
    ) -> Option<String> {
        let most = |count: u64, what: &str| format!("at most {} {what} fit", format_count(count));
        if size.splats >= fitting_splats {
            let (expected, most) = (self.expected_pairs(render_scale), device.max_pairs);
            return Some(format!(
                "a step is expected to need {} of at most {} tile-splat pairs, and some must stay free",
                format_count(expected),
                format_count(most)
            ));
        }
        if counts.over_budget == 0 {
            return None;
        }
        if size.splats as u64 >= device.max_splats {
            return Some(most(device.max_splats, "splats"));
        }
        // The next finer maps do not fit, though a few texels would.
        let is_full = size.texels as u64 >= device.max_texels - device.max_texels / 20;
        is_full.then(|| most(device.max_texels, "texels"))
    }

    /// Makes the images smaller from a render scale on, because a step on them does not fit.
    pub fn reduce_images(&mut self, render_scale: f64) {
        self.least_scale = render_scale * SMALLER;
        self.forget();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEVICE: DeviceLimits = DeviceLimits {
        max_side_px: 100,
        max_pixels: 6_000,
        max_splats: 50,
        max_texels: 400,
        max_pairs: 1_000,
    };

    #[test]
    fn pairs_bound_the_splats_and_remove_none() {
        let none = DeviceBound::default();
        assert_eq!(none.fitting_splats(&DEVICE, 10, 1.0), usize::MAX);
        let mut bound = none;
        let work = |visible_splats, tile_pairs| RasterCounters {
            visible_splats,
            tile_pairs,
            ..RasterCounters::default()
        };
        bound.observe(&work(4, 100));
        bound.observe(&work(9, 90));
        assert_eq!((bound.visible, bound.expected_pairs(1.0)), (4, 100));
        // 4 of 10 splats are visible and reach 8; of 800 pairs the root is 28.3.
        assert_eq!(bound.fitting_splats(&DEVICE, 10, 1.0), 1028);
        // Images of half the size need fewer pairs than full ones.
        assert_eq!((bound.expected_pairs(3.5), bound.fitting_splats(&DEVICE, 10, 3.5)), (900, 0));
        let most =
            |bound: &DeviceBound, scale| bound.within(&Budget::default(), &DEVICE, 10, scale).max_splats;
        assert_eq!([most(&none, 1.0), most(&bound, 1.0), most(&bound, 3.5)], [Some(50), Some(50), Some(10)]);
        // Wider splats on full images.
        bound.observe(&work(4, 753));
        assert_eq!(most(&bound, 1.0), Some(20));
    }

    #[test]
    fn growth_ends_once_at_the_present_size() {
        let mut bound = DeviceBound::default();
        let size = SizeFigures { splats: 10, texels: 30, params: 300 };
        assert!(bound.end_growth(size, 7));
        assert!(!bound.end_growth(SizeFigures { splats: 12, texels: 20, params: 350 }, 9));
        let expected = Budget { max_splats: Some(10), max_texels: Some(20), max_params: Some(300) };
        assert_eq!((bound.budget, bound.ended_step), (expected, 7));
        let mut at_start = DeviceBound::default();
        assert!(at_start.end_growth(size, 0) && at_start.ended_step == 1);
    }

    #[test]
    fn a_model_at_a_bound_of_the_device_says_which() {
        let bound = DeviceBound { pairs: 900, visible: 30, ..DeviceBound::default() };
        let size = |splats, texels| SizeFigures { splats, texels, params: 0 };
        let refused = DensityCounts { over_budget: 1, ..DensityCounts::default() };
        let reached =
            |size, fitting, counts: &DensityCounts| bound.reached(&DEVICE, size, fitting, counts, 1.0);
        let says = |text: Option<String>, what: &str| text.is_some_and(|text| text.contains(what));
        assert!(says(
            reached(size(40, 0), 40, &DensityCounts::default()),
            "900 of at most 1,000 tile-splat pairs"
        ));
        assert!(says(reached(size(50, 0), 60, &refused), "50 splats"));
        assert!(says(reached(size(9, 380), 60, &refused), "400 texels"));
        assert_eq!(reached(size(49, 379), 60, &refused), None);
        assert_eq!(reached(size(50, 400), 60, &DensityCounts::default()), None, "nothing was refused");
    }
}
