//! The machine that a benchmark runs on: its hardware, load and clock, and whether it was quiet enough for a run's
//! times to be trusted.

use crate::results::Hardware;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Time constant of the one-minute load average.
const LOAD1_SECS: f64 = 60.0;
/// A run on the CPU with more wall seconds per CPU second did not even have one core to itself: a single busy thread
/// gives 1, reading photos and waiting for disks a little more.
const BUSY_WALL_PER_CPU: f64 = 1.25;
/// Shorter runs are not checked for that: the system's CPU clock is too coarse.
const CHECKED_CPU_SECS_MIN: f64 = 1.0;

/// Describes this machine, as far as the system tells.
pub fn hardware(memory_bytes: Option<u64>) -> Hardware {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let cpuinfo = read("/proc/cpuinfo");
    let model = cpuinfo.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':'));
    let kernel = read("/proc/sys/kernel/osrelease");
    let os = format!("{} {} {}", std::env::consts::OS, kernel.trim(), std::env::consts::ARCH);
    Hardware {
        cpu: model.map_or(String::new(), |(_, name)| name.trim().to_owned()),
        memory_bytes,
        os: os.split_whitespace().collect::<Vec<_>>().join(" "),
    }
}

/// Number of cores that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// One-minute load average; `None` where the system does not tell.
pub fn load1() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}

/// The current time as RFC 3339.
pub fn utc_now() -> String {
    utc(SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs()))
}

fn utc(unix_secs: u64) -> String {
    // Days to a Gregorian date, with years that start in March.
    let (days, secs) = (unix_secs / 86_400 + 719_468, unix_secs % 86_400);
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    let (hour, minute, second) = (secs / 3600, secs / 60 % 60, secs % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

/// Load that a finished run of this benchmark put on the machine.
#[derive(Clone, Copy, Debug)]
pub struct OwnLoad {
    /// Start of the run.
    pub from: Instant,
    /// End of the run.
    pub to: Instant,
    /// Mean number of busy cores.
    pub cores: f64,
}

/// What our own runs contribute to the one-minute load average at `now`: without this, every run would count the one
/// before it as noise.
pub fn own_load1(runs: &[OwnLoad], now: Instant) -> f64 {
    let rest = |t: Instant| (-now.saturating_duration_since(t).as_secs_f64() / LOAD1_SECS).exp();
    runs.iter().fold(0.0, |sum, r| sum + r.cores * (rest(r.to) - rest(r.from)))
}

/// Conditions under which a run was timed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Conditions {
    /// One-minute load average at the start.
    pub load1: Option<f64>,
    /// The part of it that earlier runs of the benchmark caused.
    pub own_load1: f64,
    /// Cores of the machine.
    pub cores: usize,
    /// Runs at the same time.
    pub jobs: usize,
    /// Training time of a run on the CPU; `None` for other devices.
    pub wall_and_cpu_secs: Option<(f64, f64)>,
}

/// Reasons not to trust a run's times; empty if there are none.
pub fn noise(q: &Conditions) -> Vec<String> {
    let mut why = Vec::new();
    if let Some(load) = q.load1
        && load - q.own_load1 > q.cores as f64
    {
        why.push(format!(
            "load average {load:.1} at the start, {:.1} of it from this benchmark, on {} cores",
            q.own_load1, q.cores
        ));
    }
    if q.jobs > 1 {
        why.push(format!("{} runs at the same time", q.jobs));
    }
    if let Some((wall, cpu)) = q.wall_and_cpu_secs
        && cpu >= CHECKED_CPU_SECS_MIN
        && wall > BUSY_WALL_PER_CPU * cpu
    {
        why.push(format!("{wall:.1} s of training with only {cpu:.1} CPU seconds"));
    }
    why
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn dates_match_the_calendar() {
        assert_eq!(utc(0), "1970-01-01T00:00:00Z");
        assert_eq!(utc(951_782_399), "2000-02-28T23:59:59Z");
        assert_eq!(utc(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(utc(1_709_251_199), "2024-02-29T23:59:59Z");
        assert_eq!(utc(1_767_225_600), "2026-01-01T00:00:00Z");
    }

    #[test]
    fn own_load_builds_up_and_fades() {
        let start = Instant::now();
        let at = |secs| start + Duration::from_secs(secs);
        let run = OwnLoad { from: start, to: at(600), cores: 2.0 };
        assert!((own_load1(&[run], at(600)) - 2.0).abs() < 1e-3);
        assert!((own_load1(&[run], at(660)) - 2.0 / 1_f64.exp()).abs() < 1e-3);
        let halves = [OwnLoad { to: at(300), ..run }, OwnLoad { from: at(300), ..run }];
        assert!((own_load1(&halves, at(600)) - own_load1(&[run], at(600))).abs() < 1e-12);
    }

    #[test]
    fn only_load_of_other_programs_counts_as_noise() {
        let quiet = Conditions {
            load1: Some(1.9),
            own_load1: 0.0,
            cores: 2,
            jobs: 1,
            wall_and_cpu_secs: Some((10.0, 18.0)),
        };
        assert!(noise(&quiet).is_empty());
        assert!(noise(&Conditions { load1: Some(3.0), own_load1: 1.5, ..quiet }).is_empty());
        assert!(noise(&Conditions { load1: Some(3.0), own_load1: 0.5, ..quiet })[0].contains("3.0"));
        assert_eq!(noise(&Conditions { jobs: 2, ..quiet }).len(), 1);
        assert_eq!(noise(&Conditions { wall_and_cpu_secs: Some((30.0, 18.0)), ..quiet }).len(), 1);
        assert!(noise(&Conditions { wall_and_cpu_secs: Some((0.9, 0.1)), ..quiet }).is_empty());
        assert!(noise(&Conditions { load1: None, ..quiet }).is_empty());
    }
}
