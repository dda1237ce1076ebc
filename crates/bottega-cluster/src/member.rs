//! A process at a farm: what it is, what it does, and what it has used.

use std::sync::{Arc, Mutex, PoisonError};

use bottega_farm::StopSwitch;

use crate::{
    activity::ActivityLog,
    job_board::{JobBoard, Presence},
    refusals::Refusals,
    stall_watch::StallWatch,
    usage::UsageMeter,
};

/// A process at a farm.
#[derive(Clone)]
pub(crate) struct Member {
    pub board: JobBoard,
    pub name: String,
    pub threads: usize,
    /// What paints beside its processors.
    pub devices: Vec<String>,
    /// The user wants to stop.
    pub stop: StopSwitch,
    /// What the machine says that it is.
    pub tags: Vec<String>,
    /// Jobs that this machine does not paint.
    pub refusals: Refusals,
    /// What it uses for each job.
    pub meter: UsageMeter,
    /// What it does.
    pub activity: ActivityLog,
    /// Its watch over the jobs of the farm.
    pub stalls: Arc<Mutex<StallWatch>>,
}

impl Member {
    /// A process that waits for work.
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

    /// Looks whether a job waits though machines are free.
    pub(crate) fn watch_stalls(&self) {
        self.stalls.lock().unwrap_or_else(PoisonError::into_inner).look(&self.board);
    }

    /// Its seat, while it paints a job or waits for one.
    pub(crate) fn seat(&self, job: Option<u32>) -> Presence {
        let (is_guest, refusals, usages) = (self.board.uplink.is_guest(), self.refusals.last(), self.meter.usages());
        let (devices, tags) = (self.devices.clone(), self.tags.clone());
        let (activity, moves) = (self.activity.now(), self.activity.moves());
        let seat = Presence::new(&self.name, self.threads, job);
        Presence { is_guest, tags, refusals, usages, devices, activity, moves, ..seat }
    }
}
