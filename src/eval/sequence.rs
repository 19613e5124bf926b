//! The error of a video over time: what flickers in the render and not in the truth.

use super::pair::ImagePair;

/// Sums over the pairs of consecutive frames.
#[derive(Clone, Debug, Default)]
pub struct SequenceError {
    last: Option<ImagePair>,
    sum: u64,
    values: u64,
}

impl SequenceError {
    /// Adds the next frame. A frame of another size begins a new sequence.
    pub fn add(&mut self, frame: ImagePair) {
        if let Some(last) = &self.last
            && (last.width_px, last.height_px) == (frame.width_px, frame.height_px)
        {
            for i in 0..frame.rendered.len() {
                let change = |now: &[u8], before: &[u8]| i64::from(now[i]) - i64::from(before[i]);
                let error = change(&frame.rendered, &last.rendered) - change(&frame.target, &last.target);
                self.sum += error.unsigned_abs();
            }
            self.values += frame.rendered.len() as u64;
        }
        self.last = Some(frame);
    }

    /// Mean of abs(change of the render - change of the photo) over all channels, 0 to 1; `None` without two frames.
    pub fn mean(&self) -> Option<f64> {
        (self.values > 0).then(|| self.sum as f64 / (255.0 * self.values as f64))
    }
}
