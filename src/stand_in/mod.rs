//! Stand-ins: small models of a whole scene at the beginning of a `.ltgs` file, shown until enough of the scene itself has arrived.
//! They are made by pruning the scene and then trained on renders of it, with rounded numbers, so that no photos are needed.

mod arrival;
mod rendered;
mod start;

use crate::backend::RenderedImage;
use crate::bake::{asset_camera, bake, camera, model_from_asset};
use crate::camera::mean_and_reach;
use crate::constants::EXTENT_MARGIN;
use crate::model::Model;
use crate::rounding::LastRounding;
use crate::train::{Control, Policy, RateConfig, Timing, TrainConfig, TrainState, train_by};
use crate::verify::{Backends, Difference, FileRounder, SceneRenderer, evenly_spread, views_around};
use crate::{Error, Report, Result};
use glam::DVec3;
use litetex_exporters::ltgs::{LtgsOptions, Reader, StandIn, encode};
use litetex_exporters::{AssetCamera, ColourSpace, Provenance, Quality, ReadLimits, SplatAsset};
use rendered::RenderedViews;
use std::path::Path;
use std::time::Instant;

/// A stand-in takes one of this many parts of its file, at most (lab/choices.md 33).
const FILE_PARTS: u64 = 12;

/// Largest stand-in. A choice: at 10 Mbit/s it is there after a tenth of a second.
const BYTES_MAX: u64 = 128 << 10;

/// Smaller files have none: they arrive in the time that a stand-in is meant to save.
const SMALLEST_FILE_BYTES: u64 = 100_000;

/// Files of a wanted size may stay below it by one of this many parts, and have a stand-in all the same.
const TOO_SMALL_PARTS: u64 = 16;

/// What a stand-in adds to the metadata of a file, at most. Measured: 46 to 52.
const METADATA_BYTES: u64 = 64;

/// Views that a stand-in is trained on, at most.
const VIEWS: usize = 64;

/// Longer side of their images, px.
const SIDE_PX: u32 = 256;

/// Steps of the training.
const STEPS: u32 = 400;

/// Highest SH degree: without bands, 0.4 dB less; more take bytes from splats (lab/choices.md 33).
const SH_DEGREE_MAX: u32 = 1;

/// Splats that training begins with, for each byte: most are pruned (lab/choices.md 33).
const FIRST_SPLATS_PER_BYTE: f64 = 0.4;

/// Views at which a stand-in is compared with the scene.
const COMPARED_VIEWS: usize = 8;

/// About how many views are rendered for a stand-in.
pub const VIEWS_TO_RENDER: usize = STEPS as usize + 4 * VIEWS + 10 * COMPARED_VIEWS;

/// A stand-in that was made.
#[derive(Clone, Debug, PartialEq)]
pub struct MadeStandIn {
    /// A `.ltgs` file.
    pub file: Vec<u8>,
    /// Splats in it.
    pub splats: usize,
    /// PSNR against the scene at eight of the views that it was trained on, dB, without rounding to 8 bits.
    pub psnr: f64,
    /// Once this many bytes behind it have arrived, the scene itself looks better.
    pub until_bytes: u64,
    /// Bytes behind it.
    pub scene_bytes: u64,
}

impl MadeStandIn {
    /// As writers take it.
    pub fn as_written(&self) -> StandIn<'_> {
        StandIn { file: &self.file, until_bytes: self.until_bytes }
    }
}

/// Why a file has no stand-in.
pub type WhyNone = &'static str;

/// Most bytes of a stand-in for a file of `file_bytes`, the stand-in included.
fn most_bytes(file_bytes: u64) -> u64 {
    (file_bytes / FILE_PARTS).min(BYTES_MAX)
}

/// What a file of at most `file_bytes` with a stand-in has for the rest; all of it if the file is too small for one.
pub fn bytes_for_scene(file_bytes: u64) -> u64 {
    if file_bytes < SMALLEST_FILE_BYTES {
        return file_bytes;
    }
    file_bytes - most_bytes(file_bytes) - METADATA_BYTES
}

/// Makes the stand-in of a `.ltgs` file that has none, or says why it gets none; the same file and devices give the same bytes.
/// `max_bytes` is the size that the file with its stand-in may have, if one is wanted.
///
/// # Errors
/// What the devices report, [`Error::Interrupted`].
pub fn make(
    file: &[u8],
    max_bytes: Option<u64>,
    backends: &Backends<'_>,
) -> Result<Result<MadeStandIn, WhyNone>> {
    let whole_bytes = file.len() as u64 * FILE_PARTS / (FILE_PARTS - 1);
    let smallest = SMALLEST_FILE_BYTES - max_bytes.map_or(0, |_| SMALLEST_FILE_BYTES / TOO_SMALL_PARTS);
    if whole_bytes < smallest {
        return Ok(Err("the file is below 100 kB and arrives soon enough"));
    }
    let reader = Reader::open(file, Path::new(""), &ReadLimits::default())?;
    let scene = reader.decode()?.asset;
    if scene.colour_space != ColourSpace::SrgbRec709Display {
        return Ok(Err("the scene is in linear light"));
    }
    let all = if scene.cameras.is_empty() { views_around(&scene) } else { scene.cameras.clone() };
    let views: Vec<AssetCamera> = evenly_spread(&all, VIEWS).iter().map(reduced).collect();
    let mut renderer = SceneRenderer::new((backends.rendering)()?, backends.go_on);
    let images = renderer.images(&scene, &views)?;
    let most = most_bytes(whole_bytes.min(max_bytes.unwrap_or(whole_bytes)));
    let (model, rounding) = match trained(&scene, (&views, &images), most, backends) {
        // Of the sizes that users give, none is meant.
        Err(Error::Usage(_)) => return Ok(Err("the scene has no coarser form that is small enough")),
        outcome => outcome?,
    };
    let (small, stand_in) = encoded(&scene, &model, &rounding)?;
    if max_bytes.is_some_and(|max| (file.len() + stand_in.len()) as u64 + METADATA_BYTES > max) {
        return Ok(Err("the file would be larger than wanted"));
    }
    let compared = evenly_spread(&(0..views.len()).collect::<Vec<_>>(), COMPARED_VIEWS);
    let some: Vec<AssetCamera> = compared.iter().map(|&view| views[view].clone()).collect();
    let expected: Vec<RenderedImage> = compared.iter().map(|&view| images[view].clone()).collect();
    let mut psnr = |asset: &SplatAsset| Ok(mean_psnr(&renderer.images(asset, &some)?, &expected));
    let own = psnr(&small)?;
    let (until_bytes, scene_bytes) = arrival::better_from(&reader, &scene, own, &mut psnr)?;
    Ok(Ok(MadeStandIn { file: stand_in, splats: small.num_splats(), psnr: own, until_bytes, scene_bytes }))
}

