//! The failure of a request that an agent passed on to the farm.

use thiserror::Error as ThisError;

use crate::error::Error;

/// The reason why the farm did not carry out the request of an agent, as the agent's answer gives it.
#[derive(Clone, Debug, PartialEq, Eq, ThisError)]
pub(super) enum FarmFailure {
    /// The farm refused, or does not answer.
    #[error("{chain}")]
    Farm {
        /// The error with its causes.
        chain: String,
    },
    /// The job was removed.
    #[error("there is no job {number} any more")]
    NoJob {
        /// The number of the job.
        number: u32,
    },
    /// The thread for the answer cannot be started.
    #[error("cannot start a thread: {problem}")]
    NoThread {
        /// The error of the system.
        problem: String,
    },
}

impl From<Error> for FarmFailure {
    fn from(error: Error) -> Self {
        Self::Farm { chain: error.error_chain() }
    }
}
