//! `litetex inspect`: the contents of a capture, a run, a checkpoint or an asset.

use super::capture_args::WholeCaptureArgs;
use super::sources::{check_kind, is_asset, read_scene};
use glam::{DVec2, DVec3, Vec3};
use litetex_exporters::{Describes, LayerSize, METRES, Quality, SplatAsset, Transform, UNKNOWN_SCALE};
use litetex_gs::bake::model_from_asset;
use litetex_gs::camera::Pinhole;
use litetex_gs::camera::up::Up;
use litetex_gs::capture::{Capture, LoadOptions, Reason, Verdict, read_ply_points};
use litetex_gs::console::{Log, Output, Table, path_text};
use litetex_gs::model::Model;
use litetex_gs::run::{LayersPerPixel, Summary, Trained, find_checkpoint, is_checkpoint};
use litetex_gs::text::{format_bytes, format_count, shortened};
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Result, input_file};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Show the contents of a capture, a run, a checkpoint or an asset
///
/// For a capture, the last lines are a verdict: good, usable or shoot again, with at most three reasons and what to do about each. At
/// most 60 of its photos are decoded for it. Of a scene with cameras, the layers per pixel are counted over up to 32 of them, on images
/// of at most 480 pixels.
#[derive(clap::Args)]
pub struct InspectArgs {
    /// Folder of a capture or a run, checkpoint (.safetensors) or asset
    #[arg(value_name = "FILE|RUN|CAPTURE")]
    path: PathBuf,
    #[command(flatten)]
    capture_args: WholeCaptureArgs,
}

/// Reads and prints.
pub fn run(args: &InspectArgs, log: &Log) -> Result<Output> {
    let found = inspect(args, log)?;
    let mut table = Table::default();
    flatten("", &found.json, &mut table);
    let mut json = found.json;
    let mut text = table.to_string();
    if let Some(verdict) = found.verdict {
        text.push_str(&in_words(&verdict));
        json["verdict"] = json!(verdict);
    }
    Ok(Output::new("litetex-inspect/1", json, text))
}

/// What was found, and the verdict where it is a capture.
struct Found {
    json: Value,
    verdict: Option<Verdict>,
}

impl From<Value> for Found {
    fn from(json: Value) -> Self {
        Self { json, verdict: None }
    }
}

/// A verdict for people.
fn in_words(verdict: &Verdict) -> String {
    let mut text = format!("\nverdict: {}\n", verdict.rating.words());
    for Reason { found, remedy, .. } in &verdict.reasons {
        text.push_str(&format!("  {found}: {remedy}\n"));
    }
    text
}

fn inspect(args: &InspectArgs, log: &Log) -> Result<Found> {
    let path = &args.path;
    input_file::check_exists(path)?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    match extension.to_ascii_lowercase().as_str() {
        "ply" if path.is_file() => ply(path, log).map(Found::from),
        _ if is_asset(path) => asset(path, log).map(Found::from),
        _ if is_checkpoint(path) => checkpoint(path).map(Found::from),
        _ if is_run(path) => run_folder(path).map(Found::from),
        extension => {
            if !["zip", "r3d", "json", "csv", "xml"].contains(&extension) && !Capture::is_pose_file(path) {
                check_kind(path, " or a capture (a folder, a ZIP archive, transforms.json)")?;
            }
            let mut options = LoadOptions::default();
            args.capture_args.apply(&mut options);
            let capture = Capture::load(path, &options)?;
            log.report(&capture.report);
            Ok(Found { json: of_capture(&capture), verdict: Some(capture.verdict()) })
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
            // For one line per view there is the file itself.
            quality.evaluation.per_view.clear();
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
        "file": path_text(path),
        "bytes": std::fs::metadata(path).map_or(0, |m| m.len()),
        "step": trained.step,
        "capture": trained.config.data.as_deref().map(path_text),
        "up": of_up(&trained.up),
        "scale": trained.scale_words(),
        "model": of_model(&trained.model),
        "layers_per_pixel": LayersPerPixel::of_stored(&trained.flushed()?, &trained.cameras),
    }))
}

