//! The optimisation loop. It knows neither files nor progress bars nor devices: it drives a
//! [`Backend`](crate::backend::Backend) over a [`ViewSource`](crate::views::ViewSource) and emits
//! [`TrainEvent`]s.

mod config;
mod events;
mod state;

pub use config::{RateConfig, TexturePolicy, TrainConfig};
pub use events::{Control, StopReason, TrainEvent};
pub use state::{CurvePoint, TrainHistory, TrainState};

use crate::Result;
use crate::backend::Backend;
use crate::views::ViewSource;

/// Trains from `start` (a fresh state or a loaded checkpoint) to the end of `config.steps`, the time
/// limit or the consumer's stop, and returns the final state and why it ended.
///
/// # Errors
/// Whatever the backend or the views report; the consumer has then seen the last checkpoint.
pub fn train(
    _config: &TrainConfig,
    _backend: &mut dyn Backend,
    _views: &dyn ViewSource,
    _start: TrainState,
    _sink: &mut dyn FnMut(TrainEvent<'_>) -> Result<Control>,
) -> Result<(TrainState, StopReason)> {
    unreachable!("not written yet")
}
