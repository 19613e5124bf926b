//! `litetex render`: images of a scene from a named view, the test views or an orbit.

use super::colour_by::{ColourBy, Coloured};
use super::sources::{load_layers, open_photos, say_up};
use glam::DVec3;
use litetex_exporters::{Overview, SplatAsset, Transform};
use litetex_gs::backend::RenderedImage;
use litetex_gs::bake::{AssetViews, camera, model_from_asset, set_up};
use litetex_gs::camera::Camera;
use litetex_gs::camera::orbit::orbit;
use litetex_gs::capture::Capture;
use litetex_gs::console::values::{ImageSize, parse_image_size, whole};
use litetex_gs::console::{Log, Output, Table, check_free, device, path_text};
use litetex_gs::eval::quantised;
use litetex_gs::image::{
    Channels, JPEG_QUALITY, depth_range, grey_from_depth, rgb_from_normal, write_exr, write_jpeg, write_png,
};
use litetex_gs::model::{AdamState, Model};
use litetex_gs::run::{LayersPerPixel, image_name, render_options};
use litetex_gs::text::quoted;
use litetex_gs::verify::to_display;
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Error, Result, usage};
use serde_json::json;
use std::path::{Path, PathBuf};

/// File name of the poster.
const POSTER: &str = "poster.jpg";

/// Render views of a run or an asset as images
///
/// Writes PNG: colour in display space, depth as grey (near is white), normals as a normal map, alpha as grey. With
/// --exr, writes 32-bit floats: linear colour, depth in units of the capture, normals in camera axes (x right, y down,
/// z forward).
#[derive(clap::Args)]
#[command(group(clap::ArgGroup::new("which").required(true)))]
pub struct RenderArgs {
    /// Folder of a run, a checkpoint, or an asset
    #[arg(value_name = "RUN|CHECKPOINT|ASSET")]
    source: PathBuf,
    /// Render the view of the photo with this name
    #[arg(long, value_name = "NAME", group = "which")]
    view: Option<String>,
    /// Render all test views
    #[arg(long, group = "which")]
    test: bool,
    /// Render N views on a circle around what the cameras look at
    #[arg(long, value_name = "N", group = "which", value_parser = whole::<u32>(1..=100_000))]
    orbit: Option<u32>,
    /// Render the home view, at which pages open, as poster.jpg, to be shown until the scene is there
    #[arg(long, group = "which", conflicts_with_all = ["exr", "what", "colour_by", "capture"])]
    poster: bool,
    /// Folder to write into
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Overwrite existing files
    #[arg(long)]
    force: bool,
    /// What to render
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "colour")]
    what: Vec<What>,
    /// Colour each splat by its map or its SH degree, with a legend, instead of its appearance
    #[arg(long, value_name = "WHAT", visible_alias = "color-by", conflicts_with = "exr")]
    colour_by: Option<ColourBy>,
    /// Size: WIDTHxHEIGHT or the longer side [default: as trained]
    #[arg(long, value_name = "SIZE", value_parser = parse_image_size)]
    size: Option<ImageSize>,
    /// Also count, for these images, the splats whose support covers a pixel (rasterised) and those that are blended
    #[arg(long)]
    stats: bool,
    /// Write EXR in 32-bit float instead of PNG
    #[arg(long)]
    exr: bool,
    /// Render only the first N layers of a .ltgs file, or one inside glTF, which are a coarser scene; 0: its stand-in
    #[arg(long, value_name = "N", value_parser = whole::<u32>(0..=u64::MAX))]
    layers: Option<u32>,
    /// Use the views of this capture instead of the scene's own
    #[arg(long, value_name = "DIR")]
    capture: Option<PathBuf>,
    /// Where to compute
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = "Device")]
    device: String,
}

/// A quantity that can be rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum What {
    /// Colour
    #[value(alias = "color")]
    Colour,
    /// Expected depth along the optical axis
    Depth,
    /// Blended normals
    Normal,
    /// Coverage
    Alpha,
}

impl What {
    /// Inserted before the extension; empty for the colours of the scene itself.
    fn suffix(self, colour_by: Option<ColourBy>) -> String {
        match self {
            Self::Colour => colour_by.map_or(String::new(), |by| format!(".{}", by.name())),
            Self::Depth => ".depth".to_owned(),
            Self::Normal => ".normal".to_owned(),
            Self::Alpha => ".alpha".to_owned(),
        }
    }
}

