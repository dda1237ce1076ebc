//! How agents reach the server: each over a link of its own.

use std::{env, process::Command, sync::Arc};

use bottega_agents::driver::nats::NatsThread;
use bottega_farm::{Link, WorkId};

use super::FarmBenchArgs;
use bottega_cluster::{FarmAddress, FarmLink, link, own_server::Entry};

use crate::{error::CliError, farm::LoginArgs};

/// The variable of the environment in which a process with agents finds the farm.
const FARM: &str = "BOTTEGA_FARM";

/// The way to the server.
pub(super) enum Ways {
    /// One that was started for this; the links of a process share a thread.
    Own(Entry, Arc<NatsThread>),
    /// One that was there.
    Farm(Box<(FarmAddress, LoginArgs)>),
}

impl Ways {
    /// To a server that this program has started.
    pub(super) fn own(entry: Entry) -> Result<Self, CliError> {
        let thread = NatsThread::start().map_err(|source| {
            let remedy = "let fewer programs run at once".to_owned();
            bottega_cluster::Error::Farm { source, remedy }
        })?;
        Ok(Self::Own(entry, thread))
    }

    /// Of a process with some of the agents.
    pub(super) fn of(args: &FarmBenchArgs) -> Result<Self, CliError> {
        if let (Some(address), Some(folder)) = (args.at, &args.state) {
            return Self::own(Entry { folder: folder.clone(), address });
        }
        let told = || env::var(FARM).ok()?.parse().ok();
        let farm = args.farm.clone().or_else(told);
        let farm =
            farm.ok_or_else(|| CliError::usage("no farm is named", "run `bottega bench farm` without --share"))?;
        Ok(Self::Farm(Box::new((farm, args.login.clone()))))
    }

    /// Tells another process of it.
    pub(super) fn tell(&self, command: &mut Command) {
        match self {
            Self::Own(Entry { folder, address }, _) => {
                command.arg("--at").arg(address.to_string()).arg("--state").arg(folder);
            }
            Self::Farm(farm) => {
                // It may hold a word that is for nobody else's eyes: all can see what a program is started with.
                command.env(FARM, farm.0.to_string());
                farm.1.tell(command);
            }
        }
    }

    /// The link of an agent.
    pub(super) fn link(&self, work: u64, agent: u32) -> Result<Link, CliError> {
        let work = WorkId(work);
        match self {
            Self::Own(entry, thread) => {
                let name = format!("bench-{agent}");
                Ok(Link { uplink: Arc::new(entry.link(thread, &name)?), work, name })
            }
            Self::Farm(farm) => {
                let FarmLink { uplink, name, .. } = link(Some(&farm.0), &farm.1.credentials())?;
                // Behind a full stop a member may call itself what it likes.
                Ok(Link { uplink, work, name: format!("{name}.{agent}") })
            }
        }
    }
}
