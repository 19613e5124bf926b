//! `litetex inspect`: what is in a capture, a run, a checkpoint or a PLY file.

use super::capture::{self, Capture};
use super::capture_args::CaptureArgs;
use super::eval::Trained;
use super::log::Log;
use super::run_folder::find_checkpoint;
use super::summary::Summary;
use super::table::{Table, print_json};
use super::values::{format_bytes, format_count};
use glam::{DVec3, Vec3};
use litetex_exporters::ply::read_ply;
use litetex_gs::dataset::read_ply_points;
use litetex_gs::model::Model;
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Error, Result};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Say what is in a capture, a run, a checkpoint or a PLY file
#[derive(clap::Args)]
pub struct InspectArgs {
    /// Folder of a capture or a run, checkpoint (.safetensors) or Gaussians (.ply)
    #[arg(value_name = "FILE|RUN|CAPTURE")]
    path: PathBuf,
    /// As JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    capture_args: CaptureArgs,
}

/// Prints what was found.
pub fn run(args: &InspectArgs, log: &Log) -> anyhow::Result<()> {
    let found = inspect(args, log)?;
    if args.json {
        return Ok(print_json(&found)?);
    }
    let mut table = Table::default();
    flatten("", &found, &mut table);
    Ok(table.print()?)
}

