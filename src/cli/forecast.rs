//! Memory and time that training will take, told before it starts. A coarse model: memory counts the
//! arrays that exist, time rests on three measured rates. Estimates, and called so.

use super::values::{format_bytes, format_duration};
use litetex_gs::constants::sh_coefficients;
use litetex_gs::model::Model;
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Error, Result};

/// CPU seconds of the `cpu` backend per step, per pixel and step, and per splat and step, fitted to
/// measurements (2 cores, AVX-512). Measured, and what the model gives: 270 x 480 with 14,553 splats 0.119 s
/// (0.091); 539 x 960 with 14,553 splats 0.29 s (0.25); 400 x 400 with 20,000 splats before a mostly black
/// background 0.065 s (0.11); 960 x 710 with 3,673 splats 0.24 s (0.31); 320 x 240 with 4,000 splats 0.06 s
/// (0.053). How many splats cover a pixel is not known beforehand, so it cannot be much better.
const CPU_SECS_PER_STEP: f64 = 0.015;
const CPU_SECS_PER_PIXEL: f64 = 0.42e-6;
const CPU_SECS_PER_SPLAT: f64 = 1.5e-6;
/// Bytes per pixel of one view at work: photo, picture, gradient, SSIM's windows, kept blending state.
const BYTES_PER_PIXEL: u64 = 120;
/// Bytes per splat of one view at work: projection, its gradient, about eight tile pairs with partial sums.
const BYTES_PER_SPLAT: u64 = 1400;

/// What is going to be trained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Workload {
    pub splats: u64,
    pub texels: u64,
    pub sh_degree: u32,
    /// Largest view.
    pub pixels_max: u64,
    /// Mean over the views trained on.
    pub pixels_mean: f64,
    pub views: u64,
    pub cache_limit_bytes: u64,
    pub steps: u32,
    /// Threads of the CPU backend; `None`: another device computes, of whose speed nothing is known.
    pub threads: Option<usize>,
}

/// Estimates.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Forecast {
    pub model_bytes: u64,
    /// Moments.
    pub optimiser_bytes: u64,
    pub gradient_bytes: u64,
    /// The copy that a checkpoint is written from.
    pub copy_bytes: u64,
    pub view_bytes: u64,
    pub image_cache_bytes: u64,
    pub total_bytes: u64,
    /// Null for devices other than the CPU.
    pub cpu_secs: Option<f64>,
    /// Null for devices other than the CPU.
    pub wall_secs: Option<f64>,
}

impl Workload {
    /// What a model, views and settings amount to.
    pub fn new(
        model: &Model,
        views: &dyn ViewSource,
        cache_limit_bytes: u64,
        steps: u32,
        on_cpu: bool,
    ) -> Self {
        let pixels = |v: usize| views.camera(v).pinhole.num_pixels() as u64;
        let train = views.indices(Split::Train);
        let sum: u64 = train.iter().map(|&v| pixels(v)).sum();
        Self {
            splats: model.num_splats() as u64,
            texels: model.num_texels() as u64,
            sh_degree: model.splats.sh_degree,
            pixels_max: (0..views.num_views()).map(pixels).max().unwrap_or(0),
            pixels_mean: sum as f64 / train.len().max(1) as f64,
            views: views.num_views() as u64,
            cache_limit_bytes,
            steps,
            threads: on_cpu.then(rayon::current_num_threads),
        }
    }

    /// Memory and time.
    pub fn forecast(&self) -> Forecast {
        let floats = 10 + 3 * sh_coefficients(self.sh_degree) as u64;
        let parameters = 4 * (self.splats * floats + 3 * self.texels);
        let model_bytes = parameters + 12 * self.splats;
        let optimiser_bytes = 2 * parameters + 4 * self.splats;
        let photos = self.views * (self.pixels_mean * 4.0) as u64;
        let mut forecast = Forecast {
            model_bytes,
            optimiser_bytes,
            gradient_bytes: parameters,
            copy_bytes: model_bytes + optimiser_bytes,
            view_bytes: self.pixels_max * BYTES_PER_PIXEL + self.splats * BYTES_PER_SPLAT,
            image_cache_bytes: photos.min(self.cache_limit_bytes),
            total_bytes: 0,
            cpu_secs: None,
            wall_secs: None,
        };
        forecast.total_bytes = model_bytes
            + optimiser_bytes
            + forecast.gradient_bytes
            + forecast.copy_bytes
            + forecast.view_bytes
            + forecast.image_cache_bytes;
        if let Some(threads) = self.threads {
            let per_step = CPU_SECS_PER_STEP
                + self.pixels_mean * CPU_SECS_PER_PIXEL
                + self.splats as f64 * CPU_SECS_PER_SPLAT;
            let cpu_secs = f64::from(self.steps) * per_step;
            forecast.cpu_secs = Some(cpu_secs);
            forecast.wall_secs = Some(cpu_secs / threads.max(1) as f64);
        }
        forecast
    }
}

