//! A machine of a farm as its seat shows it.

use serde::{Deserialize, Serialize};

use crate::{activity::Activity, build::build, usage::JobUsage};

/// The state of a machine, ordered or actual.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PresenceState {
    /// It paints what is asked for.
    #[default]
    Active,
    /// It keeps its seat, and its processors are free for others.
    Suspended,
    /// It leaves the farm.
    Terminated,
}

impl PresenceState {
    /// As people read it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::Suspended => "suspended",
            Self::Terminated => "terminated",
        }
    }
}

/// A job that a machine does not paint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refusal {
    /// The number of the job.
    pub job: u32,
    /// The number of its painting, which no other one has had: painted again, it may be another matter.
    pub work: u64,
    /// Why.
    pub reason: String,
}

/// A machine that is there.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Presence {
    /// The process.
    pub name: String,
    /// Its processors.
    pub threads: usize,
    /// What paints beside them: names of GPUs, addresses of boards.
    #[serde(default)]
    pub devices: Vec<String>,
    /// The identity of its build.
    pub version: String,
    /// The job that it paints.
    pub job: Option<u32>,
    /// What it does, as it was told.
    pub standing: PresenceState,
    /// Whether it is at work for its job.
    #[serde(default)]
    pub activity: Activity,
    /// A number that is another one when it has begun or finished something.
    #[serde(default)]
    pub moves: u64,
    /// Whether it does what it is told; not the process that asked for a job and paints with the others until it is done.
    pub takes_orders: bool,
    /// Whether it may paint and no more.
    #[serde(default)]
    pub is_guest: bool,
    /// What it says that it is, by which jobs ask for it.
    #[serde(default)]
    pub tags: Vec<String>,
    /// The last jobs that it does not paint, and why.
    #[serde(default)]
    pub refusals: Vec<Refusal>,
    /// What it has used for the last jobs.
    #[serde(default)]
    pub usages: Vec<JobUsage>,
}

impl Presence {
    /// The seat of a machine of this build that paints, or waits for work.
    pub fn new(name: &str, threads: usize, job: Option<u32>) -> Self {
        Self {
            name: name.to_owned(),
            threads,
            devices: Vec::new(),
            version: build().identity().to_owned(),
            job,
            standing: PresenceState::Active,
            activity: Activity::Waiting,
            moves: 0,
            takes_orders: true,
            is_guest: false,
            tags: Vec::new(),
            refusals: Vec::new(),
            usages: Vec::new(),
        }
    }
}
