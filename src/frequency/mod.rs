//! Frequency schedule (method 7): derives from the photos' spectra how coarse training images may be at each time,
//! how large texture maps may be and how many splats the model should have.
//!
//! Times are fractions of T_r, the step at which the last stage begins (two thirds of the run by default). The
//! module knows views and photos, but neither the trainer nor backends nor files.

mod analyse;
mod budget;
mod fft;
#[cfg(test)]
mod fixtures;
mod noise;
mod options;
mod schedule;
mod significance;
mod spectrum;
mod stages;

pub use budget::SplatBudget;
pub use options::{CapRule, FrequencyOptions, RuleSet, ScaleRule, ScheduleRules, StartRule};
pub use schedule::{FrequencySchedule, SMALLEST_SIDE_PX};

#[cfg(test)]
mod tests;
