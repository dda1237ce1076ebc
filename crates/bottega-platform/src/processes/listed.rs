//! Processes listed by the crate `sysinfo`: macOS and Windows.

use std::ffi::OsString;

use sysinfo::{Pid, ProcessRefreshKind, ProcessesToUpdate, System, UpdateKind};

use super::tree_usage::{MARK, TreeUsage};

/// Lists all processes; `None`: the system does not report them.
fn all(what: ProcessRefreshKind) -> Option<System> {
    let mut system = System::new().ok()?;
    system.refresh_processes_specifics(ProcessesToUpdate::All, true, what);
    Some(system)
}

/// Returns the number of processes and the resident memory of the process with id `root` and its descendants. Zero: it does not
/// exist, or the system does not list processes.
pub fn usage(root: u32) -> TreeUsage {
    let Some(system) = all(ProcessRefreshKind::nothing().with_memory()) else { return TreeUsage::default() };
    let processes = system.processes();
    let mut tree = TreeUsage::default();
    let mut next = vec![Pid::from_u32(root)];
    while let Some(id) = next.pop() {
        let Some(found) = processes.get(&id) else { continue };
        tree.processes += 1;
        tree.resident_bytes += found.memory();
        // Limit the count, because a list made while processes change may contain cycles.
        if tree.processes <= processes.len() {
            let is_child = |(other, process): &(&Pid, &sysinfo::Process)| process.parent() == Some(id) && **other != id;
            next.extend(processes.iter().filter(is_child).map(|(id, _)| *id));
        }
    }
    tree
}

/// Returns the ids of all processes with this mark, as far as the system shows their environments.
pub fn marked(mark: &str) -> Vec<u32> {
    let wanted = OsString::from(format!("{MARK}={mark}"));
    let Some(system) = all(ProcessRefreshKind::nothing().with_environ(UpdateKind::Always)) else { return Vec::new() };
    let carries = system.processes().iter().filter(|(_, process)| process.environ().contains(&wanted));
    carries.map(|(id, _)| id.as_u32()).collect()
}

/// Kills the process with this id. Returns `true` if it existed and this was allowed.
pub fn kill(process: u32) -> bool {
    let id = Pid::from_u32(process);
    let Ok(mut system) = System::new() else { return false };
    system.refresh_processes_specifics(ProcessesToUpdate::Some(&[id]), false, ProcessRefreshKind::nothing());
    system.process(id).is_some_and(sysinfo::Process::kill)
}
