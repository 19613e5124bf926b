//! The summary of a training: assembled at its end, and printed as a short table.

use super::capture::Capture;
use super::config_file::RunConfig;
use super::memory::process_bytes;
use super::session::reason_name;
use super::sources::render_options;
use super::summary::{
    CaptureFigures, DiskBytes, Fps, GrowthFigures, Quality, Resumed, SCHEMA, Size, Summary, Times,
};
use super::table::Table;
use super::values::{format_bytes, format_count, format_duration};
use litetex_exporters::ltgs::{LtgsOptions, encode};
use litetex_exporters::{Provenance, Quality as AssetQuality};
use litetex_gs::backend::Backend;
use litetex_gs::eval::Evaluation;
use litetex_gs::model::{Model, TextureMap};
use litetex_gs::train::{Schedule, StopReason, TrainState};
use litetex_gs::verify::bake_checkpoint;
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Report, Result, Warning};
use std::time::Instant;

/// What a training ended with.
pub struct Outcome<'a> {
    pub config: &'a RunConfig,
    pub capture: &'a Capture,
    pub state: &'a TrainState,
    pub reason: StopReason,
    /// The last evaluation.
    pub evaluation: Option<&'a Evaluation>,
    pub resumed: Option<Resumed>,
    /// Training views whose loss stood out at the end.
    pub outlying_views: Vec<String>,
    pub warnings: Vec<Warning>,
}

impl Outcome<'_> {
    /// The summary; measures the speed of rendering and the sizes of files, unless the run was interrupted. `total_wall_secs` is left at 0
    /// for the caller, who began earlier.
    ///
    /// # Errors
    /// What rendering reports.
    pub fn summarise(self, backend: &mut dyn Backend) -> Result<Summary> {
        let Self { config, capture, state, reason, .. } = self;
        let train = &config.train;
        let schedule = Schedule::new(train, capture.indices(Split::Train).len());
        let fps = match reason {
            StopReason::Consumer => None,
            _ => measure_fps(backend, capture, state, train.background)?,
        };
        let memory_peak_bytes = process_bytes().map(|(_, peak)| peak);
        let disk = match reason {
            StopReason::Consumer => None,
            _ => disk_bytes(backend, state)?,
        };
        Ok(Summary {
            schema: SCHEMA.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: capture.name.clone(),
            capture: capture_figures(capture),
            resample: "area".to_owned(),
            background: train.background,
            device: backend.device(),
            seed: train.seed,
            steps: state.step,
            steps_planned: train.steps,
            profile: config.profile,
            policy: train.policy,
            components: train.active_components(),
            inactive: schedule.inactive(train),
            outlying_views: self.outlying_views,
            map_sides: map_sides(&state.model),
            stopped_by: reason_name(reason).to_owned(),
            quality: self.evaluation.map(Quality::from),
            size: Size {
                splats: state.model.num_splats(),
                texels: state.model.num_texels(),
                maps: state.model.size().maps,
                sh_coefficients: state.model.size().sh_coefficients,
                params: state.model.num_params(),
                params_published: state.model.size().params_published(),
                disk,
            },
            growth: GrowthFigures::new(&state.growth, train, state.step, schedule.densify_until),
            given_back: state.history.given_back.clone(),
            fps,
            curve: state.history.curve.clone(),
            resumed: self.resumed,
            memory_peak_bytes,
            warnings: self.warnings,
            time: Times {
                train_wall_secs: state.history.train_wall_secs,
                train_cpu_secs: state.history.train_cpu_secs,
                density_control_wall_secs: state.history.density_control_wall_secs,
                give_back_wall_secs: state.history.give_back_wall_secs,
                analysis_wall_secs: state.history.analysis_wall_secs,
                total_wall_secs: 0.0,
            },
        })
    }
}

/// Sizes of the scene's files; `None` for a scene that no file can hold.
fn disk_bytes(backend: &mut dyn Backend, state: &TrainState) -> Result<Option<DiskBytes>> {
    let model = (&state.model, &state.adam);
    let provenance = Provenance::default();
    let asset = bake_checkpoint(backend, model, Vec::new(), [0.0; 3], provenance, &mut Report::default())?;
    let bytes = |quality| {
        let file = encode(&asset, &LtgsOptions { quality, ..LtgsOptions::default() });
        file.ok().map(|file| file.len())
    };
    let both = bytes(AssetQuality::Balanced).zip(bytes(AssetQuality::Tiny));
    Ok(both.map(|(ltgs_balanced, ltgs_tiny)| DiskBytes { ltgs_balanced, ltgs_tiny }))
}

