//! The training loop. It drives a [`Backend`](crate::backend::Backend) over a
//! [`ViewSource`](crate::views::ViewSource) and emits [`TrainEvent`]s; it knows no files, progress bars or
//! devices.

mod background;
pub mod charge;
pub mod checkpoint;
mod colour;
mod config;
pub mod density;
mod device_bound;
mod eta;
mod evaluate;
mod events;
mod expected_size;
mod exposure;
mod inactive;
mod limits;
mod order;
mod pacing;
mod prune;
mod random;
mod rates;
mod rounding_phase;
mod run;
mod schedule;
mod size_figures;
mod stages;
mod state;
mod step_costs;
mod targets;
mod window;

pub use config::{Backdrop, Exposure, LengthChange, RateConfig, TrainConfig, params_for_bytes};
pub use density::{FirstMap, Policy, PolicySpec, Rule, policies};
pub use device_bound::{DeviceBound, GROWTH_ENDED, SMALLER_IMAGES};
pub use eta::{Course, Remaining};
pub use evaluate::{Evaluated, evaluate};
pub use events::{Control, Sink, StopReason, TrainEvent};
pub use expected_size::ExpectedSize;
pub use exposure::Exposures;
pub use inactive::inactive;
pub use limits::check_limits;
pub use pacing::{MOST_STEPS, Timing};
pub use prune::Pruned;
pub use run::{NO_SNAPSHOT, photos_ahead, train, train_by};
pub use schedule::{MOST_PROBES, Schedule};
pub use stages::{StageSpan, stage_spans};
pub use state::{CurvePoint, SizeFigures, TrainHistory, TrainState};
pub use step_costs::StepCosts;
