//! Pruning after growth: takes from a model the splats, SH bands and texels whose loss costs less squared error than a threshold
//! per parameter (method 6.15).

mod accept;
mod costs;
mod cut;
mod merge;
mod offers;
mod prices;
mod round;
mod run;
#[cfg(test)]
mod tests;

pub use round::{Pruned, Round, TrainingViews};
