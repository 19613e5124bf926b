//! The interface between the trainer and the devices. A backend owns the model and the optimiser's state during
//! training; the trainer sends it views and plans and reads results back.

mod comparison;
mod costs;
mod exposure;
mod limits;
mod pair_count;
mod plan;
mod probe;

use crate::camera::Camera;
pub use crate::image::TargetImage;
pub use crate::model::LearningRates;
use crate::model::{AdamState, Model};
use crate::{Error, Result};
pub use costs::{AXES, Costs, Derivatives, costs_of, depths};
pub use exposure::{ColourMap, ColourSums, NUM_COLOUR_SUMS};
pub use limits::{DeviceLimits, SceneShape};
pub use pair_count::{pairs_of, reach_of, splats_of};
pub use plan::{DensityPlan, Grid, MapChange, SplatEdit};
pub use probe::{BETWEEN, Probe, probe_scale, probed};
use serde::{Deserialize, Serialize};
use std::any::Any;

/// Description of a device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceInfo {
    /// Short name accepted by `--device`.
    pub name: String,
    /// What runs there: instruction set and threads, or adapter, driver and API.
    pub description: String,
}

/// Options of [`Backend::render`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// Display-space colour behind all splats.
    pub background: [f32; 3],
    /// SH degree to evaluate; splats of a lower one use their own.
    pub sh_degree: u32,
    /// Whether to render depth and normals too.
    pub geometry: bool,
}

/// A rendered view.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderedImage {
    /// Width in pixels.
    pub width_px: u32,
    /// Height in pixels.
    pub height_px: u32,
    /// Colours in display space, not clamped. `[height, width, 3]`
    pub rgb: Vec<f32>,
    /// 1 - transmittance. `[height, width]`
    pub alpha: Vec<f32>,
    /// Expected depth of the hits along the optical axis, local units, 0 where nothing is drawn;
    /// empty without [`RenderOptions::geometry`]. `[height, width]`
    pub depth: Vec<f32>,
    /// Blended normals in camera axes, facing the camera, normalised, 0 where nothing is drawn;
    /// empty without [`RenderOptions::geometry`]. `[height, width, 3]`
    pub normal: Vec<f32>,
}

/// Weights of the loss terms (method 3); a weight of 0 switches a term off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct LossWeights {
    /// Mean absolute difference. Default 0.8 (3DGS; paper, Adaptive Per-Gaussian Texture Optimization).
    pub l1: f32,
    /// 1 - mean SSIM. Default 0.2 (as above).
    pub dssim: f32,
    /// Mean squared difference. Default 0 (paper; authors' configuration: 0.03; not measured).
    pub mse: f32,
    /// Mean over all splats of the opacity of the visible ones. Default 0 (method 3; CAT and authors' code: 0.01):
    /// the term favours surfaces of many thin layers, each of which has texels.
    pub opacity: f32,
    /// Sum of the absolute residuals over the texels of visible maps. Default 1e-8 (CAT; not measured).
    pub texture: f32,
    /// Spread of the depths of a pixel's samples, for geometry. Default 0 (paper; not measured).
    pub distortion: f32,
    /// Deviation of the splats' normals from those of the depth map, for geometry. Default 0 (paper; not measured).
    pub normal: f32,
}

impl LossWeights {
    /// All terms off.
    pub const NONE: Self =
        Self { l1: 0.0, dssim: 0.0, mse: 0.0, opacity: 0.0, texture: 0.0, distortion: 0.0, normal: 0.0 };

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

/// A training step on one view.
pub struct StepRequest<'a> {
    /// Number of the step, 1 for the first of a run; the optimiser's time.
    pub step: u32,
    /// Camera of the view.
    pub camera: Camera,
    /// Identity of the photo: until [`Backend::forget_photos`], equal numbers mean equal photos if the size is the same, so
    /// that a backend may keep them resident. `None`: it is used once.
    pub photo: Option<u32>,
    /// The photo, of the camera's size.
    pub target: &'a TargetImage,
    /// Display-space colour behind all splats.
    pub background: [f32; 3],
    /// SH degree in use.
    pub sh_degree: u32,
    /// Weights of the loss terms.
    pub loss: LossWeights,
    /// Learning rates of this step.
    pub rates: LearningRates,
    /// Whether this render counts in the statistics window.
    pub accumulate_statistics: bool,
    /// The exposure of the photo, by which the image is corrected before the comparison; `None`: not at all.
    pub exposure: Option<ColourMap>,
}

impl<'a> StepRequest<'a> {
    /// A step that moves nothing but the first moments, from 0 to the derivatives of a probe over [`Probe::scale`].
    pub fn of_probe(probe: &'a Probe) -> Self {
        Self {
            step: 1,
            camera: probe.camera,
            photo: None,
            target: &probe.signs,
            background: probe.background,
            sh_degree: probe.sh_degree,
            loss: LossWeights { l1: 1.0, ..LossWeights::NONE },
            rates: LearningRates::default(),
            accumulate_statistics: false,
            exposure: Some(probe.exposure),
        }
    }

