//! The activity of the owner by `/proc`, logind, the X server and terminals.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{self, Command, Stdio},
    time::{Duration, Instant, SystemTime},
};

/// A counter of the processors that other programs keep busy.
#[derive(Default)]
pub struct BusyClock {
    /// Processor time of all programs and of this one, in ticks, and the time of the measurement.
    before: Option<([u64; 2], Instant)>,
}

impl BusyClock {
    /// Returns the mean number of processors kept busy since the last call by programs other than this one and its descendants; 0
    /// on the first call, or if the system does not report it.
    pub fn others(&mut self) -> f32 {
        let Some(now) = busy_ticks() else { return 0.0 };
        let before = self.before.replace((now, Instant::now()));
        let Some((before, then)) = before else { return 0.0 };
        let [all, own] = [0, 1].map(|index| now[index].saturating_sub(before[index]) as f32);
        // On every Linux, a tick in user space is a hundredth of a second.
        (all - own).max(0.0) / 100.0 / then.elapsed().as_secs_f32().max(0.01)
    }
}

/// Returns the processor time of all processes, and of this one with its descendants, because engines paint for the farm, too.
fn busy_ticks() -> Option<[u64; 2]> {
    let all = fs::read_to_string("/proc/stat").ok()?;
    let stats =
        fs::read_dir("/proc").ok()?.flatten().filter_map(|entry| fs::read_to_string(entry.path().join("stat")).ok());
    let processes: Vec<ProcessTime> = stats.filter_map(|stat| process_time(&stat)).collect();
    Some([all_ticks(&all)?, own_ticks(&processes, process::id())])
}

/// The processor time of a process.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ProcessTime {
    id: u32,
    parent: u32,
    /// Ticks, including those of children that have ended.
    ticks: u64,
}

/// Returns the sum of user, nice, system and interrupts, without idle and I/O wait.
fn all_ticks(stat: &str) -> Option<u64> {
    let fields: Vec<u64> = stat.lines().next()?.split_whitespace().skip(1).filter_map(|it| it.parse().ok()).collect();
    Some(*fields.first()? + fields.get(1)? + fields.get(2)? + fields.get(5)? + fields.get(6)?)
}

/// Parses fields 1, 4 and 14 to 17; the name in field 2 may contain anything, but is in parentheses.
fn process_time(stat: &str) -> Option<ProcessTime> {
    let (id, rest) = stat.split_once(' ')?;
    let fields: Vec<&str> = rest.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = fields.iter().skip(11).take(4).filter_map(|it| it.parse::<u64>().ok()).sum();
    Some(ProcessTime { id: id.parse().ok()?, parent: fields.get(1)?.parse().ok()?, ticks })
}

/// Returns the ticks of a process and its descendants.
fn own_ticks(processes: &[ProcessTime], root: u32) -> u64 {
    let mut family = vec![root];
    let mut at = 0;
    while let Some(&parent) = family.get(at) {
        let children = processes.iter().filter(|it| it.parent == parent && it.id != parent).map(|it| it.id);
        family.extend(children.collect::<Vec<_>>());
        at += 1;
    }
    processes.iter().filter(|it| family.contains(&it.id)).map(|it| it.ticks).sum()
}

/// Returns the time since the owner's last input, as reported by logind and the X server; `None`: neither knows it.
pub fn idle() -> Option<Duration> {
    [idle_sessions(), idle_x_server()].into_iter().flatten().min()
}

/// Returns the time since the last read from a terminal; `None`: there are none.
pub fn idle_terminals() -> Option<Duration> {
    idle_terminals_in(Path::new("/dev"))
}

fn idle_terminals_in(devices: &Path) -> Option<Duration> {
    let terminals = fs::read_dir(devices.join("pts")).into_iter().flatten().flatten();
    let consoles = (1..=6).map(|number| devices.join(format!("tty{number}")));
    let all = terminals.map(|entry| entry.path()).filter(|path| !path.ends_with("ptmx")).chain(consoles);
    let now = SystemTime::now();
    let read = |path: PathBuf| fs::metadata(path).ok()?.accessed().ok();
    all.filter_map(read).map(|time| now.duration_since(time).unwrap_or_default()).min()
}

/// Returns by logind the time since all sessions are idle.
fn idle_sessions() -> Option<Duration> {
    if !Path::new("/run/systemd/seats").exists() {
        return None;
    }
    let place = ["org.freedesktop.login1", "/org/freedesktop/login1", "org.freedesktop.login1.Manager"];
    let said = answer(Command::new("busctl").args(["get-property"]).args(place).args(["IdleHint", "IdleSinceHint"]))?;
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).ok()?;
    idle_of_sessions(&said, now)
}

/// - `said`: for example `b true` and `t 1764160000000000`, in microseconds since 1970.
fn idle_of_sessions(said: &str, now: Duration) -> Option<Duration> {
    let mut lines = said.lines();
    match lines.next()? {
        "b true" => {
            let since = lines.next()?.strip_prefix("t ")?.parse().ok().filter(|since| *since > 0)?;
            Some(now.saturating_sub(Duration::from_micros(since)))
        }
        "b false" => Some(Duration::ZERO),
        _ => None,
    }
}

/// Returns the idle time of the X server, if `xprintidle` is installed.
fn idle_x_server() -> Option<Duration> {
    std::env::var_os("DISPLAY")?;
    Some(Duration::from_millis(answer(&mut Command::new("xprintidle"))?.trim().parse().ok()?))
}

fn answer(command: &mut Command) -> Option<String> {
    let output = command.stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_of_the_system_and_of_a_family_are_read() {
        assert_eq!(all_ticks("cpu  10 2 30 4000 500 6 7 0 0 0\ncpu0 1 1 1 1\n"), Some(55));
        let stat = "42 (a ) b) S 7 42 42 0 -1 4194304 1 2 3 4 100 20 3 1 20 0 9 0 1";
        let one = process_time(stat).expect("a process");
        assert_eq!(one, ProcessTime { id: 42, parent: 7, ticks: 124 });
        let other = |id, parent| ProcessTime { id, parent, ticks: 1 };
        assert_eq!(own_ticks(&[one, other(50, 42), other(51, 50), other(7, 1), other(60, 7)], 42), 126);
        assert_eq!(all_ticks("cpu 1"), None);
    }

    #[test]
    fn logind_says_since_when_all_sessions_are_idle() {
        let now = Duration::from_secs(1000);
        assert_eq!(idle_of_sessions("b true\nt 400000000\n", now), Some(Duration::from_secs(600)));
        assert_eq!(idle_of_sessions("b false\nt 400000000\n", now), Some(Duration::ZERO));
        // There are no sessions.
        assert_eq!(idle_of_sessions("b true\nt 0\n", now), None);
    }

    #[test]
    fn a_terminal_that_was_read_now_is_not_idle() {
        let devices = tempfile::tempdir().expect("a folder");
        assert_eq!(idle_terminals_in(devices.path()), None);
        fs::create_dir(devices.path().join("pts")).expect("a folder");
        fs::write(devices.path().join("pts/3"), "x").expect("a file");
        fs::read(devices.path().join("pts/3")).expect("a file");
        assert!(idle_terminals_in(devices.path()).is_some_and(|idle| idle < Duration::from_secs(60)));
    }

    #[test]
    fn others_can_be_observed() {
        let mut clock = BusyClock::default();
        assert_eq!(clock.others(), 0.0);
        assert!(clock.others() >= 0.0);
    }
}
