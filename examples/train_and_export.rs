//! Trains a capture on the CPU, fills the folder of a run and writes the scene as a `.glb`, as `litetex train` and `export` do:
//! `cargo run --release --example train_and_export -- captures/fox runs/fox fox.glb`

use litetex_exporters::{WriteOptions, write_asset};
use litetex_gs::capture::Capture;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::run::{Recorder, RunConfig, RunFolder, Trained, fresh_state};
use litetex_gs::train::{Control, train};
use litetex_gs::{Error, Report, Result};
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> Result<()> {
    let paths: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [capture, run, glb] = &paths[..] else {
        return Err(Error::Usage("usage: train_and_export CAPTURE RUN FILE.glb".to_owned()));
    };
    train_and_export(capture, run, glb, 1000)
}

/// From a capture to a run and a file.
pub fn train_and_export(path: &Path, run: &Path, glb: &Path, steps: u32) -> Result<()> {
    let (started, mut report) = (Instant::now(), Report::default());
    let mut config = RunConfig { data: Some(path.to_owned()), ..RunConfig::default() };
    config.train.steps = steps;
    let capture = Capture::load(path, &config.capture)?;
    let state = fresh_state(&capture, &config, &mut report)?;
    let mut backend = CpuBackend::new(None)?;
    let folder = RunFolder::create(run, false)?;
    let mut recorder = Recorder::new(&folder, &capture, &config, 0, || started.elapsed().as_secs_f64())?;
    let (state, reason) = train(&config.train, &mut backend, &capture, state, &mut |event| {
        recorder.record(&event).map(|()| Control::Continue)
    })?;
    recorder.finish(&mut backend, &capture, (&state, reason), None, report)?;
    let asset = Trained::load(run)?.bake(&mut backend, &mut Report::default())?;
    write_asset(glb, &asset, &WriteOptions::default())?;
    Ok(())
}
