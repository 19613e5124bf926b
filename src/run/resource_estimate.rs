//! Memory and time that training will take, predicted before it starts. Memory counts the arrays that exist
//! in each phase of a run (checking the photos, analysis, training, evaluation), at the start and at the
//! size that the model is expected to reach; time is given. The peak grows over the first steps,
//! because the allocator keeps what it cannot return: runs of a few steps stay up to 40 % below the estimate, which is that
//! of longer ones (16 views of 1600 x 1200, an image cache of 64 MiB: 12 steps 533 MiB, 100 steps 709, 400 steps 788).

use crate::capture::Capture;
use crate::model::{MAP_PARAMS, Model, ModelSize, TEXEL_PARAMS, splat_params};
use crate::text::{format_bytes, format_count, format_duration};
use crate::train::density::{Budget, MapRule, SplitShare};
use crate::train::{Schedule, TrainConfig};
use crate::views::{Split, ViewSource as _};
use crate::{Error, Result};

/// Memory that does not depend on the capture: the program, its threads and what the allocator keeps.
const BASE_BYTES: u64 = 34 << 20;

/// Bytes per pixel of a view in training: photo, image, gradient, SSIM's windows, kept blending state. And
/// for each thread, what the allocator keeps of earlier phases.
const BYTES_PER_PIXEL: u64 = 66;
const BYTES_PER_PIXEL_AND_THREAD: u64 = 27;
/// Bytes per splat of a view in training: projection, its gradient, about eight tile pairs with partial sums.
const BYTES_PER_SPLAT: u64 = 1600;
/// More of it where the model is pruned: the model before, what its parts cost, merges on trial. Fitted to fox, 300 steps
/// with 300,000 parameters: `litetex` with up to 25,000 splats 223 MiB, `plain` with up to 39,000 228 MiB.
const PRUNING_BYTES_PER_SPLAT: u64 = 1400;

/// Bytes per pixel and thread while a photo's spectrum is taken: three planes, weights, gradients and the
/// transform, all in f64.
const ANALYSIS_BYTES_PER_PIXEL: u64 = 56;

/// Views evaluated at once, and bytes per pixel of each: colour and alpha in f32.
const EVALUATED_VIEWS: u64 = 4;
const RENDERED_BYTES_PER_PIXEL: u64 = 16;
/// Bytes per pixel and thread while a view is compared with its photo: both images, SSIM's moments in f64.
const QUALITY_BYTES_PER_PIXEL: u64 = 80;

/// Reduced copies of the photos are kept up to this size (`train::targets`).
const REDUCED_BYTES_MAX: u64 = 1 << 30;

/// Without a budget: splats at the end over splats at the start (published runs: 209,000 from about 115,000
/// points), and texels for each (published: 78; fox, 270 x 480, 500 steps: 100). How much detail the photos
/// hold is not known beforehand; few views that contradict each other can take several times as much.
const EXPECTED_GROWTH: u64 = 2;
const EXPECTED_TEXELS_EACH: u64 = 100;
/// The same where growth is drawn (fox and lego at 160 to 480 pixels: 3.6 to 4.9).
const EXPECTED_BUDGET_TEXELS_EACH: u64 = 4;

/// What is going to be trained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workload {
    /// Splats at the start.
    pub splats: u64,
    /// Texels at the start.
    pub texels: u64,
    /// Parameters of a splat without its map, on average.
    pub splat_params: u64,
    /// Largest view.
    pub pixels_max: u64,
    /// Mean over the training views.
    pub pixels_mean: f64,
    /// Training views.
    pub train_views: u64,
    /// Test views.
    pub test_views: u64,
    /// Bound of the image cache.
    pub cache_limit_bytes: u64,
    /// Photos made ahead of their use, at most.
    pub photos_ahead: u64,
    /// Memory for decoding as many photos at once as may be decoded at once.
    pub decoding_bytes: u64,
    /// Whether the model is pruned after growth.
    pub is_pruned: bool,
    /// Whether the photos are analysed, and reduced for the first stages.
    pub is_scheduled: bool,
    /// Worker threads.
    pub threads: u64,
    /// Time of the training, if anything is known of the device's speed.
    pub wall_secs: Option<f64>,
}

