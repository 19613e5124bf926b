//! Whether a device can hold a run, checked before the first step so that a run does not fail halfway.

use super::config::TrainConfig;
use super::schedule::Schedule;
use crate::backend::{Backend, DeviceLimits, SceneShape};
use crate::model::{MAP_PARAMS, Model, ModelSize, TEXEL_PARAMS, splat_params};
use crate::views::{Split, ViewSource};
use crate::{Error, Result};

/// Checks the initial model, the images of all views at full size and the budget against the limits of the
/// device, and returns these. A run without a budget needs no further check: the limits bound its growth.
///
/// # Errors
/// [`Error::Usage`] if the model holds more than the budget allows, maps left aside; [`Error::Device`] listing everything
/// that does not fit, with counts, limits and remedies.
pub fn check_limits(
    config: &TrainConfig,
    backend: &dyn Backend,
    views: &dyn ViewSource,
    model: &Model,
) -> Result<DeviceLimits> {
    // Maps can be made smaller; splats would have to be removed.
    let bare = ModelSize { maps: 0, texels: 0, ..model.size() };
    let budget = Schedule::new(config, views.indices(Split::Train).len()).budget(config, 0);
    let bounds = [
        ("budget.max-splats", "splats", bare.splats, budget.max_splats),
        (config.params_bound(), "parameters besides its maps", bare.params(), budget.max_params),
    ];
    for (flag, what, holds, most) in bounds {
        if let Some(most) = most.filter(|most| holds > *most) {
            return Err(Error::Usage(format!(
                "the model already has {holds} {what}, more than {most}: raise {flag}, or start a new run"
            )));
        }
    }
    // Splats may gain SH bands.
    let sh_degree = config.sh_degree.max(model.splats.sh_degree());
    let shape = SceneShape { sh_degree, geometry: config.loss.needs_geometry() };
    let limits = backend.limits(shape);
    let mut misfits = of_model(model, &limits);
    misfits.extend(of_budget(config, sh_degree, &limits));
    misfits.extend(of_views(views, &limits));
    if misfits.is_empty() {
        return Ok(limits);
    }
    let name = backend.device().name;
    Err(Error::Device(format!(
        "{name} cannot hold this run: {}; or use another --device",
        misfits.join("; ")
    )))
}

fn of_model(model: &Model, limits: &DeviceLimits) -> Vec<String> {
    let (splats, texels) = (model.num_splats() as u64, model.num_texels() as u64);
    let mut out = Vec::new();
    if splats > limits.max_splats {
        let most = limits.max_splats;
        out.push(format!("the initial model has {splats} splats, at most {most} fit: lower max-points"));
    }
    if texels > limits.max_texels {
        let most = limits.max_texels;
        out.push(format!(
            "the initial model has {texels} texels, at most {most} fit: lower max-points, or choose smaller \
             maps (--policy)"
        ));
    }
    out
}

fn of_budget(config: &TrainConfig, sh_degree: u32, limits: &DeviceLimits) -> Vec<String> {
    let budget = &config.budget;
    let each = (splat_params(sh_degree) + MAP_PARAMS) as u64;
    let texels = limits.max_texels.saturating_mul(TEXEL_PARAMS as u64);
    let params = limits.max_splats.saturating_mul(each).saturating_add(texels);
    let bounds = [
        ("budget.max-splats", "splats", budget.max_splats, limits.max_splats),
        ("budget.max-texels", "texels", budget.max_texels, limits.max_texels),
        // The parameters of the largest model that fits.
        (config.params_bound(), "parameters", config.most_params(), params),
    ];
    let too_large = bounds.into_iter().filter_map(|(flag, what, asked, most)| {
        let asked = asked.filter(|&asked| asked as u64 > most)?;
        Some(format!("{flag} allows {asked} {what}, at most {most} fit: lower or omit it"))
    });
    too_large.collect()
}

