//! The work bin: what waits, and what goes next. Plain data: no lock, no clock, no thread.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::results_bin::ResultsBin;
use crate::{Primitive, PrimitiveSet, ResourceId, Work, WorkUnit};

/// A unit in the bin, or on its way through a resource.
pub(crate) struct Pending<W: Work> {
    pub(crate) work: W,
    pub(crate) envelope: Envelope<W>,
}

impl<W: Work> Pending<W> {
    /// What the client submitted.
    pub(crate) fn into_unit(self) -> WorkUnit<W> {
        let Envelope { ticket, max_delay, priority, .. } = self.envelope;
        WorkUnit { work: self.work, ticket, max_delay, priority }
    }
}

/// What stays with the allocator while the work is with a resource.
pub(crate) struct Envelope<W: Work> {
    pub(crate) client: Arc<ResultsBin<W::Output>>,
    pub(crate) ticket: u64,
    pub(crate) max_delay: Duration,
    pub(crate) priority: i32,
    pub(crate) primitive: Primitive,
    pub(crate) size: u64,
    pub(crate) submitted: Instant,
    /// When the unit becomes late.
    pub(crate) deadline: Instant,
    pub(crate) attempts: u32,
    /// Who tried and failed.
    pub(crate) failed_on: Vec<ResourceId>,
}

/// Who is there, and who can do what.
pub(crate) struct Roster {
    able: Vec<PrimitiveSet>,
    counts: [u32; Primitive::COUNT],
}

impl Roster {
    pub(crate) fn new(able: Vec<PrimitiveSet>) -> Self {
        let mut roster = Self { able, counts: [0; Primitive::COUNT] };
        roster.count();
        roster
    }

    fn count(&mut self) {
        for primitive in Primitive::ALL {
            let able = self.able.iter().filter(|set| set.contains(primitive)).count();
            self.counts[primitive.index()] = able as u32;
        }
    }

    /// Takes a resource out for good.
    pub(crate) fn retire(&mut self, resource: ResourceId) {
        self.able[resource.index()] = PrimitiveSet::NONE;
        self.count();
    }

    pub(crate) fn primitives(&self, resource: ResourceId) -> PrimitiveSet {
        self.able[resource.index()]
    }

    /// How many resources can do it.
    pub(crate) fn count_of(&self, primitive: Primitive) -> u32 {
        self.counts[primitive.index()]
    }

    /// Whether `resource` may try a unit that failed elsewhere: not if it failed here, unless it failed with everyone.
    pub(crate) fn may_try(&self, resource: ResourceId, primitive: Primitive, failed_on: &[ResourceId]) -> bool {
        let can = |index: usize| self.able[index].contains(primitive);
        let failed = |index: usize| failed_on.iter().any(|failed| failed.index() == index);
        can(resource.index())
            && (!failed(resource.index()) || (0..self.able.len()).all(|index| !can(index) || failed(index)))
    }
}

/// Highest priority first, then first come.
type Order = (Reverse<i32>, u64);

struct Queue<W: Work> {
    units: BTreeMap<Order, Pending<W>>,
    /// Every unit of `units`, by the time at which it becomes late.
    deadlines: BTreeSet<(Instant, Order)>,
}

impl<W: Work> Queue<W> {
    fn remove(&mut self, order: Order) -> Option<Pending<W>> {
        let pending = self.units.remove(&order)?;
        self.deadlines.remove(&(pending.envelope.deadline, order));
        Some(pending)
    }
}

/// All units that wait.
pub(crate) struct WorkBin<W: Work> {
    queues: [Queue<W>; Primitive::COUNT],
    /// Units that came back from a resource that failed: few, for a resource that fails is left alone for a while.
    retries: Vec<Pending<W>>,
    len: usize,
    sequence: u64,
}

