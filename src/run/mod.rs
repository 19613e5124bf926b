//! Runs: their settings and their folder, what is written into it while a training goes on, and how it is read again. Flags,
//! progress and Ctrl-C belong to the command line.

mod config;
mod evaluations;
mod first_model;
mod folder;
mod init_source;
mod outcome;
mod outlying;
mod profile;
mod purpose;
mod recorder;
#[cfg(test)]
mod recorder_tests;
mod resource_estimate;
mod scale;
mod summary;
mod trained;
mod view_files;

pub use config::{MAX_RESOLUTION_MIN, RunConfig, SaveImages};
pub use evaluations::StagedFolder;
pub use first_model::{fresh_model, fresh_state};
pub use folder::{
    PREVIEW, RUN_OR_CHECKPOINT, RunFolder, RunLock, check_empty, checkpoints_after, find_checkpoint,
    holds_checkpoint, is_checkpoint, is_run, run_of_checkpoint,
};
pub use init_source::InitSource;
pub use profile::Profile;
pub use purpose::Purpose;
pub use recorder::Recorder;
pub use resource_estimate::{ResourceEstimate, Resources, Workload};
pub use scale::Scale;
pub use summary::{
    CaptureFigures, DiskBytes, EndOfGrowth, Fps, GrowthFigures, Resumed, Size, Summary, TestFigures, Times,
};
pub use trained::{Trained, config_of, render_options};
pub use view_files::{image_name, write_per_view, write_view};
