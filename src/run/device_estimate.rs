//! Pairs and memory that training will take on a GPU, predicted before it starts, and what may outgrow the device's limits. It is
//! no reason to refuse the run, which stops growing where the device has no more room.

use super::resource_estimate::Workload;
use crate::backend::{DeviceLimits, SceneShape, pairs_of, reach_of};
use crate::text::{format_bytes, format_count};
use crate::train::TrainConfig;

/// Splats that lie over a pixel, by the boxes around their supports. Fitted to the pairs of fox with 14,771 splats, of which about
/// 10,000 are in a view: 34,069 at 270 x 480 (formula: 37,000), about 225,000 at 1067 x 1899 (219,000).
const LAYERS: f64 = 17.0;

/// Side of a tile on GPUs, in pixels.
const TILE_PX: f64 = 16.0;

/// Bytes of a pair: two sort keys with their values twice, its splat, its record with states of pixels, and its partial sums.
const PAIR_BYTES: u64 = 16 + 4 + 20 + 80;
/// Bytes of a pixel: image, gradients, SSIM maps.
const PIXEL_BYTES: u64 = 80;
/// The same with terms on depths and normals.
const GEOMETRY_BYTES: [u64; 2] = [16, 80];
/// Bytes of a splat besides its parameters and their moments: projection, bounds, sums, statistics, records.
const SPLAT_BYTES: u64 = 330;
/// Bytes of a texel besides its values and their moments: gradient and activated texel.
const TEXEL_BYTES: u64 = 28;
/// Copies of the parameters and moments at most: a trial of a merge holds the model before and after it, while a round of pruning keeps
/// the states before the round and before the trial.
const STATES: u64 = 4;
/// Photos on the device, at most.
const PHOTOS_BYTES: u64 = 2 << 30;

/// Longer sides below this are not proposed.
const SIDE_MIN_PX: u32 = 160;

/// What a workload takes on a GPU.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct DeviceNeed {
    /// Tile-splat pairs of a step.
    pub pairs: u64,
    /// Bytes of pairs, pixels and splats.
    pub work_bytes: u64,
    /// Bytes of the model and its moments, with copies.
    pub state_bytes: u64,
    /// Bytes of photos.
    pub photos_bytes: u64,
    /// All of it.
    pub total_bytes: u64,
}

/// Reach of the splats of a view.
fn reach(pixels: u64) -> f64 {
    (LAYERS * pixels as f64).sqrt() / TILE_PX
}

/// The number of pixels at which splats have a reach.
fn pixels_of(reach: f64) -> u64 {
    ((reach * TILE_PX).powi(2) / LAYERS) as u64
}

impl DeviceNeed {
    /// The need of a workload.
    pub fn new(workload: &Workload, geometry: bool) -> Self {
        let w = workload;
        let [more_pair, more_pixel] = if geometry { GEOMETRY_BYTES } else { [0; 2] };
        // Of a view that shows all splats.
        let pairs = pairs_of(w.splats as f64, reach(w.pixels_max)) as u64;
        let work_bytes = pairs * (PAIR_BYTES + more_pair)
            + w.pixels_max * (PIXEL_BYTES + more_pixel)
            + w.splats * SPLAT_BYTES
            + w.texels * TEXEL_BYTES;
        let state_bytes = STATES * 3 * 4 * (w.splats * w.splat_params + 3 * w.texels);
        let photos_bytes = ((w.train_views as f64 * w.pixels_mean) as u64 * 4).min(PHOTOS_BYTES);
        let total_bytes = work_bytes + state_bytes + photos_bytes;
        Self { pairs, work_bytes, state_bytes, photos_bytes, total_bytes }
    }

    /// One sentence.
    fn describe(&self) -> String {
        format!(
            "{} ({} tile-splat pairs and pixels {}, model and optimiser {}, photos {})",
            format_bytes(self.total_bytes),
            format_count(self.pairs),
            format_bytes(self.work_bytes),
            format_bytes(self.state_bytes),
            format_bytes(self.photos_bytes)
        )
    }
}