fn of_model(model: &Model) -> Value {
    let sides = model.textures.maps.iter().map(|m| (m.rows, m.cols));
    let positions = model.splats.positions.as_chunks::<3>().0.iter();
    let in_capture = |p: &[f32; 3]| model.capture_from_local.transform_point(Vec3::from(*p).as_dvec3());
    let (low, high) = bounds(positions.map(in_capture));
    json!({
        "splats": model.num_splats(),
        "texels": model.num_texels(),
        "params": model.num_params(),
        "params_published": model.size().params_published(),
        "sh_degree": model.splats.sh_degree(),
        "sh_degrees": degree_counts(model.splats.sh_degrees()),
        "maps": histogram(sides),
        "bounds_in_capture": { "min": low, "max": high },
        "capture_from_local": {
            "scale": model.capture_from_local.scale,
            "translation": model.capture_from_local.translation.to_array(),
        },
        "near": model.near,
        "filter": model.filter,
    })
}

/// Number of splats of each SH degree.
fn degree_counts(degrees: &[u8]) -> [usize; 4] {
    let mut counts = [0; 4];
    degrees.iter().for_each(|&degree| counts[usize::from(degree)] += 1);
    counts
}

/// Number of maps of each size.
fn histogram(sides: impl Iterator<Item = (u16, u16)>) -> serde_json::Map<String, Value> {
    let mut counts: BTreeMap<(u16, u16), usize> = BTreeMap::new();
    sides.for_each(|sides| *counts.entry(sides).or_default() += 1);
    counts.into_iter().map(|((r, c), n)| (format!("{r}x{c}"), json!(n))).collect()
}

/// As [`of_model`]; the frame of an asset may be rotated too.
fn of_asset(asset: &SplatAsset) -> Value {
    let frame = |f: &Transform| json!({ "scale": f.scale, "rotation_wxyz": f.rotation, "translation": f.translation });
    let bounds_in = |f: &Transform| {
        let (low, high) = bounds(asset.positions.iter().map(|p| DVec3::from_array(f.transform_point(*p))));
        json!({ "min": low, "max": high })
    };
    let mut found = of_model(&model_from_asset(asset));
    found["bounds_in_capture"] = bounds_in(&asset.capture_from_local);
    found["capture_from_local"] = frame(&asset.capture_from_local);
    if !asset.world_from_capture.is_identity() {
        found["bounds_in_world"] = bounds_in(&asset.world_from_local());
        found["world_from_capture"] = frame(&asset.world_from_capture);
    }
    found
}

/// A PLY file of splats or, failing that, of points.
fn ply(path: &Path, log: &Log) -> Result<Value> {
    asset(path, log).or_else(|error| match read_ply_points(path) {
        Ok(points) if !points.is_empty() && !names_gaussians(path) => {
            let (low, high) = bounds(points.iter().map(|p| p.position_in_capture));
            Ok(json!({
                "kind": "points",
                "file": path_text(path),
                "points": points.len(),
                "bounds": { "min": low, "max": high },
            }))
        }
        _ => Err(error),
    })
}

/// Whether a PLY's header has properties that only splats have: it is then a damaged file of splats.
fn names_gaussians(path: &Path) -> bool {
    const HEADER_BYTES_MAX: u64 = 1 << 16;
    let mut header = Vec::new();
    let read = std::fs::File::open(path).and_then(|f| f.take(HEADER_BYTES_MAX).read_to_end(&mut header));
    let header = String::from_utf8_lossy(&header);
    let header = header.split("end_header").next().unwrap_or_default();
    read.is_ok() && [" f_dc_0", " rot_0", " scale_0"].iter().any(|name| header.contains(name))
}

