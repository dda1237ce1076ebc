//! The presence of a machine at a farm, as it announces itself.

use serde::{Deserialize, Serialize};

use crate::{
    build::build,
    job::{activity::Activity, usage::JobUsage},
};

/// The state of a machine, commanded or actual.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PresenceState {
    /// The machine works on jobs.
    #[default]
    Active,
    /// The machine stays in the farm, but its processors are free for other programs.
    Suspended,
    /// The machine leaves the farm.
    Terminated,
}

impl PresenceState {
    /// Returns the name of the state, such as `active`: in messages, JSON, the HTTP API and FIPA messages.
    pub fn word(self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::Suspended => "suspended",
            Self::Terminated => "terminated",
        }
    }
}

/// A job that a machine refuses to render.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refusal {
    /// The number of the job.
    pub job: u32,
    /// The unique number of the painting that it refuses; it may accept a later one.
    pub work: u64,
    /// The reason, as text for the submitter.
    pub reason: String,
}

/// The presence of a machine: its properties and current work.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Presence {
    /// The name of the process.
    pub name: String,
    /// The number of threads with which the process renders.
    pub threads: usize,
    /// The machine's other devices: names of GPUs, addresses of boards.
    #[serde(default)]
    pub devices: Vec<String>,
    /// The identity of the process's build.
    pub version: String,
    /// The number of the job that the process works on; `None`: it waits for one.
    pub job: Option<u32>,
    /// The actual state of the process, which follows the command to it.
    pub standing: PresenceState,
    /// The activity of the process at its job.
    #[serde(default)]
    pub activity: Activity,
    /// A counter that changes when the process starts or finishes something.
    #[serde(default)]
    pub moves: u64,
    /// True if the process obeys commands; false for one that submitted a job and only works on that.
    pub takes_orders: bool,
    /// True if the process may only render.
    #[serde(default)]
    pub is_guest: bool,
    /// The machine's tags, which jobs can require.
    #[serde(default)]
    pub tags: Vec<String>,
    /// The machine's last refusals, at most 16, in the order of the jobs' numbers.
    #[serde(default)]
    pub refusals: Vec<Refusal>,
    /// The resources that the process has used for its last jobs.
    #[serde(default)]
    pub usages: Vec<JobUsage>,
}

impl Presence {
    /// Returns the presence of an active machine of this build that waits for work and obeys commands, without further devices,
    /// tags, refusals and usages.
    ///
    /// - `name`: the name of its process.
    /// - `threads`: number of threads with which it renders.
    /// - `job`: the number of the job that it works on; `None`: it waits for one.
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