fn inspect(args: &InspectArgs, log: &Log) -> Result<Value> {
    let path = &args.path;
    if !path.exists() {
        return Err(Error::io(path, std::io::ErrorKind::NotFound.into()));
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    match extension.to_ascii_lowercase().as_str() {
        "safetensors" => checkpoint(path),
        "ply" if path.is_file() => ply(path),
        _ if is_run(path) => run_folder(path),
        _ => {
            let mut options = capture::LoadOptions::default();
            args.capture_args.apply(&mut options);
            let capture = capture::open(path, &options)?;
            log.report(&capture.report);
            Ok(of_capture(&capture))
        }
    }
}

fn is_run(path: &Path) -> bool {
    path.join("checkpoints").is_dir() || path.join("summary.json").is_file()
}

fn run_folder(path: &Path) -> Result<Value> {
    let mut found = json!({ "kind": "run" });
    if path.join("summary.json").is_file() {
        let mut summary = Summary::read(&path.join("summary.json"))?;
        if let Some(quality) = &mut summary.quality {
            // The table per view is in the file itself.
            quality.per_view.clear();
        }
        summary.curve.clear();
        found["summary"] = json!(summary);
    }
    if let Ok(file) = find_checkpoint(path) {
        found["checkpoint"] = checkpoint(&file)?;
    }
    Ok(found)
}

fn checkpoint(path: &Path) -> Result<Value> {
    let trained = Trained::load(path)?;
    Ok(json!({
        "kind": "checkpoint",
        "file": path,
        "bytes": std::fs::metadata(path).map_or(0, |m| m.len()),
        "step": trained.step,
        "capture": trained.config.data,
        "model": of_model(&trained.model),
    }))
}

fn of_model(model: &Model) -> Value {
    let mut histogram: BTreeMap<(u16, u16), usize> = BTreeMap::new();
    for map in &model.textures.maps {
        *histogram.entry((map.rows, map.cols)).or_default() += 1;
    }
    let histogram: serde_json::Map<String, Value> =
        histogram.into_iter().map(|((r, c), n)| (format!("{r}x{c}"), json!(n))).collect();
    let positions = model.splats.positions.as_chunks::<3>().0.iter();
    let in_capture = |p: &[f32; 3]| model.capture_from_local.transform_point(Vec3::from(*p).as_dvec3());
    let (low, high) = bounds(positions.map(in_capture));
    json!({
        "primitives": model.num_splats(),
        "texels": model.num_texels(),
        "params": model.num_params(),
        "sh_degree": model.splats.sh_degree,
        "maps": histogram,
        "bounds_in_capture": { "min": low, "max": high },
        "capture_from_local": {
            "scale": model.capture_from_local.scale,
            "translation": model.capture_from_local.translation.to_array(),
        },
        "near": model.near,
    })
}

/// Gaussians, or else a point cloud.
fn ply(path: &Path) -> Result<Value> {
    match read_ply(path) {
        Ok(contents) => {
            let asset = &contents.asset;
            let (low, high) = bounds(asset.positions.iter().map(|p| Vec3::from(*p).as_dvec3()));
            Ok(json!({
                "kind": "gaussians",
                "file": path,
                "primitives": asset.num_splats(),
                "sh_degree": asset.sh_degree,
                "surfels": contents.is_surfel,
                "thick": contents.num_thick,
                "bounds": { "min": low, "max": high },
                "comments": contents.comments,
            }))
        }
        Err(error) => match read_ply_points(path) {
            Ok(points) if !points.is_empty() => {
                let (low, high) = bounds(points.iter().map(|p| p.position_in_capture));
                Ok(json!({
                    "kind": "points",
                    "file": path,
                    "points": points.len(),
                    "bounds": { "min": low, "max": high },
                }))
            }
            _ => Err(from_exporters(error)),
        },
    }
}

fn from_exporters(error: litetex_exporters::Error) -> Error {
    use litetex_exporters::Error as E;
    match error {
        E::Io { path, source } => Error::io(path, source),
        E::Unsupported { path, what } | E::TooLarge { path, what } => Error::Unsupported { path, what },
        E::Invalid { path, what } => Error::InvalidInput { path, what },
        other => Error::Device(other.to_string()),
    }
}

fn bounds(points: impl Iterator<Item = DVec3>) -> ([f64; 3], [f64; 3]) {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (low, high) = points.fold(none, |(low, high), p| (low.min(p), high.max(p)));
    (low.to_array(), high.to_array())
}

fn of_capture(capture: &Capture) -> Value {
    let mut sizes: BTreeMap<String, usize> = BTreeMap::new();
    for v in 0..capture.num_views() {
        let p = capture.camera(v).pinhole;
        *sizes.entry(format!("{}x{}", p.width_px, p.height_px)).or_default() += 1;
    }
    let names =
        |split| -> Vec<&str> { capture.indices(split).into_iter().map(|v| capture.name(v)).collect() };
    json!({
        "kind": "capture",
        "path": capture.root,
        "format": capture.format,
        "views": capture.num_views(),
        "train_views": capture.indices(Split::Train).len(),
        "test_views": names(Split::Test),
        "sizes": sizes,
        "points": capture.points.len(),
        "capture_from_local": {
            "scale": capture.capture_from_local.scale,
            "translation": capture.capture_from_local.translation.to_array(),
        },
        "near": capture.near,
        "health": capture.health,
        "warnings": capture.report.warnings,
    })
}

/// Nested names become `a.b`; long lists are counted.
fn flatten(prefix: &str, value: &Value, table: &mut Table) {
    const SHOWN: usize = 8;
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let name = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
                flatten(&name, value, table);
            }
        }
        Value::Array(items) if items.is_empty() => {}
        Value::Array(items) if items.len() > SHOWN || items.iter().any(Value::is_object) => {
            let first: Vec<String> = items.iter().take(3).filter(|i| !i.is_object()).map(text).collect();
            let more = if first.is_empty() { String::new() } else { format!(": {}, ...", first.join(", ")) };
            table.row(prefix, format!("{}{more}", items.len()));
        }
        Value::Array(items) => {
            let all: Vec<String> = items.iter().map(text).collect();
            table.row(prefix, all.join(", "));
        }
        Value::Null => {}
        Value::Number(n) if prefix.ends_with("bytes") => {
            table.row(prefix, format_bytes(n.as_u64().unwrap_or(0)));
        }
        Value::Number(n) => {
            table.row(prefix, n.as_u64().map_or_else(|| n.to_string(), format_count));
        }
        other => {
            table.row(prefix, text(other));
        }
    }
}

fn text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}
