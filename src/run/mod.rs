//! Runs: their settings and their folder, what is written into it while a training goes on, and how it is read again. Flags,
//! progress and Ctrl-C belong to the command line.

mod batch;
mod batch_table;
mod config;
mod device_estimate;
mod evaluations;
mod first_model;
mod folder;
#[cfg(test)]
mod folder_tests;
mod init_source;
mod layers;
mod outcome;
mod outlying;
mod process;
mod profile;
mod purpose;
mod recorder;
#[cfg(test)]
mod recorder_tests;
mod resource_estimate;
mod scale;
mod step_trial;
mod summary;
mod time_plan;
mod trained;
mod view_files;
mod work;

pub use batch::{BatchRun, RunState, batch_runs, share};
pub use batch_table::{BatchTable, Row, RowStatus, to_json as table_to_json};
pub use config::{MAX_RESOLUTION_MIN, RunConfig, SaveImages};
pub use device_estimate::{DeviceEstimate, DeviceNeed};
pub use evaluations::StagedFolder;
pub use first_model::{fresh_model, fresh_state, splat_bytes};
pub use folder::{
    PREVIEW, RUN_OR_CHECKPOINT, RunFolder, RunLock, SCENE, check_empty, checkpoints_after, find_checkpoint,
    holds_checkpoint, is_checkpoint, is_run, run_of_checkpoint,
};
pub use init_source::InitSource;
pub use layers::LayersPerPixel;
pub use process::{End, Process, Stop, without_mark};
pub use profile::Profile;
pub use purpose::Purpose;
pub use recorder::Recorder;
pub use resource_estimate::{ResourceEstimate, Resources, Workload};
pub use scale::Scale;
pub use step_trial::{Trial, measure};
pub use summary::{
    CaptureFigures, DiskBytes, EndOfGrowth, Fps, GrowthFigures, Resumed, Size, Summary, TestFigures, Times,
};
pub use time_plan::{Plan, Situation, expected_secs};
pub use trained::{Trained, config_of, file_frame, render_options};
pub use view_files::{image_name, write_per_view, write_view};
pub use work::{Outcome, work_through};
