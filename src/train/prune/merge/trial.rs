//! Whether training makes up for merges: a model with them and one without are trained alike for a while, and compared.

use super::{Merging, Parts};
use crate::backend::{Backend, StepRequest, TargetImage};
use crate::model::TextureMap;
use crate::train::density::{SplatHistory, pixel_sizes};
use crate::train::prune::costs::SplatCosts;
use crate::train::prune::round::{RAISES, Round, TRIALS, TrainingViews, Trial};
use crate::{Error, Result};
use std::sync::Arc;

/// Merges that were kept.
pub struct Kept {
    /// For each splat the one that it was; of merged ones, the first.
    pub sources: Vec<u32>,
    /// Longer sides of the maps of merged splats, in texels; `None` for all others.
    pub sides: Vec<Option<u16>>,
    /// Parameters after.
    pub params: usize,
    /// Texels after.
    pub texels: usize,
    /// Predicted rise of the mean squared error.
    pub predicted: f64,
    /// That after the trial, of the views checked.
    pub measured: f64,
}

impl Kept {
    /// The histories of the splats, given those before. Their ceilings allow the maps of merged splats.
    pub fn histories(&self, before: &[SplatHistory]) -> Vec<SplatHistory> {
        let of = |(&source, &side): (&u32, &Option<u16>)| {
            let history = before[source as usize];
            side.map_or(history, |side| SplatHistory {
                band_checks: history.band_checks,
                bands_settled: history.bands_settled,
                ..SplatHistory::first(history.ceiling.max(side))
            })
        };
        self.sources.iter().zip(&self.sides).map(of).collect()
    }
}

impl Round {
    /// Merges neighbours of the model in the backend if training makes up for what that costs: if the error of the views
    /// `checked` rises by less than `threshold` for each parameter saved, or is still good enough. `costs` are
    /// those of its splats.
    ///
    /// # Errors
    /// Whatever the backend or the views report.
    pub fn merge(
        &self,
        backend: &mut dyn Backend,
        training: &mut TrainingViews<'_>,
        trial: &Trial,
        (order, checked): (&[usize], &[usize]),
        threshold: f64,
        costs: &[Option<SplatCosts>],
    ) -> Result<Option<Kept>> {
        let before = backend.save()?;
        // Merged splats take flushed values, all others keep theirs.
        let model = backend.read_flushed()?;
        let cameras: Vec<_> = order.iter().map(|&view| training.views.camera(view)).collect();
        let parts = Parts::of(&model, costs, &pixel_sizes(&model, &cameras), trial.limits);
        let slack = self.good_enough() - self.error(backend, training, checked)?;
        // The state, and its error after training without merges, read and measured if any are tried.
        let mut unmerged = None;
        let mut tried = Vec::new();
        for raise in RAISES {
            if tried.len() == TRIALS {
                break;
            }
            let merged = parts.merged_at(raise * threshold);
            if merged.len() == parts.len() {
                break;
            }
            let allowed = threshold * (parts.params() - merged.params()) as f64;
            if merged.cost() > allowed.max(slack) || tried.contains(&merged.params()) {
                continue;
            }
            tried.push(merged.params());
            let (stored, adam, without) = match &unmerged {
                Some(unmerged) => unmerged,
                None => {
                    let (stored, adam) = backend.read_back()?;
                    self.train(backend, training, trial, order, adam.step)?;
                    let without = self.error(backend, training, checked)?;
                    unmerged.insert((stored, adam, without))
                }
            };
            let Merging { model, adam, sources, is_merged } = merged.build(stored, adam)?;
            backend.upload(&model, &adam)?;
            let start = backend.save()?;
            self.train(backend, training, trial, order, adam.step)?;
            let error = self.error(backend, training, checked)?;
            if error <= (without + allowed).max(self.good_enough()) {
                backend.restore(&start)?;
                let side =
                    |(map, &is_merged): (&TextureMap, &bool)| is_merged.then(|| map.rows.max(map.cols));
                let sides = model.textures.maps.iter().zip(&is_merged).map(side).collect();
                let (params, texels) = (model.num_params(), model.num_texels());
                let [predicted, measured] = [merged.cost(), error - without];
                return Ok(Some(Kept { sources, sides, params, texels, predicted, measured }));
            }
        }
        if !tried.is_empty() {
            backend.restore(&before)?;
        }
        Ok(None)
    }

    /// Trains the model in the backend, on views in this order.
    fn train(
        &self,
        backend: &mut dyn Backend,
        training: &mut TrainingViews<'_>,
        trial: &Trial,
        order: &[usize],
        done: u32,
    ) -> Result<()> {
        let steps: Vec<(u32, usize)> =
            (done + 1..=done + trial.steps).zip(order.iter().copied().cycle()).collect();
        let batch_steps = training.targets.batch_steps(training.views, backend.batch_steps());
        for batch in steps.chunks(batch_steps) {
            let photos: Vec<Arc<TargetImage>> = batch
                .iter()
                .map(|&(_, view)| training.targets.get(training.views, view))
                .collect::<Result<_>>()?;
            let request = |(&(step, view), target)| StepRequest {
                step,
                camera: training.targets.camera(training.views, view),
                photo: Some(training.targets.photo(view)),
                target,
                background: self.background,
                sh_degree: self.sh_degree,
                loss: trial.loss,
                rates: trial.rates,
                accumulate_statistics: false,
                exposure: training.exposures.of(view),
            };
            let requests: Vec<StepRequest<'_>> =
                batch.iter().zip(photos.iter().map(Arc::as_ref)).map(request).collect();
            let mut done = 0;
            while done < requests.len() {
                done += match backend.steps(&requests[done..])?.len() {
                    0 => return Err(Error::Device(format!("{done} of {} steps were done", requests.len()))),
                    some => some,
                };
            }
        }
        Ok(())
    }
}