/// Memory and time at one size of the model.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Resources {
    /// The model.
    pub model_bytes: u64,
    /// Adam's moments.
    pub optimiser_bytes: u64,
    /// Gradients of all parameters.
    pub gradient_bytes: u64,
    /// The copy that a checkpoint is written from.
    pub copy_bytes: u64,
    /// Decoded photos, and those reduced ahead of their use.
    pub image_cache_bytes: u64,
    /// Photos reduced to the size of a stage.
    pub reduced_photos_bytes: u64,
    /// The largest need of a phase, next to what is always there.
    pub phase_bytes: u64,
    /// All of it.
    pub total_bytes: u64,
    /// Time of the training: what was planned, else what the CPU is expected to take; null for other devices.
    pub wall_secs: Option<f64>,
}

impl Workload {
    /// Training this model on the views of a capture, with `photos_ahead` photos made ahead of their use, in this time if anything is
    /// known of it.
    pub fn new(
        model: &Model,
        capture: &Capture,
        config: &TrainConfig,
        photos_ahead: usize,
        wall_secs: Option<f64>,
    ) -> Self {
        let pixels = |v: usize| capture.camera(v).pinhole.num_pixels() as u64;
        let train = capture.indices(Split::Train);
        let sum: u64 = train.iter().map(|&v| pixels(v)).sum();
        let threads = rayon::current_num_threads();
        let bare = ModelSize { maps: 0, texels: 0, ..model.size() };
        Self {
            splats: model.num_splats() as u64,
            texels: model.num_texels() as u64,
            splat_params: (bare.params() / bare.splats.max(1)) as u64,
            pixels_max: (0..capture.num_views()).map(pixels).max().unwrap_or(0),
            pixels_mean: sum as f64 / train.len().max(1) as f64,
            train_views: train.len() as u64,
            test_views: (capture.num_views() - train.len()) as u64,
            cache_limit_bytes: capture.cache_limit_bytes(),
            photos_ahead: photos_ahead as u64,
            decoding_bytes: capture.decoding_bytes(threads),
            is_pruned: config.prunes_after_growth(),
            is_scheduled: config.active_components().scheduler,
            threads: threads as u64,
            wall_secs,
        }
    }

    /// The same with the model at the size that it is expected to reach, within its budget.
    pub fn grown(&self, config: &TrainConfig) -> Self {
        let budget = &Schedule::new(config, self.train_views as usize).budget(config, 0);
        let bound = |most: Option<usize>| most.map_or(u64::MAX, |most| most as u64);
        let rule = config.rule();
        let wanted = match rule.split_share {
            SplitShare::Fixed(0.0) => self.splats,
            SplitShare::Fixed(_) => u64::MAX / 64,
            SplitShare::Scheduled => EXPECTED_GROWTH * self.splats,
        };
        // Splats lose bands that they do not need, soon after these were trained.
        let splat_params = self.splat_params.min(splat_params(config.least_sh_degree()) as u64);
        let grown = Self { splat_params, ..*self };
        let texels_each =
            if rule.splits_any_length { EXPECTED_BUDGET_TEXELS_EACH } else { EXPECTED_TEXELS_EACH };
        let splats = wanted.min(bound(budget.max_splats)).min(bound(budget.max_params) / grown.params(1, 0));
        let texels = match config.policy.spec().map_rule {
            MapRule::None => 0,
            MapRule::Fixed(side) => splats.saturating_mul(u64::from(side).pow(2)),
            MapRule::Adaptive => splats.saturating_mul(texels_each).max(self.texels),
        };
        let texels = texels.min(bound(budget.max_texels));
        // Splats and texels share what the parameters allow as they would share it without a bound.
        let now = grown.params(self.splats, self.texels) as f64;
        let then = grown.params(splats, texels) as f64;
        let most = bound(budget.max_params) as f64;
        let share = if then > most { ((most - now) / (then - now)).max(0.0) } else { 1.0 };
        let part = |now: u64, then: u64| (now as f64 + share * (then as f64 - now as f64)) as u64;
        Self { splats: part(self.splats, splats), texels: part(self.texels, texels), ..grown }
    }

