//! Selects the views to analyse, and combines their spectra into one schedule.

use super::fft::PlaneTransform;
use super::options::{FrequencyOptions, LEAST_VIEWS, LEVELS, MAX_PIXELS, MAX_VIEWS, RuleSet, StartRule};
use super::schedule::FrequencySchedule;
use super::spectrum::{RINGS, Spectrum, Windows};
use super::{noise, significance, stages};
use crate::Result;
use crate::views::{Split, ViewSource};
use rayon::prelude::*;
use std::collections::BTreeMap;

impl FrequencySchedule {
    /// Analyses the training views of a capture. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] for invalid settings, and whatever reading the photos reports.
    pub fn analyse(views: &dyn ViewSource, options: &FrequencyOptions) -> Result<Self> {
        Self::analyse_by(views, options, &options.rules.set())
    }

    /// The analysis by these rules.
    pub(super) fn analyse_by(
        views: &dyn ViewSource,
        options: &FrequencyOptions,
        rules: &RuleSet,
    ) -> Result<Self> {
        options.check()?;
        let train = views.indices(Split::Train);
        let pixels: usize = train.iter().map(|&view| views.camera(view).pinhole.num_pixels()).sum();
        let chosen = evenly_picked(&train, num_analysed(train.len(), pixels));
        let mut transforms = BTreeMap::new();
        for &view in &chosen {
            let p = views.camera(view).pinhole;
            transforms
                .entry((p.width_px, p.height_px))
                .or_insert_with_key(|&(w, h)| PlaneTransform::new(w as usize, h as usize));
        }
        // Collected in the order of the views, so that sums do not depend on the threads.
        let spectra: Vec<Option<Spectrum>> = chosen
            .par_iter()
            .map(|&view| {
                let photo = views.target(view)?;
                let size = (photo.width_px, photo.height_px);
                match transforms.get(&size) {
                    Some(transform) => Ok(significance::spectrum(&photo, transform)),
                    None => Err(usage!(
                        "{:?}: the photo has {}x{} px, its camera another size",
                        views.name(view),
                        size.0,
                        size.1
                    )),
                }
            })
            .collect::<Result<_>>()?;
        let spectra: Vec<Spectrum> = spectra.into_iter().flatten().collect();
        Ok(schedule(&spectra, options, rules))
    }
}

/// How many of `views` views, with `pixels` pixels together, are analysed.
fn num_analysed(views: usize, pixels: usize) -> usize {
    let within = MAX_PIXELS as f64 * views as f64 / pixels.max(1) as f64;
    (within as usize).clamp(LEAST_VIEWS, MAX_VIEWS)
}

/// At most `most` of `views`, in order and evenly spaced.
fn evenly_picked(views: &[usize], most: usize) -> Vec<usize> {
    let num = views.len().min(most);
    // The middle of each of `num` equal parts.
    (0..num).map(|i| views[(2 * i + 1) * views.len() / (2 * num)]).collect()
}

/// The schedule for views with these spectra.
fn schedule(spectra: &[Spectrum], options: &FrequencyOptions, rules: &RuleSet) -> FrequencySchedule {
    let denoised = |view: &Spectrum| match rules.removes_noise {
        true => noise::denoised_rings(view),
        false => (view.rings(), 0.0),
    };
    let (rings, noise): (Vec<Vec<f64>>, Vec<f64>) = spectra.iter().map(denoised).unzip();
    let single: Vec<Windows> = rings.iter().map(|rings| Windows::new(rings.iter().copied())).collect();
    // The sum will do: the number of views cancels in every use.
    let mean = Windows::new((0..RINGS).map(|ring| rings.iter().map(|view| view[ring]).sum::<f64>()));
    let s_max = match rules.start {
        StartRule::Quantile(quantile) => stages::start_scale(&single, options, quantile),
        StartRule::Mean => stages::start_scale(std::slice::from_ref(&mean), options, 0.0),
    };
    let nodes = stages::nodes(&mean, s_max, LEVELS);
    let noise = stages::quantile(noise, 0.5).unwrap_or(0.0).sqrt();
    FrequencySchedule { s_max: nodes[0].1, nodes, views: spectra.len(), noise: stages::rounded(noise) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fewer_views_are_analysed_where_photos_are_large() {
        // Of the default size, even square ones; of 12 and of 48 megapixels.
        for (side, expected) in [(480, 50), (1_600, 50), (3_464, 10), (6_928, 8)] {
            assert_eq!(num_analysed(875, 875 * side * side), expected, "{side}");
        }
        assert_eq!(evenly_picked(&[3, 5, 7], num_analysed(3, 3 * 480 * 480)), [3, 5, 7]);
    }
}
