//! The thread of a far resource: a sliding window of numbered packets, sent without waiting for answers.
//!
//! Source: Pereira et al., *Efficient use of Multiple Hardware Components for Image Synthesis*, sections 3.2.1 and
//! 3.3.6. Unlike there, packets may be answered in any order, lost ones are detected, and their number and size follow
//! from measurements ([`crate::policy::flow`]).

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

use super::direct::{quietly, recover, take_works};
use super::settle::{Attempt, lost};
use super::shared::{AllocatorState, PacketAnswer};
use super::sync::lock;
use crate::policy::core::Next;
use crate::policy::incident::Fault;
use crate::policy::time::Time;
use crate::{DataId, Failed, ResourceDescriptor, ResourceId, Transfer, Work};

/// A resource that takes packets without answering at once. Called from a thread of its own.
pub trait WindowedResource<W: Work>: Send {
    /// Returns the description. Called once, before the first packet.
    fn descriptor(&self) -> ResourceDescriptor;

    /// Sends a packet; must not wait for its results. Its [`Reply`] may be used later, from any thread.
    fn send(&mut self, packet: Packet<W>);

    /// Makes the resource ready again after a failure.
    ///
    /// # Errors
    /// The resource is not ready yet, with the reason for the user. It is called again after a longer suspension, until
    /// it is given up.
    fn recover(&mut self) -> Result<(), String> {
        Ok(())
    }

    /// Evicts data from the resource's memory: the least recently used, to make room. No packet in flight needs it; may
    /// name data that was never sent here.
    fn evict(&mut self, data: DataId) {
        let _ = data;
    }

    /// Returns the bytes of memory free for data; `None`: unknown. Called after the resource ran out of memory.
    fn memory_free(&self) -> Option<u64> {
        None
    }
}

/// Work units that are sent to a resource together.
pub struct Packet<W: Work> {
    /// The number of the packet; increases by one per packet to this resource.
    pub sequence: u64,
    /// The works; all of one primitive, on the same data.
    pub works: Vec<W>,
    /// The handle that answers the packet.
    pub reply: Reply<W>,
}

/// The handle for the results of a packet. Dropping it unused reports the packet as lost.
pub struct Reply<W: Work> {
    shared: Arc<AllocatorState<W>>,
    lane: ResourceId,
    sequence: u64,
    answered: bool,
}

impl<W: Work> Reply<W> {
    /// Answers the packet with an outcome per work, in order. Units beyond the end of `outcomes` count as lost; further
    /// outcomes are dropped.
    pub fn send(mut self, outcomes: Vec<Result<W::Output, Failed<W>>>) {
        self.answer(outcomes, None, None, Fault::Refused);
    }

    /// Answers like [`Reply::send`], and reports the measured traffic, which determines packet sizes.
    ///
    /// - `transfers`: the traffic to the resource, and that back.
    pub fn send_transferred(mut self, outcomes: Vec<Result<W::Output, Failed<W>>>, transfers: [Transfer; 2]) {
        self.answer(outcomes, None, Some(transfers), Fault::Refused);
    }

    /// Answers like [`Reply::send`], and reports the time that the resource worked on the packet, which is otherwise
    /// inferred from the times of answers.
    pub fn send_timed(mut self, outcomes: Vec<Result<W::Output, Failed<W>>>, busy: Duration) {
        self.answer(outcomes, Some(busy), None, Fault::Refused);
    }

    /// Reports that the resource must prepare before it starts this packet, for instance compile kernels, and returns all of the
    /// packet; other resources may do it meanwhile. The resource is requested to [recover](WindowedResource::recover), which may take
    /// any length of time, and gets nothing until then. This is not a failure, and the time before the first answer is not
    /// measured.
    pub fn not_ready(mut self, works: Vec<W>) {
        self.answered = true;
        self.deliver(PacketAnswer {
            sequence: self.sequence,
            outcomes: Vec::new(),
            busy: None,
            transfers: None,
            fault: Fault::Refused,
            unbegun: Some(works),
        });
    }

    /// Reports that the resource lacks memory for this packet, and gives all of it back. It then gets smaller packets,
    /// and units too large for it alone are done elsewhere.
    pub fn out_of_memory(mut self, works: Vec<W>) {
        let failed = |work| Err(Failed { work, reason: "out of memory".to_owned() });
        self.answer(works.into_iter().map(failed).collect(), None, None, Fault::OutOfMemory);
    }

    /// Returns true if the answer is still needed: false after the packet was given up and its units done elsewhere. A
    /// resource that is late may skip such packets.
    pub fn is_awaited(&self) -> bool {
        lock(&self.shared.lanes[self.lane.index()].ledger).look(self.sequence).is_some()
    }

    fn answer(
        &mut self,
        outcomes: Vec<Result<W::Output, Failed<W>>>,
        busy: Option<Duration>,
        transfers: Option<[Transfer; 2]>,
        fault: Fault,
    ) {
        self.answered = true;
        self.deliver(PacketAnswer { sequence: self.sequence, outcomes, busy, transfers, fault, unbegun: None });
    }

