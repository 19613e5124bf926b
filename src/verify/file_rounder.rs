//! Rounds models in training as a `.ltgs` file of a wanted size will hold them (method 10).

use super::contribution::Contribution;
use super::difference::evenly_spread;
use super::rate_distortion::MEASURED_VIEWS;
use super::renderer::GoOn;
use super::scaled_steps::{FACTOR_LOG2, Scaled, factor_of_size, size_of};
use super::sensitivity::sensitivities;
use crate::backend::Backend;
use crate::bake::{bake, model_from_asset};
use crate::model::Model;
use crate::rounding::{Quantisation, Rounder};
use crate::text::{counted, format_bytes};
use crate::{Error, Report, Result};
use litetex_exporters::ltgs::{LtgsOptions, encode, oriented, rounded_in_place};
use litetex_exporters::{AssetCamera, Quality, SplatAsset};

/// Share of the wanted size that is aimed at before the last rounding: files grow and shrink a little while training goes on.
const AIMED_SHARE: f64 = 0.985;

/// Bytes for words of the header that are known only at the end.
const RESERVED_BYTES: u64 = 64;

/// A file that is smaller than wanted by more than this part of it is made with finer steps.
const TOO_SMALL: u64 = 25;

/// Bytes of the tables and headers of splats, however few. Measured on fox, bonsai and lego with 60 to 1,100 splats: 310 to 450.
const TABLE_BYTES: u64 = 400;

/// Bytes of a splat in the coarsest files, with a margin: 6 to 8 on these.
const SPLAT_BYTES: u64 = 10;

/// Finest steps, as a power of two of those by which all numbers cost the same: finer ones gain nothing that shows. Measured on 60,000
/// parameters of the fox, 240 pixels: 52 kB, 27.92 / 35.91 dB of PSNR and gradient-PSNR; with -2, 80 kB, 27.93 / 35.92 dB.
const FINEST_LOG2: f64 = 2.0;

/// Most times that the numbers of a file are rounded again.
const REPEATS_MAX: usize = 4;

/// Fewest splats of a file. A choice, not measured.
const SPLATS_MIN: u64 = 100;

/// Rounds models as a file of a wanted size.
pub struct FileRounder<'a> {
    /// The file but for splats: cameras, background, provenance.
    frame: SplatAsset,
    /// Views that sensitivities are measured at.
    views: Vec<AssetCamera>,
    /// Largest size.
    max_bytes: u64,
    /// Bytes that it has for splats.
    splat_bytes: u64,
    /// Opens the backend that measures sensitivities.
    statistics: &'a dyn Fn() -> Result<Box<dyn Backend>>,
    /// Whether to go on, asked before each view that is measured.
    go_on: GoOn<'a>,
}

/// Bytes for splats in a file of at most `max_bytes` that holds what `frame` does.
///
/// # Errors
/// [`Error::Usage`] with the smallest size that is possible.
pub fn bytes_for_splats(frame: &SplatAsset, max_bytes: u64) -> Result<u64> {
    let options = LtgsOptions { quality: Quality::Custom, ..LtgsOptions::default() };
    let frame_bytes = encode(frame, &options)?.len() as u64;
    let least = frame_bytes + TABLE_BYTES + SPLAT_BYTES * SPLATS_MIN;
    if max_bytes < least {
        return Err(usage!(
            "--max-size {}: too small for this capture, whose smallest file has {least} bytes, {frame_bytes} of them for cameras \
             and other metadata",
            format_bytes(max_bytes)
        ));
    }
    Ok(max_bytes - frame_bytes - TABLE_BYTES)
}

impl<'a> FileRounder<'a> {
    /// For a file of at most `max_bytes`, which holds what `frame` does, besides splats. `statistics` opens the backend that
    /// measures sensitivities, and `go_on` is asked before each view.
    ///
    /// # Errors
    /// As [`bytes_for_splats`].
    pub fn new(
        frame: SplatAsset,
        max_bytes: u64,
        statistics: &'a dyn Fn() -> Result<Box<dyn Backend>>,
        go_on: GoOn<'a>,
    ) -> Result<Self> {
        let splat_bytes = bytes_for_splats(&frame, max_bytes)?;
        let training: Vec<AssetCamera> = frame.cameras.iter().filter(|c| !c.held_out).cloned().collect();
        let views = evenly_spread(&training, MEASURED_VIEWS);
        Ok(Self { frame, views, max_bytes, splat_bytes, statistics, go_on })
    }

