//! What a benchmark notes of the machine it runs on: processor, load, time of day, the program's own build;
//! and whether a run's times can be trusted.

use litetex_gs::results::Hardware;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Seconds after which the load average over a minute has forgotten all but 1/e of what was.
const LOAD1_SECS: f64 = 60.0;
/// Wall seconds per CPU second of a run on the CPU above which it did not even get one core for itself: a
/// single thread at work gives 1, reading photos and waiting for disks a little more.
const STARVED_WALL_PER_CPU: f64 = 1.25;

/// CPU seconds below which that is not judged: the system counts them in steps of its clock.
const STARVED_CPU_SECS_MIN: f64 = 1.0;

/// The machine.
pub fn hardware() -> Hardware {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let cpuinfo = read("/proc/cpuinfo");
    let model = cpuinfo.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':'));
    let kernel = read("/proc/sys/kernel/osrelease");
    let os = format!("{} {} {}", std::env::consts::OS, kernel.trim(), std::env::consts::ARCH);
    Hardware {
        cpu: model.map_or(String::new(), |(_, name)| name.trim().to_owned()),
        memory_bytes: crate::cli::memory::machine_bytes(),
        os: os.split_whitespace().collect::<Vec<_>>().join(" "),
    }
}

/// Cores that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Load average over a minute.
pub fn load1() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}

/// CRC-32 of the running program's file; empty if it cannot be read.
pub fn build() -> String {
    let bytes = std::env::current_exe().and_then(std::fs::read);
    bytes.map_or(String::new(), |b| format!("{:08x}", crc32fast::hash(&b)))
}

/// Now, as RFC 3339.
pub fn utc_now() -> String {
    utc(SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs()))
}

fn utc(unix_secs: u64) -> String {
    // Days to a date of the Gregorian calendar, with years that start in March.
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

/// A finished run of this benchmark, as the load average sees it.
#[derive(Clone, Copy, Debug)]
pub struct Busy {
    /// Start.
    pub from: Instant,
    /// End.
    pub to: Instant,
    /// Cores at work on average.
    pub cores: f64,
}

/// What runs of our own have left in the load average over a minute at `now`: without this every run would
/// count the one before it as noise.
pub fn own_load1(runs: &[Busy], now: Instant) -> f64 {
    let rest = |t: Instant| (-now.saturating_duration_since(t).as_secs_f64() / LOAD1_SECS).exp();
    runs.iter().fold(0.0, |sum, r| sum + r.cores * (rest(r.to) - rest(r.from)))
}

/// What the judgement on a run's times rests on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet {
    /// Load average at the start.
    pub load1: Option<f64>,
    /// Our own part of it.
    pub own: f64,
    /// Cores of the machine.
    pub cores: usize,
    /// Runs at the same time.
    pub jobs: usize,
    /// Wall and CPU seconds of a training on the CPU.
    pub wall_and_cpu_secs: Option<(f64, f64)>,
}

/// Why times are not to be trusted; empty if they are.
pub fn noise(q: &Quiet) -> Vec<String> {
    let mut why = Vec::new();
    if let Some(load) = q.load1
        && load - q.own > q.cores as f64
    {
        why.push(format!(
            "load average {load:.1} at the start, {:.1} of it our own, on {} cores",
            q.own, q.cores
        ));
    }
    if q.jobs > 1 {
        why.push(format!("{} runs at the same time", q.jobs));
    }
    if let Some((wall, cpu)) = q.wall_and_cpu_secs
        && cpu >= STARVED_CPU_SECS_MIN
        && wall > STARVED_WALL_PER_CPU * cpu
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
    fn dates() {
        assert_eq!(utc(0), "1970-01-01T00:00:00Z");
        assert_eq!(utc(951_782_399), "2000-02-28T23:59:59Z");
        assert_eq!(utc(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(utc(1_709_251_199), "2024-02-29T23:59:59Z");
        assert_eq!(utc(1_767_225_600), "2026-01-01T00:00:00Z");
    }

    #[test]
    fn our_own_load_builds_up_and_fades() {
        let start = Instant::now();
        let at = |secs| start + Duration::from_secs(secs);
        let run = Busy { from: start, to: at(600), cores: 2.0 };
        assert!((own_load1(&[run], at(600)) - 2.0).abs() < 1e-3);
        assert!((own_load1(&[run], at(660)) - 2.0 / 1_f64.exp()).abs() < 1e-3);
        let halves = [Busy { to: at(300), ..run }, Busy { from: at(300), ..run }];
        assert!((own_load1(&halves, at(600)) - own_load1(&[run], at(600))).abs() < 1e-12);
    }

    #[test]
    fn noise_is_what_others_do() {
        let quiet =
            Quiet { load1: Some(1.9), own: 0.0, cores: 2, jobs: 1, wall_and_cpu_secs: Some((10.0, 18.0)) };
        assert!(noise(&quiet).is_empty());
        assert!(noise(&Quiet { load1: Some(3.0), own: 1.5, ..quiet }).is_empty());
        assert!(noise(&Quiet { load1: Some(3.0), own: 0.5, ..quiet })[0].contains("3.0"));
        assert_eq!(noise(&Quiet { jobs: 2, ..quiet }).len(), 1);
        assert_eq!(noise(&Quiet { wall_and_cpu_secs: Some((30.0, 18.0)), ..quiet }).len(), 1);
        assert!(noise(&Quiet { wall_and_cpu_secs: Some((0.9, 0.1)), ..quiet }).is_empty());
        assert!(noise(&Quiet { load1: None, ..quiet }).is_empty());
    }
}
