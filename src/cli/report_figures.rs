//! What `litetex report` states besides images: the capture, files, settings and rights.

use super::sources::{read_limits, read_scene};
use litetex_exporters::{Format, Provenance, read_fallback};
use litetex_gs::capture::Capture;
use litetex_gs::console::{Interrupt, Log, device};
use litetex_gs::report_page::FileFigures;
use litetex_gs::run::{Summary, Trained, run_of_checkpoint};
use litetex_gs::text::{counted, format_count, format_duration};
use litetex_gs::train::TrainConfig;
use litetex_gs::verify::{
    BakedScene, EXPORT_VIEWS, ExpectedImages, QualityLimits, ReadBack, SceneRenderer, evenly_spread, verify,
};
use litetex_gs::views::{Split, ViewSource as _};
use litetex_gs::{Error, Result};
use std::path::{Path, PathBuf};

/// The capture of a run, or why there is none: one that is named must be there, the run's own may be gone.
///
/// # Errors
/// What the loader found in the named folder.
pub fn open_capture(
    trained: &Trained,
    named: Option<&Path>,
    log: &Log,
) -> Result<(Option<Capture>, Option<String>)> {
    match trained.open_capture(named) {
        Ok(capture) => {
            log.report(&capture.report);
            Ok((Some(capture), None))
        }
        Err(error) if named.is_some() => Err(error),
        Err(error) => {
            log.warn(
                "no-photos",
                &format!("the report is made without photos; --capture names their folder: {error}"),
                1,
            );
            Ok((None, Some("the capture of the run was not there when the report was made".to_owned())))
        }
    }
}

/// Compares files with the scene, without limits.
///
/// # Errors
/// What reading and rendering report.
pub fn figures_of_files(
    files: &[PathBuf],
    scene: &BakedScene,
    capture: Option<&Capture>,
    device: &str,
    log: &Log,
) -> Result<Vec<FileFigures>> {
    if files.is_empty() {
        return Ok(Vec::new());
    }
    let read: Vec<BakedScene> = files.iter().map(|file| read_scene(file, log)).collect::<Result<_>>()?;
    let interrupt = Interrupt::current();
    let go_on = || !interrupt.is_requested();
    let mut renderer = SceneRenderer::new(device::open(device, log)?, &go_on);
    let (tests, training): (Vec<_>, Vec<_>) = scene.asset.cameras.iter().cloned().partition(|c| c.held_out);
    let [training, tests] = [training, tests].map(|cameras| evenly_spread(&cameras, EXPORT_VIEWS));
    let expected = ExpectedImages::render(&mut renderer, &scene.asset, &training)?;
    let photos = capture.filter(|_| !tests.is_empty());
    let of_tests = photos.map(|_| ExpectedImages::render(&mut renderer, &scene.asset, &tests)).transpose()?;
    let mut figures = Vec::new();
    for (path, file) in files.iter().zip(&read) {
        let fallback = read_fallback(path, &read_limits()).map_err(Error::from)?;
        let textured = Format::of(path).map_err(Error::from)?.keeps_textures();
        let read_back = ReadBack { asset: &file.asset, textured, fallback: fallback.as_ref() };
        let verdict = verify(&mut renderer, &expected, read_back, None, QualityLimits::NONE)?;
        let on_tests = match (&of_tests, photos) {
            (Some(expected), Some(photos)) => {
                verify(&mut renderer, expected, read_back, Some(photos), QualityLimits::NONE)?.on_test_photos
            }
            _ => None,
        };
        let bytes = file.contents.iter().flat_map(|c| &c.sections).map(|section| section.bytes).sum();
        figures.push(FileFigures::new(path, bytes, (&verdict, on_tests), scene.asset.num_texels() > 0));
    }
    Ok(figures)
}

/// Settings and results of a run.
pub fn facts(trained: &Trained, capture: Option<&Capture>) -> Vec<(&'static str, String)> {
    let config = &trained.config;
    let train = &config.train;
    let summary = run_of_checkpoint(&trained.path)
        .and_then(|run| Summary::read(&run.join("summary.json")).ok())
        .filter(|summary| summary.steps == trained.step);
    let mut facts = Vec::new();
    let mut add = |name, value: String| facts.push((name, value));
    add("steps", steps(trained.step, train));
    add("profile, policy", format!("{}, {}", config.profile.name(), train.policy));
    add("seed", train.seed.to_string());
    let model = &trained.model;
    let [splats, texels, params] =
        [model.num_splats(), model.num_texels(), model.num_params()].map(|n| format_count(n as u64));
    add("model", format!("{splats} splats, {texels} texels, {params} parameters"));
    if let Some(capture) = capture {
        let split = [Split::Train, Split::Test].map(|split| capture.indices(split).len());
        add("views", format!("{} for training, {}", split[0], counted(split[1], "test view")));
    }
    let longest = trained.cameras.iter().max_by_key(|c| c.width_px.max(c.height_px));
    if let Some(camera) = longest {
        add("image size", format!("{} x {}", camera.width_px, camera.height_px));
    }
    if let Some(summary) = &summary {
        let time = &summary.time;
        add("device", format!("{}: {}", summary.device.name, summary.device.description));
        add("training time", format_duration(time.train_wall_secs));
        add("total time", format_duration(time.total_wall_secs));
        if let Some(quality) = &summary.quality {
            let figures = &quality.evaluation;
            add("test PSNR", format!("{:.2} dB", figures.psnr));
            add("test gradient-PSNR", format!("{:.2} dB", figures.grad_psnr));
            add("test SSIM (3DGS / valid)", format!("{:.4} / {:.4}", figures.ssim_3dgs, figures.ssim_valid));
            add("test FLIP", format!("{:.4}", figures.flip));
        }
        if let Some(layers) = &summary.layers_per_pixel {
            add("layers per pixel", layers.words());
        }
        add("trained with", format!("litetex {}", summary.version));
    }
    add("up", trained.up.words());
    add("scale", trained.scale_words());
    facts
}

/// The steps of a training, and what it lacks of the length that it last decided on.
fn steps(done: u32, train: &TrainConfig) -> String {
    let [done_text, last] = [done, train.last_step()].map(|steps| format_count(steps.into()));
    match done < train.last_step() {
        true => format!("{done_text} of {last}: the training was interrupted, or has not ended"),
        false => done_text,
    }
}

/// Title, author, licence and source.
pub fn metadata(facts: &Provenance) -> Vec<(&'static str, String)> {
    let or = |text: &str, option: &str| match text {
        "" => format!("not stated ({option} states it)"),
        text => text.to_owned(),
    };
    vec![
        ("title", or(&facts.title, "--title")),
        ("author", or(&facts.author, "--author")),
        ("licence", or(&facts.licence, "--licence")),
        ("source", or(&facts.source, "--source")),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_training_is_ended_by_its_plan() {
        let planned =
            |plan: &[[u32; 2]]| TrainConfig { steps: 115, plan: plan.to_vec(), ..TrainConfig::default() };
        let shorter = planned(&[[20, 137], [44, 71]]);
        assert_eq!(steps(71, &shorter), "71");
        assert_eq!(steps(70, &shorter), "70 of 71: the training was interrupted, or has not ended");
        // Negative controls: a plan that has grown, and none.
        assert!(steps(115, &planned(&[[20, 1200]])).starts_with("115 of 1,200: "));
        assert_eq!(steps(115, &planned(&[])), "115");
    }
}
