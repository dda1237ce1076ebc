//! The processors kept busy by other programs, by the crate `sysinfo`: macOS and Windows.

use sysinfo::{Pid, ProcessRefreshKind, ProcessesToUpdate, System};

/// A counter of the processors that other programs keep busy.
#[derive(Default)]
pub struct BusyClock {
    /// The state at the last call.
    system: Option<System>,
}

impl BusyClock {
    /// Returns the mean number of processors kept busy since the last call by programs other than this one and its descendants; 0
    /// on the first call, or if the system does not report it.
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
    // Usage is in percent of one processor.
    others.filter_map(|id| processes.get(id)).map(|process| process.cpu_usage().max(0.0) / 100.0).sum()
}

fn comes_from(system: &System, process: Pid, root: Pid) -> bool {
    let mut at = Some(process);
    // Limit the depth, because a list made while processes change may contain cycles.
    for _ in 0..64 {
        match at {
            Some(id) if id == root => return true,
            Some(id) => at = system.process(id).and_then(sysinfo::Process::parent),
            None => return false,
        }
    }
    false
}
