//! CPU time of the process, which measures work on a shared machine better than wall time does.

use cpu_time::ProcessTime;

/// CPU seconds (user and system, all threads) that the process has used so far; 0 where the system does not report
/// them. Only differences between readings are meaningful.
pub fn process_cpu_secs() -> f64 {
    ProcessTime::try_now().map_or(0.0, |t| t.as_duration().as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cpu_time_grows_with_work() {
        let before = process_cpu_secs();
        let mut x = 1.0_f64;
        while process_cpu_secs() - before < 0.02 {
            x = std::hint::black_box(x.sin() + 1.0);
        }
        assert!(x.is_finite());
        assert!(process_cpu_secs() > before);
    }
}
