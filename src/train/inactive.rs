//! What of a run's settings cannot act, and why.

use super::config::TrainConfig;
use super::density::{Components, MapRule, Policy};
use super::schedule::Schedule;
use crate::text::counted;
use serde_json::Value;

/// Settings that differ from those of `unchanged`, the run's profile, but cannot act in this run, and parts of the method for
/// which it is too short; each with the reason.
pub fn inactive(schedule: &Schedule, config: &TrainConfig, unchanged: &TrainConfig) -> Vec<String> {
    let value = |config: &TrainConfig| serde_json::to_value(config).unwrap_or_default();
    let [mine, theirs] = [config, unchanged].map(value);
    let at = |value: &Value, key: &str| value.pointer(&format!("/{}", key.replace('.', "/"))).cloned();
    let mut out: Vec<String> = Vec::new();
    for (reason, keys) in unused(config) {
        for key in keys.into_iter().filter(|key| at(&mine, key) != at(&theirs, key)) {
            if !out.iter().any(|said| said.starts_with(&format!("{key}: "))) {
                out.push(format!("{key}: {reason}"));
            }
        }
    }
    out.extend(too_short(schedule, config));
    out
}

/// Settings that cannot act, with the reason.
fn unused(config: &TrainConfig) -> Vec<(String, Vec<String>)> {
    let (density, rule, policy) = (&config.density, config.rule(), config.policy);
    let (parts, spec) = (config.active_components(), policy.spec());
    let of_policy = format!("not used by the policy {policy}");
    let has_budget = config.budget.max_params.is_some();
    let prunes = config.prunes_after_growth();
    let prunes_by_need = prunes && (!has_budget || density.need_db > 0.0);
    let (adaptive, textured) = (spec.map_rule == MapRule::Adaptive, spec.map_rule != MapRule::None);
    let conditions: [(bool, &str, &[&str]); 16] = [
        (!(rule.ends_by_need || prunes && has_budget), &of_policy, &["density.need-db"]),
        (!adaptive, &of_policy, &["density.grow-by-axis", "density.coarsen-below"]),
        (!adaptive && rule.splits_any_length, &of_policy, &["density.quantile"]),
        (
            !textured,
            &of_policy,
            &["density.texture-start", "rates.texel", "loss.texture", "budget.max-texels"],
        ),
        (
            !parts.update_rule || !textured,
            "the update rule is off",
            &["rates.texel-growth", "rates.texel-growth-limit"],
        ),
        (rule.splits_any_length, "splats of any length are split", &["density.split-texels"]),
        (!parts.coarsening, "coarsening is off", &["density.coarsen-below"]),
        (!parts.splitting, "splitting is off", &["density.split-texels"]),
        (
            !parts.pruning,
            "pruning is off",
            &["density.prune-contribution", "density.prune-area", "density.patience-steps"],
        ),
        (
            !parts.scheduler,
            "the scheduler is off",
            &["scheduler.beta", "scheduler.max-scale", "scheduler.rules"],
        ),
        (
            !prunes,
            "nothing is pruned after growth",
            &["density.overshoot", "density.floor-db", "density.merge", "density.price-fragments"],
        ),
        (!has_budget, "there is no budget of parameters", &["density.overshoot"]),
        (!prunes_by_need, "the budget decides", &["density.floor-db", "density.merge"]),
        (matches!(spec.map_rule, MapRule::Fixed(_)), &of_policy, &["density.merge"]),
        (density.sh_below == 0.0, "density.sh-below is 0", &["density.sh-raise"]),
        (config.sh_degree == 0, "the SH degree is 0", &["density.sh-below", "density.sh-raise"]),
    ];
    let named = |keys: &[&str]| keys.iter().map(|&key| key.to_owned()).collect::<Vec<_>>();
    let mut out: Vec<(String, Vec<String>)> = conditions
        .iter()
        .filter(|(is_unused, ..)| *is_unused)
        .map(|(_, reason, keys)| ((*reason).to_owned(), named(keys)))
        .collect();
    let of_rule = rule.unused.iter().map(|name| format!("density.{name}")).collect();
    let mut switches: Vec<&str> = spec.without.to_vec();
    switches.extend(Components::NAMES.into_iter().filter(|name| match spec.map_rule {
        MapRule::Adaptive => false,
        MapRule::Fixed(_) => matches!(*name, "growth" | "coarsening"),
        MapRule::None => matches!(*name, "growth" | "coarsening" | "update-rule"),
    }));
    // `plain` has no pruning by contribution, but its rounds after growth.
    switches.retain(|name| *name != "pruning" || density.prune_db == 0.0);
    out.push((of_policy, of_rule));
    let missing = format!("the policy {policy} has no such part");
    out.push((missing, switches.into_iter().map(|name| format!("components.{name}")).collect()));
    out
}