fn capture_figures(capture: &Capture) -> CaptureFigures {
    let sizes = (0..capture.num_views()).map(|v| capture.camera(v).pinhole);
    let (width_px, height_px) = sizes.fold((0, 0), |(w, h), p| (w.max(p.width_px), h.max(p.height_px)));
    CaptureFigures {
        path: capture.root.display().to_string(),
        format: capture.format.to_string(),
        train_views: capture.indices(Split::Train).len(),
        test_views: capture.indices(Split::Test).len(),
        width_px,
        height_px,
        points: capture.points.len(),
    }
}

/// Number of splats by the longer side of their map: none, 2, up to 4, 8, ... 256 texels.
fn map_sides(model: &Model) -> Vec<usize> {
    let mut counts = vec![0; TextureMap::SIDE_CLASSES + 1];
    model.textures.maps.iter().for_each(|map| counts[map.side_class()] += 1);
    counts
}

/// Times renders of the test views, 8 to 64, after one that does not count.
fn measure_fps(
    backend: &mut dyn Backend,
    capture: &Capture,
    state: &TrainState,
    background: [f32; 3],
) -> Result<Option<Fps>> {
    let test = capture.indices(Split::Test);
    let Some(&first) = test.first() else {
        return Ok(None);
    };
    let options = render_options(&state.model, background, false);
    backend.render(&capture.camera(first), &options)?;
    let renders = test.len().clamp(8, 64);
    let mut secs = Vec::new();
    for &view in test.iter().cycle().take(renders) {
        let camera = capture.camera(view);
        let start = Instant::now();
        backend.render(&camera, &options)?;
        secs.push(start.elapsed().as_secs_f64().max(1e-9));
    }
    secs.sort_by(f64::total_cmp);
    let figures = capture_figures(capture);
    Ok(Some(Fps {
        median: 1.0 / secs[renders / 2],
        p5: 1.0 / secs[(renders - 1) * 95 / 100],
        renders,
        width_px: figures.width_px,
        height_px: figures.height_px,
    }))
}

/// Prints the result as a short table.
pub fn print(s: &Summary) -> std::io::Result<()> {
    let mut table = Table::default();
    table.row("scene", &s.scene);
    table.row("steps", format!("{} ({})", format_count(u64::from(s.steps)), s.stopped_by));
    if let Some(q) = &s.quality {
        table.row("test PSNR", format!("{:.2} dB", q.psnr));
        table.row("test gradient-PSNR", format!("{:.2} dB", q.grad_psnr));
        table.row("test SSIM (3DGS / valid)", format!("{:.4} / {:.4}", q.ssim_3dgs, q.ssim_valid));
        table.row("test FLIP", format!("{:.4}", q.flip));
        if let Some(uncovered) = q.uncovered {
            table.row("uncovered test pixels", format!("{:.2} %", 100.0 * uncovered));
        }
    }
    table.row("splats", format_count(s.size.splats as u64));
    table.row("texels", format_count(s.size.texels as u64));
    table.row("parameters", format_count(s.size.params as u64));
    if let Some(growth) = s.growth.as_ref().and_then(GrowthFigures::line) {
        table.row("growth", growth);
    }
    if let Some(disk) = &s.size.disk {
        let [balanced, tiny] = [disk.ltgs_balanced, disk.ltgs_tiny].map(|bytes| format_bytes(bytes as u64));
        table.row(".ltgs file (balanced / tiny)", format!("{balanced} / {tiny}"));
    }
    table.row(
        "training time (wall / CPU)",
        format!("{} / {}", format_duration(s.time.train_wall_secs), format_duration(s.time.train_cpu_secs)),
    );
    table.row("total time", format_duration(s.time.total_wall_secs));
    if let Some(fps) = &s.fps {
        table.row("rendering", format!("{:.1} fps at {} x {}", fps.median, fps.width_px, fps.height_px));
    }
    table.row("device", format!("{}: {}", s.device.name, s.device.description));
    table.print()
}
