//! The process of a farm that hosts the agents of its platform: one says so, again and again, and another takes them when it
//! falls silent.

use std::{
    thread,
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::BlobError;
use serde::{Deserialize, Serialize};

use crate::{JobBoard, job_board::RENEW_EVERY, names::fresh_number};

/// Who has not said for so long that it has them has gone.
const SILENT_AFTER: Duration = Duration::from_millis(2500);
/// How often is looked whether one says so.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// The process that hosts the agents of a platform.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlatformHost {
    /// A number that no other process has.
    process: u64,
    /// Where its transport is; empty: it is about to begin.
    pub address: String,
}

/// The right to have the agents of a platform.
#[derive(Debug)]
pub(super) struct HostSeat {
    name: String,
    host: PlatformHost,
    renewed: Option<Instant>,
}

/// Who has the agents of the platform of this name, if anybody has.
pub fn host_of(board: &JobBoard, platform: &str) -> Option<PlatformHost> {
    let notice = board.uplink.notices().get(&name_of(platform)).filter(|notice| notice.unchanged < SILENT_AFTER)?;
    serde_json::from_slice(&notice.text).ok()
}

impl HostSeat {
    /// Takes the right. `None`: another process has it, or the farm's server takes no notice of it, as with a full disk.
    pub(super) fn claim(board: &JobBoard, platform: &str) -> Option<Self> {
        let name = name_of(platform);
        if board.uplink.is_guest() || is_renewed(board, &name) {
            return None;
        }
        let host = PlatformHost { process: fresh_number(), address: String::new() };
        let revision = board.uplink.notices().get(&name).map_or(0, |notice| notice.revision);
        let taken = board.uplink.notices().update(&name, &text(&host), revision).unwrap_or_else(|error| {
            tracing::warn!(%error, "the farm's server does not take that the platform's agents are here: they are not");
            None
        });
        taken.map(|_| Self { name, host, renewed: None })
    }

    /// The transport is there.
    pub(super) fn at(self, address: &str) -> Self {
        Self { host: PlatformHost { address: address.to_owned(), ..self.host }, ..self }
    }

    /// Says that this process has them, when it is time to.
    pub(super) fn renew(&mut self, board: &JobBoard) {
        if self.renewed.is_some_and(|at| at.elapsed() < RENEW_EVERY) {
            return;
        }
        self.renewed = Some(Instant::now());
        let told = board.uplink.notices().put(&self.name, &text(&self.host));
        if let Err(error @ BlobError { .. }) = told {
            tracing::debug!(%error, "the farm does not answer");
        }
    }

    /// Nobody need wait until it has been silent for long enough.
    pub(super) fn lay_down(&self, board: &JobBoard) {
        if let Err(error) = board.uplink.notices().remove(&self.name) {
            tracing::debug!(%error, "the farm does not answer");
        }
    }
}

/// Whether somebody says again that it has them: that it has said so before may be long ago.
fn is_renewed(board: &JobBoard, name: &str) -> bool {
    let begun = Instant::now();
    let revision = || board.uplink.notices().get(name).map(|notice| notice.revision);
    let Some(before) = revision() else { return false };
    while begun.elapsed() < SILENT_AFTER {
        thread::sleep(LOOK_EVERY);
        if revision().is_none_or(|now| now != before) {
            return revision().is_some();
        }
    }
    false
}

fn name_of(platform: &str) -> String {
    format!("host/{}", platform.to_lowercase())
}

fn text(host: &PlatformHost) -> Vec<u8> {
    serde_json::to_vec(host).expect("a number and a text can be written")
}
