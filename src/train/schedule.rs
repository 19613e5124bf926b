//! The timetable of a run: the published one of 30,000 steps, scaled by `s = steps / 30,000` (method 4.2
//! and 6.1). A run that has a time instead of a number of steps changes the length of what is left on its way
//! ([`Schedule::changed`]): from there on, the rest of the timetable is stretched or shortened.

use super::charge::Charge;
use super::config::{LengthChange, TrainConfig};
use super::density::{Bound, Budget};
use super::rounding_phase::{self, RoundingPhase};

/// Length of the published timetable.
pub(super) const PUBLISHED_STEPS: f64 = 30_000.0;

/// Last step at which splats are split and maps refined if growth ends by need (published timetable).
const NEED_UNTIL: u32 = 22_000;

/// First possible step of the last round of pruning (published timetable), so that what is left is trained for a fifth
/// of the steps; and least steps from the end of densification to the last round.
const PRUNE_UNTIL: f64 = 24_000.0;
const PRUNE_STEPS: f64 = 4_000.0;

/// Most rounds of pruning, from the end of densification to the last fifth of the steps; two in short runs (method 6.15).
const PRUNE_ROUNDS: u32 = 4;

/// Steps for which an SH band is trained before it is tested (published timetable; method 6.13).
const SH_TRIAL: f64 = 7_000.0;

/// Views that a round probes, at most. A splat that only other views see would look idle.
pub const MOST_PROBES: usize = 64;

/// Steps of a run for each probe, unless it has only two rounds of pruning.
const STEPS_PER_PROBE: u32 = 30;

/// What a run of `steps` steps would do without changes of its length; shares of the run are measured in it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Original {
    steps: u32,
    density_interval: u32,
    densify_until: u32,
    full_size_from: u32,
}

/// The timetable of a run. Steps are those of the run itself; those before the last change of its length are as they were.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    original: Original,
    /// Step after which the length last changed; 0: never.
    changed_at: u32,
    /// Steps of the original timetable done by then, and done by each step since.
    original_then: f64,
    original_per_step: f64,
    /// Last step of the run.
    pub last_step: u32,
    /// Steps of the original timetable after which the SH degree in use rises by one (published: 1,000).
    sh_interval: u32,
    /// Steps of it for which an SH band is trained before it is tested.
    sh_trial: u32,
    /// Step from which texels are trained (published: 1,000).
    pub texture_start: u32,
    /// Step of the original timetable at which the rate of positions has decayed (published: 24,000).
    pub(super) position_end: u32,
    /// Steps between density-control steps (published: 250).
    pub density_interval: u32,
    /// First step whose statistics are used; before it, maps are only fitted (published: 500).
    pub density_start: u32,
    /// Last step after which splats are split and maps refined (published: 15,000).
    pub densify_until: u32,
    /// Rounds of pruning, evenly spread from `densify_until` or full size to `prune_until`.
    pub prune_rounds: u32,
    /// Step of the last round of pruning (published: 24,000).
    pub prune_until: u32,
    /// Step from which images have full size and the texture cap is open (published: 15,000).
    pub full_size_from: u32,
    /// Least number of steps between tests for coarsening after `densify_until` (published: 1,000).
    pub coarsen_interval: u32,
    /// Steps between crops and pads of maps; 0: at density-control steps only (published: 100).
    pub crop_interval: u32,
    /// Last step that a density-control step may follow (published: 1,000 before the end).
    pub density_end: u32,
    /// Prune count that removes a splat (published: 8).
    pub patience: u16,
    /// When the model is rounded, if it is trained as its file will hold it.
    pub rounding: Option<RoundingPhase>,
}

