//! A process and all that it has started, as the system tells of them.

/// The variable that marks whatever a child has started, so that it is found even when it left the group.
pub(super) const MARK: &str = "BOTTEGA_ENGINE_CHILD";

/// What a child and its children take. All 0 where the system does not tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct ProcessTree {
    pub(super) processes: usize,
    pub(super) resident_bytes: u64,
}

/// Whether the system tells what processes take.
pub(super) const IS_TOLD: bool = cfg!(unix);

/// A process, as `ps -axo pid=,ppid=,rss=` tells of it.
#[cfg(any(test, all(unix, not(target_os = "linux"))))]
fn listed(line: &str) -> Option<(u32, u32, u64)> {
    let mut numbers = line.split_whitespace().map(str::parse::<u64>);
    let mut next = || numbers.next()?.ok();
    let (id, parent, kib) = (next()?, next()?, next()?);
    Some((u32::try_from(id).ok()?, u32::try_from(parent).ok()?, kib << 10))
}

/// What a process takes with all below it, of processes with their parents and bytes.
#[cfg(any(test, all(unix, not(target_os = "linux"))))]
fn summed(all: &[(u32, u32, u64)], root: u32) -> ProcessTree {
    let mut tree = ProcessTree::default();
    let mut next = vec![root];
    while let Some(id) = next.pop() {
        let Some((_, _, bytes)) = all.iter().find(|(other, ..)| *other == id) else { continue };
        tree.processes += 1;
        tree.resident_bytes += bytes;
        // No process is its own grandparent, but for lists that are made while all changes.
        if tree.processes <= all.len() {
            next.extend(all.iter().filter(|(other, parent, _)| *parent == id && *other != id).map(|(id, ..)| *id));
        }
    }
    tree
}

#[cfg(not(target_os = "linux"))]
mod system {
    use super::ProcessTree;

    impl ProcessTree {
        /// Of the process `root` and all below it.
        #[cfg(unix)]
        pub(in super::super) fn of(root: u32) -> ProcessTree {
            let told = std::process::Command::new("ps").args(["-axo", "pid=,ppid=,rss="]).output();
            let text = told.map(|told| String::from_utf8_lossy(&told.stdout).into_owned()).unwrap_or_default();
            let all: Vec<_> = text.lines().filter_map(super::listed).collect();
            super::summed(&all, root)
        }

        #[cfg(not(unix))]
        pub(in super::super) fn of(_root: u32) -> ProcessTree {
            ProcessTree::default()
        }
    }

    pub(in super::super) fn marked(_mark: &str) -> Vec<u32> {
        Vec::new()
    }

    pub(in super::super) fn kill(_process: u32) {}
}

#[cfg(target_os = "linux")]
mod system {
    use std::{collections::BTreeMap, fs};

    use super::{MARK, ProcessTree};

    struct Stat {
        parent: u32,
        pages: u64,
    }

    fn processes() -> impl Iterator<Item = u32> {
        let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
        entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok())
    }

    fn stat(process: u32) -> Option<Stat> {
        let text = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
        // The name of the program stands in brackets and may hold anything.
        let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
        let number = |i: usize| fields.get(i).and_then(|field| field.parse::<u64>().ok());
        // proc(5): the parent is field 4, the resident pages 24; the first of `fields` is 3.
        Some(Stat { parent: number(1)? as u32, pages: number(21)? })
    }

    impl ProcessTree {
        /// Of the process `root` and all below it.
        pub(in super::super) fn of(root: u32) -> ProcessTree {
            let all: BTreeMap<u32, Stat> = processes().filter_map(|id| Some((id, stat(id)?))).collect();
            let mut tree = ProcessTree::default();
            let mut next = vec![root];
            while let Some(id) = next.pop() {
                let Some(found) = all.get(&id) else { continue };
                tree.processes += 1;
                tree.resident_bytes += found.pages * rustix::param::page_size() as u64;
                if tree.processes <= all.len() {
                    next.extend(all.iter().filter(|(_, stat)| stat.parent == id).map(|(id, _)| *id));
                }
            }
            tree
        }
    }

    /// All processes that carry this mark.
    pub(in super::super) fn marked(mark: &str) -> Vec<u32> {
        let wanted = format!("{MARK}={mark}");
        let carries = |id: &u32| {
            let environment = fs::read(format!("/proc/{id}/environ")).unwrap_or_default();
            environment.split(|byte| *byte == 0).any(|entry| entry == wanted.as_bytes())
        };
        processes().filter(carries).collect()
    }

    pub(in super::super) fn kill(process: u32) {
        if let Some(process) = i32::try_from(process).ok().and_then(rustix::process::Pid::from_raw) {
            let _ = rustix::process::kill_process(process, rustix::process::Signal::KILL);
        }
    }
}

pub(super) use system::{kill, marked};

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn processes_are_weighed_with_all_that_they_have_started() {
        let all: Vec<_> =
            ["    1     0   800", " 70 1 1024", "71 70 2048", "72 71 4", "80 1 99999", "PID PPID RSS", ""]
                .into_iter()
                .filter_map(listed)
                .collect();
        assert_eq!(summed(&all, 70), ProcessTree { processes: 3, resident_bytes: (1024 + 2048 + 4) << 10 });
        assert_eq!(summed(&all, 9), ProcessTree::default());
        // A circle ends.
        assert!(summed(&[(5, 6, 1), (6, 5, 1)], 5).processes <= 3);
    }
}
