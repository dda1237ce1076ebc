//! Faults of resources: suspension, recovery, and finally retirement.

use super::core::{Core, FollowUps};
use super::incident::Fault;
use super::lane::Health;
use super::time::Time;
use super::unit::Unit;
use crate::ResourceId;

/// The reason why a unit is not attempted again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum GiveUp {
    /// The unit was attempted as often as allowed.
    Failed,
    /// No remaining resource can do it.
    NoResource,
    /// The allocator was shut down.
    Closed,
    /// The unit has expired.
    Expired,
}

impl<T> Core<T> {
    /// Handles a fault of a resource: it is suspended, or retired.
    pub(super) fn fail(&mut self, now: Time, id: ResourceId, fault: Fault, reason: &str, out: &mut FollowUps<T>) {
        self.incidents.note(now, id, fault, reason);
        let lane = &mut self.lanes[id];
        // A resource that is only late keeps its data, if its kind does: the data is not sent again.
        lane.is_lost |= !(lane.keeps_data && matches!(fault, Fault::Hung | Fault::Doubted));
        if let Some(flow) = &mut lane.flow {
            flow.failed();
        }
        // Packets that were in flight at a failure are not new failures
        if !matches!(lane.health, Health::Paused(_)) {
            let pause = match fault {
                Fault::Doubted => Some(lane.backoff.doubted(&self.config)),
                _ => lane.backoff.failed(&self.config),
            };
            match pause {
                Some(pause) => lane.health = Health::Paused(now.after(pause)),
                None => return self.retire(now, id, out),
            }
        }
        self.placement.forget_plan();
        self.lanes.settle_activity(now, id);
        self.wake_all_if_waiting(out);
    }

    /// Asks a resource to prepare for packets that it was sent, and sends it nothing until that is done.
    pub(super) fn make_ready(&mut self, now: Time, id: ResourceId, out: &mut FollowUps<T>) {
        let lane = &mut self.lanes[id];
        if lane.health == Health::Up {
            lane.health = Health::Paused(now);
        }
        self.placement.forget_plan();
        self.lanes.settle_activity(now, id);
        self.wake_all_if_waiting(out);
    }

    /// Handles an overdue packet whose units are done elsewhere.
    pub(crate) fn hung(&mut self, now: Time, id: ResourceId, sequence: u64, out: &mut FollowUps<T>) {
        let lane = &mut self.lanes[id];
        let Some(flight) = lane.land(sequence) else { return };
        if lane.health == Health::Retired {
            return;
        }
        lane.account.failures += 1;
        let reason = format!("no answer after {:.3} s", now.since(flight.sent).as_secs_f64());
        // Before its deadline the resource is only doubted: others do its work, and it is suspended
        let fault = if flight.deadline > now { Fault::Doubted } else { Fault::Hung };
        self.fail(now, id, fault, &reason, out);
        let lane = &mut self.lanes[id];
        // A near resource blocks its thread; its suspension begins when it returns
        if lane.flow.is_none() && lane.health != Health::Retired {
            lane.health = Health::Hung;
        }
        self.lanes.settle_activity(now, id);
    }

    /// Extends the deadline of an overdue packet whose units cannot be done again.
    pub(crate) fn spare(&mut self, now: Time, id: ResourceId, sequence: u64) {
        let Some(flight) = self.lanes[id].flights.get_mut(&sequence) else { return };
        flight.deadline = now.after(now.since(flight.sent));
        self.incidents.note(now, id, Fault::Hung, "no answer; waiting for it, because its work has no backup");
    }

    /// Handles the return of a near resource from a call that was given up: it may recover at once.
    pub(super) fn returned(&mut self, now: Time, id: ResourceId) {
        let lane = &mut self.lanes[id];
        if lane.health == Health::Hung {
            lane.health = Health::Paused(now);
        }
    }

    /// Takes in the result of a recovery.
    pub(crate) fn recovered(&mut self, now: Time, id: ResourceId, outcome: Result<(), String>, out: &mut FollowUps<T>) {
        let lane = &mut self.lanes[id];
        if lane.health != Health::Recovering {
            return;
        }
        match outcome {
            Ok(()) => {
                lane.health = Health::Up;
                self.placement.forget_plan();
                self.lanes.settle_activity(now, id);
            }
            Err(reason) => {
                lane.account.failures += 1;
                self.fail(now, id, Fault::NotRecovered, &reason, out);
            }
        }
    }

    /// Retires a resource. Units that no other resource can do become orphans.
    pub(crate) fn retire(&mut self, now: Time, id: ResourceId, out: &mut FollowUps<T>) {
        self.incidents.note(now, id, Fault::Retired, "too many failures in a row, or it could not be started");
        let lane = &mut self.lanes[id];
        lane.health = Health::Retired;
        let overdue: Vec<_> = lane.flights.keys().map(|&sequence| (id, sequence)).collect();
        out.overdue.extend(overdue);
        self.lanes.capabilities.retire(id);
        self.placement.forget_plan();
        self.lanes.settle_activity(now, id);
        let capabilities = &self.lanes.capabilities;
        out.orphans.extend(self.waiting.bin.extract(|unit| {
            !capabilities.anybody_can(unit.meta.primitive, unit.meta.data.map_or(0, |data| data.bytes))
        }));
        // A unit that failed on all remaining resources may be tried on them again
        self.wake_all_if_waiting(out);
    }

    /// Handles a unit that comes back undone from `id`; `blamed` if the resource is to blame. It is queued again, or
    /// returned if that is useless.
    pub(crate) fn give_back(
        &mut self,
        now: Time,
        id: ResourceId,
        mut unit: Unit<T>,
        blamed: bool,
        out: &mut FollowUps<T>,
    ) -> Option<(Unit<T>, GiveUp)> {
        if blamed {
            unit.meta.attempts += 1;
            if !unit.meta.failed_on.contains(&id) {
                unit.meta.failed_on.push(id);
            }
        }
        let meta = &unit.meta;
        let bytes = meta.data.map_or(0, |data| data.bytes);
        if self.closed {
            return Some((unit, GiveUp::Closed));
        } else if meta.expires <= now {
            self.expiries.note_late(now, 1);
            return Some((unit, GiveUp::Expired));
        } else if meta.attempts >= self.config.max_attempts.max(1) {
            return Some((unit, GiveUp::Failed));
        } else if !self.lanes.capabilities.anybody_can(meta.primitive, bytes) {
            return Some((unit, GiveUp::NoResource));
        }
        let needs = meta.needs();
        let lanes: Vec<ResourceId> = (0..self.lanes.count() as u32).map(ResourceId).collect();
        let may = |lane: &ResourceId| self.lanes.capabilities.may_try(*lane, meta);
        let fit = lanes
            .into_iter()
            .filter(may)
            .filter(|lane| self.lanes[*lane].dozes)
            .min_by_key(|lane| self.lanes[*lane].finish(now, &needs));
        self.waiting.bin.push_retry(unit);
        if let Some(lane) = fit {
            self.lanes.wake(lane, &mut out.wake);
        }
        None
    }

    /// Wakes all other resources, in place of one that is gone.
    fn wake_all_if_waiting(&mut self, out: &mut FollowUps<T>) {
        if self.waiting.bin.len() > 0 {
            self.lanes.wake_all(&mut out.wake);
        }
    }
}
