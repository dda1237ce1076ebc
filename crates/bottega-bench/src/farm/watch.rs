//! Observers of awards: when they were made, and how long agents waited for them.

use std::{
    collections::{BTreeSet, VecDeque},
    sync::{Mutex, MutexGuard, PoisonError},
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use bottega_agents::{Performative, Revision, Time};
use bottega_farm::{FarmContent, FarmMessage, Observer, ZoneRow, ZoneState};
use serde::{Deserialize, Serialize};

/// An award that an agent received.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Wait {
    /// The time of receipt, in microseconds since 1970; all processes of a measurement share a clock.
    pub(super) at: u64,
    /// The time since the agent reported a zone as finished, or bid for this one, in microseconds.
    pub(super) took: u64,
}

/// The maximum number of an agent's bids that may still be awarded.
const BIDS_MAX: usize = 64;

/// An observer of one agent.
#[derive(Default)]
pub(super) struct AgentWatch(Mutex<WaitTimes>);

#[derive(Default)]
struct WaitTimes {
    /// The times at which the agent could take another zone.
    rooms: VecDeque<Time>,
    /// The orders that the agent has reported as finished.
    reported: BTreeSet<Revision>,
    waits: Vec<Wait>,
    /// Its last bids: conversation and time.
    bids: VecDeque<(u64, Time)>,
    answers: Vec<Wait>,
}

impl AgentWatch {
    fn lock(&self) -> MutexGuard<'_, WaitTimes> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the waits observed: from reports to awards, and from bids to awards.
    pub(super) fn take(&self) -> [Vec<Wait>; 2] {
        let mut waits = self.lock();
        [std::mem::take(&mut waits.waits), std::mem::take(&mut waits.answers)]
    }
}

impl Observer for AgentWatch {
    fn message(&self, now: Time, message: &FarmMessage) {
        if message.performative == Performative::Propose {
            let mut waits = self.lock();
            if waits.bids.len() == BIDS_MAX {
                waits.bids.pop_front();
            }
            waits.bids.push_back((message.conversation_id, now));
        }
        let FarmContent::Report(report) = &message.content else { return };
        // A report of fewer samples is a profile.
        if report.outcome.as_ref().is_ok_and(|painting| painting.result.samples == painting.choice.samples) {
            let mut waits = self.lock();
            // A report is repeated until it is acknowledged.
            if waits.reported.insert(report.fence) {
                waits.rooms.push_back(now);
            }
        }
    }

    fn heard(&self, now: Time, message: &FarmMessage) {
        if message.performative != Performative::AcceptProposal {
            return;
        }
        let mut waits = self.lock();
        let bid = waits.bids.iter().find(|(conversation, _)| *conversation == message.conversation_id).copied();
        if let Some((_, since)) = bid {
            waits.answers.push(Wait { at: unix_micros(), took: micros(now - since) });
        }
        // The first awards precede any report.
        if let Some(since) = waits.rooms.pop_front() {
            waits.waits.push(Wait { at: unix_micros(), took: micros(now - since) });
        }
    }
}

/// An observer of the Master's blackboard, and of the Master's own agent.
#[derive(Default)]
pub(super) struct MasterWatch {
    pub(super) agent: AgentWatch,
    awards: Mutex<Vec<u64>>,
    profiles: Mutex<Vec<u64>>,
}

impl MasterWatch {
    /// Returns the times of awards on the blackboard, in microseconds since 1970.
    pub(super) fn awards(&self) -> Vec<u64> {
        self.awards.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Returns the times of profiles on the blackboard, likewise.
    pub(super) fn profiles(&self) -> Vec<u64> {
        self.profiles.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Observer for MasterWatch {
    fn zone_changed(&self, row: &ZoneRow) {
        let times = match row.state {
            ZoneState::Awarded => &self.awards,
            ZoneState::Profiled => &self.profiles,
            _ => return,
        };
        times.lock().unwrap_or_else(PoisonError::into_inner).push(unix_micros());
    }

    fn message(&self, now: Time, message: &FarmMessage) {
        self.agent.message(now, message);
    }

    fn heard(&self, now: Time, message: &FarmMessage) {
        self.agent.heard(now, message);
    }
}

fn micros(time: Duration) -> u64 {
    u64::try_from(time.as_micros()).unwrap_or(u64::MAX)
}

pub(crate) fn unix_micros() -> u64 {
    // The clock is after 1970.
    micros(SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default())
}
