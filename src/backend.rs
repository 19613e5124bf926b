//! The seam between the optimisation and the machines it runs on. A backend owns the model and the
//! optimiser's state while training lasts; the trainer sends it views and plans and reads back.

mod limits;
mod plan;

use crate::camera::Camera;
pub use crate::image::TargetImage;
pub use crate::model::LearningRates;
use crate::model::{AdamState, Model};
use crate::{Error, Result};
pub use limits::{DeviceLimits, SceneShape};
pub use plan::{Grid, MapChange, SplatEdit, DensityPlan};
use serde::{Deserialize, Serialize};

/// What a device says of itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceInfo {
    /// Short name accepted by `--device`.
    pub name: String,
    /// What runs there: instruction set and threads, or adapter, driver and API.
    pub description: String,
}

/// What to render besides the colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// Display-space colour behind everything.
    pub background: [f32; 3],
    /// SH degree to evaluate (at most the model's).
    pub sh_degree: u32,
    /// Also depth and normals.
    pub geometry: bool,
}

/// A rendered view.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderedImage {
    /// Width.
    pub width_px: u32,
    /// Height.
    pub height_px: u32,
    /// Display space, not clamped. `[height, width, 3]`
    pub rgb: Vec<f32>,
    /// 1 - transmittance. `[height, width]`
    pub alpha: Vec<f32>,
    /// Expected hit depth along the optical axis, local units, 0 where nothing is drawn;
    /// empty unless asked for. `[height, width]`
    pub depth: Vec<f32>,
    /// Blended normals in camera axes, facing the camera, normalised, 0 where nothing is drawn;
    /// empty unless asked for. `[height, width, 3]`
    pub normal: Vec<f32>,
}

/// Weights of the loss terms (method section 3); a weight of 0 switches a term off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct LossWeights {
    /// Mean absolute difference.
    pub l1: f32,
    /// 1 - mean SSIM.
    pub dssim: f32,
    /// Mean squared difference.
    pub mse: f32,
    /// Mean over all splats of the opacity of those that this view sees. Published: 0.01; off by default,
    /// since it makes surfaces of many thin layers, each of which has texels (`docs/choices.md`).
    pub opacity: f32,
    /// Sum of absolute residuals over the texels of the maps that this view sees.
    pub texture: f32,
    /// The same, each map times 1 - the mean transmittance in front of it: hidden maps go smooth.
    pub texture_hidden: f32,
    /// Spread of the depths that make up a pixel; for geometry, off by default.
    pub distortion: f32,
    /// Deviation of the splats' normals from those of the depth map; for geometry, off by default.
    pub normal: f32,
}

impl LossWeights {
    /// Every term off.
    pub const NONE: Self = Self {
        l1: 0.0,
        dssim: 0.0,
        mse: 0.0,
        opacity: 0.0,
        texture: 0.0,
        texture_hidden: 0.0,
        distortion: 0.0,
        normal: 0.0,
    };

    /// The published terms.
    pub const PUBLISHED: Self = Self { l1: 0.8, dssim: 0.2, opacity: 0.01, texture: 1e-8, ..Self::NONE };

    /// Whether a term needs depths and normals.
    pub fn needs_geometry(&self) -> bool {
        self.distortion != 0.0 || self.normal != 0.0
    }
}

impl Default for LossWeights {
    fn default() -> Self {
        Self { opacity: 0.0, ..Self::PUBLISHED }
    }
}

/// One iteration on one view.
pub struct StepRequest<'a> {
    /// 1 for the first step of the run: the optimiser's clock.
    pub step: u32,
    /// The view.
    pub camera: Camera,
    /// Identity of the photo: equal numbers are equal photos, at equal size, until the next upload of a
    /// model, so that a backend may keep them resident. The trainer passes the index of the view.
    pub photo: u32,
    /// The photo, of the camera's size.
    pub target: &'a TargetImage,
    /// Display-space colour behind everything.
    pub background: [f32; 3],
    /// SH degree in use.
    pub sh_degree: u32,
    /// Loss terms.
    pub loss: LossWeights,
    /// Learning rates.
    pub rates: LearningRates,
    /// Whether this render counts in the window statistics.
    pub accumulate_statistics: bool,
}

impl StepRequest<'_> {
    /// Checks that camera and photo are of one size.
    ///
    /// # Errors
    /// [`Error::Usage`] with both.
    pub fn check(&self) -> Result<()> {
        let (p, t) = (&self.camera.pinhole, self.target);
        if (p.width_px, p.height_px) == (t.width_px, t.height_px) && t.rgb.len() == 3 * p.num_pixels() {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "camera is {}x{} px but its photo {}x{} px with {} values",
            p.width_px,
            p.height_px,
            t.width_px,
            t.height_px,
            t.rgb.len()
        )))
    }
}

/// Value of each loss term, weighted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LossValues {
    /// Sum of the others.
    pub total: f64,
    /// L1 term.
    pub l1: f64,
    /// SSIM term.
    pub dssim: f64,
    /// MSE term.
    pub mse: f64,
    /// Opacity term.
    pub opacity: f64,
    /// Texture terms.
    pub texture: f64,
    /// Distortion term.
    pub distortion: f64,
    /// Normal term.
    pub normal: f64,
}

