//! Selects the views to analyse, and combines their spectra into one schedule.

use super::fft::PlaneTransform;
use super::options::{FrequencyOptions, LEVELS, MAX_VIEWS, RuleSet, StartRule};
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
        let chosen = evenly_picked(&views.indices(Split::Train), MAX_VIEWS);
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