    /// The largest budget of parameters, below the user's own, with which the model is expected to grow, and to a size that
    /// `fits`.
    pub(super) fn fitting_budget(
        &self,
        config: &TrainConfig,
        fits: impl Fn(&Workload) -> bool,
    ) -> Option<usize> {
        let grown = |params| {
            let budget = Budget { max_params: Some(params), ..config.budget };
            self.grown(&TrainConfig { budget, ..config.clone() })
        };
        let last = self.grown(config);
        let most = last.params(last.splats, last.texels) as usize;
        // Growth may exceed the budget, so the largest one is searched for.
        let (mut low, mut high) = (0, config.budget.max_params.map_or(most, |own| own.min(most)));
        while high - low > 1 {
            let middle = low.midpoint(high);
            *(if fits(&grown(middle)) { &mut low } else { &mut high }) = middle;
        }
        let found = grown(low);
        (fits(&found) && found.splats > self.splats).then_some(low)
    }

    /// Parameters of a model of this size, in which every splat has a map or none.
    fn params(&self, splats: u64, texels: u64) -> u64 {
        let map = if texels > 0 { MAP_PARAMS } else { 0 };
        splats * (self.splat_params + map as u64) + TEXEL_PARAMS as u64 * texels
    }

    /// Memory and time of this workload.
    pub fn resources(&self) -> Resources {
        let parameters = 4 * (self.splats * self.splat_params + 3 * self.texels);
        let model_bytes = parameters + 12 * self.splats;
        let optimiser_bytes = 2 * parameters + 4 * self.splats;
        let bytes_per_photo = (3.0 * self.pixels_mean) as u64;
        let reduced_ahead = if self.is_scheduled { self.photos_ahead.min(self.train_views) } else { 0 };
        let cached_photos = self.train_views + self.test_views + reduced_ahead;
        let image_cache_bytes = (cached_photos * bytes_per_photo).min(self.cache_limit_bytes);
        let reduced_photos_bytes = match self.is_scheduled {
            true => (self.train_views * bytes_per_photo).min(REDUCED_BYTES_MAX).min(self.cache_limit_bytes),
            false => 0,
        };
        let copy_bytes = model_bytes + optimiser_bytes;
        let phase_bytes = self.phase_bytes(parameters + copy_bytes + reduced_photos_bytes);
        Resources {
            model_bytes,
            optimiser_bytes,
            gradient_bytes: parameters,
            copy_bytes,
            image_cache_bytes,
            reduced_photos_bytes,
            phase_bytes,
            total_bytes: BASE_BYTES + model_bytes + optimiser_bytes + image_cache_bytes + phase_bytes,
            wall_secs: self.wall_secs,
        }
    }

    /// What the hungriest phase needs next to model, optimiser and image cache. `training_bytes` are the arrays
    /// of training that do not depend on the view; freed ones count in evaluation too, for the allocator keeps
    /// what is freed piece by piece.
    fn phase_bytes(&self, training_bytes: u64) -> u64 {
        let analysis = match self.is_scheduled {
            true => self.pixels_max * ANALYSIS_BYTES_PER_PIXEL * self.threads.min(self.train_views),
            false => 0,
        };
        let per_pixel = BYTES_PER_PIXEL + BYTES_PER_PIXEL_AND_THREAD * self.threads;
        let pruning = if self.is_pruned { PRUNING_BYTES_PER_SPLAT } else { 0 };
        let per_splat = BYTES_PER_SPLAT + pruning;
        let training = training_bytes + self.pixels_max * per_pixel + self.splats * per_splat;
        let held = self.test_views.min(EVALUATED_VIEWS);
        let comparing = held.min(self.threads);
        let evaluation =
            self.pixels_max * (RENDERED_BYTES_PER_PIXEL * held + QUALITY_BYTES_PER_PIXEL * comparing);
        self.decoding_bytes.max(analysis).max(training + evaluation)
    }
}

