//! What rounds of pruning ask of a GPU: uploads of the model, photos sent, waits of the host, bytes read back, dispatches and
//! submissions of each batch of steps after which a run prunes, with its density-control step.
//!
//!     cargo run --release --package litetex-lab --example pruning_work -- CAPTURE LONGER_SIDE_PX STEPS DEVICE

use litetex_gs::capture::{Capture, LoadOptions};
use litetex_gs::console::device::open_gpu_backend;
use litetex_gs::run::{RunConfig, fresh_state};
use litetex_gs::train::{Control, TrainEvent, train};
use litetex_gs::{Report, Result, usage};

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [capture, longer_side_px, steps, device] = &args[..] else {
        return Err(usage!("usage: pruning_work CAPTURE LONGER_SIDE_PX STEPS DEVICE"));
    };
    let whole = |text: &str| text.parse().map_err(|_| usage!("{text}: expected a whole number"));
    let max_resolution = whole(longer_side_px)?;
    let mut config = RunConfig {
        capture: LoadOptions { max_resolution, ..LoadOptions::default() },
        ..RunConfig::default()
    };
    config.train.steps = whole(steps)?;
    config.train.eval_every = 0;
    let capture = Capture::load(capture.as_ref(), &config.capture)?;
    let state = fresh_state(&capture, &config, &mut Report::default())?;
    let mut backend = open_gpu_backend(device)?;
    let meter = backend.gpu().work_meter();
    // Between the events of a batch the device rests.
    let (mut before, mut after) = (meter(), meter());
    train(&config.train, &mut backend, &capture, state, &mut |event| {
        if meter() != after {
            (before, after) = (after, meter());
        }
        if let TrainEvent::Pruned(pruned) = event {
            println!("{} splats, {} parameters:", pruned.splats, pruned.params);
            println!("  before {before:?}\n  after  {after:?}");
        }
        Ok(Control::Continue)
    })?;
    Ok(())
}