    /// Measures at these views, at most `MEASURED_VIEWS` of them, instead of the file's own.
    #[must_use]
    pub fn measured_at(self, views: &[AssetCamera]) -> Self {
        Self { views: evenly_spread(views, MEASURED_VIEWS), ..self }
    }

    /// The model as an asset; nothing may be left out.
    fn asset(&self, model: &Model) -> Result<SplatAsset> {
        let SplatAsset { cameras, background, provenance, world_from_capture, .. } = self.frame.clone();
        let asset = bake(model, cameras, background, provenance, &mut Report::default());
        let asset = SplatAsset { world_from_capture, ..asset };
        if asset.num_splats() < model.num_splats() {
            let what = counted(model.num_splats() - asset.num_splats(), "splat");
            return Err(Error::Device(format!(
                "{what} cannot be drawn: lower the learning rates, or report this with the capture"
            )));
        }
        Ok(asset)
    }

    /// Exponents and steps, up to a factor, by which rounding any number costs the same error of images.
    fn measured(&self, asset: &SplatAsset) -> Result<Quantisation> {
        let mut backend = (self.statistics)()?;
        let (base, exponents) =
            sensitivities(backend.as_mut(), asset, &self.views, self.go_on)?.rounding(asset);
        let contributions =
            Contribution::measure(backend.as_mut(), asset, &self.views, self.go_on)?.weight_px;
        Ok(Quantisation { base, factor_log2: 0.0, exponents, contributions })
    }
}

impl Rounder for FileRounder<'_> {
    fn splat_bytes(&self) -> f64 {
        self.splat_bytes as f64
    }

    fn choose(
        &mut self,
        model: &Model,
        before: Option<&Quantisation>,
        is_last: bool,
    ) -> Result<Quantisation> {
        let asset = oriented(&self.asset(model)?);
        let chosen = before.cloned().map_or_else(|| self.measured(&asset), Ok)?;
        let scaled = Scaled { base: chosen.base, per_splat: chosen.per_splat() };
        let most = self.max_bytes.saturating_sub(RESERVED_BYTES);
        let bytes = |factor| size_of(&asset, Quality::Balanced, scaled, factor);
        // Numbers are trained for quantisation steps: the file is made with the same, if it can be.
        if is_last && before.is_some() {
            let bytes = bytes(chosen.factor_log2)?;
            let is_finest = chosen.factor_log2 <= FINEST_LOG2;
            if bytes <= most && (is_finest || bytes >= most - most / TOO_SMALL) {
                return Ok(chosen);
            }
        }
        let share = if is_last { 1.0 } else { AIMED_SHARE };
        let found = factor_of_size(&asset, Quality::Balanced, scaled, (share * most as f64) as u64)?;
        let factor_log2 = match found {
            Ok(factor) => factor.max(FINEST_LOG2),
            Err(_) if !is_last => FACTOR_LOG2[1],
            Err(bytes) => {
                return Err(usage!(
                    "--max-size {}: the coarsest file of the model has {}; give more, or train a smaller model with \
                     --budget-params",
                    format_bytes(self.max_bytes),
                    format_bytes(bytes)
                ));
            }
        };
        Ok(Quantisation { factor_log2, ..chosen })
    }

    fn round(&self, model: &Model, steps: &Quantisation, is_last: bool) -> Result<Model> {
        let asset = self.asset(model)?;
        let once = |asset: &SplatAsset| rounded_in_place(asset, &steps.steps(), steps.per_splat());
        let mut rounded = once(&asset)?;
        // The grid of a file follows from its numbers, so that it may change once or twice with those that are rounded.
        for _ in 0..if is_last { REPEATS_MAX } else { 0 } {
            let again = once(&rounded)?;
            let is_settled = again == rounded;
            rounded = again;
            if is_settled {
                break;
            }
        }
        let mut out = model_from_asset(&rounded);
        for (map, before) in out.textures.maps.iter_mut().zip(&model.textures.maps) {
            if map.num_texels() == 0 {
                *map = *before;
            }
        }
        Ok(out)
    }
}
