//! The resources that a process has used for a job.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The source of a machine's energy values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EnergySource {
    /// Counters of the machine's processor packages.
    Counters,
    /// Watts declared by its owner, or by the operator of the farm.
    Watts,
}

/// The processor time and energy that one process has used for a job so far.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobUsage {
    /// The unique number of the job, [`Job::origin`](crate::job::record::Job::origin).
    pub work: u64,
    /// Processor time in milliseconds.
    pub processor_ms: u64,
    /// Energy in millijoules. `None`: unknown.
    pub millijoules: Option<u64>,
    /// The source of the energy value. `None`: the energy is unknown.
    pub source: Option<EnergySource>,
    /// The number of processors of its machine.
    pub processors: usize,
}
