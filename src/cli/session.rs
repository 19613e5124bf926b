//! The command line's consumer of training events: a [`Recorder`] fills the run folder; this updates the progress display and
//! the preview, and tells the trainer whether to continue.

use super::live_view::Preview;
use super::progress::{Progress, StepFigures};
use litetex_gs::Result;
use litetex_gs::console::{Interrupt, Log};
use litetex_gs::run::Recorder;
use litetex_gs::text::{counted, format_duration, shell_word};
use litetex_gs::train::{Control, TrainEvent};
use std::path::Path;

/// The files and the display of one training.
pub struct Session<'a> {
    /// What fills the run folder.
    pub recorder: Recorder<'a>,
    /// What shows the model while it trains.
    pub preview: Option<Preview>,
    log: &'a Log,
    interrupt: Interrupt,
    progress: Progress<'a>,
}

impl<'a> Session<'a> {
    /// A session around a recorder.
    pub fn new(recorder: Recorder<'a>, progress: Progress<'a>, log: &'a Log, interrupt: Interrupt) -> Self {
        Self { recorder, preview: None, log, interrupt, progress }
    }

    /// Handles one event.
    ///
    /// # Errors
    /// What writing files reports.
    pub fn handle(&mut self, event: TrainEvent<'_>) -> Result<Control> {
        let is_wanted = self.preview.as_mut().is_some_and(|preview| preview.handle(&event, self.log));
        self.show(&event);
        self.recorder.record(&event)?;
        match event {
            TrainEvent::Checkpoint { .. } => {
                let saved = self.recorder.checkpoint().unwrap_or(Path::new(""));
                self.log.detail(&format!("saved {}", saved.display()));
            }
            TrainEvent::Snapshot { step, model, wall_secs } => {
                if let Some(preview) = &mut self.preview {
                    preview.take(step, model, wall_secs);
                }
            }
            _ => {}
        }
        self.say_warnings();
        Ok(match (self.interrupt.is_requested(), is_wanted) {
            (true, _) => Control::Stop,
            (false, true) => Control::Snapshot,
            (false, false) => Control::Continue,
        })
    }

    /// Shows an event on the terminal.
    fn show(&mut self, event: &TrainEvent<'_>) {
        match event {
            TrainEvent::Started { device, train_views, test_views, .. } => self.log.info(&format!(
                "{} to train on, {test_views} held out, on {}: {}",
                counted(*train_views, "view"),
                device.name,
                device.description
            )),
            &TrainEvent::Step { step, loss, size, train_wall_secs, remaining_secs, .. } => self
                .progress
                .step(StepFigures { step, loss: loss.total, size, train_wall_secs, remaining_secs }),
            TrainEvent::Evaluated { step, evaluation, .. } => {
                self.progress.evaluated(*step, evaluation.psnr, evaluation.grad_psnr);
            }
            &TrainEvent::Planned { step, last_step, remaining } => {
                self.progress.set_steps(last_step);
                let left = format_duration(remaining.secs());
                self.log.detail(&format!("after step {step}: planned to end at step {last_step}, in {left}"));
            }
            TrainEvent::Finished { .. } => self.progress.finish(),
            _ => {}
        }
    }

    /// Prints the warnings that the recorder has gathered.
    pub fn say_warnings(&mut self) {
        for warning in self.recorder.take_warnings() {
            self.log.warn(&warning.code, &warning.message, warning.count);
        }
    }

    /// After a failure: reports what was saved and how to continue from there.
    pub fn report_how_to_continue(&self, run: &Path) {
        if let Some(saved) = self.recorder.checkpoint() {
            let message = format!(
                "the run failed after it was saved in {}; fix the cause and continue with: litetex train --resume {}",
                saved.display(),
                shell_word(run)
            );
            self.log.warn("saved-before-failure", &message, 1);
        }
    }
}