impl Schedule {
    /// The timetable for `config` and a number of training views, before any change of its length.
    pub fn new(config: &TrainConfig, train_views: usize) -> Self {
        let s = f64::from(config.steps) / PUBLISHED_STEPS;
        let at = |published: f64| ((published * s).round() as u32).max(1);
        let c = &config.density;
        let rule = config.rule();
        let epoch = (train_views as u32).clamp(rule.epoch[0], rule.epoch[1]);
        let usual = || at(rule.interval.into()).clamp(epoch.min(rule.interval), rule.interval);
        let density_interval = c.interval.map_or_else(usual, |interval| at(interval.into()));
        // To see whether growth pays takes several windows at full image size.
        let needs = rule.ends_by_need && c.need_db > 0.0;
        let usual = config.policy.spec().densify_until;
        let until = c.densify_until.unwrap_or(if needs { usual.max(NEED_UNTIL) } else { usual });
        let patience = (f64::from(c.patience_steps) * s / f64::from(density_interval)).round();
        let [densify_until, full_size_from] = [until, config.scheduler.until()].map(|step| at(step.into()));
        Self {
            original: Original { steps: config.steps, density_interval, densify_until, full_size_from },
            changed_at: 0,
            original_then: 0.0,
            original_per_step: 1.0,
            last_step: config.steps,
            sh_interval: at(1_000.0),
            sh_trial: at(SH_TRIAL),
            texture_start: at(c.texture_start.into()),
            position_end: at(24_000.0),
            density_interval,
            density_start: at(c.start.into()),
            densify_until,
            prune_rounds: 0,
            prune_until: at(f64::from(until) + PRUNE_STEPS).max(at(PRUNE_UNTIL)),
            full_size_from,
            coarsen_interval: at(1_000.0),
            crop_interval: if density_interval >= 100 && rule.crops_between {
                density_interval * 2 / 5
            } else {
                0
            },
            density_end: config.steps.saturating_sub(at(1_000.0)),
            patience: (patience as u16).max(if c.patience_steps == 0 { 1 } else { 2 }),
            rounding: None,
        }
        .with_rounds(config, train_views)
        .with_rounding(config)
    }

    /// With the last phase for rounded numbers, if the file has a wanted size: splats and maps stay as they are from then on.
    fn with_rounding(self, config: &TrainConfig) -> Self {
        if config.max_bytes.is_none() {
            return self;
        }
        let from = f64::from(config.steps) / PUBLISHED_STEPS * rounding_phase::FROM;
        // The last round of pruning comes before, in runs of any length.
        let start = (from as u32).max(self.prune_until.max(self.full_size_from) + self.density_interval);
        let start = start.min(self.last_step);
        let phase = RoundingPhase { start, last: self.last_step };
        Self { rounding: Some(phase), density_end: self.density_end.min(start), ..self }
    }

    /// With the rounds of pruning for which there is time.
    fn with_rounds(self, config: &TrainConfig, train_views: usize) -> Self {
        // A density-control step follows the time of the last round.
        if !config.prunes_after_growth() || self.prune_until + self.density_interval > self.density_end {
            return self;
        }
        let probes = train_views.clamp(1, MOST_PROBES) as u32;
        let affordable = (config.steps / STEPS_PER_PROBE / probes).max(2);
        Self { prune_rounds: affordable.min(PRUNE_ROUNDS), ..self }
    }

    /// The timetable with the changes of `config` that apply once `done` steps are done.
    pub fn of_run(config: &TrainConfig, train_views: usize, done: u32) -> Self {
        let changes = config.plan.iter().filter(|change| change[0] <= done);
        changes.fold(Self::new(config, train_views), |now, &change| now.changed(change))
    }

    /// The timetable if, once `at` steps are done, what is left is stretched or shortened so that the run ends at
    /// step `last`.
    pub fn changed(self, [at, last]: LengthChange) -> Self {
        let stretch =
            f64::from(last.saturating_sub(at)) / f64::from(self.last_step.saturating_sub(at).max(1));
        let stretched = |steps: u32| (f64::from(steps) * stretch).round() as u32;
        let moved = |step: u32| if step <= at { step } else { at + stretched(step - at) };
        let density_interval = stretched(self.density_interval).max(1);
        Self {
            changed_at: at,
            original_then: self.original_steps(at),
            original_per_step: self.original_per_step / stretch.max(f64::MIN_POSITIVE),
            last_step: last,
            texture_start: moved(self.texture_start),
            density_interval,
            density_start: moved(self.density_start),
            densify_until: moved(self.densify_until),
            prune_until: moved(self.prune_until),
            full_size_from: moved(self.full_size_from),
            crop_interval: if self.crop_interval > 0 { (density_interval * 2 / 5).max(1) } else { 0 },
            density_end: moved(self.density_end),
            rounding: self.rounding.map(|phase| RoundingPhase { start: moved(phase.start), last }),
            ..self
        }
    }

    /// Steps of the timetable without changes that `step` steps correspond to.
    pub(super) fn original_steps(&self, step: u32) -> f64 {
        self.original_then + (f64::from(step) - f64::from(self.changed_at)) * self.original_per_step
    }

    /// Steps as a share of the run, at most 1.
    pub fn share(&self, step: u32) -> f64 {
        (self.original_steps(step) / f64::from(self.original.steps)).min(1.0)
    }

    /// Steps after a step if the rest of the run has the length it was first planned with.
    pub fn original_steps_left(&self, step: u32) -> f64 {
        (f64::from(self.original.steps) - self.original_steps(step)).max(0.0)
    }

