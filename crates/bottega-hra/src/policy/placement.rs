//! Placement: the unit that a resource gets, if any.
//!
//! In this order: a unit that failed elsewhere; the one that has been late longest; the highest priority. Among the
//! primitives of one priority the fluid [`plan`] assigns work by comparative advantage. A resource that finishes a unit
//! later than all others finish everything does not get it (*expected finish time*, as in Topcuoglu's HEFT and StarPU's
//! `dmda`), unless the stream of work has lasted so long that it does not matter.

use std::time::Duration;

use super::bin::{BinHead, PacketBound};
use super::choice::{ASK_AGAIN_MIN, LaneChoice};
use super::core::{Core, FollowUps};
use super::lane::{Health, LaneState};
use super::plan::{self, ByPrimitive, PlannedPacket, ResourceKind};
use super::time::Time;
use super::unit::{Data, Meta, UnitNeeds};
use crate::{Primitive, ResourceId};

/// Validity of a plan, as a share of the time that it plans for, but at most of the time that work has been coming,
/// since first plans know little; and at least [`PLAN_VALID_MIN`].
const PLAN_VALID: f64 = 0.03;
const PLAN_VALID_OF_PAST: f64 = 0.05;
const PLAN_VALID_MIN: Duration = Duration::from_millis(5);
/// Shares of time below this are noise of the optimization.
const SHARE_MIN: f64 = 0.01;
/// Maximum share of a resource's remaining work in one packet.
const PACKET_SHARE: f64 = 0.2;
/// Maximum round trip, in nanoseconds, up to which a resource is tried before the others are measured.
const TRIED_WITHIN: f64 = 10e6;
/// Maximum time after which a resource that got nothing asks again.
const ASK_AGAIN_MAX: Duration = Duration::from_secs(1);

/// The rate at which the remaining work is done.
struct DrainRate {
    /// The remaining work, in the plan's prices.
    worth: f64,
    /// The rate of each resource, in the plan's prices.
    rates: Vec<f64>,
    rate: f64,
}

impl<T> Core<T> {
    /// The choice for `id`, which has room.
    // First a unit that failed elsewhere
    pub(super) fn choose(&mut self, now: Time, id: ResourceId) -> LaneChoice<T> {
        if self.bin.len() == 0 {
            return LaneChoice::Nothing;
        }
        let (lane, lanes, roster) = (&self.lanes[id.index()], &self.lanes, &self.roster);
        let near_can = |meta: &Meta| {
            let is_near = |(other, _): &(&LaneState, u32)| other.flow.is_none() && other.health != Health::Retired;
            lanes
                .iter()
                .zip(0..)
                .filter(is_near)
                .any(|(_, near)| roster.can(ResourceId(near), meta.primitive, meta.data))
        };
        // A unit that a near resource had no time for is not sent far away
        let is_for_near = |meta: &Meta| {
            meta.failed_on.is_empty() && lane.longest_way_ns(&meta.needs()) > TRIED_WITHIN && near_can(meta)
        };
        if let Some(unit) = self.bin.take_retry(|meta| roster.may_try(id, meta) && !is_for_near(meta)) {
            return LaneChoice::Retry(unit);
        }
        let able = self.roster.primitives(id);
        let holds = |data: Option<Data>| self.roster.holds(id, data);
        if let Some(head) = self.bin.latest(able, now.after(self.lead()), holds) {
            let bound = self.lanes[id.index()].packet_bound(&head.needs);
            return LaneChoice::Draw { head, bound };
        }
        let lane = &self.lanes[id.index()];
        let resident = |data| lane.residency.is_resident(data);
        let mut heads: Vec<BinHead> =
            able.iter().filter_map(|primitive| self.bin.head(primitive, holds, resident)).collect();
        let Some(priority) = heads.iter().map(BinHead::priority).max() else {
            return if self.starves(id) { LaneChoice::shortly(now) } else { LaneChoice::Nothing };
        };
        let lane = &self.lanes[id.index()];
        heads.retain(|head| head.priority() == priority && !lane.is_trying(head.needs.primitive));
        self.replan(now);
        let suits = |head: &BinHead| {
            !self.lanes[id.index()].knows(head.needs.primitive) || self.has_share(id, head.needs.primitive)
        };
        if !heads.iter().any(suits) && self.starves(id) {
            return LaneChoice::shortly(now);
        }
        self.sort(id, &mut heads);
        let pace = self.pace();
        let (mut ask_again, mut sooner) = (None, Vec::new());
        for head in heads {
            match self.declines(now, id, &head, pace.as_ref()) {
                Some((until, who)) => {
                    ask_again = ask_again.into_iter().chain([until]).min();
                    sooner.push(who);
                }
                None => {
                    let bound = self.packet_bound(id, &head.needs, pace.as_ref());
                    self.owe(id, &head.needs, bound.units);
                    return LaneChoice::Draw { head, bound };
                }
            }
        }
        ask_again.map_or(LaneChoice::Nothing, |until| LaneChoice::Decline { until, sooner })
    }