/// Renders and says what was written.
pub fn run(args: &RenderArgs, log: &Log) -> Result<Output> {
    if args.out.is_file() {
        return Err(usage!("{}: is a file, expected a folder", args.out.display()));
    }
    if let Some(by) = args.colour_by.filter(|_| !args.what.contains(&What::Colour)) {
        return Err(usage!(
            "--colour-by {} needs colour images, and --what excludes them; add colour to --what, or drop --colour-by",
            by.name()
        ));
    }
    let (mut scene, trained) = load_layers(&args.source, args.layers, log)?;
    let of_capture = match &args.capture {
        Some(folder) => open_photos(&scene, trained.as_ref(), Some(folder), log)?,
        None => None,
    };
    let views: Box<dyn ViewSource> = match of_capture {
        Some(capture) => {
            move_to(&mut scene.asset, &capture);
            if scene.asset.provenance.up.is_empty() {
                set_up(&mut scene.asset, &capture.up);
            }
            Box::new(capture)
        }
        None => Box::new(AssetViews(scene.asset.cameras.clone())),
    };
    if args.orbit.is_some() {
        say_up(&scene.asset, log);
    }
    let up = DVec3::from_array(scene.asset.up_in_local());
    let jobs = if args.poster { vec![poster(args, &scene.asset)?] } else { jobs(args, views.as_ref(), up)? };
    let legend = args.colour_by.and_then(|by| by.legend_path(&args.out));
    let files: Vec<PathBuf> = jobs.iter().flat_map(|job| job.files.clone()).chain(legend).collect();
    check_free(&files, args.force)?;
    let train_views = views.indices(Split::Train);
    let cameras: Vec<Camera> = train_views.iter().map(|&view| views.camera(view)).collect();
    let model = model_from_asset(&scene.asset);
    let coloured = args.colour_by.map(|by| Coloured::new(by, &model, &cameras));
    let model = coloured.as_ref().map_or(&model, |coloured| &coloured.model);
    let written = render_all(args, &jobs, &scene.asset, model, log)?;
    let rendered: Vec<Camera> = jobs.iter().map(|job| job.camera).collect();
    let layers = args.stats.then(|| LayersPerPixel::of(model, &rendered)).flatten();
    let mut table = Table::default();
    table.row("scene", scene.path.display());
    table.row("images", format!("{written} in {}", args.out.display()));
    if let Some(layers) = &layers {
        table.row("layers per pixel", layers.words());
        table.row(
            "share of the largest 5 %",
            format!("{:.0} % of the rasterised", 100.0 * layers.share_of_largest),
        );
    }
    if let Some(coloured) = &coloured {
        if let Some(path) = coloured.write_legend(&args.out)? {
            table.row("legend", path.display());
        }
        coloured.add_rows(&mut table);
    }
    let mut found = json!({
        "scene": path_text(&scene.path),
        "out": path_text(&args.out),
        "images": written,
        "files": files.iter().map(|file| path_text(file)).collect::<Vec<_>>(),
    });
    if let Some(layers) = layers {
        found["layers_per_pixel"] = json!(layers);
    }
    Ok(Output::new("litetex-render/1", found, table))
}

/// Renders and writes the images; returns how many.
fn render_all(
    args: &RenderArgs,
    jobs: &[Job],
    asset: &SplatAsset,
    model: &Model,
    log: &Log,
) -> Result<usize> {
    let mut backend = device::open(&args.device, log)?;
    backend.upload(model, &AdamState::zeros(model))?;
    let geometry = args.what.iter().any(|w| matches!(w, What::Depth | What::Normal));
    let options = render_options(model, asset.background, geometry);
    let capture_from_local_scale = asset.capture_from_local.scale as f32;
    let mut written = 0;
    for job in jobs {
        let mut image = backend.render(&job.camera, &options)?;
        to_display(&mut image, asset.colour_space);
        for (what, path) in args.what.iter().zip(&job.files) {
            if let Some(folder) = path.parent() {
                std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
            }
            if args.exr {
                write_values(path, &image, *what, capture_from_local_scale)?;
            } else {
                write_image(path, &image, *what)?;
            }
            log.detail(&format!("wrote {}", path.display()));
            written += 1;
        }
    }
    Ok(written)
}

/// Moves a scene into the local frame of a capture's cameras. Formats without cameras carry no near distance either.
fn move_to(asset: &mut SplatAsset, capture: &Capture) {
    let frame = capture.capture_from_local;
    let frame = Transform::scaled_and_moved(frame.scale, frame.translation.to_array());
    let has_near = !asset.cameras.is_empty();
    *asset = asset.in_frame(&frame);
    if !has_near {
        asset.near = capture.near;
    }
}

