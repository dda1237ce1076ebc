//! Placement: the unit that a resource gets, if any.
//!
//! In this order: a unit that failed elsewhere; the one that has been late longest; the highest priority. Among the
//! primitives of one priority the fluid [`plan`] assigns work by comparative advantage. A resource that finishes a unit
//! later than all others finish everything does not get it (*expected finish time*, as in Topcuoglu's HEFT and StarPU's
//! `dmda`), unless the stream of work has lasted so long that it does not matter.

use std::time::Duration;

use super::bin::{BinHead, PacketBound};
use super::choice::{ASK_AGAIN_MIN, LaneChoice};
use super::lane::{Health, LaneState};
use super::plan::{self, ByPrimitive, PlannedPacket, ResourceKind};
use super::resource_states::ResourceStates;
use super::time::Time;
use super::unit::{Data, Meta, UnitNeeds};
use super::waiting::WaitingWork;
use crate::{HraConfig, Primitive, ResourceId};

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

/// The assignment of waiting work to resources, by a plan that is renewed from time to time.
#[derive(Default)]
pub(crate) struct Placement {
    /// `None`: there is nothing to choose, or a resource has come or gone.
    planned: Option<PlannedPacket>,
}

impl Placement {
    /// Drops the plan: a resource has come or gone.
    pub(super) fn forget_plan(&mut self) {
        self.planned = None;
    }

    /// Returns the choice for `id`, which has room.
    pub(super) fn choose<T>(
        &mut self,
        now: Time,
        id: ResourceId,
        config: &HraConfig,
        lanes: &ResourceStates,
        waiting: &mut WaitingWork<T>,
    ) -> LaneChoice<T> {
        if waiting.bin.len() == 0 {
            return LaneChoice::Nothing;
        }
        let (lane, capabilities) = (&lanes[id], &lanes.capabilities);
        // First a unit that failed elsewhere
        let near_can = |meta: &Meta| {
            let is_near = |other: &LaneState| other.flow.is_none() && other.health != Health::Retired;
            let can = |near| capabilities.can(near, meta.primitive, meta.data);
            lanes.iter().any(|(other, near)| is_near(other) && can(near))
        };
        // A unit that a near resource had no time for is not sent far away
        let is_for_near = |meta: &Meta| {
            meta.failed_on.is_empty() && lane.longest_way_ns(&meta.needs()) > TRIED_WITHIN && near_can(meta)
        };
        if let Some(unit) = waiting.bin.take_retry(|meta| capabilities.may_try(id, meta) && !is_for_near(meta)) {
            return LaneChoice::Retry(unit);
        }
        let able = capabilities.primitives(id);
        let holds = |data: Option<Data>| capabilities.holds(id, data);
        // Then one that has waited too long, compared with the units that may go before it
        let lead = waiting.length.wait_behind(waiting.bin.len()).min(config.bin_delay);
        if let Some(head) = waiting.bin.latest(able, now.after(lead), holds) {
            let bound = lane.packet_bound(&head.needs);
            return LaneChoice::Draw { head, bound };
        }
        // Then those of the highest priority, in the order of the plan
        let resident = |data| lane.residency.is_resident(data);
        let mut heads: Vec<BinHead> =
            able.iter().filter_map(|primitive| waiting.bin.head(primitive, holds, resident)).collect();
        let Some(priority) = heads.iter().map(BinHead::priority).max() else {
            return if self.starves(id, lanes, waiting) { LaneChoice::shortly(now) } else { LaneChoice::Nothing };
        };
        heads.retain(|head| head.priority() == priority && !lane.is_trying(head.needs.primitive));
        self.replan(now, lanes, waiting);
        let suits = |head: &BinHead| !lane.knows(head.needs.primitive) || self.has_share(id, head.needs.primitive);
        if !heads.iter().any(suits) && self.starves(id, lanes, waiting) {
            return LaneChoice::shortly(now);
        }
        self.sort(id, &mut heads, lanes);
        let pace = self.pace(lanes, &waiting.backlog());
        let (mut ask_again, mut sooner) = (None, Vec::new());
        for head in heads {
            match declines(now, id, &head, pace.as_ref(), lanes, waiting.demand.overshoot()) {
                Some((until, who)) => {
                    ask_again = ask_again.into_iter().chain([until]).min();
                    sooner.push(who);
                }
                None => {
                    let bound = packet_bound(lane, &head.needs, pace.as_ref());
                    self.owe(id, &head.needs, bound.units, lane);
                    return LaneChoice::Draw { head, bound };
                }
            }
        }
        ask_again.map_or(LaneChoice::Nothing, |until| LaneChoice::Decline { until, sooner })
    }