    /// The time before its limit at which a unit counts as late: that of the work that may be before it.
    fn lead(&self) -> Duration {
        self.length.wait_behind(self.bin.len()).min(self.config.bin_delay)
    }

    /// True if `id` has a share of a primitive in the plan, or there is no plan.
    fn has_share(&self, id: ResourceId, primitive: Primitive) -> bool {
        let planned = self.planned.as_ref();
        planned.is_none_or(|plan| plan.plan.shares[plan.rows[id.index()]][primitive.index()] >= SHARE_MIN)
    }

    /// True if the work of `id` is outside of the bin and about to enter. A bin that is full, or was a moment ago,
    /// grows for it if it can.
    fn starves(&mut self, id: ResourceId) -> bool {
        let outside = |primitive: Primitive| {
            let is_outside = self.bin.items_of(primitive) == 0 && self.demand.announced(primitive) > 0;
            is_outside && self.has_share(id, primitive)
        };
        let is_full = 4 * self.bin.len() >= 3 * self.length.capacity();
        self.roster.primitives(id).iter().any(outside) && (!is_full || self.length.starved())
    }

    fn backlog(&self) -> ByPrimitive<f64> {
        Primitive::ALL
            .map(|primitive| self.bin.items_of(primitive).saturating_add(self.demand.announced(primitive)) as f64)
    }

    /// Makes a new plan if the old one has expired; none if there is nothing to choose.
    fn replan(&mut self, now: Time) {
        let backlog = self.backlog();
        let live = backlog.map(|items| items > 0.0);
        if live.iter().filter(|&&live| live).count() < 2 {
            self.planned = None;
            return;
        }
        if self.planned.as_ref().is_some_and(|planned| now < planned.valid_until && planned.live == live) {
            return;
        }
        let Some((kinds, rows)) = self.kinds(&live) else {
            self.planned = None;
            return;
        };
        let plan = plan::plan(&kinds, &backlog);
        let valid = Duration::try_from_secs_f64(plan.time_ns * 1e-9 * PLAN_VALID).unwrap_or(Duration::MAX);
        let valid = valid.min(now.since(self.demand.first()).mul_f64(PLAN_VALID_OF_PAST));
        let owed = self.planned.take().map_or_else(|| vec![[0.0; Primitive::COUNT]; self.lanes.len()], |old| old.owed);
        self.planned =
            Some(PlannedPacket { plan, valid_until: now.after(valid.max(PLAN_VALID_MIN)), live, rows, owed });
    }

    /// Groups resources into kinds that support the same primitives at about the same speed. Returns the kinds, and the kind of
    /// each resource. Times that are unknown for a resource are taken from the others. `None`: some primitive was not measured on
    /// any resource.
    fn kinds(&self, live: &ByPrimitive<bool>) -> Option<(Vec<ResourceKind>, Vec<usize>)> {
        let mut typical = [None; Primitive::COUNT];
        for primitive in Primitive::ALL.into_iter().filter(|primitive| live[primitive.index()]) {
            let known: Vec<f64> = self.lanes.iter().filter_map(|lane| lane.ns_per_item(primitive)).collect();
            typical[primitive.index()] = Some(known.iter().sum::<f64>() / known.len() as f64);
            if known.is_empty() {
                return None;
            }
        }
        let (mut kinds, mut rows): (Vec<ResourceKind>, Vec<usize>) = (Vec::new(), Vec::new());
        for (lane, id) in self.lanes.iter().zip(0..) {
            let mut times = [f64::INFINITY; Primitive::COUNT];
            let able = self.roster.primitives(ResourceId(id));
            for primitive in able.iter().filter(|_| lane.health == Health::Up) {
                if let Some(typical) = typical[primitive.index()] {
                    times[primitive.index()] = lane.ns_per_item(primitive).unwrap_or(typical);
                }
            }
            let row = kinds.iter().position(|kind| kind.is_like(&times)).unwrap_or(kinds.len());
            if row == kinds.len() {
                kinds.push(ResourceKind { times, count: 0.0 });
            }
            kinds[row].add(&times);
            rows.push(row);
        }
        Some((kinds, rows))
    }