/// Work done by the rasteriser in one forward pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RasterCounters {
    /// Pixels of the view.
    pub pixels: u64,
    /// Splats that touch a tile.
    pub visible_splats: u64,
    /// Tile-splat pairs.
    pub tile_pairs: u64,
    /// Pixel-splat pairs for which the falloff was computed (SIMD lanes included).
    pub evaluated_pairs: u64,
    /// ... with alpha >= 1/255, before the pixel stopped or not.
    pub inside_pairs: u64,
    /// ... blended.
    pub blended_pairs: u64,
    /// Global atomics that added texel gradients in the backward pass, where they are counted.
    #[serde(default)]
    pub texel_atomics: u64,
}

/// What one step did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Loss before the update.
    pub loss: LossValues,
    /// Work of the forward pass.
    pub counters: RasterCounters,
    /// Gradient entries that were NaN or infinite and counted as zero.
    pub non_finite_gradients: u64,
    /// Time per stage, in the order of execution.
    pub stages: Vec<(&'static str, std::time::Duration)>,
}

/// Sums over the views rendered since the last reading (method section 9); views are normalised by
/// their pixel count.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WindowStatistics {
    /// Views counted.
    pub views: u32,
    /// Views in which a splat touched a tile. `[n]`
    pub seen: Vec<u32>,
    /// Share of pixels with alpha >= 1/255 before the stop, summed over views. `[n]`
    pub area: Vec<f32>,
    /// Blending weight per pixel, summed over views. `[n]`
    pub contribution: Vec<f32>,
    /// Blending weight times loss per pixel, summed over views. `[n]`
    pub error: Vec<f32>,
}

impl WindowStatistics {
    /// A window that has just begun.
    pub fn empty(num_splats: usize) -> Self {
        let zeros = vec![0.0; num_splats];
        Self {
            views: 0,
            seen: vec![0; num_splats],
            area: zeros.clone(),
            contribution: zeros.clone(),
            error: zeros,
        }
    }

    /// Checks that there is one entry for each of `num_splats` splats.
    ///
    /// # Errors
    /// [`Error::Usage`] with the numbers.
    pub fn check(&self, num_splats: usize) -> Result<()> {
        let found = [self.seen.len(), self.area.len(), self.contribution.len(), self.error.len()];
        if found == [num_splats; 4] {
            return Ok(());
        }
        Err(Error::Usage(format!("window statistics of {found:?} entries for {num_splats} splats")))
    }
}

/// A machine that renders and optimises.
pub trait Backend {
    /// What this is.
    fn device(&self) -> DeviceInfo;

    /// What it can hold at most.
    fn limits(&self, shape: SceneShape) -> DeviceLimits;

    /// Takes over a model and its optimiser state.
    ///
    /// # Errors
    /// [`Error::Device`] if it does not fit, with counts.
    fn upload(&mut self, model: &Model, adam: &AdamState) -> Result<()>;

    /// Renders the model as of the last step. Does not influence later steps in any bit.
    ///
    /// # Errors
    /// [`Error::Device`] if memory or the device fails.
    fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage>;

    /// One iteration: forward, loss, backward, Adam.
    ///
    /// # Errors
    /// [`Error::Device`] if memory or the device fails, [`Error::Usage`] if image and camera differ in size.
    fn step(&mut self, request: &StepRequest<'_>) -> Result<StepReport>;

    /// How many steps this machine wants at once, at least 1: a device that is fed through a queue
    /// idles if every step waits for the report of the one before. The photos of a batch are held in
    /// memory while it runs.
    fn batch_steps(&self) -> usize {
        1
    }

    /// Several iterations, in order: one report for each request. Gives the same bits, in the state and
    /// in the reports, as calling [`Backend::step`] for each.
    ///
    /// # Errors
    /// As [`Backend::step`]. None or some of the steps, from the first on, have then been applied whole;
    /// the state stays readable, and its `AdamState::step` says how many.
    fn steps(&mut self, requests: &[StepRequest<'_>]) -> Result<Vec<StepReport>> {
        requests.iter().map(|request| self.step(request)).collect()
    }

    /// Sums since the window began: with the last upload or density-control step, or as set by
    /// [`Backend::set_statistics`]. Leaves them as they are.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails.
    fn read_statistics(&mut self) -> Result<WindowStatistics>;

    /// Continues a window from the sums of [`Backend::read_statistics`], or begins one from zeros.
    ///
    /// # Errors
    /// [`Error::Usage`] if they are not of the model's size, [`Error::Device`] if the device fails.
    fn set_statistics(&mut self, statistics: &WindowStatistics) -> Result<()>;

    /// Changes the structure, and begins a new window of statistics.
    ///
    /// # Errors
    /// [`Error::Usage`] if the plan does not fit the model, [`Error::Device`] if memory fails.
    fn apply_plan(&mut self, plan: &DensityPlan) -> Result<()>;

    /// The state exactly as it is: uploading it elsewhere continues the run bit for bit. Parameters of
    /// splats that the last steps did not see may lag behind (`AdamState::last_step`); see
    /// [`Backend::read_flushed`].
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails.
    fn read_back(&mut self) -> Result<(Model, AdamState)>;

    /// The model with all lazy updates done: what is rendered, evaluated and exported.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails.
    fn read_flushed(&mut self) -> Result<Model>;
}