impl<W: Work> WorkBin<W> {
    pub(crate) fn new() -> Self {
        let queues = std::array::from_fn(|_| Queue { units: BTreeMap::new(), deadlines: BTreeSet::new() });
        Self { queues, retries: Vec::new(), len: 0, sequence: 0 }
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    pub(crate) fn push(&mut self, pending: Pending<W>) {
        let order = (Reverse(pending.envelope.priority), self.sequence);
        self.sequence += 1;
        let queue = &mut self.queues[pending.envelope.primitive.index()];
        queue.deadlines.insert((pending.envelope.deadline, order));
        queue.units.insert(order, pending);
        self.len += 1;
    }

    /// Puts back a unit that failed; it goes before all others.
    pub(crate) fn push_retry(&mut self, pending: Pending<W>) {
        self.retries.push(pending);
        self.len += 1;
    }

    /// The unit that `resource` should do next.
    ///
    /// In turn: a unit that failed elsewhere; the one that is late for longest; the one of highest priority. Among
    /// equal priorities comes first what the fewest resources can do, so that one who can do everything does not take
    /// away the only work of one who cannot; then first come.
    pub(crate) fn take(&mut self, resource: ResourceId, roster: &Roster, now: Instant) -> Option<Pending<W>> {
        if self.len == 0 {
            return None;
        }
        let may_retry =
            |pending: &Pending<W>| roster.may_try(resource, pending.envelope.primitive, &pending.envelope.failed_on);
        let taken = if let Some(index) = self.retries.iter().position(may_retry) {
            Some(self.retries.remove(index))
        } else {
            let able = roster.primitives(resource);
            let (primitive, order) = self.latest(able, now).or_else(|| self.foremost(able, roster))?;
            self.queues[primitive.index()].remove(order)
        };
        self.len -= usize::from(taken.is_some());
        taken
    }

    /// The unit whose deadline passed first.
    fn latest(&self, able: PrimitiveSet, now: Instant) -> Option<(Primitive, Order)> {
        able.iter()
            .filter_map(|primitive| {
                let &(deadline, order) = self.queues[primitive.index()].deadlines.first()?;
                (deadline <= now).then_some((deadline, primitive, order))
            })
            .min()
            .map(|(_, primitive, order)| (primitive, order))
    }

    /// The unit of highest priority.
    fn foremost(&self, able: PrimitiveSet, roster: &Roster) -> Option<(Primitive, Order)> {
        able.iter()
            .filter_map(|primitive| {
                let (&order, _) = self.queues[primitive.index()].units.first_key_value()?;
                Some((primitive, order))
            })
            .min_by_key(|&(primitive, (priority, sequence))| (priority, roster.count_of(primitive), sequence))
    }

    /// Takes out all units for which `wanted` holds, in order of submission within a primitive and priority.
    pub(crate) fn extract(&mut self, wanted: impl Fn(&Envelope<W>) -> bool) -> Vec<Pending<W>> {
        let mut out: Vec<_> = self.retries.extract_if(.., |pending| wanted(&pending.envelope)).collect();
        for queue in &mut self.queues {
            let orders: Vec<Order> =
                queue.units.iter().filter(|(_, pending)| wanted(&pending.envelope)).map(|(&order, _)| order).collect();
            out.extend(orders.into_iter().filter_map(|order| queue.remove(order)));
        }
        self.len -= out.len();
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Job(Primitive);
    impl Work for Job {
        type Output = ();
        fn primitive(&self) -> Primitive {
            self.0
        }
        fn size(&self) -> u64 {
            1
        }
    }

    fn pending(primitive: Primitive, ticket: u64, priority: i32, now: Instant, delay_ms: u64) -> Pending<Job> {
        let max_delay = Duration::from_millis(delay_ms);
        Pending {
            work: Job(primitive),
            envelope: Envelope {
                client: Arc::new(ResultsBin::new()),
                ticket,
                max_delay,
                priority,
                primitive,
                size: 1,
                submitted: now,
                deadline: now + max_delay,
                attempts: 0,
                failed_on: Vec::new(),
            },
        }
    }

    fn order_taken(bin: &mut WorkBin<Job>, roster: &Roster, now: Instant) -> Vec<u64> {
        std::iter::from_fn(|| bin.take(ResourceId(0), roster, now)).map(|pending| pending.envelope.ticket).collect()
    }

    #[test]
    fn priority_goes_first_until_a_unit_is_late() {
        let roster = Roster::new(vec![PrimitiveSet::ALL]);
        let now = Instant::now();
        let fill = || {
            let mut bin = WorkBin::new();
            for (ticket, priority, delay_ms) in [(0, 0, 50), (1, 0, 40), (2, 7, 5_000), (3, 7, 5_000)] {
                bin.push(pending(Primitive::Intersect, ticket, priority, now, delay_ms));
            }
            bin
        };
        assert_eq!(order_taken(&mut fill(), &roster, now), [2, 3, 0, 1]);
        // Once both have waited too long they go first, the one that is late for longest before the other.
        assert_eq!(order_taken(&mut fill(), &roster, now + Duration::from_millis(60)), [1, 0, 2, 3]);
    }

    #[test]
    fn who_can_do_everything_leaves_the_work_of_who_can_do_little() {
        let roster = Roster::new(vec![PrimitiveSet::ALL, PrimitiveSet::from([Primitive::Intersect])]);
        let now = Instant::now();
        let mut bin = WorkBin::new();
        bin.push(pending(Primitive::Intersect, 0, 0, now, 1_000));
        bin.push(pending(Primitive::PixelBlock, 1, 0, now, 1_000));
        bin.push(pending(Primitive::Intersect, 2, 1, now, 1_000));
        assert_eq!(order_taken(&mut bin, &roster, now), [2, 1, 0]);
    }

    #[test]
    fn a_partial_resource_takes_only_what_it_can_do() {
        let roster = Roster::new(vec![PrimitiveSet::from([Primitive::Occluded]), PrimitiveSet::ALL]);
        let now = Instant::now();
        let mut bin = WorkBin::new();
        bin.push(pending(Primitive::PixelBlock, 0, 9, now, 0));
        bin.push(pending(Primitive::Occluded, 1, 0, now, 1_000));
        assert_eq!(order_taken(&mut bin, &roster, now + Duration::from_secs(5)), [1]);
        assert_eq!(bin.len(), 1);
    }

    #[test]
    fn a_failed_unit_returns_to_the_resource_that_failed_only_when_all_others_failed_too() {
        let roster = Roster::new(vec![PrimitiveSet::ALL, PrimitiveSet::ALL]);
        let now = Instant::now();
        let mut bin = WorkBin::new();
        let mut unit = pending(Primitive::Intersect, 0, 0, now, 1_000);
        unit.envelope.failed_on.push(ResourceId(0));
        bin.push_retry(unit);
        assert!(bin.take(ResourceId(0), &roster, now).is_none());
        let mut unit = bin.take(ResourceId(1), &roster, now).expect("the other resource may try");
        unit.envelope.failed_on.push(ResourceId(1));
        bin.push_retry(unit);
        assert!(bin.take(ResourceId(0), &roster, now).is_some());
        assert_eq!(bin.len(), 0);
    }

    #[test]
    fn extracting_leaves_the_rest_in_order() {
        let roster = Roster::new(vec![PrimitiveSet::ALL]);
        let now = Instant::now();
        let mut bin = WorkBin::new();
        for ticket in 0..6 {
            let primitive = if ticket % 2 == 0 { Primitive::Occluded } else { Primitive::Intersect };
            bin.push(pending(primitive, ticket, 0, now, 1_000));
        }
        let out = bin.extract(|envelope| envelope.primitive == Primitive::Occluded);
        assert_eq!(out.iter().map(|pending| pending.envelope.ticket).collect::<Vec<_>>(), [0, 2, 4]);
        // Nothing of the extracted units may linger among the deadlines.
        assert_eq!(order_taken(&mut bin, &roster, now + Duration::from_secs(9)), [1, 3, 5]);
    }
}
