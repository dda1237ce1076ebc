//! Connections of agents to the server: each has a link of its own.

use std::sync::Arc;

use bottega_agents::driver::nats::NatsThread;
use bottega_cluster::{Credentials, FarmAddress, FarmLink, link, own_server::Entry};
use bottega_farm::{Link, WorkId};

use crate::error::Error;

/// The way to the server, as processes tell each other.
#[derive(Clone, Debug)]
pub(crate) enum ServerAccess {
    /// To a server that was started for a measurement.
    Started(Entry),
    /// To that of a farm.
    Farm(Box<FarmAddress>, Credentials),
}

/// Makes the links of a process.
pub(crate) enum ServerLinks {
    /// They share a thread.
    Started(Entry, Arc<NatsThread>),
    /// Each has its own.
    Farm(Box<FarmAddress>, Credentials),
}

impl ServerLinks {
    pub(crate) fn new(access: ServerAccess) -> Result<Self, Error> {
        Ok(match access {
            ServerAccess::Started(entry) => {
                let thread = NatsThread::start().map_err(|source| {
                    let remedy = "let fewer programs run at once".to_owned();
                    bottega_cluster::Error::Farm { source, remedy }
                })?;
                Self::Started(entry, thread)
            }
            ServerAccess::Farm(address, credentials) => Self::Farm(address, credentials),
        })
    }

    /// The link of an agent.
    pub(crate) fn link(&self, work: u64, agent: u32) -> Result<Link, Error> {
        let work = WorkId(work);
        match self {
            Self::Started(entry, thread) => {
                let name = format!("bench-{agent}");
                Ok(Link { uplink: Arc::new(entry.link(thread, &name)?), work, job: None, name })
            }
            Self::Farm(address, credentials) => {
                let FarmLink { uplink, name, .. } = link(Some(address), credentials)?;
                // Behind a full stop a member may call itself what it likes.
                Ok(Link { uplink, work, job: None, name: format!("{name}.{agent}") })
            }
        }
    }
}