    /// Returns true if `id` has a share of a primitive in the plan, or there is no plan.
    fn has_share(&self, id: ResourceId, primitive: Primitive) -> bool {
        let planned = self.planned.as_ref();
        planned.is_none_or(|plan| plan.plan.shares[plan.rows[id.index()]][primitive.index()] >= SHARE_MIN)
    }

    /// Returns true if the work of `id` is outside of the bin and about to enter. A bin that is full, or was a moment
    /// ago, grows for it if it can.
    fn starves<T>(&self, id: ResourceId, lanes: &ResourceStates, waiting: &mut WaitingWork<T>) -> bool {
        let outside = |primitive: Primitive| {
            let is_outside = waiting.bin.items_of(primitive) == 0 && waiting.demand.announced(primitive) > 0;
            is_outside && self.has_share(id, primitive)
        };
        let is_full = 4 * waiting.bin.len() >= 3 * waiting.length.capacity();
        lanes.capabilities.primitives(id).iter().any(outside) && (!is_full || waiting.length.starved())
    }

    /// Makes a new plan if the old one has expired; none if there is nothing to choose.
    fn replan<T>(&mut self, now: Time, lanes: &ResourceStates, waiting: &WaitingWork<T>) {
        let backlog = waiting.backlog();
        let live = backlog.map(|items| items > 0.0);
        if live.iter().filter(|&&live| live).count() < 2 {
            self.planned = None;
            return;
        }
        if self.planned.as_ref().is_some_and(|planned| now < planned.valid_until && planned.live == live) {
            return;
        }
        let Some((kinds, rows)) = kinds(&live, lanes) else {
            self.planned = None;
            return;
        };
        let plan = plan::plan(&kinds, &backlog);
        let valid = Duration::try_from_secs_f64(plan.time_ns * 1e-9 * PLAN_VALID).unwrap_or(Duration::MAX);
        let valid = valid.min(now.since(waiting.demand.first()).mul_f64(PLAN_VALID_OF_PAST));
        let owed = self.planned.take().map_or_else(|| vec![[0.0; Primitive::COUNT]; lanes.count()], |old| old.owed);
        self.planned =
            Some(PlannedPacket { plan, valid_until: now.after(valid.max(PLAN_VALID_MIN)), live, rows, owed });
    }