    /// Sorts heads, the best first. Without a plan: primitives that the fewest resources support first, so that
    /// versatile resources leave the others their only work; then first come.
    fn sort(&self, id: ResourceId, heads: &mut [BinHead]) {
        let Some(planned) = &self.planned else {
            heads.sort_by_key(|head| (self.roster.count_of(head.needs.primitive), head.sequence()));
            return;
        };
        let lane = &self.lanes[id.index()];
        let rank = |head: &BinHead| {
            let (primitive, p) = (head.needs.primitive, head.needs.primitive.index());
            if !lane.knows(primitive) {
                return (true, f64::INFINITY); // Tried first, so that it becomes known.
            }
            let has_share = self.has_share(id, primitive);
            let pay = planned.plan.prices[p] / lane.ns_per_item(primitive).unwrap_or(1.0);
            (has_share, if has_share { planned.owed[id.index()][p] } else { pay })
        };
        heads.sort_by(|a, b| {
            let ((a_has, a), (b_has, b)) = (rank(a), rank(b));
            b_has.cmp(&a_has).then(b.total_cmp(&a))
        });
    }

    /// Accounts for the time that `id` spends on a primitive.
    fn owe(&mut self, id: ResourceId, needs: &UnitNeeds, units: usize) {
        let Some(planned) = &mut self.planned else { return };
        let time = self.lanes[id.index()].predict_ns(needs.primitive, needs.size).unwrap_or(0.0) * units as f64;
        let owed = &mut planned.owed[id.index()];
        for (owed, share) in owed.iter_mut().zip(&planned.plan.shares[planned.rows[id.index()]]) {
            *owed += share * time;
        }
        owed[needs.primitive.index()] -= time;
    }

    /// The rate at which the remaining work is done; `None`: unknown.
    fn pace(&self) -> Option<DrainRate> {
        let backlog = self.backlog();
        let live = || Primitive::ALL.into_iter().filter(|primitive| backlog[primitive.index()] > 0.0);
        let prices = match &self.planned {
            Some(planned) => planned.plan.prices,
            None if live().count() == 1 => [1.0; Primitive::COUNT],
            None => return None,
        };
        let rate = |(lane, index): (&LaneState, u32)| {
            let able = self.roster.primitives(ResourceId(index));
            let pay = |primitive| Some(prices[Primitive::index(primitive)] / lane.ns_per_item(primitive)?);
            let pays =
                live().filter(|&primitive| lane.health == Health::Up && able.contains(primitive)).filter_map(pay);
            pays.fold(0.0, f64::max)
        };
        let rates: Vec<f64> = self.lanes.iter().zip(0..).map(rate).collect();
        let worth = live().map(|primitive| prices[primitive.index()] * backlog[primitive.index()]).sum();
        let rate = rates.iter().sum();
        (rate > 0.0).then_some(DrainRate { worth, rate, rates })
    }

    /// The limit on units for `id` at once: what suits it, but at most its share of the remaining work. If handing over
    /// is expensive, a packet has units for at least as long as that takes.
    fn packet_bound(&self, id: ResourceId, needs: &UnitNeeds, pace: Option<&DrainRate>) -> PacketBound {
        let lane = &self.lanes[id.index()];
        let wanted = lane.packet_bound(needs);
        match (pace, lane.cost_ns(needs.primitive, needs.size)) {
            (Some(pace), Some((fixed_ns, unit_ns))) if wanted.units > 1 && unit_ns > 0.0 && pace.rate > 0.0 => {
                let fair_ns = PACKET_SHARE * pace.worth / pace.rate - fixed_ns;
                let fair = (fair_ns.max(lane.least_ns(fixed_ns)) / unit_ns) as usize;
                PacketBound { units: wanted.units.min(fair).max(1), ..wanted }
            }
            _ => wanted,
        }
    }

