//! The process of a farm that hosts the agents of its platform: it renews a notice, and another process takes over when it
//! falls silent.

use std::{
    thread,
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::BlobError;
use serde::{Deserialize, Serialize};

use crate::{
    job::board::{JobBoard, RENEW_EVERY},
    names::fresh_number,
};

/// Time without a renewal after which a host counts as gone.
const SILENT_AFTER: Duration = Duration::from_millis(2500);
/// Interval between checks for a renewal.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// The process that hosts the agents of a platform.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlatformHost {
    /// A unique number of the process.
    process: u64,
    /// The address of the platform's message transport; empty: it is starting.
    pub address: String,
}

/// The right to host the agents of a platform.
#[derive(Debug)]
pub(super) struct HostClaim {
    name: String,
    host: PlatformHost,
    renewed: Option<Instant>,
}

/// Returns the host of a platform's agents; `None`: no process hosts them.
///
/// - `platform`: the name of the platform.
pub fn host_of(board: &JobBoard, platform: &str) -> Option<PlatformHost> {
    let notice = board.uplink.notices().get(&name_of(platform)).filter(|notice| notice.unchanged < SILENT_AFTER)?;
    serde_json::from_slice(&notice.text).ok()
}

impl HostClaim {
    /// Claims the right. `None`: another process has it, or the farm's server cannot store it, as with a full disk.
    pub(super) fn claim(board: &JobBoard, platform: &str) -> Option<Self> {
        let name = name_of(platform);
        if board.uplink.is_guest() || is_renewed(board, &name) {
            return None;
        }
        let host = PlatformHost { process: fresh_number(), address: String::new() };
        let revision = board.uplink.notices().get(&name).map_or(0, |notice| notice.revision);
        let taken = board.uplink.notices().update(&name, &text(&host), revision).unwrap_or_else(|error| {
            tracing::warn!(%error, "this process cannot host the platform's agents: the farm's server does not store its claim");
            None
        });
        taken.map(|_| Self { name, host, renewed: None })
    }

    /// Sets the address of the started transport.
    pub(super) fn at(self, address: &str) -> Self {
        Self { host: PlatformHost { address: address.to_owned(), ..self.host }, ..self }
    }

    /// Renews the claim if it is due.
    pub(super) fn renew(&mut self, board: &JobBoard) {
        if self.renewed.is_some_and(|at| at.elapsed() < RENEW_EVERY) {
            return;
        }
        self.renewed = Some(Instant::now());
        let renewed = board.uplink.notices().put(&self.name, &text(&self.host));
        if let Err(error @ BlobError { .. }) = renewed {
            tracing::debug!(%error, "the farm does not answer");
        }
    }

    /// Releases the claim, so that no process waits for it to expire.
    pub(super) fn release(&self, board: &JobBoard) {
        if let Err(error) = board.uplink.notices().remove(&self.name) {
            tracing::debug!(%error, "the farm does not answer");
        }
    }
}

/// Returns true if a host renews its claim while this function watches: the age of a claim is unknown at first.
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