    /// Step after which the length last changed; 0: never.
    pub fn changed_at(&self) -> u32 {
        self.changed_at
    }

    /// Whether no round of pruning is left after a step; the density-control step of the last one included.
    pub fn is_pruned(&self, step: u32) -> bool {
        self.rounds_done(self.last_density_step(step)) == self.prune_rounds
    }

    /// Whether a round of pruning is due by a step.
    pub fn prunes_by(&self, step: u32) -> bool {
        self.rounds_done(step) > 0
    }

    /// Density checks for which an SH band is on trial.
    pub fn sh_trial_checks(&self) -> u16 {
        self.sh_trial.div_ceil(self.original.density_interval.max(1)).min(u16::MAX.into()) as u16
    }

    /// Bounds of the model after a step: while it grows, it may exceed the user's budget of parameters, which pruning then
    /// meets.
    pub fn budget(&self, config: &TrainConfig, step: u32) -> Budget {
        let grows = step < self.prune_until || self.rounds_left(step) > 0;
        let overshoot = if grows && self.prune_rounds > 0 { config.density.overshoot } else { 1.0 };
        let raised = |most: usize| (most as f64 * overshoot) as usize;
        Budget { max_params: config.most_params().map(raised), ..config.budget }
    }

    /// What the model may have after a step, with the bytes that a file of a wanted size has for splats: rounds of pruning leave
    /// what it has room for; without any, the start and growth must.
    pub fn bound(&self, config: &TrainConfig, step: u32, splat_bytes: Option<f64>) -> Bound {
        let budget = self.budget(config, step);
        match splat_bytes.filter(|_| self.prune_rounds == 0) {
            Some(most_charge) => Bound { budget, charge: Charge::UNPRUNED_BYTES, most_charge },
            None => {
                let charge = Charge::for_file(config.max_bytes.is_some());
                Bound { budget, charge, most_charge: f64::INFINITY }
            }
        }
    }

    /// Whether a density-control step follows a step.
    pub fn is_density_step(&self, step: u32) -> bool {
        self.is_multiple_since(step, self.density_interval) && step <= self.density_end
    }

    /// Whether `interval` divides the steps since the last change of the length.
    fn is_multiple_since(&self, step: u32, interval: u32) -> bool {
        step >= self.changed_at && (step - self.changed_at).is_multiple_of(interval)
    }

    /// The last density-control step by the time `done` steps are done: its stage is in force; 0: none yet.
    pub fn last_density_step(&self, done: u32) -> u32 {
        let last = done.min(self.density_end).max(self.changed_at);
        last - (last - self.changed_at) % self.density_interval
    }

    /// The first density-control step after `done` steps, or where it would be after the last.
    pub fn next_density_step(&self, done: u32) -> u32 {
        let since = done.saturating_sub(self.changed_at);
        self.changed_at
            .saturating_add((since / self.density_interval + 1).saturating_mul(self.density_interval))
    }

    /// The rounds of pruning still to come after a density-control step, with that one; 0 if none follows it.
    pub fn rounds_left(&self, step: u32) -> u32 {
        let [before, done] = [step.saturating_sub(self.density_interval), step].map(|s| self.rounds_done(s));
        if self.is_density_step(step) && done > before { self.prune_rounds - done + 1 } else { 0 }
    }

    /// Rounds of pruning that are due by a step.
    fn rounds_done(&self, step: u32) -> u32 {
        let from = self.densify_until.max(self.full_size_from);
        let length = self.prune_until.saturating_sub(from);
        let passed = u64::from(step.saturating_sub(from).min(length)) * u64::from(self.prune_rounds);
        passed.checked_div(length.into()).unwrap_or(0) as u32
    }

    /// Whether a round of pruning came before what follows a step.
    pub fn has_pruned(&self, step: u32) -> bool {
        self.rounds_done(self.last_density_step(step.saturating_sub(1))) > 0
    }

    /// Whether maps are cropped and padded after a step. Density-control steps do so in any case.
    pub fn is_crop_step(&self, step: u32) -> bool {
        self.crop_interval > 0 && self.is_multiple_since(step, self.crop_interval) && step <= self.density_end
    }

    /// Whether the density-control step after `step` tests maps for coarsening.
    pub fn may_coarsen(&self, step: u32) -> bool {
        step <= self.densify_until || step % self.coarsen_interval < self.density_interval
    }

