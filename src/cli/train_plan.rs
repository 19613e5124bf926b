//! How long a run is: what a time, or saying nothing, comes to on this capture and device.

use super::train_job::TrainJob;
use litetex_gs::backend::Backend;
use litetex_gs::capture::Capture;
use litetex_gs::console::{Log, device};
use litetex_gs::run::{Plan, Situation, expected_secs, fresh_state, measure};
use litetex_gs::text::{format_count, format_duration};
use litetex_gs::train::{StepCosts, TrainState};
use litetex_gs::views::{Split, ViewSource as _};
use litetex_gs::{Report, Result};
use std::sync::Arc;

/// Time of a run for which nothing is said, without a GPU and with one.
const FREE_CPU_SECS: f64 = 15.0 * 60.0;
const FREE_GPU_SECS: f64 = 5.0 * 60.0;

/// Where nothing is said, a run sees no photo more often than this on average. A choice, not a measured end of the gain: with
/// 300,000 parameters fox, 270 x 480, had 28.9, 31.0 and 32.0 dB after 23, 116 and 698 passes, flower 26.6 and 28.1 dB after 48
/// and 238, bonsai 24.2 and 24.3 dB after 53 and 263 (lab/results, variants pooled, one or two runs at the long ends).
const ENOUGH_PASSES: u32 = 200;

/// Time from the last step to the exit where nothing was measured.
const END_SECS: f64 = 2.0;

/// Where a run starts; a plan may replace capture and state by those of another image size.
pub struct Start<'a> {
    pub capture: &'a mut Arc<Capture>,
    pub state: &'a mut TrainState,
    /// Time that loading the capture took.
    pub loaded_secs: f64,
    pub is_resumed: bool,
    /// Whether the user chose the image size.
    pub keeps_size: bool,
}

/// What is known of the time of a run.
pub struct Planned {
    pub costs: StepCosts,
    /// From the last step to the exit.
    pub end_secs: f64,
    /// Of the training; of GPUs' speed nothing is known without a trial.
    pub train_secs: Option<f64>,
}

/// Plans the run if it has a time, with trial steps on the device, and says so.
///
/// # Errors
/// [`litetex_gs::Error::Usage`] if the time is too short; what the trial and loading again report.
pub fn plan(
    job: &mut TrainJob,
    start: Start<'_>,
    backend: &mut dyn Backend,
    now: &dyn Fn() -> f64,
    log: &Log,
) -> Result<Planned> {
    let is_hardware = device::is_hardware(&backend.device().name);
    if job.is_free {
        job.config.time_secs = Some(if is_hardware { FREE_GPU_SECS } else { FREE_CPU_SECS });
    }
    let threads = rayon::current_num_threads() as f64;
    let costs = if is_hardware { StepCosts::GPU } else { StepCosts::CPU.scaled(1.0 / threads) };
    let planned_anew = !start.is_resumed && start.state.step == 0;
    let Some(time_secs) = job.config.time_secs.filter(|_| planned_anew) else {
        let found = (start.state.step, start.state.model.num_splats());
        let train_secs = || expected_secs(costs, &job.config.train, &**start.capture, found);
        return Ok(Planned { costs, end_secs: END_SECS, train_secs: (!is_hardware).then(train_secs) });
    };
    let trial = measure(backend, &**start.capture, &start.state.model, &job.config.train, costs, now)?;
    let train_views = start.capture.indices(Split::Train);
    let sizes: Vec<_> = train_views.iter().map(|&view| start.capture.camera(view).pinhole).collect();
    let views = train_views.len();
    let situation = Situation {
        time_secs,
        gone_secs: now(),
        reload_secs: start.loaded_secs,
        trial,
        splats: start.state.model.num_splats(),
        views: [views, start.capture.num_views() - views],
        side_px: sizes.iter().map(|size| size.width_px.max(size.height_px)).max().unwrap_or(1),
        pixels: sizes.iter().map(|size| size.num_pixels() as f64).sum::<f64>() / views.max(1) as f64,
        keeps_size: start.keeps_size,
        threads,
        enough_steps: job.is_free.then(|| ENOUGH_PASSES.saturating_mul(views as u32)),
    };
    let plan = situation.plan(&job.config.train)?;
    job.config.train.steps = plan.steps;
    job.config.most_steps = job.is_free.then_some(plan.most_steps);
    if !plan.fits {
        // Fewer steps than these would be no run.
        job.config.forget_time();
    }
    if let Some(side) = plan.max_resolution {
        job.config.capture.max_resolution = side;
        *start.capture = Arc::new(Capture::load(job.config.data()?, &job.config.capture)?);
    }
    // The budget follows from the steps, the model from both.
    *start.state = fresh_state(start.capture, &job.config, &mut Report::default())?;
    say(job, &situation, plan, log);
    let train_secs = Some(plan.done_secs - plan.end_secs - now());
    Ok(Planned { costs: trial.costs, end_secs: plan.end_secs, train_secs })
}

