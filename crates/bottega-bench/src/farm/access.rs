//! Connections of agents to the server; each agent has its own link.

use std::sync::Arc;

use bottega_agents::driver::nats::{NatsThread, NatsUplink};
use bottega_cluster::{Credentials, FarmAddress, FarmLink, job_link, link, own_server::Entry};
use bottega_farm::{FarmCodec, Link, WorkId};

use crate::error::Error;

/// The address of the server, passed between processes.
#[derive(Clone, Debug)]
pub(crate) enum ServerAccess {
    /// A server started for the measurement.
    Started(Entry),
    /// The server of a farm.
    Farm(Box<FarmAddress>, Credentials),
}

/// The links of a process.
pub(crate) enum ServerLinks {
    /// Links to a server started for the measurement; they share a thread.
    Started(Entry, Arc<NatsThread>),
    /// Links to a farm, each with a thread of its own.
    Farm(Box<FarmAddress>, Credentials),
}

/// The link of an agent, and its connection, whose traffic is counted.
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

    /// Opens the link of an agent.
    pub(crate) fn link(&self, work: u64, agent: u32) -> Result<AgentLink, Error> {
        let work = WorkId(work);
        let (uplink, name) = match self {
            Self::Started(entry, thread) => {
                let name = format!("bench-{agent}");
                (Arc::new(entry.link(thread, &name)?), name)
            }
            Self::Farm(address, credentials) => {
                let FarmLink { uplink, name, .. } = link(Some(address), credentials)?;
                // A member may choose any name after its own and a dot.
                (uplink, format!("{name}.{agent}"))
            }
        };
        Ok(AgentLink { link: job_link(Arc::clone(&uplink), work, None, name), uplink })
    }
}