/// A view to render.
struct Job {
    camera: Camera,
    /// A file for each of `--what`.
    files: Vec<PathBuf>,
}

impl Job {
    fn new(args: &RenderArgs, name: &Path, camera: &Camera) -> Self {
        let extension = if args.exr { "exr" } else { "png" };
        let stem = name.with_extension("");
        let file = |what: &What| {
            args.out.join(format!("{}{}.{extension}", stem.display(), what.suffix(args.colour_by)))
        };
        Self { camera: sized(camera, args.size), files: args.what.iter().map(file).collect() }
    }
}

/// The views that were requested; `up` is a direction of the local frame.
fn jobs(args: &RenderArgs, views: &dyn ViewSource, up: DVec3) -> Result<Vec<Job>> {
    if views.num_views() == 0 {
        return Err(usage!(
            "{}: the file has no cameras; name a capture with --capture",
            args.source.display()
        ));
    }
    let of_view = |v: usize| Job::new(args, &image_name(views, v), &views.camera(v));
    let mut all = 0..views.num_views();
    if let Some(name) = &args.view {
        return match all.clone().find(|&v| views.name(v) == name) {
            Some(view) => Ok(vec![of_view(view)]),
            None => {
                let some: Vec<String> = all.by_ref().take(5).map(|v| quoted(views.name(v))).collect();
                Err(usage!(
                    "--view {}: no such view among {}, for example {}",
                    quoted(name),
                    views.num_views(),
                    some.join(", ")
                ))
            }
        };
    }
    if let Some(count) = args.orbit {
        let cameras: Vec<Camera> = all.map(|v| views.camera(v)).collect();
        let orbit = orbit(&cameras, up, count);
        let named = |(i, camera)| Job::new(args, Path::new(&format!("orbit-{i:04}.png")), &camera);
        return Ok(orbit.into_iter().enumerate().map(named).collect());
    }
    let test: Vec<_> = views.indices(Split::Test).into_iter().map(of_view).collect();
    if test.is_empty() {
        return Err(usage!("--test: the scene has no test views"));
    }
    Ok(test)
}

/// The home view, as a JPEG file.
fn poster(args: &RenderArgs, asset: &SplatAsset) -> Result<Job> {
    let Some(home) = Overview::of(asset).home else {
        return Err(usage!(
            "--poster: {} has no cameras, so no home view; use --orbit",
            args.source.display()
        ));
    };
    let camera = sized(&camera(&asset.cameras[home]), args.size);
    Ok(Job { camera, files: vec![args.out.join(POSTER)] })
}

/// The camera at the size requested.
fn sized(camera: &Camera, size: Option<ImageSize>) -> Camera {
    match size {
        None => *camera,
        Some(ImageSize::Exact(w, h)) => camera.resized(w, h),
        Some(ImageSize::Longer(px)) => camera.with_longer_side(px),
    }
}

fn write_image(path: &Path, image: &RenderedImage, what: What) -> Result<()> {
    let (channels, bytes) = match what {
        What::Colour => (Channels::Rgb, quantised(&image.rgb)),
        What::Alpha => (Channels::Grey, quantised(&image.alpha)),
        What::Normal => (Channels::Rgb, rgb_from_normal(&image.normal)),
        What::Depth => {
            let range = depth_range(&image.depth).unwrap_or((1.0, 1.0));
            (Channels::Grey, grey_from_depth(&image.depth, range))
        }
    };
    if path.ends_with(POSTER) {
        return write_jpeg(path, image.width_px, image.height_px, &bytes, JPEG_QUALITY);
    }
    write_png(path, image.width_px, image.height_px, channels, &bytes)
}

fn write_values(path: &Path, image: &RenderedImage, what: What, to_capture: f32) -> Result<()> {
    let (channels, values) = match what {
        What::Colour => (Channels::Rgb, image.rgb.iter().map(|&v| linear_from_display(v)).collect()),
        What::Alpha => (Channels::Grey, image.alpha.clone()),
        What::Normal => (Channels::Rgb, image.normal.clone()),
        What::Depth => (Channels::Grey, image.depth.iter().map(|&z| z * to_capture).collect()),
    };
    let values: Vec<f32> = values;
    write_exr(path, image.width_px, image.height_px, channels, &values)
}

/// The sRGB curve (IEC 61966-2-1); EXR files hold linear colours.
fn linear_from_display(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}
