//! Progress of training on standard error: a bar on a terminal, elsewhere a plain line every few seconds, or JSON.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use litetex_gs::console::Log;
use litetex_gs::memory::process_bytes;
use litetex_gs::text::{format_bytes, format_count, format_duration};
use litetex_gs::train::SizeFigures;
use serde_json::json;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Time between plain lines.
pub(super) const LINE_INTERVAL: Duration = Duration::from_secs(5);
/// Time between updates of the bar.
pub(super) const BAR_INTERVAL: Duration = Duration::from_millis(200);
/// Weight of the newest loss in the running mean shown: losses differ from view to view.
const LOSS_SMOOTHING: f64 = 0.05;

/// Figures of one step to show.
#[derive(Clone, Copy, Debug)]
pub struct StepFigures {
    pub step: u32,
    pub loss: f64,
    pub size: SizeFigures,
    pub train_wall_secs: f64,
    pub remaining_secs: f64,
}

/// Progress of one training.
pub struct Progress<'a> {
    log: &'a Log,
    bar: Option<ProgressBar>,
    steps: u32,
    /// First step of this process and the training time then; a resumed run has earlier ones.
    origin: Option<(u32, f64)>,
    loss: Option<f64>,
    psnr: Option<f64>,
    shown: Option<Instant>,
}

/// A bar of this length, where one can be shown.
pub(super) fn bar(log: &Log, length: u64) -> Option<ProgressBar> {
    let wants_bar = std::io::stderr().is_terminal() && !log.is_json() && !log.is_quiet();
    wants_bar.then(|| {
        let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{pos:>7}/{len} {wide_bar} {msg}") {
            bar.set_style(style);
        }
        bar
    })
}

impl<'a> Progress<'a> {
    /// A display for a training to `steps`, of which `done` are done.
    pub fn new(log: &'a Log, done: u32, steps: u32) -> Self {
        let bar = bar(log, steps.into());
        bar.iter().for_each(|bar| bar.set_position(done.into()));
        log.attach_bar(bar.clone());
        Self { log, bar, steps, origin: None, loss: None, psnr: None, shown: None }
    }

    /// Takes in another length of the run.
    pub fn set_steps(&mut self, steps: u32) {
        self.steps = steps;
        self.bar.iter().for_each(|bar| bar.set_length(steps.into()));
    }

    /// Takes in a step and shows it if it is time to.
    pub fn step(&mut self, figures: StepFigures) {
        let smoothed = self.loss.map_or(figures.loss, |old| old + LOSS_SMOOTHING * (figures.loss - old));
        self.loss = Some(smoothed);
        let (first, first_secs) = *self.origin.get_or_insert((figures.step, figures.train_wall_secs));
        let interval = if self.bar.is_some() { BAR_INTERVAL } else { LINE_INTERVAL };
        let due = self.shown.is_none_or(|at| at.elapsed() >= interval);
        if !due && figures.step != self.steps {
            return;
        }
        self.shown = Some(Instant::now());
        let secs = figures.train_wall_secs - first_secs;
        let rate = (secs > 0.0).then(|| f64::from(figures.step - first) / secs);
        self.show(&figures, smoothed, rate);
    }

    /// Logs an evaluation of the test views.
    pub fn evaluated(&mut self, step: u32, psnr: f64, grad_psnr: f64) {
        self.psnr = Some(psnr);
        self.log.event(
            "evaluated",
            &format!("step {step}: test PSNR {psnr:.2} dB, gradient-PSNR {grad_psnr:.2} dB"),
            json!({ "step": step, "psnr_test": psnr, "grad_psnr_test": grad_psnr }),
        );
    }

    /// Removes the bar.
    pub fn finish(&mut self) {
        self.log.attach_bar(None);
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }

    fn show(&self, f: &StepFigures, loss: f64, rate: Option<f64>) {
        let eta_secs = f.remaining_secs.max(0.0);
        let memory = process_bytes().map(|(now, _)| now);
        let parts = [
            rate.map(|r| if r >= 10.0 { format!("{r:.0} steps/s") } else { format!("{r:.2} steps/s") }),
            Some(format!("loss {loss:.4}")),
            self.psnr.map(|p| format!("test {p:.2} dB")),
            Some(format!("{} splats", format_count(f.size.splats as u64))),
            Some(format!("{} texels", format_count(f.size.texels as u64))),
            Some(format!("{} parameters", format_count(f.size.params as u64))),
            memory.map(format_bytes),
            Some(format!("ETA {}", format_duration(eta_secs))),
        ];
        let text = parts.into_iter().flatten().collect::<Vec<_>>().join(", ");
        if let Some(bar) = &self.bar {
            bar.set_position(u64::from(f.step));
            bar.set_message(text);
            return;
        }
        let fields = json!({
            "step": f.step, "steps": self.steps, "steps_per_sec": rate, "loss": loss, "psnr_test": self.psnr,
            "splats": f.size.splats, "texels": f.size.texels, "params": f.size.params, "memory_bytes": memory, "eta_secs": eta_secs,
        });
        self.log.event("progress", &format!("step {}/{}: {text}", f.step, self.steps), fields);
    }
}

impl Drop for Progress<'_> {
    fn drop(&mut self) {
        self.finish();
    }
}