    /// Returns `Some` if others finish everything before `id` finishes this unit: the time to ask again, and the resource that
    /// finishes the unit first. Among all resources that ask about a unit, that one accepts it.
    fn declines(
        &self,
        now: Time,
        id: ResourceId,
        head: &BinHead,
        pace: Option<&DrainRate>,
    ) -> Option<(Time, ResourceId)> {
        let needs = &head.needs;
        let others = || {
            let able = |id: ResourceId| self.roster.can(id, needs.primitive, needs.data);
            let lanes = self.lanes.iter().zip(0..).map(|(lane, index)| (lane, ResourceId(index)));
            lanes.filter(move |&(lane, other)| other != id && lane.health == Health::Up && able(other))
        };
        let lane = &self.lanes[id.index()];
        let way_ns = lane.longest_way_ns(needs);
        let (mine, pace) = match pace {
            Some(pace) if lane.knows(needs.primitive) => (lane.finish(now, needs)?, pace),
            // Lower bound: a large unit is not sent only to measure the speed.
            Some(pace) if way_ns > 0.0 => (now.plus_ns(lane.latency_ns() + way_ns), pace),
            // Near resources are soon measured
            None if !lane.knows(needs.primitive) && way_ns > TRIED_WITHIN => {
                let (_, near) = others().find(|(lane, _)| lane.flow.is_none())?;
                return Some((now.plus_ns(0.1 * TRIED_WITHIN), near));
            }
            _ => return None, // Not measured yet: try it.
        };
        let at_least = Duration::try_from_secs_f64(pace.worth / pace.rate * 1e-9).unwrap_or(Duration::MAX);
        if mine <= now.after(at_least.max(self.demand.overshoot())) {
            return None;
        }
        let finish = |(lane, other): (&LaneState, ResourceId)| Some((lane.finish(now, needs)?, other));
        let (soonest, who) = others().filter_map(finish).min()?;
        if mine <= soonest || mine <= self.all_done(now, pace) {
            return None;
        }
        let pause = (soonest.since(now) / 2).clamp(ASK_AGAIN_MIN, ASK_AGAIN_MAX);
        Some((now.after(pause), who))
    }

    /// The time at which everything is done at the current rates.
    fn all_done(&self, now: Time, pace: &DrainRate) -> Time {
        let mut workers: Vec<(f64, f64)> = self
            .lanes
            .iter()
            .zip(&pace.rates)
            .filter(|(_, rate)| **rate > 0.0)
            .map(|(lane, &rate)| {
                let start = lane.free_at(now).max(now.plus_ns(lane.latency_ns()));
                (start.since(now).as_nanos() as f64, rate)
            })
            .collect();
        workers.sort_by(|a, b| a.0.total_cmp(&b.0));
        now.plus_ns(plan::water_level(&workers, pace.worth))
    }

    /// Wakes resources for a number of units: enough to take all of them, without those about to ask anyway.
    pub(super) fn call(&mut self, now: Time, unit: &UnitNeeds, count: usize, out: &mut FollowUps<T>) {
        if self.dozing == 0 {
            return;
        }
        let coming = self.lanes.iter().zip(0..).filter(|(lane, _)| lane.called);
        let coming = coming.filter(|&(_, index)| self.roster.can(ResourceId(index), unit.primitive, unit.data));
        let taken: usize = coming.map(|(lane, _)| lane.usual_bound(unit).units).sum();
        let mut left = count.saturating_sub(taken);
        while left > 0
            && let Some(id) = self.best_of_dozing(now, unit)
        {
            left = left.saturating_sub(self.lanes[id.index()].usual_bound(unit).units);
            self.wake(id, out);
        }
    }

    /// Wakes resources for the work left after one has taken its packet.
    pub(super) fn call_for_rest(&mut self, now: Time, out: &mut FollowUps<T>) {
        for primitive in Primitive::ALL {
            if self.dozing == 0 {
                return;
            }
            let dozing = |data| {
                let mut lanes = self.lanes.iter().zip(0..);
                lanes.any(|(lane, index)| lane.dozes && self.roster.can(ResourceId(index), primitive, data))
            };
            if let Some(head) = self.bin.head(primitive, dozing, |_| false) {
                let units = self.bin.items_of(primitive).div_ceil(head.needs.size.max(1));
                self.call(now, &head.needs, usize::try_from(units).unwrap_or(usize::MAX), out);
            }
        }
    }

    /// The waiting resource that finishes such a unit first.
    fn best_of_dozing(&self, now: Time, unit: &UnitNeeds) -> Option<ResourceId> {
        let lanes = self.lanes.iter().zip(0..).map(|(lane, index)| (lane, ResourceId(index)));
        let fit = lanes.filter(|&(lane, id)| lane.dozes && self.roster.can(id, unit.primitive, unit.data));
        // Prefer the least versatile of equal ones.
        let best = fit.min_by_key(|(lane, id)| (lane.finish(now, unit), self.roster.primitives(*id).iter().count()));
        best.map(|(_, id)| id)
    }
}
