//! Connections of agents to the server: each has a link of its own.

use std::sync::Arc;

use bottega_agents::driver::nats::{NatsThread, NatsUplink};
use bottega_cluster::{Credentials, FarmAddress, FarmLink, job_link, link, own_server::Entry};
use bottega_farm::{FarmCodec, Link, WorkId};

use crate::Error;

/// The way to the server, as processes tell each other.
#[derive(Clone, Debug)]
pub enum ServerAccess {
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

/// The link of an agent, and the connection under it, whose traffic is counted.
pub(crate) struct AgentLink {
    pub(crate) link: Link,
    pub(crate) uplink: Arc<NatsUplink<FarmCodec>>,
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
    pub(crate) fn link(&self, work: u64, agent: u32) -> Result<AgentLink, Error> {
        let work = WorkId(work);
        let (uplink, name) = match self {
            Self::Started(entry, thread) => {
                let name = format!("bench-{agent}");
                (Arc::new(entry.link(thread, &name)?), name)
            }
            Self::Farm(address, credentials) => {
                let FarmLink { uplink, name, .. } = link(Some(address), credentials)?;
                // Behind a full stop a member may call itself what it likes.
                (uplink, format!("{name}.{agent}"))
            }
        };
        Ok(AgentLink { link: job_link(Arc::clone(&uplink), work, None, name), uplink })
    }
}
