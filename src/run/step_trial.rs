//! Measures a device before a run with a time is planned: a few training steps on the initial model, thrown away.

use crate::backend::{Backend, StepRequest};
use crate::camera::Camera;
use crate::eval::quality_of;
use crate::model::{AdamState, Model};
use crate::train::{Schedule, StepCosts, TrainConfig};
use crate::views::{Split, ViewSource};
use crate::{Error, Result};

/// Longer sides of the images of the trial, pixels: costs grow linearly with the pixels between and beyond them.
const SIDES_PX: [f64; 2] = [120.0, 480.0];
/// Where a step on the larger image takes less, a third size is tried: so few pixels do not occupy a GPU. It is that of most
/// trainings, so no trial fails on a device that could train. Measured: an H100 takes 3 ms for 480 pixels, two CPU cores 60 ms.
const FAST_STEP_SECS: f64 = 0.02;
const FAST_SIDE_PX: f64 = 1600.0;
/// Steps at each size, after one that does not count.
const STEPS: u32 = 3;

/// Opacity of the splats in the trial. Trained splats hide what is behind them; initial ones do not, so their steps cost more, by
/// how many lie behind each other. Steps planned for a minute over steps done, fox, flower, bonsai at 480 pixels, initial splats at
/// the spacing: with opacity 0.1 1.5, 0.6, 0.6; with this 1.3, 0.7, 1.2.
const OPACITY: f32 = 0.8;

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trial {
    /// A training step.
    pub costs: StepCosts,
    /// Reading a photo at the capture's size.
    pub photo_secs: f64,
    /// Rendering an image and comparing it with its photo, for each pixel.
    pub evaluation_secs_per_pixel: f64,
}

/// Does trial steps; what they do not show is taken from what is `known` of such devices. The backend's model is then to be
/// replaced.
///
/// # Errors
/// What the backend and the photos report.
pub fn measure(
    backend: &mut dyn Backend,
    views: &dyn ViewSource,
    model: &Model,
    config: &TrainConfig,
    known: StepCosts,
    now: &dyn Fn() -> f64,
) -> Result<Trial> {
    let train = views.indices(Split::Train);
    let &view = train
        .get(train.len() / 2)
        .ok_or_else(|| Error::Usage("no training view: every view is held out; lower --test-every".into()))?;
    let began = now();
    let photo = views.target(view)?;
    let photo_secs = now() - began;
    let camera = views.camera(view);
    let schedule = Schedule::new(config, train.len());
    let model = &opaque(model);
    let longer = f64::from(camera.pinhole.width_px.max(camera.pinhole.height_px));
    backend.forget_photos();
    backend.upload(model, &AdamState::zeros(model))?;
    let mut step = 0;
    let mut secs_at = |backend: &mut dyn Backend, at: usize, scale: f64| -> Result<_> {
        let [width, height] = [camera.pinhole.width_px, camera.pinhole.height_px]
            .map(|px| ((f64::from(px) / scale) as u32).max(1));
        let camera = Camera { pinhole: camera.pinhole.resized(width, height), ..camera };
        let target = photo.reduced(width, height);
        let mut request = || {
            step += 1;
            StepRequest {
                step,
                camera,
                photo: Some(at as u32),
                target: &target,
                background: config.background,
                sh_degree: config.sh_degree,
                loss: config.loss,
                rates: schedule.rates(config, 1),
                accumulate_statistics: true,
                exposure: None,
            }
        };
        backend.steps(&[request()])?;
        let began = now();
        backend.steps(&[(); STEPS as usize].map(|()| request()))?;
        let secs = (now() - began) / f64::from(STEPS);
        Ok((camera, target, (f64::from(width * height), secs)))
    };
    let [small, large] = SIDES_PX.map(|side| longer / side);
    let (.., few) = secs_at(backend, 0, small.max(2.0))?;
    let (mut camera, mut target, mut many) = secs_at(backend, 1, large.max(1.0))?;
    if many.1 < FAST_STEP_SECS && large > 1.0 {
        (camera, target, many) = secs_at(backend, 2, (longer / FAST_SIDE_PX).max(1.0))?;
    }
    let began = now();
    let options = super::trained::render_options(model, config.background, false);
    let image = backend.render(&camera, &options)?;
    quality_of("trial", &image.rgb, &target);
    Ok(Trial {
        costs: costs([few, many], model.num_splats() as f64, known),
        photo_secs,
        evaluation_secs_per_pixel: (now() - began) / many.0,
    })
}

/// A model of the same splats that hide each other as trained ones do.
fn opaque(model: &Model) -> Model {
    let mut opaque = model.clone();
    opaque.splats.opacity_logits.fill((OPACITY / (1.0 - OPACITY)).ln());
    opaque
}

/// Costs of steps at two sizes; what does not depend on the pixels is shared between splats and the rest as on the CPU.
fn costs([(small, few), (large, many)]: [(f64, f64); 2], splats: f64, known: StepCosts) -> StepCosts {
    let most = many / large.max(1.0);
    let secs_per_pixel = ((many - few) / (large - small).max(1.0)).clamp(0.1 * most, most);
    let rest = (many - large * secs_per_pixel).max(0.05 * many);
    let of_splats = splats * StepCosts::CPU.secs_per_splat;
    let share = of_splats / (of_splats + StepCosts::CPU.fixed_secs);
    StepCosts {
        fixed_secs: (1.0 - share) * rest,
        secs_per_pixel,
        secs_per_splat: share * rest / splats.max(1.0),
        ..known
    }
}
