//! Bits of SH coefficients in SPZ files, chosen by rendering.

use super::difference::{Difference, EXPORT_VIEWS, evenly_spread, mse_to_photos};
use super::limits::QualityLimits;
use super::rate_distortion::are_within;
use super::renderer::SceneRenderer;
use crate::backend::RenderedImage;
use crate::{Error, Result};
use litetex_exporters::spz::{ShBits, SpzOptions, decode_spz, encode_spz};
use litetex_exporters::{AssetCamera, Quality, ReadLimits, SplatAsset};
use std::path::Path;

/// About how many views [`find_sh_bits`] renders for a scene with this many training views.
pub fn sh_bits_views(asset: &SplatAsset, quality: Quality, training: usize) -> usize {
    // Bits from 8 down to 5, then those of the higher degrees once more.
    let renders = if asset.sh_degree == 0 || quality == Quality::Lossless { 0 } else { 6 };
    renders * training.min(EXPORT_VIEWS)
}

/// The fewest bits with which rounding the SH coefficients alone keeps the limits of the quality, against the untextured scene:
/// the same for all degrees, then fewer for those above 1. `Lossless` takes all bits. `open` makes the renderer if it is needed.
///
/// # Errors
/// Those of the writer, what the device reports, or [`Error::Interrupted`].
pub fn find_sh_bits<'a>(
    asset: &SplatAsset,
    quality: Quality,
    open: impl FnOnce() -> Result<SceneRenderer<'a>>,
) -> Result<ShBits> {
    let training: Vec<AssetCamera> = asset.cameras.iter().filter(|c| !c.held_out).cloned().collect();
    if asset.sh_degree == 0 || quality == Quality::Lossless {
        return Ok(ShBits::MOST);
    }
    if training.is_empty() {
        return Ok(ShBits::default());
    }
    let views = evenly_spread(&training, EXPORT_VIEWS);
    let mut renderer = open()?;
    let mut untextured = asset.untextured();
    // Where the scene lies does not matter to SH, but may lie beyond the coordinates that the format holds.
    untextured.capture_from_local.translation = [0.0; 3];
    untextured.world_from_capture.translation = [0.0; 3];
    let expected = renderer.images(&untextured, &views)?;
    let (limits, mse_to_photos) = (QualityLimits::of(quality), mse_to_photos(asset));
    let mut keeps = |bits: ShBits| -> Result<bool> {
        let images = renderer.images(&with_rounded_sh(&untextured, bits)?, &views)?;
        let mse = |(found, expected): (&RenderedImage, &RenderedImage)| Difference::mse_of(found, expected);
        let errors: Vec<f64> = images.iter().zip(&expected).map(mse).collect();
        Ok(are_within(&errors, mse_to_photos, &limits))
    };
    let mut found = ShBits::MOST;
    let fewer: [fn(ShBits) -> ShBits; 2] = [
        |bits| ShBits { first: bits.first - 1, rest: bits.rest - 1 },
        |bits| ShBits { rest: bits.rest - 1, ..bits },
    ];
    for fewer in fewer.iter().take(asset.sh_degree.min(2) as usize) {
        while found.rest > 1 && keeps(fewer(found))? {
            found = fewer(found);
        }
    }
    Ok(found)
}

/// The scene with the SH coefficients above degree 0 of a file with this many bits.
fn with_rounded_sh(untextured: &SplatAsset, sh_bits: ShBits) -> Result<SplatAsset> {
    let options = SpzOptions { sh_bits, ..SpzOptions::default() };
    let (bytes, _) = encode_spz(untextured, &options)?;
    let read = decode_spz(&bytes, Path::new("scene.spz"), &ReadLimits::default()).map_err(Error::from)?;
    let mut rounded = untextured.clone();
    rounded.sh = read.asset.in_frame(&untextured.capture_from_local).sh;
    let width = rounded.sh.len() / rounded.num_splats().max(1);
    for (rounded, exact) in rounded.sh.chunks_mut(width).zip(untextured.sh.chunks(width)) {
        rounded[..3].copy_from_slice(&exact[..3]);
    }
    Ok(rounded)
}
