//! The resources together: their states and capabilities, and which of them are woken for new work.

use std::ops::{Index, IndexMut};

use super::bin::Bin;
use super::capabilities::Capabilities;
use super::lane::{Health, LaneState};
use super::time::Time;
use super::unit::UnitNeeds;
use crate::{Activity, Primitive, ResourceId};

/// All resources of an allocator.
pub(crate) struct ResourceStates {
    states: Vec<LaneState>,
    pub(super) capabilities: Capabilities,
    /// Number of resources that wait to be woken.
    dozing: usize,
    /// Number of resources that were woken and have not requested work yet.
    called: usize,
}

impl Index<ResourceId> for ResourceStates {
    type Output = LaneState;

    fn index(&self, id: ResourceId) -> &LaneState {
        &self.states[id.index()]
    }
}

impl IndexMut<ResourceId> for ResourceStates {
    fn index_mut(&mut self, id: ResourceId) -> &mut LaneState {
        &mut self.states[id.index()]
    }
}

impl ResourceStates {
    pub(super) fn new(states: Vec<LaneState>) -> Self {
        let descriptors: Vec<_> = states.iter().map(|lane| lane.descriptor.clone()).collect();
        Self { capabilities: Capabilities::new(&descriptors), states, dozing: 0, called: 0 }
    }

    /// Returns the number of resources, including retired ones.
    pub(super) fn count(&self) -> usize {
        self.states.len()
    }

    /// Returns the states of all resources, by id.
    pub(crate) fn states(&self) -> &[LaneState] {
        &self.states
    }

    /// Iterates over all resources, in the order of their ids.
    pub(super) fn iter(&self) -> impl Iterator<Item = (&LaneState, ResourceId)> {
        self.states.iter().zip((0..).map(ResourceId))
    }

    /// Returns true if arrivals must be reported at once: some resource waits to be woken, and none is about to ask.
    pub(super) fn listen(&self) -> bool {
        self.dozing > 0 && self.called == 0
    }

    /// Notes that a resource waits to be woken.
    pub(super) fn doze(&mut self, id: ResourceId) {
        self.states[id.index()].dozes = true;
        self.dozing += 1;
    }

    /// Notes that a resource asks for work.
    pub(super) fn note_asking(&mut self, id: ResourceId) {
        let lane = &mut self.states[id.index()];
        self.dozing -= usize::from(std::mem::take(&mut lane.dozes));
        self.called -= usize::from(std::mem::take(&mut lane.called));
    }

    /// Wakes a resource if it waits for that.
    ///
    /// - `woken`: the resources to wake, to which this one is added.
    pub(super) fn wake(&mut self, id: ResourceId, woken: &mut Vec<ResourceId>) {
        let lane = &mut self.states[id.index()];
        if std::mem::take(&mut lane.dozes) {
            lane.called = true;
            self.dozing -= 1;
            self.called += 1;
            woken.push(id);
        }
    }

    /// Wakes all resources, in place of one that is gone.
    pub(super) fn wake_all(&mut self, woken: &mut Vec<ResourceId>) {
        for id in 0..self.states.len() as u32 {
            self.wake(ResourceId(id), woken);
        }
    }

    /// Wakes resources for a number of units: enough to take all of them, without those about to ask anyway.
    pub(super) fn call(&mut self, now: Time, unit: &UnitNeeds, count: usize, woken: &mut Vec<ResourceId>) {
        if self.dozing == 0 {
            return;
        }
        let coming = self.iter().filter(|(lane, _)| lane.called);
        let coming = coming.filter(|&(_, id)| self.capabilities.can(id, unit.primitive, unit.data));
        let taken: usize = coming.map(|(lane, _)| lane.usual_bound(unit).units).sum();
        let mut left = count.saturating_sub(taken);
        while left > 0
            && let Some(id) = self.best_of_dozing(now, unit)
        {
            left = left.saturating_sub(self[id].usual_bound(unit).units);
            self.wake(id, woken);
        }
    }

    /// Wakes resources for the work left after one has taken its packet.
    pub(super) fn call_for_rest<T>(&mut self, now: Time, bin: &Bin<T>, woken: &mut Vec<ResourceId>) {
        for primitive in Primitive::ALL {
            if self.dozing == 0 {
                return;
            }
            let dozing = |data| self.iter().any(|(lane, id)| lane.dozes && self.capabilities.can(id, primitive, data));
            if let Some(head) = bin.head(primitive, dozing, |_| false) {
                let units = bin.items_of(primitive).div_ceil(head.needs.size.max(1));
                self.call(now, &head.needs, usize::try_from(units).unwrap_or(usize::MAX), woken);
            }
        }
    }

    /// Returns the waiting resource that finishes such a unit first.
    fn best_of_dozing(&self, now: Time, unit: &UnitNeeds) -> Option<ResourceId> {
        let fit =
            |&(lane, id): &(&LaneState, ResourceId)| lane.dozes && self.capabilities.can(id, unit.primitive, unit.data);
        // Prefer the least versatile of equal ones.
        let versatility = |id| self.capabilities.primitives(id).iter().count();
        let best = self.iter().filter(fit).min_by_key(|&(lane, id)| (lane.finish(now, unit), versatility(id)));
        best.map(|(_, id)| id)
    }

    /// Updates the account with the resource's current activity.
    pub(super) fn settle_activity(&mut self, now: Time, id: ResourceId) {
        let lane = &mut self.states[id.index()];
        let activity = match lane.health {
            Health::Retired => Activity::Retired,
            Health::Hung => Activity::Suspended,
            _ if !lane.flights.is_empty() => Activity::Working,
            Health::Paused(_) | Health::Recovering => Activity::Suspended,
            Health::Up => Activity::Idle,
        };
        lane.account.enter(activity, now);
    }
}