/// The view with a smaller image.
fn reduced(view: &AssetCamera) -> AssetCamera {
    let longer_side_px = view.width_px.max(view.height_px).min(SIDE_PX);
    asset_camera(&view.name, false, &camera(view).with_longer_side(longer_side_px))
}

/// Trains a few of the scene's splats until they look like all of them in a file of at most `max_bytes`.
fn trained(
    scene: &SplatAsset,
    (views, images): (&[AssetCamera], &[RenderedImage]),
    max_bytes: u64,
    backends: &Backends<'_>,
) -> Result<(Model, LastRounding)> {
    let count = (FIRST_SPLATS_PER_BYTE * max_bytes as f64) as usize;
    let sh_degree = scene.sh_degree.min(SH_DEGREE_MAX);
    let start = model_from_asset(&start::first_splats(scene, views, (count, sh_degree), backends)?);
    let rates = RateConfig::default();
    let extent = extent(views);
    let config = TrainConfig {
        steps: STEPS,
        sh_degree,
        policy: Policy::Plain,
        max_bytes: Some(max_bytes),
        filter: start.filter,
        background: scene.background,
        save_secs: 0,
        rates: RateConfig {
            position: rates.position * extent,
            position_end: rates.position_end * extent,
            ..rates
        },
        ..TrainConfig::default()
    };
    let frame = metadata_of(scene);
    let mut rounder =
        FileRounder::new(frame, max_bytes, backends.statistics, backends.go_on)?.measured_at(views);
    let rendered = RenderedViews::new(views, images);
    let mut backend = (backends.rendering)()?;
    let began = Instant::now();
    let now = || began.elapsed().as_secs_f64();
    let timing = Timing::by_steps(&now);
    let state = TrainState::fresh(start);
    let go_on = backends.go_on;
    let (state, _) =
        train_by(&timing, &config, backend.as_mut(), Some(&mut rounder), &rendered, state, &mut |_| {
            if go_on() { Ok(Control::Continue) } else { Err(Error::Interrupted) }
        })?;
    let rounding = state.rounded.ok_or_else(|| Error::Device("the stand-in was not rounded".to_owned()))?;
    Ok((state.model, rounding))
}

/// Extent of the scene by its cameras, which is 1 in local frames of our own trainings.
fn extent(views: &[AssetCamera]) -> f32 {
    let centres: Vec<DVec3> = views.iter().map(|view| camera(view).centre_in_local()).collect();
    let extent = EXTENT_MARGIN * mean_and_reach(&centres).1;
    if extent > 1e-6 && extent.is_finite() { extent as f32 } else { 1.0 }
}

/// What of the scene's metadata shapes images.
fn metadata_of(scene: &SplatAsset) -> SplatAsset {
    let &SplatAsset { near, filter, background, .. } = scene;
    SplatAsset { near, filter, background, ..SplatAsset::default() }
}

/// The file of a trained stand-in, and what a reader gets.
fn encoded(scene: &SplatAsset, model: &Model, rounding: &LastRounding) -> Result<(SplatAsset, Vec<u8>)> {
    let asset = bake(model, Vec::new(), scene.background, Provenance::default(), &mut Report::default());
    let options = LtgsOptions {
        quality: Quality::Custom,
        steps: Some(rounding.steps.steps()),
        per_splat: rounding.steps.per_splat(),
        ..LtgsOptions::default()
    };
    let file = encode(&asset, &options)?;
    let read = Reader::open(&file, Path::new(""), &ReadLimits::default())?.decode()?.asset;
    Ok((read, file))
}

fn mean_psnr(found: &[RenderedImage], expected: &[RenderedImage]) -> f64 {
    let each = found.iter().zip(expected).map(|(found, expected)| Difference::of("", found, expected).psnr());
    each.sum::<f64>() / found.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stand_in_and_its_entry_fit_into_what_is_taken_from_the_scene() {
        assert_eq!([0, 99_999].map(bytes_for_scene), [0, 99_999]);
        assert_eq!(bytes_for_scene(120_000), 110_000 - METADATA_BYTES);
        // Whatever the scene takes of its bytes, the stand-in that is made for it fits the rest.
        for file_bytes in [100_000_u64, 123_457, 5_000_000] {
            let scene = bytes_for_scene(file_bytes);
            let made = most_bytes(scene * FILE_PARTS / (FILE_PARTS - 1));
            assert!(scene + made + METADATA_BYTES <= file_bytes, "{file_bytes}");
            assert!(made > file_bytes / (FILE_PARTS + 1) || made == BYTES_MAX, "{file_bytes}: {made}");
        }
    }
}
