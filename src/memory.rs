//! Memory of the machine and of this process, as the operating system reports it. `resource_estimate` predicts.

/// Memory that this process may use: the machine's, or its control group's where that is less.
pub fn machine_bytes() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let machine = kib_of(&text, "MemTotal:")?;
    let group = std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
    let group = group.and_then(|g| g.trim().parse().ok()).unwrap_or(u64::MAX);
    Some(machine.min(group))
}

/// Memory of this process: now, and at most so far.
pub fn process_bytes() -> Option<(u64, u64)> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    Some((kib_of(&text, "VmRSS:")?, kib_of(&text, "VmHWM:")?))
}

fn kib_of(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|l| l.strip_prefix(key))?;
    let kib: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meminfo_is_parsed() {
        assert_eq!(kib_of("MemFree: 1 kB\nMemTotal:   16 kB\n", "MemTotal:"), Some(16_384));
        assert_eq!(kib_of("MemTotal: x", "MemTotal:"), None);
    }
}
