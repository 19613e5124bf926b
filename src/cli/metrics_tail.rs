//! Reads the end of `metrics.jsonl` as it grows: how far a training is, as its page shows it.

use super::curve::Curve;
use litetex_exporters::html::{SessionTraining, TrainingState};
use litetex_exporters::regular_file_bytes;
use serde_json::Value;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::PathBuf;

/// Steps reported last by which the time left is estimated.
const RATE_LINES: usize = 20;

/// Most bytes that are taken in at a time, of lines that are a thousand bytes long.
const PIECE_BYTES: u64 = 16 << 20;

/// The progress of a run that another process writes.
pub struct MetricsTail {
    path: PathBuf,
    /// Bytes taken in: whole lines.
    read: u64,
    steps: u32,
    step: u32,
    splats: u64,
    texels: u64,
    curve: Curve,
    ended: Option<TrainingState>,
    /// Steps and training time, seconds, of the last lines.
    recent: VecDeque<(u32, f64)>,
}

impl MetricsTail {
    /// The metrics of a run of this many steps.
    pub fn new(path: PathBuf, steps: u32) -> Self {
        Self {
            path,
            read: 0,
            steps,
            step: 0,
            splats: 0,
            texels: 0,
            curve: Curve::default(),
            ended: None,
            recent: VecDeque::new(),
        }
    }

    /// Takes in the lines that are new, and tells where the training is; the state is `Running` unless the file says that it
    /// ended. `None` if there is no such file.
    pub fn read(&mut self) -> Option<SessionTraining> {
        // A pipe in its place would never open.
        let bytes = regular_file_bytes(&self.path).ok()?;
        let mut file = File::open(&self.path).ok()?;
        if bytes < self.read {
            // Of a new run, or one that was resumed from an earlier step.
            *self = Self::new(std::mem::take(&mut self.path), self.steps);
        }
        file.seek(SeekFrom::Start(self.read)).ok()?;
        let mut bytes = Vec::new();
        file.take(PIECE_BYTES).read_to_end(&mut bytes).ok()?;
        let is_full = bytes.len() as u64 == PIECE_BYTES;
        // Nothing of ours has lines as long as a piece; one that has is left out.
        let end = bytes.iter().rposition(|b| *b == b'\n').map(|at| at + 1);
        let whole = end.unwrap_or(if is_full { bytes.len() } else { 0 });
        self.read += whole as u64;
        for line in bytes[..whole].split(|b| *b == b'\n') {
            self.take(&serde_json::from_slice(line).unwrap_or_default());
        }
        Some(self.training())
    }

    fn take(&mut self, line: &Value) {
        let step = line["step"].as_u64().and_then(|step| u32::try_from(step).ok()).unwrap_or(self.step);
        match line["event"].as_str() {
            Some("started") => {
                self.ended = None;
                self.recent.clear();
                self.steps = line["steps"].as_u64().map_or(self.steps, |steps| steps as u32);
            }
            Some("step") => {
                let number = |name: &str| line[name].as_u64().unwrap_or_default();
                (self.splats, self.texels) = (number("splats"), number("texels"));
                self.curve.add_loss(step, line["loss"]["total"].as_f64().unwrap_or(f64::NAN));
                self.recent.extend(line["train_wall_secs"].as_f64().map(|secs| (step, secs)));
                if self.recent.len() > RATE_LINES {
                    self.recent.pop_front();
                }
            }
            Some("evaluated") => {
                self.curve.add_psnr(step, line["point"]["psnr_test"].as_f64().unwrap_or(f64::NAN));
            }
            Some("finished") if line["reason"] == "interrupted" => self.ended = Some(TrainingState::Stopped),
            Some("finished") => self.ended = Some(TrainingState::Finished),
            _ => return,
        }
        self.step = step;
    }

    fn training(&self) -> SessionTraining {
        let (curve_of, curve) = self.curve.shown();
        SessionTraining {
            step: self.step,
            steps: self.steps,
            eta_secs: self.eta_secs(),
            splats: self.splats,
            texels: self.texels,
            curve,
            curve_of: curve_of.to_owned(),
            state: self.ended.unwrap_or(TrainingState::Running),
            revision: 0,
        }
    }

    /// At the pace of the last lines.
    fn eta_secs(&self) -> Option<f64> {
        let (&(first, began), &(last, ended)) = (self.recent.front()?, self.recent.back()?);
        let pace = (ended - began) / f64::from(last.checked_sub(first).filter(|steps| *steps > 0)?);
        Some(pace * f64::from(self.steps.saturating_sub(self.step)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn lines_are_taken_in_as_they_come() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.jsonl");
        let mut tail = MetricsTail::new(path.clone(), 50);
        assert_eq!(tail.read(), None);
        let append = |text: &str| {
            let mut file = File::options().create(true).append(true).open(&path).unwrap();
            file.write_all(text.as_bytes()).unwrap();
        };
        append("{\"event\":\"started\",\"step\":0,\"steps\":40}\n");
        for step in [10, 20] {
            append(&format!(
                "{{\"event\":\"step\",\"step\":{step},\"loss\":{{\"total\":0.{step}}},\"splats\":7,\"texels\":9,\"train_wall_secs\":{step}.0}}\n"
            ));
        }
        append("{\"event\":\"step\",\"step\":30,\"lo");
        let found = tail.read().unwrap();
        assert_eq!((found.step, found.steps, found.splats, found.texels), (20, 40, 7, 9));
        assert_eq!((found.eta_secs, found.curve_of.as_str()), (Some(20.0), "loss"));
        assert_eq!(found.curve, [(10, 0.1), (20, 0.2)]);
        assert_eq!(found.state, TrainingState::Running);
        append("ss\":{\"total\":0.3}}\nnot JSON\n");
        for step in [20, 30] {
            append(&format!(
                "{{\"event\":\"evaluated\",\"step\":{step},\"point\":{{\"psnr_test\":{step}}}}}\n"
            ));
        }
        append("{\"event\":\"finished\",\"reason\":\"steps\"}\n");
        let found = tail.read().unwrap();
        assert_eq!((found.step, found.curve_of.as_str()), (30, "psnr"));
        assert_eq!(found.curve, [(20, 20.0), (30, 30.0)]);
        assert_eq!(found.state, TrainingState::Finished);
        // Resumed from an earlier step.
        std::fs::write(&path, "{\"event\":\"started\",\"step\":10,\"steps\":90}\n").unwrap();
        let found = tail.read().unwrap();
        assert_eq!((found.step, found.steps, found.state), (10, 90, TrainingState::Running));
        assert!(found.curve.is_empty());
    }
}
