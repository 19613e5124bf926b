//! `litetex render`: images of a scene from named views, the test views or an orbit.

use super::capture::Capture;
use super::colour_by::{ColourBy, Coloured};
use super::devices;
use super::differences::to_display;
use super::frozen::Frozen;
use super::log::Log;
use super::orbit;
use super::session::image_name;
use super::table::Table;
use super::values::{ImageSize, parse_image_size};
use super::verify::photos;
use litetex_exporters::{SplatAsset, Transform};
use litetex_gs::backend::{RenderOptions, RenderedImage};
use litetex_gs::bake::{AssetViews, thaw};
use litetex_gs::camera::Camera;
use litetex_gs::eval::quantised;
use litetex_gs::image::{Channels, depth_range, grey_from_depth, rgb_from_normal, write_exr, write_png};
use litetex_gs::model::AdamState;
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Error, Result};
use std::path::{Path, PathBuf};

/// Render views of a run or an asset as images
///
/// Colour as PNG (display space), depth as grey (near is white), normals as the usual normal map, alpha as
/// grey. With --exr 32-bit float values: linear colour, depth in units of the capture, normals in camera
/// axes (x right, y down, z forward).
#[derive(clap::Args)]
#[command(group(clap::ArgGroup::new("which").required(true)))]
pub struct RenderArgs {
    /// Folder of a run, a checkpoint, or an asset
    #[arg(value_name = "RUN|CHECKPOINT|ASSET")]
    source: PathBuf,
    /// The view with this image name
    #[arg(long, value_name = "NAME", group = "which")]
    view: Option<String>,
    /// All test views
    #[arg(long, group = "which")]
    test: bool,
    /// N views on a circle around what the cameras look at
    #[arg(long, value_name = "N", group = "which", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    orbit: Option<u32>,
    /// Folder to write into; existing images of the same name are replaced
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// What to render
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "colour")]
    what: Vec<What>,
    /// Colour each splat by what it is made of, with a legend, instead of what it shows
    #[arg(long, value_name = "WHAT", visible_alias = "color-by", conflicts_with = "exr")]
    colour_by: Option<ColourBy>,
    /// Size: WIDTHxHEIGHT or the longer side [default: as trained]
    #[arg(long, value_name = "SIZE", value_parser = parse_image_size)]
    size: Option<ImageSize>,
    /// 32-bit float EXR instead of PNG
    #[arg(long)]
    exr: bool,
    /// Take the views of this capture instead of those that the scene carries
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
    /// Inserted before the extension; colour is the image itself, unless it tells something else.
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
pub fn run(args: &RenderArgs, log: &Log) -> anyhow::Result<()> {
    if args.out.is_file() {
        return Err(Error::Usage(format!("{}: is a file, expected a folder", args.out.display())).into());
    }
    if let Some(by) = args.colour_by.filter(|_| !args.what.contains(&What::Colour)) {
        return Err(Error::Usage(format!(
            "--colour-by {}: only colours can tell it, and --what leaves them out; add colour to --what, or leave \
             --colour-by out",
            by.name()
        ))
        .into());
    }
    let mut frozen = Frozen::load(&args.source, log)?;
    let of_capture = args.capture.as_deref().map(|folder| photos(&frozen, Some(folder), log)).transpose()?;
    let views: Box<dyn ViewSource> = match of_capture.flatten() {
        Some(capture) => {
            move_to(&mut frozen.asset, &capture);
            Box::new(capture)
        }
        None => Box::new(AssetViews(frozen.asset.cameras.clone())),
    };
    let jobs = jobs(args, views.as_ref())?;
    let train_views = views.indices(Split::Train);
    let cameras: Vec<Camera> = train_views.iter().map(|&view| views.camera(view)).collect();
    let whole = thaw(&frozen.asset);
    let coloured = args.colour_by.map(|by| Coloured::new(by, &whole, &cameras));
    let model = coloured.as_ref().map_or(&whole, |coloured| &coloured.model);
    let mut backend = devices::open(&args.device, log)?;
    backend.upload(model, &AdamState::zeros(model))?;
    let geometry = args.what.iter().any(|w| matches!(w, What::Depth | What::Normal));
    let options =
        RenderOptions { background: frozen.asset.background, sh_degree: model.splats.sh_degree, geometry };
    let to_capture = frozen.asset.capture_from_local.scale as f32;
    let mut written = 0;
    for (name, camera) in &jobs {
        let camera = sized(camera, args.size);
        let mut image = backend.render(&camera, &options)?;
        to_display(&mut image, frozen.asset.colour_space);
        for what in &args.what {
            let path = place(&args.out, name, &what.suffix(args.colour_by), args.exr)?;
            if args.exr {
                write_values(&path, &image, *what, to_capture)?;
            } else {
                write_image(&path, &image, *what)?;
            }
            log.detail(&format!("wrote {}", path.display()));
            written += 1;
        }
    }
    let mut table = Table::default();
    table.row("scene", frozen.path.display());
    table.row("images", format!("{written} in {}", args.out.display()));
    if let Some(coloured) = &coloured {
        if let Some(path) = coloured.write_legend(&args.out)? {
            table.row("legend", path.display());
        }
        coloured.tell(&mut table);
    }
    Ok(table.print()?)
}

