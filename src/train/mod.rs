//! The optimisation loop. It knows neither files nor progress bars nor devices: it drives a
//! [`Backend`](crate::backend::Backend) over a [`ViewSource`](crate::views::ViewSource) and emits
//! [`TrainEvent`]s.

pub mod checkpoint;
mod config;
pub mod density;
mod eta;
mod evaluate;
mod events;
mod limits;
mod order;
mod run;
mod schedule;
mod state;
mod targets;
mod window;

pub use config::{Policy, RateConfig, TrainConfig};
pub use evaluate::{Evaluated, evaluate};
pub use events::{Control, StopReason, TrainEvent};
pub use limits::check_limits;
pub use run::{Sink, train};
pub use schedule::Schedule;
pub use state::{CurvePoint, TrainHistory, TrainState};
