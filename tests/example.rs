//! The example, run on a tiny sample capture.

#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

#[allow(dead_code, reason = "its main is not called")]
#[path = "../examples/train_and_export.rs"]
mod train_and_export;

use litetex_exporters::{ReadLimits, read_asset};
use litetex_gs::run::Summary;
use litetex_gs::sample::{SampleOptions, write_sample};

#[test]
fn a_capture_becomes_a_run_and_a_file_in_forty_lines() {
    let dir = tempfile::tempdir().unwrap();
    let [capture, run, glb] = ["capture", "run", "scene.glb"].map(|name| dir.path().join(name));
    let options = SampleOptions {
        views: 9,
        width_px: 48,
        height_px: 32,
        supersampling: 1,
        points: 150,
        ..SampleOptions::default()
    };
    write_sample(&capture, &options).unwrap();
    train_and_export::train_and_export(&capture, &run, &glb, 30).unwrap();
    let summary = Summary::read(&run.join("summary.json")).unwrap();
    assert!(summary.quality.unwrap().evaluation.psnr > 10.0);
    let asset = read_asset(&glb, &ReadLimits::default()).unwrap().asset;
    assert!((1..=summary.size.splats).contains(&asset.num_splats()) && asset.cameras.len() == 9);
    let source = include_str!("../examples/train_and_export.rs");
    assert!(source.lines().count() <= 40, "{} lines", source.lines().count());
}