/// The plan in words: what was chosen, why it is not what was asked for, and how to get more.
fn words(situation: &Situation, plan: &Plan, budget: &str) -> String {
    let is_free = situation.enough_steps.is_some();
    let size = match plan.max_resolution {
        None if situation.keeps_size => "images of this size",
        _ => "this capture",
    };
    let time = format_duration(situation.time_secs);
    let purpose = match plan.fits {
        true => format!("for {time}"),
        false => format!("for more than {time}, which is too short for {size} on this device"),
    };
    let bound = match (plan.steps < plan.most_steps, is_free) {
        (true, _) => String::new(),
        (false, true) => format!(", which show each photo about {ENOUGH_PASSES} times"),
        (false, false) => ", the most that --time plans".to_owned(),
    };
    let more = match (is_free, plan.fits, situation.keeps_size) {
        (true, false, true) => "; a smaller --max-resolution is faster",
        (true, ..) => "; for more: --time 1h, or --steps and --max-resolution",
        (false, ..) if !bound.is_empty() => "; for more: --steps",
        (false, ..) => "",
    };
    format!(
        "planned {purpose}: about {} steps at {} px{bound}{budget}, done in about {}{more}",
        format_count(plan.steps.into()),
        plan.max_resolution.unwrap_or(situation.side_px),
        format_duration(plan.done_secs - situation.gone_secs)
    )
}

/// Says what was chosen for the time.
fn say(job: &TrainJob, situation: &Situation, plan: Plan, log: &Log) {
    let side_px = plan.max_resolution.unwrap_or(situation.side_px);
    let budget = job.config.train.most_params();
    let budget =
        budget.map_or(String::new(), |most| format!(", at most {} parameters", format_count(most as u64)));
    log.event(
        "plan",
        &words(situation, &plan, &budget),
        serde_json::json!({ "time_secs": situation.time_secs, "gone_secs": situation.gone_secs, "steps": plan.steps,
            "most_steps": plan.most_steps, "side_px": side_px, "done_secs": plan.done_secs, "end_secs": plan.end_secs,
            "budget_params": job.config.train.most_params() }),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use litetex_gs::run::Trial;

    #[test]
    fn a_plan_says_which_bound_it_met() {
        let costs = StepCosts::CPU;
        let situation = Situation {
            time_secs: 900.0,
            gone_secs: 1.0,
            reload_secs: 1.0,
            trial: Trial { costs, photo_secs: 0.01, evaluation_secs_per_pixel: 1e-6 },
            splats: 600,
            views: [10, 2],
            side_px: 640,
            pixels: 640.0 * 480.0,
            keeps_size: false,
            threads: 2.0,
            enough_steps: Some(2_000),
        };
        let plan = Plan {
            steps: 1_500,
            most_steps: 2_000,
            fits: true,
            max_resolution: None,
            done_secs: 891.0,
            end_secs: 2.0,
        };
        let of = |situation: &Situation, plan: &Plan| words(situation, plan, "");
        assert_eq!(
            of(&situation, &plan),
            "planned for 15 min: about 1,500 steps at 640 px, done in about 15 min; for more: --time 1h, or --steps and \
             --max-resolution"
        );
        let all = of(&situation, &Plan { steps: 2_000, done_secs: 46.0, ..plan });
        assert!(
            all.contains("show each photo about 200 times, done in about 45 s; for more: --time 1h"),
            "{all}"
        );
        let own_size = Situation { keeps_size: true, ..situation };
        let late = of(&own_size, &Plan { steps: 260, fits: false, done_secs: 1_501.0, ..plan });
        assert!(
            late.starts_with("planned for more than 15 min, which is too short for images of this size"),
            "{late}"
        );
        assert!(late.contains("done in about 25 min; a smaller --max-resolution"), "{late}");
        // With a time that the user gave.
        let asked = Situation { time_secs: 3_600.0, enough_steps: None, ..situation };
        let longest = Plan { steps: 30_000, most_steps: 30_000, done_secs: 241.0, ..plan };
        let capped = of(&asked, &longest);
        assert!(
            capped.contains("30,000 steps at 640 px, the most that --time plans, done in about 4 min"),
            "{capped}"
        );
        let usual = of(&asked, &Plan { steps: 9_000, ..longest });
        assert!(!usual.contains("the most") && !usual.contains("for more"), "{usual}");
    }
}