/// The need on a GPU at the start and at the size that the model is expected to reach.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct DeviceEstimate {
    /// At the start.
    pub start: DeviceNeed,
    /// At the size that the model is expected to reach.
    pub grown: DeviceNeed,
    #[serde(skip)]
    first: Workload,
    #[serde(skip)]
    last: Workload,
    #[serde(skip)]
    config: TrainConfig,
}

impl DeviceEstimate {
    /// The estimate for a workload with these settings.
    pub fn new(workload: &Workload, config: &TrainConfig) -> Self {
        let (first, last) = (*workload, workload.grown(config));
        let need = |workload: &Workload| DeviceNeed::new(workload, config.loss.needs_geometry());
        Self { start: need(&first), grown: need(&last), first, last, config: config.clone() }
    }

    /// What the limits of a device depend on.
    pub fn shape(config: &TrainConfig) -> SceneShape {
        SceneShape { sh_degree: config.sh_degree, geometry: config.loss.needs_geometry() }
    }

    /// One sentence.
    pub fn describe(&self, device: &str) -> String {
        let (start, grown) = (self.start.describe(), self.grown.describe());
        format!(
            "estimate for the memory of {device}: {start} at the start; {grown} at the size that is expected"
        )
    }

    /// A warning about each limit of a device that the run may meet: what it needs, what fits, which option keeps within it.
    /// `side_px` is the longer side of the largest view.
    pub fn doubts(&self, device: &str, limits: &DeviceLimits, side_px: u32) -> Option<String> {
        let (w, most) = (&self.last, limits);
        let mut out = Vec::new();
        if self.grown.pairs > most.max_pairs {
            let when = if self.start.pairs > most.max_pairs { "from the start" } else { "as it grows" };
            let pixels = pixels_of(reach_of(w.splats as f64, most.max_pairs as f64));
            let side = f64::from(side_px) * (pixels as f64 / w.pixels_max.max(1) as f64).sqrt();
            let smaller = match side as u32 {
                side if side >= SIDE_MIN_PX => format!(" (--max-resolution {side} fits)"),
                _ => String::new(),
            };
            out.push(format!(
                "a step may need {} tile-splat pairs {when}, at most {} fit{smaller}",
                format_count(self.grown.pairs),
                format_count(most.max_pairs)
            ));
        }
        for (what, need, fits) in
            [("splats", w.splats, most.max_splats), ("texels", w.texels, most.max_texels)]
        {
            if need > fits {
                out.push(format!(
                    "it may grow to {} {what}, at most {} fit",
                    format_count(need),
                    format_count(fits)
                ));
            }
        }
        if out.is_empty() {
            return None;
        }
        let needs_geometry = self.config.loss.needs_geometry();
        let fits = |w: &Workload| {
            let pairs = DeviceNeed::new(w, needs_geometry).pairs;
            pairs <= most.max_pairs && w.splats <= most.max_splats && w.texels <= most.max_texels
        };
        let remedy = match self.first.fitting_budget(&self.config, fits) {
            Some(params) => format!("--budget-params {params} keeps within this"),
            None => "lower --max-resolution or max-points".to_owned(),
        };
        let then = if self.start.pairs > most.max_pairs {
            "It is trained on smaller images where steps do not fit, and does not grow then"
        } else {
            "It stops growing there"
        };
        Some(format!(
            "{device} may not hold what the model is expected to become: {}. {then}; {remedy}, or use another --device",
            out.join("; ")
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::super::resource_estimate::FOX;
    use super::*;

    fn workload(splats: u64, texels: u64, pixels_max: u64) -> Workload {
        Workload { splats, texels, pixels_max, pixels_mean: pixels_max as f64, ..FOX }
    }

    #[test]
    fn pairs_are_near_the_counted_ones() {
        for (pixels, counted) in [(270 * 480, 34_069.0), (1067 * 1899, 225_000.0)] {
            let ratio = pairs_of(1e4, reach(pixels)) / counted;
            // Needed: 0.09.
            assert!((ratio - 1.0).abs() < 0.12, "{ratio}");
        }
        assert!(pixels_of(reach(1600 * 1200)).abs_diff(1600 * 1200) < 2);
    }

    #[test]
    fn limits_that_may_be_met_are_named_with_what_keeps_within_them() {
        let config = TrainConfig::default();
        // A small device.
        let limits = DeviceLimits {
            max_side_px: 16_384,
            max_pixels: 3_728_270,
            max_splats: 578_524,
            max_texels: 1 << 30,
            max_pairs: 1_000_000,
        };
        let doubts = |splats, pixels| {
            DeviceEstimate::new(&workload(splats, 16 * splats, pixels), &config)
                .doubts("small", &limits, 1600)
        };
        assert_eq!(doubts(15_000, 270 * 480), None);
        // Twice as many splats are expected.
        let grows = doubts(250_000, 1600 * 1200).unwrap();
        for part in [
            "small may not hold",
            "tile-splat pairs as it grows, at most 1,000,000 fit",
            "--max-resolution ",
            "--budget-params ",
        ] {
            assert!(grows.contains(part), "{part}: {grows}");
        }
        let large = doubts(2_000_000, 1600 * 1200).unwrap();
        for part in [
            "pairs from the start",
            "4,000,000 splats, at most 578,524",
            "lower --max-resolution or max-points",
        ] {
            assert!(large.contains(part), "{part}: {large}");
        }
        assert!(grows.contains("stops growing") && !large.contains("stops growing"), "{large}");
        assert!(large.contains("trained on smaller images"), "{large}");
        // Negative control: larger buffers.
        let plenty = DeviceLimits { max_pairs: 26_000_000, max_splats: 9_000_000, ..limits };
        let estimate = DeviceEstimate::new(&workload(2_000_000, 32_000_000, 1600 * 1200), &config);
        assert_eq!(estimate.doubts("large", &plenty, 1600), None);
        assert!(estimate.describe("large").contains("GiB"), "{}", estimate.describe("large"));
    }

    #[test]
    fn the_budget_of_a_doubt_leaves_none() {
        let limits = DeviceLimits {
            max_side_px: 16_384,
            max_pixels: 3_728_270,
            max_splats: 578_524,
            max_texels: 1 << 30,
            max_pairs: 1_000_000,
        };
        let start = workload(250_000, 4_000_000, 1600 * 1200);
        let doubt = |limits: &DeviceLimits, budget: Option<usize>, prune_db: f64| {
            let mut config = TrainConfig::default();
            (config.budget.max_params, config.density.prune_db) = (budget, prune_db);
            DeviceEstimate::new(&start, &config).doubts("small", limits, 1600)
        };
        let proposed = |doubt: &str| {
            let after = doubt.split_once("--budget-params ").unwrap().1;
            after.split(' ').next().unwrap().parse::<usize>().unwrap()
        };
        let few_texels = DeviceLimits { max_texels: 12_000_000, max_pairs: 1 << 40, ..limits };
        for (limits, prune_db) in [(&limits, 0.0), (&limits, 0.1), (&few_texels, 0.0), (&few_texels, 0.1)] {
            let most = proposed(&doubt(limits, None, prune_db).unwrap());
            assert_eq!(doubt(limits, Some(most), prune_db), None);
            // Negative control: a little more does not fit. The proposal is below a budget that does not.
            let larger = doubt(limits, Some(most + most / 50), prune_db).unwrap();
            // Numbers of splats and texels are rounded.
            assert!(proposed(&larger).abs_diff(most) < 100, "{most}: {larger}");
        }
        // While a run prunes, it may exceed its budget.
        let of = |prune_db| proposed(&doubt(&limits, None, prune_db).unwrap()) as f64;
        assert!((of(0.0) / of(0.1) - 2.5).abs() < 0.01);
    }
}