    /// Sorts heads, the best first. Without a plan: primitives that the fewest resources support first, so that
    /// versatile resources leave the others their only work; then first come.
    fn sort(&self, id: ResourceId, heads: &mut [BinHead], lanes: &ResourceStates) {
        let Some(planned) = &self.planned else {
            heads.sort_by_key(|head| (lanes.capabilities.count_of(head.needs.primitive), head.sequence()));
            return;
        };
        let lane = &lanes[id];
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
    fn owe(&mut self, id: ResourceId, needs: &UnitNeeds, units: usize, lane: &LaneState) {
        let Some(planned) = &mut self.planned else { return };
        let time = lane.predict_ns(needs.primitive, needs.size).unwrap_or(0.0) * units as f64;
        let owed = &mut planned.owed[id.index()];
        for (owed, share) in owed.iter_mut().zip(&planned.plan.shares[planned.rows[id.index()]]) {
            *owed += share * time;
        }
        owed[needs.primitive.index()] -= time;
    }

    /// Returns the rate at which the remaining work is done; `None`: unknown.
    fn pace(&self, lanes: &ResourceStates, backlog: &ByPrimitive<f64>) -> Option<DrainRate> {
        let live = || Primitive::ALL.into_iter().filter(|primitive| backlog[primitive.index()] > 0.0);
        let prices = match &self.planned {
            Some(planned) => planned.plan.prices,
            None if live().count() == 1 => [1.0; Primitive::COUNT],
            None => return None,
        };
        let rate = |(lane, id): (&LaneState, ResourceId)| {
            let able = lanes.capabilities.primitives(id);
            let pay = |primitive| Some(prices[Primitive::index(primitive)] / lane.ns_per_item(primitive)?);
            let pays =
                live().filter(|&primitive| lane.health == Health::Up && able.contains(primitive)).filter_map(pay);
            pays.fold(0.0, f64::max)
        };
        let rates: Vec<f64> = lanes.iter().map(rate).collect();
        let worth = live().map(|primitive| prices[primitive.index()] * backlog[primitive.index()]).sum();
        let rate = rates.iter().sum();
        (rate > 0.0).then_some(DrainRate { worth, rate, rates })
    }
}

/// Groups resources into kinds that support the same primitives at about the same speed. Returns the kinds, and the kind of
/// each resource. Times that are unknown for a resource are taken from the others. `None`: some primitive was not measured on
/// any resource.
fn kinds(live: &ByPrimitive<bool>, lanes: &ResourceStates) -> Option<(Vec<ResourceKind>, Vec<usize>)> {
    let mut typical = [None; Primitive::COUNT];
    for primitive in Primitive::ALL.into_iter().filter(|primitive| live[primitive.index()]) {
        let known: Vec<f64> = lanes.iter().filter_map(|(lane, _)| lane.ns_per_item(primitive)).collect();
        typical[primitive.index()] = Some(known.iter().sum::<f64>() / known.len() as f64);
        if known.is_empty() {
            return None;
        }
    }
    let (mut kinds, mut rows): (Vec<ResourceKind>, Vec<usize>) = (Vec::new(), Vec::new());
    for (lane, id) in lanes.iter() {
        let mut times = [f64::INFINITY; Primitive::COUNT];
        let able = lanes.capabilities.primitives(id);
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

/// Returns the limit on units for a resource at once: what suits it, but at most its share of the remaining work. If
/// handing over is expensive, a packet has units for at least as long as that takes.
fn packet_bound(lane: &LaneState, needs: &UnitNeeds, pace: Option<&DrainRate>) -> PacketBound {
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
    now: Time,
    id: ResourceId,
    head: &BinHead,
    pace: Option<&DrainRate>,
    lanes: &ResourceStates,
    overshoot: Duration,
) -> Option<(Time, ResourceId)> {
    let needs = &head.needs;
    let others = || {
        let able = |id: ResourceId| lanes.capabilities.can(id, needs.primitive, needs.data);
        lanes.iter().filter(move |&(lane, other)| other != id && lane.health == Health::Up && able(other))
    };
    let lane = &lanes[id];
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
    if mine <= now.after(at_least.max(overshoot)) {
        return None;
    }
    let finish = |(lane, other): (&LaneState, ResourceId)| Some((lane.finish(now, needs)?, other));
    let (soonest, who) = others().filter_map(finish).min()?;
    if mine <= soonest || mine <= all_done(now, pace, lanes) {
        return None;
    }
    let pause = (soonest.since(now) / 2).clamp(ASK_AGAIN_MIN, ASK_AGAIN_MAX);
    Some((now.after(pause), who))
}

/// Returns the time at which everything is done at the current rates.
fn all_done(now: Time, pace: &DrainRate, lanes: &ResourceStates) -> Time {
    let mut workers: Vec<(f64, f64)> = lanes
        .iter()
        .zip(&pace.rates)
        .filter(|(_, rate)| **rate > 0.0)
        .map(|((lane, _), &rate)| {
            let start = lane.free_at(now).max(now.plus_ns(lane.latency_ns()));
            (start.since(now).as_nanos() as f64, rate)
        })
        .collect();
    workers.sort_by(|a, b| a.0.total_cmp(&b.0));
    now.plus_ns(plan::water_level(&workers, pace.worth))
}
