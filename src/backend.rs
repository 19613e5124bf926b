//! The seam between the optimisation and the machines it runs on. A backend owns the model and the
//! optimiser's state while training lasts; the trainer sends it views and plans and reads back.

mod limits;

use crate::camera::Camera;
pub use crate::model::LearningRates;
use crate::model::{AdamState, Model};
use crate::{Error, Result};
pub use limits::{DeviceLimits, SceneShape};
use serde::{Deserialize, Serialize};

/// A photo as the optimisation sees it: display space, composited, at the size that is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetImage {
    /// Width.
    pub width_px: u32,
    /// Height.
    pub height_px: u32,
    /// Row-major. `[height, width, 3]`
    pub rgb: Vec<u8>,
    /// 255: counts in loss and metrics, 0: does not. `[height, width]`
    pub mask: Option<Vec<u8>>,
}

impl TargetImage {
    /// Whether any pixel counts in loss and metrics.
    pub fn has_pixels_that_count(&self) -> bool {
        self.mask.as_ref().is_none_or(|mask| mask.iter().any(|&m| m != 0))
    }
}

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

/// The texel grid of a map, seen as it is or at twice or half its density. Outside of it texels and first
/// moments are zero and second moments those of the nearest texel of the grid, so that a texel that comes
/// into being starts with steps of the usual size. A map without texels has zeros everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grid {
    /// The texels as they are: crop, pad, shift.
    Same,
    /// Each texel twice along each axis, texels of half the edge.
    Finer,
    /// Means of 2 x 2 texels, of twice the edge. Sizes that are no multiple of four are first padded evenly
    /// by replication, so that the result is even and has the same centre.
    Coarser,
}

impl Grid {
    /// Rows (or columns) that a map of `texels` rows has on this grid.
    pub fn texels(self, texels: u16) -> u16 {
        match self {
            Self::Same => texels,
            Self::Finer => texels.saturating_mul(2),
            Self::Coarser => texels.div_ceil(4).saturating_mul(2),
        }
    }

    /// Edge of a texel on this grid over its edge on the map.
    pub fn texel_ratio(self) -> f32 {
        match self {
            Self::Same => 1.0,
            Self::Finer => 0.5,
            Self::Coarser => 2.0,
        }
    }
}

/// What becomes of one map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MapChange {
    /// Stays as it is.
    Keep,
    /// A window of the map on its own texel grid or one twice as fine or coarse: no texel leaves its place
    /// on the surfel beyond what the grid asks for. See [`Grid`].
    Regrid {
        /// Grid that the window is cut from.
        grid: Grid,
        /// New texels along u; 0: untextured.
        rows: u16,
        /// New texels along v; 0: untextured.
        cols: u16,
        /// Row of that grid that becomes row 0; may be negative.
        first_row: i32,
        /// Column of that grid that becomes column 0; may be negative.
        first_col: i32,
        /// Factors of the texels' first and second moments.
        moment_scale: [f32; 2],
    },
    /// Bilinear resampling to a new size about the centre or a place beside it; texels and moments outside are zero. The
    /// moments of the splat's other parameters stay as they are.
    Resample {
        /// New texels along u.
        rows: u16,
        /// New texels along v.
        cols: u16,
        /// New edge of a texel, local units.
        texel_size: f32,
        /// Place of the new map's centre in the old one, texels of the old map from its centre.
        shift_texels: [f32; 2],
        /// Factors of the texels' first and second moments, applied after the resampling:
        /// `[1.0, 1.0]` is the resampling alone. A gradient by a texel shrinks with its area, so a map
        /// of twice as many texels per axis takes `[1.0 / 4.0, 1.0 / 16.0]`.
        moment_scale: [f32; 2],
    },
}

/// New values for some parameters of a splat, which starts anew there: its first moments become zero, its
/// second moments stay those of its source, so that its first steps are small and soon of the usual size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplatEdit {
    /// Index in the new model.
    pub splat: u32,
    /// Centre, local frame.
    pub position: [f32; 3],
    /// Logarithms of the standard deviations.
    pub log_scales: [f32; 2],
    /// Opacity before the sigmoid.
    pub opacity_logit: f32,
}

/// A change of structure, decided on the host and applied alike by every backend. It is applied to the
/// settled model: the one that [`Backend::read_settled`] gives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StructurePlan {
    /// For each splat of the new model the splat it comes from. `[n_new]`
    pub sources: Vec<u32>,
    /// For each splat of the new model what becomes of its source's map. `[n_new]`
    pub maps: Vec<MapChange>,
    /// Splats that get other parameters than their source has, ascending.
    pub edits: Vec<SplatEdit>,
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
    /// [`Error::Device`] if memory or the device fails, [`Error::Usage`] if picture and camera differ in size.
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

    /// Sums since the window began: with the last upload or change of structure, or as set by
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
    fn apply_plan(&mut self, plan: &StructurePlan) -> Result<()>;

    /// The state exactly as it is: uploading it elsewhere continues the run bit for bit. Parameters of
    /// splats that the last steps did not see may lag behind (`AdamState::last_step`); see
    /// [`Backend::read_settled`].
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails.
    fn read_back(&mut self) -> Result<(Model, AdamState)>;

    /// The model with all lazy updates done: what is rendered, evaluated and exported.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails.
    fn read_settled(&mut self) -> Result<Model>;
}

impl StructurePlan {
    /// Checks the plan against a model of `num_splats` splats.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the first inconsistency.
    pub fn check(&self, num_splats: usize) -> Result<()> {
        if self.sources.len() != self.maps.len() {
            return Err(Error::Usage(format!(
                "structure plan: {} sources but {} map changes",
                self.sources.len(),
                self.maps.len()
            )));
        }
        if let Some(at) = self.sources.iter().position(|&s| s as usize >= num_splats) {
            return Err(Error::Usage(format!(
                "structure plan: source {} of new splat {at} is not one of the {num_splats} splats",
                self.sources[at]
            )));
        }
        for (at, map) in self.maps.iter().enumerate() {
            if let MapChange::Resample { moment_scale, .. } | MapChange::Regrid { moment_scale, .. } = map
                && !moment_scale.iter().all(|f| f.is_finite() && *f >= 0.0)
            {
                return Err(Error::Usage(format!(
                    "structure plan: moment scale {moment_scale:?} of new splat {at}, expected finite numbers \
                     of at least 0"
                )));
            }
            if let MapChange::Regrid { rows, cols, .. } = map
                && (*rows == 0) != (*cols == 0)
            {
                return Err(Error::Usage(format!(
                    "structure plan: a map of {rows} x {cols} texels for new splat {at}, expected texels along \
                     both axes or along none"
                )));
            }
        }
        let mut next = 0;
        for edit in &self.edits {
            let values = edit.position.iter().chain(&edit.log_scales).chain([&edit.opacity_logit]);
            if edit.splat < next || edit.splat as usize >= self.sources.len() {
                return Err(Error::Usage(format!(
                    "structure plan: edits of {} new splats must name each once and in order, found {} where at \
                     least {next} was expected",
                    self.sources.len(),
                    edit.splat
                )));
            }
            if !values.into_iter().all(|v| v.is_finite()) {
                return Err(Error::Usage(format!(
                    "structure plan: edit {edit:?} has values that are not finite"
                )));
            }
            next = edit.splat + 1;
        }
        Ok(())
    }
}
