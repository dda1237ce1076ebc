//! The film of a simulation, and what must hold of all that is put into it.

use std::collections::{BTreeMap, BTreeSet};

use bottega_agents::{NumberMap, Revision, Time, bus::BlobId};

use crate::{ResultRef, ZoneId};

/// Broken invariants that are told.
pub(super) const BROKEN_MAX: usize = 16;

/// What the film of the present Master has been told, and under which orders zones are painted.
#[derive(Debug)]
pub(super) struct FilmLog {
    /// Films that were begun: one for each life of a Master that got so far.
    pub(super) films: u32,
    zone_count: usize,
    composed: NumberMap<()>,
    /// Those of them that were painted wrong.
    wrong: BTreeSet<ZoneId>,
    /// Of each zone the latest order that was begun, and whose it was, by index.
    newest: NumberMap<(Revision, u32)>,
    /// Orders that count though there are later ones, because a zone was taken over.
    rivals: BTreeSet<(ZoneId, Revision)>,
    /// Whose those of them are that are not the latest.
    older: BTreeMap<(ZoneId, Revision), u32>,
    pub(super) finished: Option<(Time, Vec<ZoneId>)>,
    pub(super) abandoned: Option<String>,
    pub(super) broken: Vec<String>,
}

impl FilmLog {
    /// The log of a work of so many zones, of which none is begun.
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

    /// Something must hold at any moment of a run.
    pub(super) fn must(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds && self.broken.len() < BROKEN_MAX {
            self.broken.push(what());
        }
    }

    /// A new, empty film.
    pub(super) fn begin(&mut self) {
        self.films += 1;
        self.composed = NumberMap::with_room_for(self.zone_count);
        self.wrong.clear();
    }

    /// An agent begins to paint.
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

    /// A zone was taken over: this order of it still counts.
    pub(super) fn take_over(&mut self, zone: ZoneId, fence: Revision) {
        self.rivals.insert((zone, fence));
    }

    /// A zone is put into the film.
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

    /// The picture is whole.
    pub(super) fn finish(&mut self, now: Time, failed: Vec<ZoneId>) {
        self.must(self.finished.is_none(), || "the work ends twice".to_owned());
        self.finished = Some((now, failed));
    }

    pub(super) fn is_composed(&self, zone: ZoneId) -> bool {
        self.composed.contains(zone.0)
    }

    /// Whether a zone of the picture was painted wrong.
    pub(super) fn is_wrong(&self, zone: ZoneId) -> bool {
        self.wrong.contains(&zone)
    }

    /// Zones of the picture that were painted wrong.
    pub(super) fn wrong_count(&self) -> usize {
        self.wrong.len()
    }

    pub(super) fn composed_count(&self) -> usize {
        self.composed.len()
    }

    /// Whether two agents had a valid order for a zone at a time.
    pub(super) fn is_taken_over(&self, zone: ZoneId) -> bool {
        self.rivals.range((zone, Revision(0))..=(zone, Revision(u64::MAX))).next().is_some()
    }

    /// Whether samples of this order may be used: it is the latest that was begun, or counts beside that.
    pub(super) fn is_valid(&self, zone: ZoneId, fence: Revision) -> bool {
        let newest = self.newest.get(zone.0).map(|(newest, _)| *newest);
        newest == Some(fence) || self.rivals.contains(&(zone, fence))
    }

    /// Whose a valid order is that was begun, by index.
    pub(super) fn whose(&self, zone: ZoneId, fence: Revision) -> Option<usize> {
        let newest = self.newest.get(zone.0).filter(|(newest, _)| *newest == fence).map(|(_, agent)| agent);
        newest.or_else(|| self.older.get(&(zone, fence))).map(|&agent| agent as usize)
    }
}

/// Stands for the samples of a zone: the same for all who paint it.
///
/// - `flaw`: what is wrong with them; 0: nothing.
pub(super) fn digest(zone: ZoneId, samples: u32, flaw: u64) -> BlobId {
    let mut digest = [0; 32];
    digest[..4].copy_from_slice(&zone.0.to_le_bytes());
    digest[4..8].copy_from_slice(&samples.to_le_bytes());
    digest[8..16].copy_from_slice(&flaw.to_le_bytes());
    BlobId(digest)
}

/// What is wrong with the samples that a digest stands for.
pub(super) fn flaw(digest: &BlobId) -> u64 {
    let mut bytes = [0; 8];
    bytes.copy_from_slice(&digest.0[8..16]);
    u64::from_le_bytes(bytes)
}

/// The same samples, made by an agent whose bits are like nobody's.
pub(super) fn signed(digest: BlobId, agent: usize) -> BlobId {
    let mut bytes = digest.0;
    bytes[16..20].copy_from_slice(&(1 + agent as u32).to_le_bytes());
    BlobId(bytes)
}

/// What all agents' are that may be the same picture.
pub(super) fn unsigned(digest: BlobId) -> BlobId {
    let mut bytes = digest.0;
    bytes[16..20].fill(0);
    BlobId(bytes)
}
