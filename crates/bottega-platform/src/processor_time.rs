//! Processor time.

/// Returns the processor time of this process so far, in seconds; `None`: the system does not report it. Other load on the
/// machine affects it only through the caches.
#[cfg(unix)]
pub fn own_seconds() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64)
}

/// Returns the processor time of this process so far, in seconds, to a millisecond; `None`: the system does not report it.
#[cfg(not(unix))]
pub fn own_seconds() -> Option<f64> {
    use sysinfo::{ProcessRefreshKind, ProcessesToUpdate, System};
    let own = sysinfo::get_current_pid().ok()?;
    let mut system = System::new().ok()?;
    system.refresh_processes_specifics(
        ProcessesToUpdate::Some(&[own]),
        false,
        ProcessRefreshKind::nothing().with_cpu(),
    );
    Some(system.process(own)?.accumulated_cpu_time() as f64 / 1e3)
}

/// Returns the processor time of the calling thread so far, in seconds; `None`: the system does not report it (only Linux does).
pub fn thread_seconds() -> Option<f64> {
    #[cfg(target_os = "linux")]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        Some(time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64)
    }
    #[cfg(not(target_os = "linux"))]
    None
}

/// Returns the processor time of all children that have ended and been waited for, and of theirs, in seconds; `None`: the system
/// does not report it (only Linux does).
pub fn children_seconds() -> Option<f64> {
    #[cfg(target_os = "linux")]
    {
        let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
        // After the name in parentheses: the state is field 3 of the line, cutime and cstime are fields 16 and 17.
        let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
        let ticks = |field: usize| fields.get(field - 3)?.parse::<f64>().ok();
        Some((ticks(16)? + ticks(17)?) / rustix::param::clock_ticks_per_second() as f64)
    }
    #[cfg(not(target_os = "linux"))]
    None
}

/// Returns the processor time of the whole machine since its start, in seconds; `None`: the system does not report it (only Linux
/// does).
pub fn machine_seconds() -> Option<f64> {
    cfg!(target_os = "linux")
        .then(|| std::fs::read_to_string("/proc/stat").ok())
        .flatten()
        .and_then(|text| busy_seconds(&text))
}

/// Parses the first line of `/proc/stat`: user, nice, system, interrupts; without idle and I/O wait.
fn busy_seconds(stat: &str) -> Option<f64> {
    /// The unit of the file on every architecture of Linux.
    const TICKS_PER_SECOND: f64 = 100.0;
    let line = stat.lines().next()?.strip_prefix("cpu ")?;
    let ticks: Vec<u64> = line.split_ascii_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    // user nice system idle iowait irq softirq steal; guest time is included in the first two.
    let busy = [0, 1, 2, 5, 6].map(|i| ticks.get(i).copied().unwrap_or_default());
    Some(busy.iter().sum::<u64>() as f64 / TICKS_PER_SECOND)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_a_machine_is_that_of_its_first_line() {
        let stat = "cpu  100 20 30 9999 50 4 6 7 60 0\ncpu0 1 2 3\n";
        assert_eq!(busy_seconds(stat), Some(1.6));
        assert_eq!(busy_seconds("intr 7"), None);
    }

    #[test]
    fn this_process_is_seen_to_work() {
        let begun = own_seconds().expect("every system that is known tells");
        let mut sum = 0u64;
        let started = std::time::Instant::now();
        while own_seconds().is_some_and(|now| now - begun < 0.05) && started.elapsed().as_secs() < 20 {
            sum = sum.wrapping_add(std::hint::black_box(1));
        }
        assert!(own_seconds().is_some_and(|now| now - begun >= 0.05));
        if cfg!(target_os = "linux") {
            assert!(thread_seconds().is_some_and(|thread| thread >= 0.04), "this thread did it");
            assert!(machine_seconds().is_some_and(|all| all >= 0.05));
        }
    }
}