fn of_views(views: &dyn ViewSource, limits: &DeviceLimits) -> Option<String> {
    let size = |view: usize| {
        let p = views.camera(view).pinhole;
        (p.width_px, p.height_px)
    };
    let all = 0..views.num_views();
    let large: Vec<usize> = all.filter(|&v| !limits.allows_image(size(v).0, size(v).1)).collect();
    let largest = large.iter().copied().max_by_key(|&v| u64::from(size(v).0) * u64::from(size(v).1))?;
    let (width, height) = size(largest);
    // The longer side of the largest image with this aspect ratio.
    let (longer, pixels) = (f64::from(width.max(height)), f64::from(width) * f64::from(height));
    let fitting = longer * (limits.max_pixels as f64 / pixels).sqrt().min(1.0);
    let fitting = (fitting as u32).min(limits.max_side_px);
    Some(format!(
        "{} of {} views are too large, the largest is {:?} with {width} x {height} = {} pixels, at most {} pixels \
         and {} per side fit: use --max-resolution {fitting}",
        large.len(),
        views.num_views(),
        views.name(largest),
        u64::from(width) * u64::from(height),
        limits.max_pixels,
        limits.max_side_px
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::TargetImage;
    use crate::camera::Camera;
    use crate::model::ModelSize;
    use crate::selftest::{SceneOptions, random_scene};
    use crate::train::density::Budget;
    use crate::views::Split;
    use std::sync::Arc;

    const LIMITS: DeviceLimits =
        DeviceLimits { max_side_px: 100, max_pixels: 6_000, max_splats: 50, max_texels: 400, max_pairs: 900 };

    struct Views(Vec<Camera>);

    impl ViewSource for Views {
        fn num_views(&self) -> usize {
            self.0.len()
        }
        fn name(&self, _: usize) -> &str {
            "a.png"
        }
        fn split(&self, _: usize) -> Split {
            Split::Test
        }
        fn camera(&self, view: usize) -> Camera {
            self.0[view]
        }
        fn target(&self, _: usize) -> Result<Arc<TargetImage>> {
            unreachable!("no photo is needed")
        }
    }

    fn model(num_splats: usize, map: (u16, u16)) -> Model {
        random_scene(&SceneOptions { num_splats, map_sizes: vec![map], ..SceneOptions::default() }).model
    }

    #[test]
    fn a_model_above_the_limits_is_reported_with_counts() {
        assert!(of_model(&model(50, (4, 2)), &LIMITS).is_empty());
        let both = of_model(&model(51, (4, 2)), &LIMITS);
        assert!(both[0].contains("51 splats, at most 50") && both[1].contains("408 texels, at most 400"));
    }

    #[test]
    fn budgets_above_the_limits_are_reported_with_counts() {
        let params = 50 * 60 + 3 * 400;
        let allowing = |budget| of_budget(&TrainConfig { budget, ..TrainConfig::default() }, 3, &LIMITS);
        let budget = |splats, texels, params| Budget {
            max_splats: Some(splats),
            max_texels: Some(texels),
            max_params: Some(params),
        };
        assert!(allowing(budget(50, 400, params)).is_empty());
        assert!(allowing(Budget::default()).is_empty(), "without a budget the device is the bound");
        let all = allowing(budget(51, 401, params + 1));
        for (text, parts) in
            all.iter().zip([["51 splats", "most 50"], ["401 texels", "most 400"], ["4201", "4200"]])
        {
            assert!(parts.iter().all(|part| text.contains(part)), "{text}");
        }
        assert_eq!(all.len(), 3);
    }

    #[test]
    fn too_large_images_are_reported_with_a_resolution_that_fits() {
        let camera = random_scene(&SceneOptions { num_splats: 0, ..SceneOptions::default() }).camera;
        let views = |sizes: &[(u32, u32)]| Views(sizes.iter().map(|&(w, h)| camera.resized(w, h)).collect());
        assert_eq!(of_views(&views(&[(100, 60), (60, 100)]), &LIMITS), None);
        let text = of_views(&views(&[(100, 60), (100, 61), (80, 80)]), &LIMITS).unwrap();
        for part in
            ["2 of 3 views", "80 x 80 = 6400 pixels", "6000 pixels", "100 per side", "--max-resolution 77"]
        {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(LIMITS.allows_image(77, 77) && !LIMITS.allows_image(78, 78));
        assert!(of_views(&views(&[(101, 2)]), &LIMITS).unwrap().contains("--max-resolution 100"));
    }

    #[test]
    fn budget_and_device_bound_the_model_together() {
        let budget = Budget { max_splats: Some(20), max_texels: None, max_params: Some(7) };
        let within = budget.within(&LIMITS);
        assert_eq!((within.max_splats, within.max_texels, within.max_params), (Some(20), Some(400), Some(7)));
        let within = Budget::default().within(&LIMITS);
        let allows = |splats, texels| within.allows(&ModelSize { splats, texels, ..ModelSize::default() });
        assert!(allows(50, 400) && !allows(51, 0) && !allows(0, 401));
    }

    #[test]
    fn a_model_with_more_splats_than_the_budget_allows_is_refused() {
        let backend = crate::cpu::CpuBackend::new(Some(1)).unwrap();
        let views = Views(vec![random_scene(&SceneOptions::default()).camera]);
        let model = model(20, (4, 4));
        let bare = ModelSize { maps: 0, texels: 0, ..model.size() }.params();
        let check = |budget: Budget| {
            let mut config = TrainConfig { budget, ..TrainConfig::default() };
            config.density.overshoot = 1.0;
            check_limits(&config, &backend, &views, &model)
        };
        // Texels beyond the budget are accepted: maps can be made smaller.
        let most = |splats, params| Budget { max_splats: splats, max_params: params, max_texels: Some(10) };
        for (refused, says) in [
            (most(Some(19), None), "20 splats, more than 19: raise budget.max-splats".to_owned()),
            (
                most(None, Some(bare - 1)),
                format!("{bare} parameters besides its maps, more than {}", bare - 1),
            ),
        ] {
            let error = check(refused).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(&says), "{error}");
        }
        assert!(check(most(Some(20), Some(bare))).is_ok());
    }
}