/// Moves a scene to the frame that a capture's cameras stand in: that of a format without frames is the capture's own.
fn move_to(asset: &mut SplatAsset, capture: &Capture) {
    let frame = capture.capture_from_local;
    let frame = Transform::scaled_and_moved(frame.scale, frame.translation.to_array());
    let knows_near = !asset.cameras.is_empty();
    *asset = asset.in_frame(&frame);
    if !knows_near {
        asset.near = capture.near;
    }
}

fn jobs(args: &RenderArgs, capture: &dyn ViewSource) -> Result<Vec<(PathBuf, Camera)>> {
    if capture.num_views() == 0 {
        return Err(Error::Usage(format!(
            "{}: carries no cameras; name a capture with --capture",
            args.source.display()
        )));
    }
    let of_view = |v: usize| (image_name(capture, v), capture.camera(v));
    if let Some(name) = &args.view {
        let all = 0..capture.num_views();
        return match all.clone().find(|&v| capture.name(v) == name) {
            Some(view) => Ok(vec![of_view(view)]),
            None => {
                let some: Vec<&str> = all.take(5).map(|v| capture.name(v)).collect();
                Err(Error::Usage(format!(
                    "--view {name:?}: no such view among {}, for example {}",
                    capture.num_views(),
                    some.join(", ")
                )))
            }
        };
    }
    if let Some(count) = args.orbit {
        let cameras: Vec<Camera> = (0..capture.num_views()).map(|v| capture.camera(v)).collect();
        let orbit = orbit::cameras(&cameras, count)?;
        let named = |(i, camera)| (PathBuf::from(format!("orbit-{i:04}.png")), camera);
        return Ok(orbit.into_iter().enumerate().map(named).collect());
    }
    let test: Vec<_> = capture.indices(Split::Test).into_iter().map(of_view).collect();
    if test.is_empty() {
        return Err(Error::Usage("--test: the scene has no test views".to_owned()));
    }
    Ok(test)
}

fn sized(camera: &Camera, size: Option<ImageSize>) -> Camera {
    let p = camera.pinhole;
    match size {
        None => *camera,
        Some(ImageSize::Exact(w, h)) => camera.resized(w, h),
        Some(ImageSize::Longer(px)) => {
            let longer = f64::from(p.width_px.max(p.height_px));
            let side = |s: u32| (f64::from(s) * f64::from(px) / longer).round().max(1.0) as u32;
            camera.resized(side(p.width_px), side(p.height_px))
        }
    }
}

fn place(out: &Path, name: &Path, suffix: &str, exr: bool) -> Result<PathBuf> {
    let extension = if exr { "exr" } else { "png" };
    let stem = name.with_extension("");
    let path = out.join(format!("{}{}.{extension}", stem.display(), suffix));
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    }
    Ok(path)
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
