//! How the photo of each view becomes its target image: size, turn, mask, lens and focal length.

use super::decode::Recipe;
use super::loaded::View;
use super::masks::{self, Masked};
use super::options::{ExifTurn, LoadOptions};
use super::photos::{PhotoHeader, bounded, fit, photo_header, swaps_sides, turn_is_open};
use super::source::{SourceView, first_names};
use super::undistortion::{self, Kept};
use crate::camera::{Camera, Similarity};
use crate::text;
use crate::views::Split;
use crate::{Error, Report, Result};
use image::metadata::Orientation;
use rayon::prelude::*;

/// The recipes of all views.
///
/// # Errors
/// [`Error::InvalidInput`] if a photo does not fit its camera, [`Error::Unsupported`] if it is too large or in a form that is
/// not read. One that is damaged is warned of: decoding it fails.
pub(super) fn recipes(
    views: &[SourceView],
    kept: &[Kept],
    options: &LoadOptions,
    report: &mut Report,
) -> Result<Vec<Recipe>> {
    let headers: Vec<Headers> =
        views.par_iter().map(|view| Headers::of(view, options)).collect::<Result<_>>()?;
    let problems: Vec<&str> = headers.iter().filter_map(|headers| headers.problem.as_deref()).collect();
    if let Some(first) = problems.first() {
        let what = format!("{} of {} photos cannot be read, the first: {first}", problems.len(), views.len());
        report.warn("photos-unreadable", problems.len(), what);
    }
    let is_open = |(view, headers): &(&SourceView, &Headers)| {
        options.exif == ExifTurn::Auto && turn_is_open(&view.lens, &headers.photo)
    };
    let open: Vec<&SourceView> = views.iter().zip(&headers).filter(is_open).map(|(view, _)| view).collect();
    warn_of_open_turns(&open, report);
    let (with_mask, masked): (Vec<usize>, Vec<Masked<'_>>) = (0..views.len())
        .filter_map(|v| {
            let Headers { photo, turn, mask, .. } = headers[v];
            Some((v, Masked { name: &views[v].name, photo, turn, mask: mask? }))
        })
        .unzip();
    let mut mask_turns = vec![Orientation::NoTransforms; views.len()];
    with_mask.into_iter().zip(masks::turns(&masked, report)).for_each(|(v, turn)| mask_turns[v] = turn);
    (0..views.len())
        .map(|v| headers[v].recipe(&views[v], mask_turns[v], kept[v].focal_scale, options))
        .collect()
}

/// What the files of a view say.
struct Headers {
    photo: PhotoHeader,
    /// Why the photo cannot be read; it is taken to have the size of its camera then.
    problem: Option<String>,
    /// With the turn.
    photo_size: (u32, u32),
    /// The turn with which the photo is taken.
    turn: Orientation,
    /// `None` also of a mask that cannot be read, which is reported when it is decoded.
    mask: Option<PhotoHeader>,
}

impl Headers {
    fn of(view: &SourceView, options: &LoadOptions) -> Result<Self> {
        let path = view.photo_path();
        let pinhole = &view.lens.pinhole;
        let (photo, problem) = match photo_header(path) {
            Ok(photo) => (photo, None),
            Err(error @ Error::InvalidInput { .. }) if path.is_file() => {
                (PhotoHeader::assumed((pinhole.width_px, pinhole.height_px)), Some(error.to_string()))
            }
            Err(error) => return Err(error),
        };
        let (photo_size, turn) = fit(path, &view.name, &view.lens, &photo, options.exif)?;
        let mask = view.mask.as_ref().and_then(|mask| photo_header(mask).ok());
        Ok(Self { photo, problem, photo_size, turn, mask })
    }

    fn recipe(
        &self,
        view: &SourceView,
        mask_turn: Orientation,
        focal_scale: f64,
        options: &LoadOptions,
    ) -> Result<Recipe> {
        let Self { photo, photo_size, turn, mask, .. } = self;
        let photo_size = *photo_size;
        let recipe = Recipe {
            photo: view.photo_path().to_owned(),
            photo_size,
            turn: *turn,
            has_alpha: photo.has_alpha,
            photo_bytes: photo.colours_bytes(swaps_sides(*turn)),
            mask: view.mask.clone(),
            mask_turn,
            mask_bytes: mask.map_or(0, |mask| mask.mask_bytes(swaps_sides(mask_turn))),
            mask_invert: options.mask_invert,
            lens: view.lens,
            focal_scale,
            memory_bytes: options.photo_memory_bytes,
            size: bounded(photo_size, options.max_resolution),
            background: options.background,
            keep_alpha: options.keep_alpha,
        };
        let needed_bytes = recipe.working_bytes();
        if needed_bytes > options.photo_memory_bytes {
            return Err(unsupported!(
                &recipe.photo,
                "decoding this photo of {}x{} pixels takes {} of memory, and one photo may take {}; allow more with --set \
                 capture.photo-memory-bytes={needed_bytes} (inspect: --photo-memory {}GiB), or use smaller copies with --images",
                photo_size.0,
                photo_size.1,
                text::format_bytes(needed_bytes),
                text::format_bytes(options.photo_memory_bytes),
                needed_bytes.div_ceil(1 << 30)
            ));
        }
        Ok(recipe)
    }
}

/// Warns of photos whose EXIF data ask for a turn that their sides do not show.
fn warn_of_open_turns(open: &[&SourceView], report: &mut Report) {
    if !open.is_empty() {
        let masks = if open.iter().any(|view| view.mask.is_some()) { ", as are their masks" } else { "" };
        let what = format!(
            "the EXIF data of {} photos ask to turn or mirror them, and their sides do not show whether the poses were \
             computed from turned photos; they are taken as stored{masks}: {}; if views fit badly, --set capture.exif=apply turns \
             them (inspect: --exif apply), capture.exif=ignore confirms this",
            open.len(),
            first_names(open.iter().map(|view| &*view.name))
        );
        report.warn("photos-turned-by-exif", open.len(), what);
    }
}

/// The views, with cameras at the sizes of their target images.
pub(super) fn views(
    sources: &[SourceView],
    recipes: &[Recipe],
    splits: &[Split],
    capture_from_local: &Similarity,
) -> Vec<View> {
    sources
        .iter()
        .zip(recipes)
        .zip(splits)
        .map(|((view, recipe), &split)| View {
            name: view.name.clone(),
            split,
            camera: Camera {
                // In two steps: a scaled copy of the photo may have rounded sides.
                pinhole: undistortion::pinhole(recipe)
                    .resized(recipe.photo_size.0, recipe.photo_size.1)
                    .resized(recipe.size.0, recipe.size.1),
                camera_from_local: capture_from_local.rebase_camera(&view.camera_from_capture),
            },
        })
        .collect()
}