impl Forecast {
    /// One sentence.
    pub fn describe(&self) -> String {
        let time =
            self.wall_secs.map_or(String::new(), |s| format!(", about {} of training", format_duration(s)));
        format!(
            "estimate: {} of memory (model {}, optimiser {}, image cache {}, one view at work {}){time}",
            format_bytes(self.total_bytes),
            format_bytes(self.model_bytes),
            format_bytes(self.optimiser_bytes),
            format_bytes(self.image_cache_bytes),
            format_bytes(self.view_bytes),
        )
    }

    /// Refuses what the machine cannot hold.
    ///
    /// # Errors
    /// [`Error::Device`] with the figures and what to change.
    pub fn check(&self, machine_bytes: Option<u64>) -> Result<()> {
        match machine_bytes {
            Some(have) if self.total_bytes > have => Err(Error::Device(format!(
                "training needs about {}, this machine has {}: {}; lower --max-resolution, --image-cache or \
                 the number of primitives",
                format_bytes(self.total_bytes),
                format_bytes(have),
                self.describe()
            ))),
            _ => Ok(()),
        }
    }
}

/// Memory that this process may use: the machine's, or its control group's where that is less.
pub fn machine_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let machine = kib_of(&text, "MemTotal:")?;
    let group = std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
    let group = group.and_then(|g| g.trim().parse().ok()).unwrap_or(u64::MAX);
    Some(machine.min(group))
}

/// Memory of this process: now, and at most so far.
pub fn process_bytes() -> Option<(u64, u64)> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    Some((kib_of(&text, "VmRSS:")?, kib_of(&text, "VmHWM:")?))
}

fn kib_of(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|l| l.strip_prefix(key))?;
    let kib: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOX: Workload = Workload {
        splats: 14_686,
        texels: 16 * 14_686,
        sh_degree: 3,
        pixels_max: 270 * 480,
        pixels_mean: 270.0 * 480.0,
        views: 50,
        cache_limit_bytes: 4 << 30,
        steps: 300,
        threads: Some(2),
    };

    #[test]
    fn a_small_scene_fits_and_a_huge_one_is_refused_with_its_figures() {
        let forecast = FOX.forecast();
        assert!(forecast.total_bytes < 256 << 20, "{forecast:?}");
        assert!((10.0..60.0).contains(&forecast.wall_secs.unwrap()), "{forecast:?}");
        assert!(forecast.describe().contains("of training"));
        let elsewhere = Workload { threads: None, ..FOX }.forecast();
        assert!(elsewhere.wall_secs.is_none() && !elsewhere.describe().contains("of training"));
        forecast.check(Some(8 << 30)).unwrap();
        forecast.check(None).unwrap();
        let huge = Workload { splats: 50_000_000, texels: 800_000_000, ..FOX };
        let error = huge.forecast().check(Some(8 << 30)).unwrap_err();
        assert_eq!(error.exit_code(), 5);
        assert!(error.to_string().contains("8.0 GiB"), "{error}");
    }

    #[test]
    fn times_are_within_a_factor_of_two_of_the_measured_ones() {
        for (pixels, splats, secs_per_step) in [
            (270 * 480, 14_553, 0.119),
            (539 * 960, 14_553, 0.29),
            (400 * 400, 20_000, 0.065),
            (960 * 710, 3_673, 0.24),
            (320 * 240, 4_000, 0.06),
        ] {
            let scene = Workload { splats, pixels_mean: f64::from(pixels), steps: 1, ..FOX };
            let ratio = scene.forecast().cpu_secs.unwrap() / secs_per_step;
            assert!((0.5..2.0).contains(&ratio), "{pixels} pixels, {splats} splats: {ratio}");
        }
    }

    #[test]
    fn the_image_cache_is_capped() {
        let many = Workload { views: 100_000, cache_limit_bytes: 1 << 30, ..FOX };
        assert_eq!(many.forecast().image_cache_bytes, 1 << 30);
    }

    #[test]
    fn meminfo_is_understood() {
        assert_eq!(kib_of("MemFree: 1 kB\nMemTotal:   16 kB\n", "MemTotal:"), Some(16_384));
        assert_eq!(kib_of("MemTotal: x", "MemTotal:"), None);
    }
}
