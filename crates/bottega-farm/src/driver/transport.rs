//! The network between the processes of one work, as an interface.

use std::sync::Arc;

use bottega_agents::{AgentId, Key, driver::Uplink};

use super::job_agent::JobAgent;

/// A network between the processes of a work. Its methods block.
pub trait JobTransport: Send + Sync {
    /// Returns the address of an agent of this process, for directories.
    fn address_of(&self, agent: &AgentId) -> String;

    /// Connects the agents of this process with those of others, and with the directories of the work's platform.
    ///
    /// - `process`: the name of this process, the part after `@` in the names of its agents.
    ///
    /// # Errors
    /// A thread cannot be started.
    fn begin(&self, process: &str) -> std::io::Result<Arc<dyn JobUplink>>;

    /// Stores a tile under a name, for other processes.
    ///
    /// # Errors
    /// The network cannot store it.
    fn put_tile(&self, name: &str, bytes: &[u8]) -> Result<(), TransportError>;

    /// Fetches the tile of a name. `None`: it does not exist.
    ///
    /// - `bytes_max`: a larger tile is an error.
    ///
    /// # Errors
    /// The network cannot return it.
    fn get_tile(&self, name: &str, bytes_max: usize) -> Result<Option<Vec<u8>>, TransportError>;

    /// Returns true if the network is connected.
    fn is_connected(&self) -> bool;

    /// Sends all waiting messages, for at most some seconds.
    fn flush(&self);

    /// Removes all entries whose keys begin with `prefix`, and all tiles whose names begin with `folder`.
    fn forget(&self, prefix: &Key, folder: &str);
}

/// The uplink of the agents of one process, until it is closed.
pub trait JobUplink: Uplink<JobAgent> {
    /// Deregisters the agents of this process from the directories. The result is not reported.
    fn close(&self);
}

/// The reason why a network did not store or return a tile.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{reason}")]
pub struct TransportError {
    /// The reason, with the name of the tile.
    pub reason: String,
    /// True if a retry also fails. A server that is down or has a full disk is not such a case.
    pub is_lasting: bool,
    /// True if the server reports a full disk.
    pub is_full: bool,
}