/// Parts of the method that are on, but for which the run is too short.
fn too_short(schedule: &Schedule, config: &TrainConfig) -> Vec<String> {
    let parts = config.active_components();
    let Schedule { density_interval, density_start, densify_until, density_end, .. } = *schedule;
    let checks_until = |until: u32| {
        let end = until.min(density_end);
        (end / density_interval).saturating_sub((density_start - 1) / density_interval)
    };
    let mut out = Vec::new();
    if checks_until(densify_until) == 0 && (parts.growth || parts.splitting || config.policy == Policy::Plain)
    {
        out.push(format!(
            "growth and splitting: no density-control step (every {density_interval} steps) between steps {density_start} \
             and {densify_until}"
        ));
    }
    let checks = checks_until(density_end);
    if parts.pruning && checks < u32::from(schedule.patience) {
        let checks = counted(checks as usize, "check");
        out.push(format!("pruning: only {checks}, fewer than the patience of {}", schedule.patience));
    }
    if config.prunes_after_growth() && schedule.prune_rounds == 0 {
        out.push(format!(
            "pruning after growth: no time for a round between steps {} and {density_end}",
            schedule.prune_until
        ));
    }
    if config.sh_degree > 0 && schedule.sh_degree(config.steps, config.sh_degree) < config.sh_degree {
        out.push("spherical harmonics: the highest degree is not reached".to_owned());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::density::DensityConfig;

    fn of(config: &TrainConfig, unchanged: &TrainConfig) -> Vec<String> {
        inactive(&Schedule::new(config, 43), config, unchanged)
    }

    #[test]
    fn settings_that_cannot_act_are_named() {
        let changed = DensityConfig {
            need_db: 0.1,
            floor_db: 41.0,
            merge: false,
            overshoot: 3.0,
            price_fragments: 0.5,
            quantile: 0.7,
            coarsen_below: 0.01,
            split_texels: [9.0; 2],
            sh_raise: 0.03,
            prune_area: 1e-5,
            ..DensityConfig::default()
        };
        let without_need = DensityConfig { need_db: 0.0, ..changed.clone() };
        let unpruned = DensityConfig { prune_db: 0.0, sh_below: 0.0, ..changed.clone() };
        let budget = Some(1_000_000);
        for (policy, density, budget, without, expected) in [
            ("litetex", &changed, None, "", "overshoot"),
            ("litetex", &changed, budget, "", "split-texels"),
            ("litetex", &without_need, budget, "", "floor-db merge split-texels"),
            (
                "litetex",
                &unpruned,
                None,
                "coarsening",
                "coarsen-below floor-db merge overshoot price-fragments sh-raise",
            ),
            ("litetex", &changed, None, "pruning", "floor-db merge overshoot price-fragments prune-area"),
            ("litetex", &changed, None, "splitting", "overshoot split-texels"),
            ("fixed:4", &changed, None, "", "coarsen-below merge overshoot"),
            ("none", &changed, budget, "growth", "coarsen-below growth quantile split-texels"),
            ("paper", &changed, None, "", "need-db overshoot sh-raise"),
            ("plain", &changed, budget, "", "coarsen-below prune-area quantile split-texels"),
            ("litetex", &DensityConfig::default(), budget, "scheduler", ""),
        ] {
            let mut config = TrainConfig { policy: policy.parse().unwrap(), ..TrainConfig::default() };
            let unchanged = config.clone();
            (config.density, config.budget.max_params) = (density.clone(), budget);
            if let Some(switch) = config.components.switch(without) {
                *switch = false;
            }
            let names = of(&config, &unchanged).into_iter().filter_map(|said| {
                let key = said.split_once(": ")?.0.rsplit_once('.')?.1;
                Some(key.to_owned())
            });
            let mut names: Vec<String> = names.collect();
            names.sort_unstable();
            assert_eq!(names.join(" "), expected, "{policy} {budget:?} without {without:?}");
            // What the profile sets was not changed.
            assert!(!of(&config, &config).iter().any(|said| said.contains("density.")), "{policy}");
        }
    }

    #[test]
    fn parts_that_need_longer_runs_are_named() {
        let of_steps = |steps, start| {
            let mut config = TrainConfig { steps, ..TrainConfig::default() };
            config.density.start = start;
            of(&config, &config)
        };
        assert_eq!(of_steps(300, 500), Vec::<String>::new());
        let tiny = of_steps(30, 500);
        assert!(tiny.len() == 3 && tiny[0].starts_with("growth"), "{tiny:?}");
        assert!(tiny.iter().any(|what| what.starts_with("pruning after growth")), "{tiny:?}");
        let late = of_steps(300, 30_000);
        assert!(late[0].contains("between steps 300 and 150"), "{late:?}");
    }
}