    /// Checks that camera and photo have the same size.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] with both sizes.
    pub fn check(&self) -> Result<()> {
        let (p, t) = (&self.camera.pinhole, self.target);
        if (p.width_px, p.height_px) == (t.width_px, t.height_px) && t.rgb.len() == 3 * p.num_pixels() {
            return Ok(());
        }
        Err(usage!(
            "the camera has {}x{} px, but its photo {}x{} px with {} values",
            p.width_px,
            p.height_px,
            t.width_px,
            t.height_px,
            t.rgb.len()
        ))
    }
}

/// A view to be compared with its photo.
pub struct ComparedView<'a> {
    /// Camera of the view.
    pub camera: Camera,
    /// Identity of the photo, as in a [`StepRequest`].
    pub photo: Option<u32>,
    /// The photo, of the camera's size.
    pub target: &'a TargetImage,
    /// Display-space colour behind all splats.
    pub background: [f32; 3],
    /// SH degree in use.
    pub sh_degree: u32,
    /// The exposure of the photo, by which the image is corrected before the comparison; `None`: not at all.
    pub exposure: Option<ColourMap>,
}

/// Values of the loss terms, times their weights. See [`LossWeights`] for the terms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LossValues {
    /// Sum of all terms.
    pub total: f64,
    /// Mean absolute difference.
    pub l1: f64,
    /// 1 - mean SSIM.
    pub dssim: f64,
    /// Mean squared difference.
    pub mse: f64,
    /// Opacity of visible splats.
    pub opacity: f64,
    /// Residuals of visible maps: both texture terms.
    pub texture: f64,
    /// Spread of depths.
    pub distortion: f64,
    /// Deviation of normals.
    pub normal: f64,
}

/// Work done by the rasteriser in one forward pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RasterCounters {
    /// Pixels of the view.
    pub pixels: u64,
    /// Splats that touch at least one tile.
    pub visible_splats: u64,
    /// Pairs of a tile and a splat that touches it.
    pub tile_pairs: u64,
    /// Samples whose falloff was computed, unused SIMD lanes included.
    pub evaluated_pairs: u64,
    /// Samples with alpha >= 1/255, also after their pixel stopped.
    pub inside_pairs: u64,
    /// Samples that were blended.
    pub blended_pairs: u64,
    /// Global atomic additions of texel gradients in the backward pass, on devices that count them.
    #[serde(default)]
    pub texel_atomics: u64,
}

/// Report of a training step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Loss before the update.
    pub loss: LossValues,
    /// Work of the forward pass.
    pub counters: RasterCounters,
    /// Number of gradient entries that were NaN or infinite and treated as zero.
    pub non_finite_gradients: u64,
    /// Sums from which the exposure of the photo is estimated, if the step corrected it.
    pub colour_sums: Option<ColourSums>,
    /// Time by part of the step, in the order of execution.
    pub stages: Vec<(&'static str, std::time::Duration)>,
}

/// Sums over the views of a statistics window, each view's divided by its number of pixels (method 6.2).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WindowStatistics {
    /// Number of views counted.
    pub views: u32,
    /// Number of views in which the splat touched a tile. `[n]`
    pub seen: Vec<u32>,
    /// Share of pixels with alpha >= 1/255 before they stopped, summed over views. `[n]`
    pub area: Vec<f32>,
    /// Blending weight per pixel, summed over views. `[n]`
    pub contribution: Vec<f32>,
    /// Blending weight times loss per pixel, summed over views. `[n]`
    pub error: Vec<f32>,
}

impl WindowStatistics {
    /// A window without views.
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

    /// Checks that every array has one entry for each of `num_splats` splats.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] with the lengths found.
    pub fn check(&self, num_splats: usize) -> Result<()> {
        let found = [self.seen.len(), self.area.len(), self.contribution.len(), self.error.len()];
        if found == [num_splats; 4] {
            return Ok(());
        }
        Err(usage!("window statistics: found {found:?} entries for {num_splats} splats"))
    }
}

/// A copy of the model and the optimiser's state, kept where the backend keeps its own.
pub struct SavedState(pub(crate) Box<dyn Any>);

/// An implementation of rendering and optimisation on a device.
pub trait Backend {
    /// Describes the device.
    fn device(&self) -> DeviceInfo;

    /// The largest models and images that the device can hold.
    fn limits(&self, shape: SceneShape) -> DeviceLimits;

    /// Replaces the model and the optimiser state.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFull`] with counts if they do not fit, [`crate::Error::Device`] if the device fails.
    fn upload(&mut self, model: &Model, adam: &AdamState) -> Result<()>;

    /// Forgets the photos seen so far, whose numbers may from now on mean others.
    fn forget_photos(&mut self) {}

    /// Copies model and optimiser state.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFull`] if memory does not suffice, [`crate::Error::Device`] if the device fails.
    fn save(&mut self) -> Result<SavedState>;

