//! How agents reach the server: each over a link of its own.

use std::{env, process::Command, sync::Arc};

use bottega_farm::{Link, WorkId};

use super::FarmBenchArgs;
use crate::{
    error::CliError,
    farm::{Entry, FarmAddress, FarmLink, LoginArgs, link},
};

/// The variable of the environment in which a process with agents finds the farm.
const FARM: &str = "BOTTEGA_FARM";

/// The way to the server.
pub(super) enum Ways {
    /// One that was started for this.
    Own(Entry),
    /// One that was there.
    Farm(Box<(FarmAddress, LoginArgs)>),
}

impl Ways {
    /// Of a process with some of the agents.
    pub(super) fn of(args: &FarmBenchArgs) -> Result<Self, CliError> {
        if let (Some(address), Some(folder)) = (args.at, &args.state) {
            return Ok(Self::Own(Entry { folder: folder.clone(), address }));
        }
        let told = || env::var(FARM).ok()?.parse().ok();
        let farm = args.farm.clone().or_else(told);
        let farm = farm.ok_or_else(|| CliError::usage("no farm is named", "run `bottega bench farm` without --share"))?;
        Ok(Self::Farm(Box::new((farm, args.login.clone()))))
    }

    /// Tells another process of it.
    pub(super) fn tell(&self, command: &mut Command) {
        match self {
            Self::Own(Entry { folder, address }) => {
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
            Self::Own(entry) => {
                let name = format!("bench-{agent}");
                Ok(Link { uplink: Arc::new(entry.link(&name)?), work, name })
            }
            Self::Farm(farm) => {
                let FarmLink { uplink, name, .. } = link(Some(&farm.0), &farm.1)?;
                // Behind a full stop a member may call itself what it likes.
                Ok(Link { uplink, work, name: format!("{name}.{agent}") })
            }
        }
    }
}