    /// Time t of the frequency schedule: steps done as a fraction of those to the last stage, at most 1.
    pub fn stage_share(&self, step: u32) -> f64 {
        (self.original_steps(step) / f64::from(self.original.full_size_from)).min(1.0)
    }

    /// Steps done as a fraction of those to the end of densification, at most 1.
    pub fn densify_share(&self, step: u32) -> f64 {
        (self.original_steps(step) / f64::from(self.original.densify_until)).min(1.0)
    }

    /// Length in finest texels above which splats are split (published: falling over 7,000 steps).
    pub fn split_texels(&self, config: &TrainConfig, step: u32) -> f64 {
        let [start, end] = config.density.split_texels;
        let t = self.original_steps(step) / f64::from(config.steps) * PUBLISHED_STEPS / 7_000.0;
        (start + (end - start) * t).max(end.min(start))
    }

    /// Opacity below which splats fade.
    pub fn opacity_floor(&self, config: &TrainConfig, step: u32) -> f64 {
        let [start, end] = config.density.opacity_floor.unwrap_or(config.policy.spec().opacity_floor);
        start + (end - start) * self.original_steps(step) / f64::from(config.steps)
    }

    /// SH degree in use at a step; steps count from 1.
    pub fn sh_degree(&self, step: u32, highest: u32) -> u32 {
        let done = (self.original_steps(step) - 1.0).max(0.0);
        ((done / f64::from(self.sh_interval)) as u32).min(highest)
    }

    /// Highest SH degree that has been trained long enough to be tested after a step; 0: none.
    pub fn sh_tested(&self, step: u32, highest: u32) -> u32 {
        let tested = (self.original_steps(step) - f64::from(self.sh_trial)).max(0.0);
        ((tested / f64::from(self.sh_interval)) as u32).min(highest)
    }
}

#[cfg(test)]
mod tests {
    use super::super::density::{DensityConfig, Policy};
    use super::*;

    #[test]
    fn rounds_of_pruning_follow_density_control_steps_after_growth() {
        let of = |steps: u32, views| {
            let config = TrainConfig { steps, ..TrainConfig::default() };
            let schedule = Schedule::new(&config, views);
            let rounds = |step| Some((step, schedule.rounds_left(step))).filter(|round| round.1 > 0);
            (1..=steps).filter_map(rounds).collect::<Vec<_>>()
        };
        assert_eq!(of(30_000, 100), [(21_000, 4), (22_000, 3), (23_000, 2), (24_000, 1)]);
        let schedule = Schedule::new(&TrainConfig::default(), 100);
        let has_pruned = [21_000, 21_001, 30_000].map(|step| schedule.has_pruned(step));
        assert_eq!(has_pruned, [false, true, true], "maps are fitted before the round of the same step");
        // Two rounds where probes of all views cost more than a thirtieth of the steps.
        assert_eq!(of(1_000, 44), [(748, 2), (836, 1)]);
        let off = TrainConfig::default();
        let off =
            TrainConfig { density: DensityConfig { prune_db: 0.0, ..off.density }, ..TrainConfig::default() };
        let schedule = Schedule::new(&off, 100);
        assert!(!schedule.has_pruned(30_000));
        assert_eq!(of(30, 44), [], "too short");
        assert!((1..=off.steps).all(|step| schedule.rounds_left(step) == 0));
    }

    #[test]
    fn a_change_of_the_length_stretches_what_is_left() {
        let config = TrainConfig { steps: 3_000, ..TrainConfig::default() };
        let before = Schedule::new(&config, 30);
        // At a density-control step, from which the interval is counted anew.
        let at = 35 * before.density_interval;
        let same = before.changed([at, 3_000]);
        let facts = |s: &Schedule, step| {
            let rates = s.rates(&config, step);
            (s.is_density_step(step), s.rounds_left(step), s.share(step), rates.position, s.stage_share(step))
        };
        for step in at + 1..=3_000 {
            assert_eq!(facts(&before, step), facts(&same, step), "no change: {step}");
        }
        // Half the pace from there: two steps of the run for one of the original.
        let slow = before.changed([at, at + 2 * (3_000 - at)]);
        assert_eq!((slow.last_step, slow.density_interval), (6_000 - at, 2 * before.density_interval));
        for step in at..=3_000 {
            let then = at + 2 * (step - at);
            assert!((before.share(step) - slow.share(then)).abs() < 1e-12, "{step}");
            assert_eq!(before.rounds_left(step), slow.rounds_left(then), "{step}");
            assert_eq!(before.opacity_floor(&config, step), slow.opacity_floor(&config, then), "{step}");
        }
        // After the last round only the end moves.
        let at = (1..3_000).find(|&step| before.rounds_left(step) == 1).unwrap();
        assert!(before.is_pruned(at) && !before.is_pruned(at - 1) && before.prunes_by(at - 1));
        let tail = before.changed([at, at + 30]);
        assert_eq!((tail.last_step, tail.share(at + 30), tail.is_pruned(at)), (at + 30, 1.0, true));
        let again = (at + 1..=at + 30).any(|step| tail.rounds_left(step) > 0);
        assert!(!again && tail.has_pruned(at + 1), "nothing is pruned twice");
        // Changes apply from their step on.
        let config = TrainConfig { plan: vec![[900, 5_100], [2_000, 4_000]], ..config };
        let of = |done| Schedule::of_run(&config, 30, done).last_step;
        assert_eq!([899, 900, 1_999, 2_000].map(of), [3_000, 5_100, 5_100, 4_000]);
    }

