//! The curve of a training for its page, with a bounded number of points.

/// Most points of a curve; where there are more, every second is left out.
const POINTS_MAX: usize = 512;

/// Losses and evaluations of a training.
#[derive(Default)]
pub struct Curve {
    losses: Vec<(u32, f64)>,
    /// Of this many losses one is kept, less one.
    skipped: usize,
    count: usize,
    psnrs: Vec<(u32, f64)>,
}

impl Curve {
    /// Takes in the loss of a step.
    pub fn add_loss(&mut self, step: u32, loss: f64) {
        self.count += 1;
        if !loss.is_finite() || !(self.count - 1).is_multiple_of(self.skipped + 1) {
            return;
        }
        self.losses.push((step, loss));
        if self.losses.len() > POINTS_MAX {
            let mut index = 0;
            self.losses.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.skipped = 2 * self.skipped + 1;
        }
    }

    /// Takes in an evaluation, dB.
    pub fn add_psnr(&mut self, step: u32, psnr: f64) {
        if psnr.is_finite() {
            self.psnrs.retain(|(before, _)| *before != step);
            self.psnrs.push((step, psnr));
        }
    }

    /// What to draw, and its name: evaluations make a curve from the second on.
    pub fn shown(&self) -> (&'static str, Vec<(u32, f64)>) {
        if self.psnrs.len() > 1 { ("psnr", self.psnrs.clone()) } else { ("loss", self.losses.clone()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_curves_lose_points_evenly() {
        let mut curve = Curve::default();
        for step in 1..=10_000 {
            curve.add_loss(step, f64::from(step));
        }
        let (name, points) = curve.shown();
        assert!(name == "loss" && (POINTS_MAX / 2..=POINTS_MAX).contains(&points.len()), "{}", points.len());
        let gap = points[1].0 - points[0].0;
        assert!(points.windows(2).all(|pair| pair[1].0 - pair[0].0 == gap));
        curve.add_psnr(10, 20.0);
        assert_eq!(curve.shown().0, "loss", "one evaluation makes no curve");
        curve.add_psnr(20, f64::NAN);
        curve.add_psnr(20, 21.0);
        curve.add_psnr(20, 22.0);
        assert_eq!(curve.shown(), ("psnr", vec![(10, 20.0), (20, 22.0)]));
    }
}