/// An asset with the sizes of its sections: in bytes per splat or bits per texel where they describe these.
fn asset(path: &Path, log: &Log) -> Result<Value> {
    let scene = read_scene(path, log)?;
    let Some(contents) = &scene.contents else { return Ok(Value::Null) };
    let asset = &scene.asset;
    let bytes: u64 = contents.sections.iter().map(|s| s.bytes).sum();
    let mut sections = serde_json::Map::new();
    let mut sums = [0.0; 2];
    for section in &contents.sections {
        let size = section.bytes as f64;
        let mut entry = json!({ "bytes": section.bytes });
        match section.describes {
            Describes::Splats => {
                sums[0] += size;
                entry["bytes_per_splat"] = rounded(size / asset.num_splats().max(1) as f64);
            }
            Describes::Texels => {
                sums[1] += size;
                entry["bits_per_texel"] = rounded(8.0 * size / asset.num_texels().max(1) as f64);
            }
            Describes::Other => {}
        }
        sections.insert(section.name.clone(), entry);
    }
    Ok(json!({
        "kind": "asset",
        "file": path_text(path),
        "format": contents.format,
        "quality": contents.quality.map(Quality::name),
        "bytes": bytes,
        "bytes_per_splat": rounded(sums[0] / asset.num_splats().max(1) as f64),
        "bits_per_texel": rounded(8.0 * sums[1] / asset.num_texels().max(1) as f64),
        "sections": sections,
        "layers": of_layers(&contents.layers),
        "stand_in": contents.stand_in.map(|stand_in| json!({
            "bytes": stand_in.bytes,
            "splats": stand_in.splats,
            "until_bytes": stand_in.until_bytes,
        })),
        "model": of_asset(asset),
        "background": asset.background,
        "cameras": asset.cameras.len(),
        "layers_per_pixel": LayersPerPixel::of_stored(&model_from_asset(asset), &asset.cameras),
        "held_out": asset.cameras.iter().filter(|c| c.held_out).count(),
        "hash": format!("{:016x}", asset.hash()),
        "scale": asset.provenance.scale_words(),
        "provenance": asset.provenance,
    }))
}

/// Splats, texels and the bytes of each kind of block, by layer; null for formats without layers.
fn of_layers(layers: &[LayerSize]) -> Value {
    let of = |(layer, size): (usize, &LayerSize)| {
        let &LayerSize { splats, texels, geometry_bytes, sh_bytes, texel_bytes } = size;
        let found = json!({
            "splats": splats,
            "texels": texels,
            "bytes": geometry_bytes + sh_bytes + texel_bytes,
            "geometry_bytes": geometry_bytes,
            "sh_bytes": sh_bytes,
            "texel_bytes": texel_bytes,
        });
        ((layer + 1).to_string(), found)
    };
    if layers.is_empty() {
        return Value::Null;
    }
    Value::Object(layers.iter().enumerate().map(of).collect())
}

fn rounded(value: f64) -> Value {
    json!((value * 1000.0).round() / 1000.0)
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
    let pinholes = || (0..capture.num_views()).map(|v| capture.camera(v).pinhole);
    // Of points on the plane z = 0, for the bounds that points in space have.
    let range = |of: fn(&Pinhole) -> (f64, f64)| {
        let (low, high) = bounds(pinholes().map(|p| DVec2::from(of(&p)).extend(0.0)));
        json!({ "min": low[..2], "max": high[..2] })
    };
    let names =
        |split| -> Vec<&str> { capture.indices(split).into_iter().map(|v| capture.name(v)).collect() };
    json!({
        "kind": "capture",
        "path": path_text(&capture.root),
        "format": capture.format,
        "views": capture.num_views(),
        "train_views": capture.indices(Split::Train).len(),
        "test_views": names(Split::Test),
        "split_by": capture.split_by,
        "sizes": sizes,
        "focal_lengths_px": range(|p| (p.fx_px, p.fy_px)),
        "principal_points_px": range(|p| (p.cx_px, p.cy_px)),
        "undistortion": capture.undistortion,
        "points": capture.points.len(),
        "capture_from_local": {
            "scale": capture.capture_from_local.scale,
            "translation": capture.capture_from_local.translation.to_array(),
        },
        "up": of_up(&capture.up),
        "scale": capture.metric.map_or_else(|| UNKNOWN_SCALE.to_owned(), |program| format!("{METRES}: as the poses of {program} are")),
        "near": capture.near,
        "health": capture.health,
        "warnings": capture.report.warnings,
    })
}

/// Up in words and in numbers.
fn of_up(up: &Up) -> Value {
    let mut found = json!({ "words": up.words() });
    if let (Some(found), Value::Object(numbers)) = (found.as_object_mut(), json!(up)) {
        found.extend(numbers);
    }
    found
}

/// Adds a value to a table: nested names become `a.b`, and long lists a count.
fn flatten(prefix: &str, value: &Value, table: &mut Table) {
    const SHOWN: usize = 8;
    const NAME_CHARS: usize = 60;
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let name = shortened(name, NAME_CHARS);
                let name = if prefix.is_empty() { name.into_owned() } else { format!("{prefix}.{name}") };
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

/// A value in a cell; names from files may be of any length.
fn text(value: &Value) -> String {
    const SHOWN_CHARS: usize = 200;
    value.as_str().map_or_else(|| value.to_string(), |text| shortened(text, SHOWN_CHARS).into_owned())
}