    fn deliver(&self, answer: PacketAnswer<W>) {
        let lane = &self.shared.lanes[self.lane.index()];
        lock(&lane.inbox).push(answer);
        lane.post.wake();
    }
}

impl<W: Work> Drop for Reply<W> {
    fn drop(&mut self) {
        if !self.answered {
            self.answer(Vec::new(), None, None, Fault::Died);
        }
    }
}

/// Serves `resource` until the allocator is shut down or the resource is retired.
pub(crate) fn drive<W: Work>(shared: &Arc<AllocatorState<W>>, id: ResourceId, resource: &mut dyn WindowedResource<W>) {
    shared.lanes[id.index()].post.man();
    Driver { shared, id, resource, sent: BTreeMap::new() }.run();
}

struct Driver<'a, W: Work> {
    shared: &'a Arc<AllocatorState<W>>,
    id: ResourceId,
    resource: &'a mut dyn WindowedResource<W>,
    /// Sending times of the packets in flight.
    sent: BTreeMap<u64, Time>,
}

impl<W: Work> Driver<'_, W> {
    fn run(mut self) {
        let lane = &self.shared.lanes[self.id.index()];
        loop {
            let answers = std::mem::take(&mut *lock(&lane.inbox));
            for answer in answers {
                self.read(answer);
            }
            let (id, shared) = (self.id, self.shared);
            match shared.with_core(|core, now, out| core.next(now, id, out)) {
                Next::Packet(packet) => self.send(packet),
                Next::Recover(evicted) => {
                    let outcome = recover(shared, id, || {
                        evicted.into_iter().for_each(|data| quietly(|| self.resource.evict(data)));
                        self.resource.recover()
                    });
                    shared.with_core(|core, now, out| core.recovered(now, id, outcome, out));
                }
                Next::Wait(until) => {
                    if lock(&lane.inbox).is_empty() {
                        lane.post.wait(until.map(|until| until.since(shared.now())));
                    }
                }
                Next::End => return,
            }
        }
    }

    fn send(&mut self, packet: crate::policy::core::DrawnPacket<super::shared::UnitPayload<W>>) {
        let lane = &self.shared.lanes[self.id.index()];
        for data in packet.evicted {
            quietly(|| self.resource.evict(data));
        }
        let sequence = packet.sequence;
        let mut units = packet.units;
        let works = take_works(&mut units);
        lock(&lane.ledger).enter(sequence, units);
        self.shared.alarm.set(packet.deadline);
        self.sent.insert(sequence, self.shared.now());
        let reply = Reply { shared: Arc::clone(self.shared), lane: self.id, sequence, answered: false };
        let packet = Packet { sequence, works, reply };
        // A panic drops the reply, which reports the packet as lost
        let _ = catch_unwind(AssertUnwindSafe(|| self.resource.send(packet)));
    }

    /// Settles the units of an answered packet.
    fn read(&mut self, answer: PacketAnswer<W>) {
        let PacketAnswer { sequence, outcomes, busy, transfers, fault, unbegun } = answer;
        let sent = self.sent.remove(&sequence).unwrap_or_default();
        let Some(units) = lock(&self.shared.lanes[self.id.index()].ledger).settle(sequence) else {
            return; // Given up before; its units are done elsewhere.
        };
        let total = units.iter().map(|unit| unit.meta.size as f64).sum::<f64>().max(1.0);
        let taken = busy.unwrap_or_else(|| self.shared.now().since(sent));
        let shares: Vec<Duration> =
            units.iter().map(|unit| taken.mul_f64((unit.meta.size as f64 / total).min(1.0))).collect();
        let attempt = |outcome: Option<Result<W::Output, Failed<W>>>| match outcome {
            Some(Ok(output)) => Attempt::Done(output),
            Some(Err(Failed { work, reason })) => Attempt::Failed { fault, reason, work: Some(work) },
            None => lost("the packet was lost"),
        };
        let is_ready = unbegun.is_none();
        let attempts: Vec<_> = match unbegun {
            Some(works) => works.into_iter().map(|work| (Attempt::Untouched(work), Duration::ZERO)).collect(),
            None => {
                let mut outcomes = outcomes.into_iter();
                shares.into_iter().map(|share| (attempt(outcomes.next()), share)).collect()
            }
        };
        let mut settled = self.shared.sort(self.id, units, attempts, sent);
        settled.landing.is_not_ready = !is_ready;
        (settled.landing.busy, settled.landing.transfers) = (busy, transfers);
        let (landed, ()) = self.shared.land(self.id, sequence, settled, |_, _, _| ());
        if fault == Fault::OutOfMemory {
            for data in landed.into_iter().flat_map(|landed| landed.evicted) {
                quietly(|| self.resource.evict(data));
            }
            let free = catch_unwind(AssertUnwindSafe(|| self.resource.memory_free())).unwrap_or(None);
            if let Some(bytes) = free {
                self.shared.with_core(|core, _, _| core.set_memory_free(self.id, bytes));
            }
        }
    }
}
