//! The way between the processes that paint one work: what a job needs of a network, whichever it is.

use std::sync::Arc;

use bottega_agents::{AgentId, Key, driver::Uplink};

use super::shared::JobAgent;

/// A network that joins the processes of a work. Its methods block.
pub trait JobTransport: Send + Sync {
    /// Returns the address of an agent of this process, for directories.
    fn address_of(&self, agent: &AgentId) -> String;

    /// Links the agents of this process with those of others, and with the pages of the work's platform.
    ///
    /// - `process`: the name of this process, behind `@` in the names of its agents.
    ///
    /// # Errors
    /// The operating system gives no thread.
    fn begin(&self, process: &str) -> std::io::Result<Arc<dyn JobUplink>>;

    /// Keeps a tile under a name, where other processes can read it.
    ///
    /// # Errors
    /// The network does not take it.
    fn put_tile(&self, name: &str, bytes: &[u8]) -> Result<(), TransportError>;

    /// Reads the tile of a name. `None`: there is none.
    ///
    /// - `bytes_max`: a larger tile is an error.
    ///
    /// # Errors
    /// The network does not give it.
    fn get_tile(&self, name: &str, bytes_max: usize) -> Result<Option<Vec<u8>>, TransportError>;

    /// Whether the network is there now.
    fn is_connected(&self) -> bool;

    /// Sends all messages that wait, as far as the network takes them within some seconds.
    fn flush(&self);

    /// Removes all entries whose keys begin with `prefix`, and all tiles whose names begin with `folder`.
    fn forget(&self, prefix: &Key, folder: &str);
}

/// The uplink of the agents of one process, until it is closed.
pub trait JobUplink: Uplink<JobAgent> {
    /// Takes the entries of this process's agents out of the directories. Nothing is heard of these afterwards.
    fn close(&self);
}

/// The reason why a network did not keep or give a tile.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{reason}")]
pub struct TransportError {
    /// The reason, with the name of the tile.
    pub reason: String,
    /// Whether every further try fails, too. A server that is away or has a full disk is not such a case.
    pub is_lasting: bool,
    /// Whether the server says that its disk is full.
    pub is_full: bool,
}
