//! What a training step costs, by pixels and splats, and what density control costs beside its renders. The constants only
//! share out what is measured while a run goes on; before it, they are all that is known.

/// Seconds that a step takes, and density control on the host.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepCosts {
    /// Whatever image and model.
    pub fixed_secs: f64,
    /// For each pixel of the image, with the model that the run starts from.
    pub secs_per_pixel: f64,
    /// For each splat of the model.
    pub secs_per_splat: f64,
    /// A density-control step, for each splat.
    pub density_secs_per_splat: f64,
    /// A round of pruning, for each splat.
    pub round_secs_per_splat: f64,
}

/// A pixel costs more where more splats cover it: by this power of their number. Measured on fox, 270 x 480: 0.7 where
/// `litetex` doubles its splats, 0.25 with `plain`.
const COVER_EXPONENT: f64 = 0.5;

impl StepCosts {
    /// CPU seconds of the `cpu` backend, fitted to measurements (2 cores, AVX-512). Measured, and what the model gives:
    /// 270 x 480 with 14,553 splats 0.119 s (0.091); 539 x 960 with 14,553 splats 0.29 s (0.25); 400 x 400 with 20,000
    /// splats before a mostly black background 0.065 s (0.11); 960 x 710 with 3,673 splats 0.24 s (0.31); 320 x 240 with
    /// 4,000 splats 0.06 s (0.053). How many splats cover a pixel is not known beforehand, so it cannot be much better.
    /// Renders take nearly all of the time of density control.
    pub const CPU: Self = Self {
        fixed_secs: 0.015,
        secs_per_pixel: 0.42e-6,
        secs_per_splat: 1.5e-6,
        density_secs_per_splat: 0.0,
        round_secs_per_splat: 0.0,
    };

    /// Seconds of a hardware GPU: 270 x 480 and 1067 x 1899 take 3.0 and 7.4 ms on an H200 (`docs/devices.md`). The host
    /// and the transfers take most of the time of density control. Measured, H100, microseconds a splat: 6, 9, 2 for a
    /// density-control step and 50, 140, 60 for a round (fox, 270 x 480 and 1067 x 1899; bonsai).
    pub const GPU: Self = Self {
        fixed_secs: 2.5e-3,
        secs_per_pixel: 2.3e-9,
        secs_per_splat: 1e-8,
        density_secs_per_splat: 8e-6,
        round_secs_per_splat: 1e-4,
    };

    /// Seconds of a step on an image of this size with this model, in a run that started with `initial` splats.
    pub fn step_secs(&self, pixels: f64, splats: f64, initial: f64) -> f64 {
        let cover = (splats / initial.max(1.0)).powf(COVER_EXPONENT);
        self.fixed_secs + pixels * self.secs_per_pixel * cover + splats * self.secs_per_splat
    }

    /// All costs times a factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            fixed_secs: factor * self.fixed_secs,
            secs_per_pixel: factor * self.secs_per_pixel,
            secs_per_splat: factor * self.secs_per_splat,
            density_secs_per_splat: factor * self.density_secs_per_splat,
            round_secs_per_splat: factor * self.round_secs_per_splat,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_within_a_factor_of_two_of_the_measured_ones() {
        for (pixels, splats, secs_per_step) in [
            (270 * 480, 14_553, 0.119),
            (539 * 960, 14_553, 0.29),
            (400 * 400, 20_000, 0.065),
            (960 * 710, 3_673, 0.24),
            (320 * 240, 4_000, 0.06),
        ] {
            let splats = f64::from(splats);
            let ratio = StepCosts::CPU.step_secs(f64::from(pixels), splats, splats) / secs_per_step;
            assert!((0.5..2.0).contains(&ratio), "{pixels} pixels, {splats} splats: {ratio}");
        }
    }
}
