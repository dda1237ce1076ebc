//! The cost of commands: their run time and processor time.

use std::{
    fs,
    process::{Child, ExitStatus},
    sync::{Mutex, PoisonError},
    time::Instant,
};

use anyhow::{Context, Result};
use rustix::process::{Pid, WaitId, WaitIdOptions, waitid};

/// The number of rows in the final table.
const ROWS_SHOWN: usize = 10;

/// The cost of a command that has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cost {
    /// Run time in seconds.
    pub(crate) clock: f64,
    /// Processor time of the command and all its children that have ended, in seconds. `None`: the system does not report it
    /// (only Linux does).
    pub(crate) processors: Option<f64>,
}

/// The costs of all commands that have ended, by name.
static SPENT: Mutex<Vec<(String, Cost)>> = Mutex::new(Vec::new());

/// Waits for a child, and records its cost under a name.
///
/// - `begun`: the start time of the child.
pub(crate) fn wait(name: &str, child: &mut Child, begun: Instant) -> Result<(ExitStatus, Cost)> {
    let number = Pid::from_child(child);
    // The processor time can be read until the process is reaped.
    waitid(WaitId::Pid(number), WaitIdOptions::EXITED | WaitIdOptions::NOWAIT).context("cannot wait for a child")?;
    let processors = fs::read_to_string(format!("/proc/{}/stat", child.id())).ok().and_then(|stat| seconds(&stat));
    let status = child.wait()?;
    let cost = Cost { clock: begun.elapsed().as_secs_f64(), processors };
    SPENT.lock().unwrap_or_else(PoisonError::into_inner).push((name.to_owned(), cost));
    Ok((status, cost))
}

/// Parses the processor time of a process and of its children that have ended, in seconds: the fields utime, stime, cutime and
/// cstime of `/proc/PID/stat`, the 14th to 17th.
fn seconds(stat: &str) -> Option<f64> {
    // The name in parentheses may contain anything; the state after it is the third field.
    let fields: Vec<&str> = stat.rsplit(')').next()?.split_whitespace().collect();
    let ticks = (14..=17).map(|field| fields.get(field - 3)?.parse::<f64>().ok()).sum::<Option<f64>>()?;
    Some(ticks / rustix::param::clock_ticks_per_second() as f64)
}

/// Prints the most expensive commands, and the sum of all.
///
/// - `begun`: the start time of the first command.
pub(crate) fn print_longest(begun: Instant) {
    let mut spent = SPENT.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let processors: f64 = spent.iter().filter_map(|(_, cost)| cost.processors).sum();
    spent.sort_by(|(_, a), (_, b)| b.weight().total_cmp(&a.weight()));
    println!("\nwhat took longest      clock  processors");
    for (name, cost) in spent.iter().take(ROWS_SHOWN) {
        println!("{cost}  {name}");
    }
    println!("{}  all", Cost { clock: begun.elapsed().as_secs_f64(), processors: Some(processors) });
}

impl Cost {
    /// Returns the sort key of the table: the larger of both times.
    fn weight(&self) -> f64 {
        self.clock.max(self.processors.unwrap_or_default())
    }
}

impl std::fmt::Display for Cost {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let processors = self.processors.map_or_else(|| "         –".to_owned(), |it| format!("{it:>8.1} s"));
        write!(f, "                  {:>8.1} s  {processors}", self.clock)
    }
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;

    #[test]
    fn a_name_with_brackets_hides_no_field() {
        let stat = "7 (a) b (c)) S 1 7 7 0 -1 4194560 1 2 3 4 100 50 25 25 20 0 1 0";
        let ticks = rustix::param::clock_ticks_per_second() as f64;
        assert_eq!(seconds(stat), Some(200.0 / ticks));
        assert_eq!(seconds("7 (a) S 1 7"), None);
    }

    #[test]
    fn what_a_child_and_its_children_spend_is_seen() {
        let begun = Instant::now();
        let count = "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done";
        let mut child = Command::new("sh").args(["-c", &format!("sh -c '{count}'; {count}")]).spawn().unwrap();
        let (status, cost) = wait("counting", &mut child, begun).unwrap();
        assert!(status.success() && cost.processors.is_some_and(|spent| spent > 0.0 && spent <= 2.0 * cost.clock));
    }
}
