//! The film of a simulation, with checks of everything composed into it.

use std::collections::{BTreeMap, BTreeSet};

use bottega_agents::{NumberMap, Revision, Time, bus::BlobId};

use crate::{ResultRef, ZoneId};

/// Maximum number of broken invariants reported.
pub(super) const BROKEN_MAX: usize = 16;

/// A log of the tiles composed into the current film, and of the orders under which zones are painted.
#[derive(Debug)]
pub(super) struct FilmLog {
    /// Number of films begun: one per life of a Master that has started the work.
    pub(super) films: u32,
    zone_count: usize,
    composed: NumberMap<()>,
    /// The zones of `composed` that were painted wrong.
    wrong: BTreeSet<ZoneId>,
    /// The latest order begun for each zone, with the index of its agent.
    newest: NumberMap<(Revision, u32)>,
    /// Older orders that still count because the zone was taken over.
    rivals: BTreeSet<(ZoneId, Revision)>,
    /// The agents of those older orders.
    older: BTreeMap<(ZoneId, Revision), u32>,
    pub(super) finished: Option<(Time, Vec<ZoneId>)>,
    pub(super) abandoned: Option<String>,
    pub(super) broken: Vec<String>,
}

impl FilmLog {
    /// Makes the log of a work with this many zones, none of them begun.
    pub(super) fn new(zone_count: usize) -> Self {
        Self {
            films: 0,
            zone_count,
            composed: NumberMap::with_room_for(zone_count),
            wrong: BTreeSet::new(),
            newest: NumberMap::with_room_for(zone_count),
            rivals: BTreeSet::new(),
            older: BTreeMap::new(),
            finished: None,
            abandoned: None,
            broken: Vec::new(),
        }
    }

    pub(super) fn is_over(&self) -> bool {
        self.finished.is_some() || self.abandoned.is_some()
    }

    /// Checks an invariant; `what` describes its violation.
    pub(super) fn must(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds && self.broken.len() < BROKEN_MAX {
            self.broken.push(what());
        }
    }

    /// Begins a new, empty film.
    pub(super) fn begin(&mut self) {
        self.films += 1;
        self.composed = NumberMap::with_room_for(self.zone_count);
        self.wrong.clear();
    }

    /// Records that an agent begins an order.
    pub(super) fn order(&mut self, zone: ZoneId, fence: Revision, agent: usize) {
        let agent = agent as u32;
        let Some(&(newest, other)) = self.newest.get(zone.0) else {
            self.newest.insert(zone.0, (fence, agent));
            return;
        };
        let (older, whose) = if fence >= newest { (newest, other) } else { (fence, agent) };
        if older != fence {
            self.newest.insert(zone.0, (fence, agent));
        }
        if self.rivals.contains(&(zone, older)) {
            self.older.insert((zone, older), whose);
        }
    }

    /// Records that a zone was taken over: this older order still counts.
    pub(super) fn take_over(&mut self, zone: ZoneId, fence: Revision) {
        self.rivals.insert((zone, fence));
    }

    /// Checks and records a zone that is composed into the film.
    pub(super) fn compose(&mut self, zone: ZoneId, result: &ResultRef) {
        let fresh = self.composed.insert(zone.0, ()).is_none();
        self.must(fresh, || format!("{zone} is composed twice"));
        let painted = unsigned(result.digest) == digest(zone, result.samples, flaw(&result.digest));
        if flaw(&result.digest) != 0 {
            self.wrong.insert(zone);
        }
        self.must(painted, || format!("{zone} is composed of samples that nobody painted"));
        let valid = self.is_valid(zone, result.fence);
        self.must(valid, || format!("{zone} is composed under {:?}, and there is a later order", result.fence));
    }

    /// Records that the picture is complete.
    pub(super) fn finish(&mut self, now: Time, failed: Vec<ZoneId>) {
        self.must(self.finished.is_none(), || "the work ends twice".to_owned());
        self.finished = Some((now, failed));
    }

    pub(super) fn is_composed(&self, zone: ZoneId) -> bool {
        self.composed.contains(zone.0)
    }

    /// Returns true if a composed zone was painted wrong.
    pub(super) fn is_wrong(&self, zone: ZoneId) -> bool {
        self.wrong.contains(&zone)
    }

    /// Returns the number of composed zones that were painted wrong.
    pub(super) fn wrong_count(&self) -> usize {
        self.wrong.len()
    }

    pub(super) fn composed_count(&self) -> usize {
        self.composed.len()
    }

    /// Returns true if two agents held valid orders for the zone at the same time.
    pub(super) fn is_taken_over(&self, zone: ZoneId) -> bool {
        self.rivals.range((zone, Revision(0))..=(zone, Revision(u64::MAX))).next().is_some()
    }

    /// Returns true if samples of this order may be used: it is the latest begun, or a valid rival.
    pub(super) fn is_valid(&self, zone: ZoneId, fence: Revision) -> bool {
        let newest = self.newest.get(zone.0).map(|(newest, _)| *newest);
        newest == Some(fence) || self.rivals.contains(&(zone, fence))
    }

    /// Returns the index of the agent that began a valid order.
    pub(super) fn whose(&self, zone: ZoneId, fence: Revision) -> Option<usize> {
        let newest = self.newest.get(zone.0).filter(|(newest, _)| *newest == fence).map(|(_, agent)| agent);
        newest.or_else(|| self.older.get(&(zone, fence))).map(|&agent| agent as usize)
    }
}

/// Returns a stand-in for the digest of a zone's samples, equal for all agents.
///
/// - `flaw`: identifies what is wrong with them; 0: correct.
pub(super) fn digest(zone: ZoneId, samples: u32, flaw: u64) -> BlobId {
    let mut digest = [0; 32];
    digest[..4].copy_from_slice(&zone.0.to_le_bytes());
    digest[4..8].copy_from_slice(&samples.to_le_bytes());
    digest[8..16].copy_from_slice(&flaw.to_le_bytes());
    BlobId(digest)
}

/// Returns the flaw of the samples behind a digest; 0: correct.
pub(super) fn flaw(digest: &BlobId) -> u64 {
    let mut bytes = [0; 8];
    bytes.copy_from_slice(&digest.0[8..16]);
    u64::from_le_bytes(bytes)
}

/// Returns the digest of the same samples from an agent that is not bit-identical to others.
pub(super) fn signed(digest: BlobId, agent: usize) -> BlobId {
    let mut bytes = digest.0;
    bytes[16..20].copy_from_slice(&(1 + agent as u32).to_le_bytes());
    BlobId(bytes)
}

/// Returns the part of a digest that is equal for all agents whose samples look alike.
pub(super) fn unsigned(digest: BlobId) -> BlobId {
    let mut bytes = digest.0;
    bytes[16..20].fill(0);
    BlobId(bytes)
}