/// Resources at the start and at the size that the model is expected to reach.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ResourceEstimate {
    /// At the start.
    pub start: Resources,
    /// At the size that the model is expected to reach.
    pub grown: Resources,
    /// Splats then.
    pub grown_splats: u64,
    /// Texels then.
    pub grown_texels: u64,
    /// Whether a budget bounds the model.
    pub has_budget: bool,
    #[serde(skip)]
    first: Workload,
    #[serde(skip)]
    config: TrainConfig,
}

impl ResourceEstimate {
    /// The estimate for a workload with these settings.
    pub fn new(workload: &Workload, config: &TrainConfig) -> Self {
        let grown = workload.grown(config);
        Self {
            start: workload.resources(),
            grown: grown.resources(),
            grown_splats: grown.splats,
            grown_texels: grown.texels,
            has_budget: config.budget != Budget::default(),
            first: *workload,
            config: config.clone(),
        }
    }

    /// One sentence.
    pub fn describe(&self) -> String {
        let basis = if self.has_budget { "within the budget" } else { "expected, no budget is set" };
        let (bytes, size) = (format_bytes(self.grown.total_bytes), self.grown_size());
        format!("{}; {bytes} with {size} ({basis})", self.start.describe())
    }

    fn grown_size(&self) -> String {
        format!("{} splats and {} texels", format_count(self.grown_splats), format_count(self.grown_texels))
    }

    /// A warning if the machine may not hold what the model may become. No reason to refuse: it may stay
    /// smaller.
    pub fn doubt(&self, machine_bytes: Option<u64>) -> Option<String> {
        let have = machine_bytes.filter(|&have| self.grown.total_bytes > have)?;
        let fits = |workload: &Workload| workload.resources().total_bytes <= have;
        let remedy = match self.first.fitting_budget(&self.config, fits) {
            Some(params) => format!("--budget-params {params} keeps within it"),
            None => "lower --max-resolution or max-points".to_owned(),
        };
        Some(format!(
            "the model may grow to need about {} ({}), but this machine has {}: {remedy}",
            format_bytes(self.grown.total_bytes),
            self.grown_size(),
            format_bytes(have)
        ))
    }
}

impl Resources {
    /// One sentence.
    pub fn describe(&self) -> String {
        let time =
            self.wall_secs.map_or(String::new(), |s| format!(", about {} of training", format_duration(s)));
        format!(
            "estimate: {} of memory at the start (model {}, optimiser {}, photos {}, work {}){time}",
            format_bytes(self.total_bytes),
            format_bytes(self.model_bytes),
            format_bytes(self.optimiser_bytes),
            format_bytes(self.image_cache_bytes),
            format_bytes(self.phase_bytes),
        )
    }

    /// Refuses what the machine cannot hold.
    ///
    /// # Errors
    /// [`Error::Device`] with the figures and what to change.
    pub fn check(&self, machine_bytes: Option<u64>) -> Result<()> {
        match machine_bytes {
            Some(have) if self.total_bytes > have => Err(Error::Device(format!(
                "training needs about {}, but this machine has {}: {}; lower --max-resolution, capture.image-cache-bytes or \
                 the number of splats",
                format_bytes(self.total_bytes),
                format_bytes(have),
                self.describe()
            ))),
            _ => Ok(()),
        }
    }
}

