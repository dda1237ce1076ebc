//! A process of a farm: its properties, its activity and its resource usage.

use std::sync::{Arc, Mutex, PoisonError};

use bottega_farm::StopSwitch;

use crate::{
    job::{activity::ActivityLog, board::JobBoard, presence::Presence, refusals::Refusals, stall_watch::StallWatch},
    machine::usage_meter::UsageMeter,
};

/// A process of a farm.
#[derive(Clone)]
pub(crate) struct Member {
    pub board: JobBoard,
    pub name: String,
    pub threads: usize,
    /// The devices with which the machine renders, without the CPU.
    pub devices: Vec<String>,
    /// Requested when the user wants to stop.
    pub stop: StopSwitch,
    /// The tags of the machine.
    pub tags: Vec<String>,
    /// The jobs that this machine refuses to render.
    pub refusals: Refusals,
    /// The resources that the machine uses for each job.
    pub meter: UsageMeter,
    /// The machine's current activity.
    pub activity: ActivityLog,
    /// The machine's watch for stalled jobs.
    pub stalls: Arc<Mutex<StallWatch>>,
}

impl Member {
    /// Returns a process that waits for work.
    pub(crate) fn new(board: JobBoard, name: String, devices: (usize, Vec<String>), stop: &StopSwitch) -> Self {
        let (threads, devices) = devices;
        Self {
            board,
            name,
            threads,
            devices,
            stop: stop.clone(),
            tags: Vec::new(),
            refusals: Refusals::default(),
            meter: UsageMeter::new(None),
            activity: ActivityLog::default(),
            stalls: Arc::new(Mutex::new(StallWatch::new())),
        }
    }

    /// Checks for jobs that wait although machines are free.
    pub(crate) fn watch_stalls(&self) {
        self.stalls.lock().unwrap_or_else(PoisonError::into_inner).look(&self.board);
    }

    /// Returns its presence, with the job that it works on, if any.
    pub(crate) fn presence(&self, job: Option<u32>) -> Presence {
        let (is_guest, refusals, usages) = (self.board.uplink.is_guest(), self.refusals.last(), self.meter.usages());
        let (devices, tags) = (self.devices.clone(), self.tags.clone());
        let (activity, moves) = (self.activity.now(), self.activity.moves());
        let presence = Presence::new(&self.name, self.threads, job);
        Presence { is_guest, tags, refusals, usages, devices, activity, moves, ..presence }
    }
}