    #[test]
    fn a_run_with_a_wanted_size_grows_no_more_than_its_steps_can_train() {
        let most = |steps, max_params, max_bytes| {
            let budget = Budget { max_params, ..Budget::default() };
            let config = TrainConfig { steps, budget, max_bytes, ..TrainConfig::default() };
            let last = Schedule::new(&config, 43).budget(&config, steps).max_params;
            assert_eq!(last, config.most_params(), "{steps} steps");
            last
        };
        let [small, large] = [Some(200_000), Some(1_800_000)];
        let size = Some(200_000_u64);
        assert_eq!(
            [1_000, 2_000, 3_000].map(|steps| most(steps, large, size)),
            [600_000, 1_200_000, 1_800_000].map(Some)
        );
        assert_eq!(most(1_000, small, size), small, "a budget below is kept");
        assert_eq!(most(1_000, large, None), large, "only with a wanted size");
        // A time that changes the length changes the bound.
        let longer =
            TrainConfig { max_bytes: size, steps: 1_000, plan: vec![[500, 2_000]], ..TrainConfig::default() };
        assert_eq!(longer.most_params(), Some(1_200_000));
    }

    #[test]
    fn short_runs_scale_the_published_timetable() {
        let config = TrainConfig::default();
        let published = Schedule::new(&config, 300);
        assert_eq!(
            (published.sh_interval, published.texture_start, published.density_interval),
            (1_000, 1_000, 250)
        );
        assert_eq!([1, 1_000, 1_001, 3_001, 9_000].map(|t| published.sh_degree(t, 3)), [0, 0, 1, 3, 3]);
        let shorter = TrainConfig { steps: 300, ..config.clone() };
        let short = Schedule::new(&shorter, 43);
        assert_eq!((short.sh_interval, short.texture_start, short.density_interval), (10, 10, 43));
        // An epoch of few views does not bring more steps of density control; `plain` keeps its own bound.
        let none = Budget::default();
        let budget = Budget { max_params: Some(1_000_000), ..none };
        let of = |policy, budget| TrainConfig { steps: 1_000, policy, budget, ..config.clone() };
        let intervals =
            |config: &TrainConfig| [3, 43, 300].map(|views| Schedule::new(config, views).density_interval);
        assert_eq!(intervals(&of(Policy::Litetex, none)), [33, 43, 50]);
        assert_eq!(intervals(&of(Policy::Litetex, budget)), [17, 25, 25]);
        assert_eq!(intervals(&of(Policy::Plain, none)), [3, 25, 25]);
        assert_eq!(intervals(&of(Policy::Paper, budget)), [33, 43, 50]);
        // A set interval is that, whatever views and budget.
        for (budget, interval) in [none, budget].into_iter().flat_map(|b| [(b, 250), (b, 1_000)]) {
            let mut set = of(Policy::Litetex, budget);
            set.density.interval = Some(interval);
            assert_eq!(intervals(&set), [(interval + 15) / 30; 3]);
        }
        let long = |policy| TrainConfig { steps: 30_000, ..of(policy, none) };
        let cropping = |policy| Schedule::new(&long(policy), 43).crop_interval;
        assert_eq!([Policy::Litetex, Policy::Paper].map(cropping), [0, 100]);
        assert!(short.is_density_step(43) && !short.is_density_step(44));
        assert!(!short.is_density_step(301) && short.density_end == 290);
        assert_eq!((published.patience, published.densify_until), (8, 15_000));
        assert_eq!((short.patience, short.densify_until), (2, 150));
        assert_eq!(
            [0, 3_500, 7_000, 20_000].map(|t| published.split_texels(&config, t)),
            [64.0, 40.0, 16.0, 16.0]
        );
    }
}
