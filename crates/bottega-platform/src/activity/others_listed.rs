//! The processors that others keep at work, as a library counts them: macOS and Windows.

use sysinfo::{Pid, ProcessRefreshKind, ProcessesToUpdate, System};

/// Counts the processors that others keep at work.
#[derive(Default)]
pub struct BusyClock {
    /// As it was at the last call.
    system: Option<System>,
}

impl BusyClock {
    /// The processors that others than this program and what it has started have kept at work since the last call; 0 at the
    /// first.
    pub fn others(&mut self) -> f32 {
        let is_first = self.system.is_none();
        let Some(mut system) = self.system.take().or_else(|| System::new().ok()) else { return 0.0 };
        system.refresh_processes_specifics(ProcessesToUpdate::All, true, ProcessRefreshKind::nothing().with_cpu());
        let others = if is_first { 0.0 } else { busy_others(&system) };
        self.system = Some(system);
        others
    }
}

fn busy_others(system: &System) -> f32 {
    let Ok(own) = sysinfo::get_current_pid() else { return 0.0 };
    let processes = system.processes();
    let others = processes.keys().filter(|id| !comes_from(system, **id, own));
    // Hundredths of one processor.
    others.filter_map(|id| processes.get(id)).map(|process| process.cpu_usage().max(0.0) / 100.0).sum()
}

fn comes_from(system: &System, process: Pid, root: Pid) -> bool {
    let mut at = Some(process);
    // No family is deeper than that, but for lists that are made while all changes.
    for _ in 0..64 {
        match at {
            Some(id) if id == root => return true,
            Some(id) => at = system.process(id).and_then(sysinfo::Process::parent),
            None => return false,
        }
    }
    false
}
