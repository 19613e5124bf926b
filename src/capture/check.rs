//! Checks all photos by decoding them: an error if one cannot be read, warnings about those that decode but are
//! useless or misleading for training.

use super::frame::median;
use super::loaded::{Capture, View};
use super::source::{first_names, first_paths};
use super::store::CheckedPhoto;
use crate::views::Split;
use crate::{Error, Report, Result};

/// Median share of the pixels left out above which masks are taken for inverted ones: objects that fill a tenth of their
/// photos are rarely masked.
const MASKED_SHARE_MAX: f64 = 0.9;

/// What to do about masks that leave out too much.
const INVERTED: &str = "white pixels count; if black ones should, the masks are inverted: --set capture.mask-invert=true (inspect: --mask-invert)";

impl Capture {
    /// Decodes every photo and mask once, so that a damaged one is found before training and not during it.
    /// What fits stays in the image cache.
    ///
    /// # Errors
    /// The first error in the order of the views, with the names of other views that have one.
    pub fn check_photos(&self) -> Result<Report> {
        let mut report = summed_up(&self.views, self.store.check_all()).map_err(|e| self.name_archive(e))?;
        if let Some(unpacked) = &self.unpacked {
            report.warnings.iter_mut().for_each(|w| w.message = unpacked.in_words(&w.message));
        }
        Ok(report)
    }
}

/// One report, or the first error, from the outcomes for each view.
fn summed_up(views: &[View], outcomes: Vec<Result<CheckedPhoto>>) -> Result<Report> {
    let unreadable: Vec<&str> =
        views.iter().zip(&outcomes).filter(|(_, o)| o.is_err()).map(|(v, _)| v.name.as_str()).collect();
    let mut report = Report::default();
    let (mut cut_off, mut masked_out, mut masked_shares) = (Vec::new(), Vec::new(), Vec::new());
    for (view, outcome) in views.iter().zip(outcomes) {
        let photo = outcome.map_err(|e| with_others(e, &unreadable[1..]))?;
        cut_off.extend(photo.cut_off);
        masked_shares.extend(photo.masked_share.map(|share| (view.name.as_str(), share)));
        if !photo.has_pixels && view.split == Split::Train {
            masked_out.push(view.name.as_str());
        }
    }
    if !cut_off.is_empty() {
        let what = format!(
            "{} JPEG files are truncated, and their missing part decodes as grey: {}; copy them again, or remove them",
            cut_off.len(),
            first_paths(&cut_off)
        );
        report.warn("photos-truncated", cut_off.len(), what);
    }
    if !masked_out.is_empty() {
        let what = format!(
            "the masks of {} training views exclude every pixel, so nothing is learnt from them: {}; {INVERTED}",
            masked_out.len(),
            first_names(masked_out.iter().copied())
        );
        report.warn("views-masked-out", masked_out.len(), what);
    }
    warn_of_nearly_all_masked(&masked_shares, &mut report);
    Ok(report)
}

/// Warns if masks, given by view and share of the pixels left out, leave out nearly everything in most of the views.
fn warn_of_nearly_all_masked(masked_shares: &[(&str, f64)], report: &mut Report) {
    let median_share = median(masked_shares.iter().map(|&(_, share)| share).collect()).unwrap_or(0.0);
    let over: Vec<&str> =
        masked_shares.iter().filter(|(_, share)| *share > MASKED_SHARE_MAX).map(|&(name, _)| name).collect();
    if median_share <= MASKED_SHARE_MAX {
        return;
    }
    let what = format!(
        "masks leave out more than {:.0} % of the pixels in {} of {} views, {:.1} % in the median: {}; {INVERTED}",
        100.0 * MASKED_SHARE_MAX,
        over.len(),
        masked_shares.len(),
        100.0 * median_share,
        first_names(over.iter().copied())
    );
    report.warn("views-nearly-masked-out", over.len(), what);
}

/// The same error, telling which other views have one.
fn with_others(error: Error, others: &[&str]) -> Error {
    if others.is_empty() {
        return error;
    }
    let more = |what: String| {
        let views = if others.len() == 1 { "other view" } else { "other views" };
        let names = first_names(others.iter().copied());
        format!("{what}; the same holds for {} {views}: {names}", others.len())
    };
    match error {
        Error::InvalidInput { path, what } => Error::InvalidInput { path, what: more(what) },
        Error::Unsupported { path, what } => Error::Unsupported { path, what: more(what) },
        other => other,
    }
}