/// The initial model of a small capture, for tests.
#[cfg(test)]
pub(super) const FOX: Workload = Workload {
    splats: 14_686,
    texels: 16 * 14_686,
    splat_params: 58,
    pixels_max: 270 * 480,
    pixels_mean: 270.0 * 480.0,
    train_views: 43,
    test_views: 7,
    cache_limit_bytes: 4 << 30,
    photos_ahead: 4,
    decoding_bytes: 16 << 20,
    is_pruned: false,
    is_scheduled: true,
    threads: 2,
    wall_secs: Some(20.0),
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_beyond_the_machines_memory_is_refused_with_figures() {
        let resources = FOX.resources();
        assert!(resources.total_bytes < 256 << 20, "{resources:?}");
        assert!(resources.describe().contains("about 20 s of training"), "{}", resources.describe());
        let elsewhere = Workload { wall_secs: None, ..FOX }.resources();
        assert!(!elsewhere.describe().contains("of training"));
        resources.check(Some(8 << 30)).unwrap();
        resources.check(None).unwrap();
        let huge = Workload { splats: 50_000_000, texels: 800_000_000, ..FOX };
        let error = huge.resources().check(Some(8 << 30)).unwrap_err();
        assert_eq!(error.exit_code(), 5);
        assert!(error.to_string().contains("8.0 GiB"), "{error}");
    }

    #[test]
    fn photos_reduced_ahead_are_in_the_cache() {
        let photo_bytes = 3 * FOX.pixels_max;
        let cached = |workload: Workload| workload.resources().image_cache_bytes / photo_bytes;
        let long = Workload { photos_ahead: 64, ..FOX };
        assert_eq!([cached(FOX), cached(long)], [50 + 4, 50 + 43]);
        assert_eq!(cached(Workload { cache_limit_bytes: 60 * photo_bytes, ..long }), 60);
        // Negative control: photos of one size only.
        assert_eq!(cached(Workload { is_scheduled: false, ..long }), 50);
    }

    #[test]
    fn the_model_is_counted_at_the_size_that_it_may_reach() {
        let grown = |policy: &str, budget: Budget| {
            let policy = policy.parse().unwrap();
            let mut config = TrainConfig { policy, budget, ..TrainConfig::default() };
            config.density.overshoot = 1.0;
            let grown = FOX.grown(&config);
            assert!(grown.splat_params <= FOX.splat_params);
            (grown.splats, grown.texels)
        };
        let most =
            |splats, texels, params| Budget { max_splats: splats, max_texels: texels, max_params: params };
        let n = FOX.splats;
        assert_eq!(grown("litetex", Budget::default()), (2 * n, 200 * n));
        assert_eq!(grown("litetex", most(Some(20_000), Some(50_000), None)), (20_000, 50_000));
        let (splats, texels) = grown("litetex", most(None, None, Some(3_000_000)));
        // With SH of degree 1, as most splats keep no more.
        let params = Workload { splat_params: 22, ..FOX }.params(splats, texels);
        assert!(splats > n && texels > FOX.texels && (2_999_900..=3_000_000).contains(&params), "{params}");
        // A budget is filled, whatever the number of points.
        assert!(grown("none", most(None, None, Some(30_000_000))).0 > 2 * n);
        let budget = most(None, None, Some(3_000_000));
        let raised = FOX.grown(&TrainConfig { budget, ..TrainConfig::default() });
        assert!(raised.splats > splats && raised.texels > texels, "growth may exceed the budget");
        assert_eq!(grown("litetex", most(None, None, Some(1_000_000))).1, FOX.texels, "less than there is");
        assert_eq!(grown("fixed:4", most(Some(20_000), None, None)), (20_000, 320_000));
        assert_eq!(grown("plain", Budget::default()), (n, 0));
        assert_eq!(grown("plain", most(None, None, Some(2_200_000))), (100_000, 0));
        assert_eq!(grown("plain", most(None, Some(5), None)), (n, 0), "a bound on texels is no budget");
        for (budget, said) in
            [(Budget::default(), "no budget"), (most(Some(9), None, None), "within the budget")]
        {
            let config = TrainConfig { budget, ..TrainConfig::default() };
            let estimate = ResourceEstimate::new(&FOX, &config);
            assert!(estimate.describe().contains(said), "{}", estimate.describe());
            let (start, grown) = (estimate.start.total_bytes, estimate.grown.total_bytes);
            assert_eq!(grown > start, budget == Budget::default());
            // A machine on which it starts and may not end.
            let doubt = estimate.doubt(Some(start + 1));
            assert_eq!(doubt.is_some_and(|d| d.contains("--budget-params ")), grown > start);
            assert!(estimate.start.check(Some(start + 1)).is_ok() && estimate.doubt(None).is_none());
        }
    }

    #[test]
    fn the_budget_of_a_doubt_about_memory_leaves_none() {
        let of = |budget, have| {
            let mut config = TrainConfig::default();
            config.budget.max_params = budget;
            ResourceEstimate::new(&FOX, &config).doubt(Some(have))
        };
        let ends = ResourceEstimate::new(&FOX, &TrainConfig::default());
        let have = u64::midpoint(ends.start.total_bytes, ends.grown.total_bytes);
        let text = of(None, have).unwrap();
        let after = text.split_once("--budget-params ").unwrap().1;
        let most: usize = after.split(' ').next().unwrap().parse().unwrap();
        assert_eq!(of(Some(most), have), None);
        // Negative control, with a budget of the user's own.
        assert!(of(Some(most + most / 50), have).unwrap().contains(&format!("--budget-params {most} ")));
    }

    /// The measured peak of a run in MiB (build for tests, x86-64 Linux, glibc), and a workload of the sizes that its model
    /// had at the end.
    fn measured(
        peak_mib: f64,
        [splats, texels]: [u64; 2],
        [width, height]: [u64; 2],
        [train_views, test_views]: [u64; 2],
        decoding_mib: u64,
        threads: u64,
    ) -> (f64, Workload) {
        let pixels_max = width * height;
        let sizes = Workload { splats, texels, pixels_max, pixels_mean: pixels_max as f64, ..FOX };
        let decoding_bytes = decoding_mib << 20;
        (peak_mib, Workload { train_views, test_views, decoding_bytes, threads, ..sizes })
    }

    #[test]
    fn memory_is_within_15_percent_of_the_measured_peaks() {
        let mut many = measured(1166.5, [4_718, 41_208], [1600, 1200], [262, 38], 11, 2);
        many.1.cache_limit_bytes = 256 << 20;
        let mut large = measured(1331.0, [4_049, 16_116], [3000, 2000], [5, 1], 34, 2);
        large.1.cache_limit_bytes = 100 << 20;
        let runs = [
            // 300 JPEGs of 1600 x 1200, an image cache of 256 MiB, 400 steps.
            many,
            // 6 PNGs of 3000 x 2000, of 100 MiB, 60 steps.
            large,
            // 10 JPEGs of 8000 x 6000, reduced to 1600 x 1200; 40 steps.
            measured(704.5, [4_000, 15_916], [1600, 1200], [8, 2], 330, 2),
            measured(1040.4, [4_000, 15_916], [1600, 1200], [8, 2], 512, 8),
            // 24 PNGs of 4000 x 3000, reduced to 800 x 600; 300 and 200 steps.
            measured(249.4, [4_502, 104_408], [800, 600], [21, 3], 82, 2),
            measured(424.8, [4_019, 26_148], [800, 600], [21, 3], 328, 8),
            // 60 JPEGs of 480 x 270, 300 steps.
            measured(214.8, [19_948, 117_092], [480, 270], [52, 8], 1, 2),
            // 50 JPEGs of 1067 x 1899 (fox), reduced to 270 x 480; 200 steps.
            measured(141.9, [14_395, 64_456], [270, 480], [43, 7], 15, 2),
        ];
        for (peak_mib, workload) in runs {
            let estimate_mib = workload.resources().total_bytes as f64 / f64::from(1 << 20);
            let ratio = estimate_mib / peak_mib;
            assert!((ratio - 1.0).abs() < 0.15, "{estimate_mib:.0} MiB, measured {peak_mib}: {workload:?}");
        }
    }

    #[test]
    fn photos_count_while_they_are_decoded_and_up_to_a_limit_in_the_cache() {
        let workload = Workload { decoding_bytes: 512 << 20, ..FOX };
        let more = workload.resources().total_bytes - FOX.resources().total_bytes;
        assert!(more > 300 << 20 && workload.resources().phase_bytes == 512 << 20);
        // The image cache is capped.
        let many = Workload { train_views: 100_000, cache_limit_bytes: 1 << 30, ..FOX };
        assert_eq!(many.resources().image_cache_bytes, 1 << 30);
    }
}