    /// Returns to a state that this backend saved, and begins a new statistics window.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] if another backend saved it, [`crate::Error::DeviceFull`] if memory does not suffice: then there may be
    /// no model any more, so that reading it fails; [`crate::Error::Device`] if the device fails.
    fn restore(&mut self, saved: &SavedState) -> Result<()>;

    /// Renders the model after the last step. Does not change a bit of later steps.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFull`] if memory does not suffice, [`crate::Error::Device`] if the device fails.
    fn render(&mut self, camera: &Camera, options: &RenderOptions) -> Result<RenderedImage>;

    /// Mean squared difference between each view of the model after the last step and its photo, over pixels and channels;
    /// pixels that the mask leaves out differ by 0. Does not change a bit of later steps.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFull`] if memory does not suffice, [`crate::Error::Device`] if the device fails,
    /// [`crate::Error::Usage`] if photo and camera differ in size.
    fn squared_errors(&mut self, views: &[ComparedView<'_>]) -> Result<Vec<f64>> {
        let of_view = |view: &ComparedView<'_>| {
            let &ComparedView { target, background, sh_degree, .. } = view;
            let image =
                self.render(&view.camera, &RenderOptions { background, sh_degree, geometry: false })?;
            let exposure = view.exposure.unwrap_or(ColourMap::IDENTITY);
            Ok(comparison::squared_error(&image.rgb, &exposure, target, background))
        };
        views.iter().map(of_view).collect()
    }

    /// Takes probes of the model after the last step, which is then replaced by the model as it is [`probed`], with moments
    /// and a statistics window of no use. Returns what losing parts of each splat costs, summed over the probes. `[n]`
    ///
    /// # Errors
    /// Those of the probes; [`crate::Error::DeviceFull`] if memory does not suffice, [`crate::Error::Device`] if the device fails.
    fn probe(&mut self, probes: &mut dyn Iterator<Item = Result<Probe>>) -> Result<Vec<Costs>>;

    /// Does a training step: forward, loss, backward, Adam.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFull`] if memory or a limit does not suffice, [`crate::Error::Device`] if the device fails,
    /// [`crate::Error::Usage`] if photo and camera differ in size.
    fn step(&mut self, request: &StepRequest<'_>) -> Result<StepReport>;

    /// Preferred number of steps per call of [`Backend::steps`], at least 1. A device that is fed through a queue
    /// idles if every step waits for the previous report. The photos of a batch are held in memory while it runs.
    fn batch_steps(&self) -> usize {
        1
    }

    /// Most steps that [`Backend::batch_steps`] prefers at any time.
    fn most_batch_steps(&self) -> usize {
        self.batch_steps()
    }

    /// Does several training steps in order, with one report for each. State and reports are bit for bit those of
    /// calling [`Backend::step`] for each request. Fewer reports mean that the device has no room for the next step: these
    /// steps are done, and the next call fails.
    ///
    /// # Errors
    /// As [`Backend::step`]; [`crate::Error::DeviceFull`] only if no step was done. After other errors, some of the first steps,
    /// or none, have been applied completely; the state is still readable, and its [`AdamState::step`] is the number of steps
    /// done.
    fn steps(&mut self, requests: &[StepRequest<'_>]) -> Result<Vec<StepReport>> {
        let mut reports = Vec::new();
        for request in requests {
            match self.step(request) {
                Ok(report) => reports.push(report),
                Err(Error::DeviceFull(_)) if !reports.is_empty() => break,
                Err(error) => return Err(error),
            }
        }
        Ok(reports)
    }

    /// Reads the sums of the window, which begins with an upload, a restored state or a density-control step, or as set by
    /// [`Backend::set_statistics`]. Does not reset them.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFull`] if memory does not suffice, [`crate::Error::Device`] if the device fails.
    fn read_statistics(&mut self) -> Result<WindowStatistics>;

    /// Replaces the sums of the window, to continue one or, with zeros, to begin one.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] if their length does not match the model, [`crate::Error::DeviceFull`] if memory does not
    /// suffice, [`crate::Error::Device`] if the device fails.
    fn set_statistics(&mut self, statistics: &WindowStatistics) -> Result<()>;

    /// Carries out a density-control plan and begins a new statistics window.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] if the plan does not match the model, [`crate::Error::DeviceFull`] if memory or a limit does
    /// not suffice; nothing has then changed.
    fn apply_plan(&mut self, plan: &DensityPlan) -> Result<()>;

    /// Reads the state as it is; uploaded elsewhere, it continues the run bit for bit. Parameters of splats that the
    /// last steps did not see may lag behind ([`AdamState::last_step`]), see [`Backend::read_flushed`].
    ///
    /// # Errors
    /// [`crate::Error::DeviceFull`] if memory does not suffice, [`crate::Error::Device`] if the device fails.
    fn read_back(&mut self) -> Result<(Model, AdamState)>;

    /// Reads the model with all lazy updates done, as it is rendered, evaluated and exported.
    ///
    /// # Errors
    /// [`crate::Error::DeviceFull`] if memory does not suffice, [`crate::Error::Device`] if the device fails.
    fn read_flushed(&mut self) -> Result<Model>;
}
