//! Resources that are far away: a sliding window of numbered packets, sent without waiting for answers.
//!
//! Source: Pereira et al., *Efficient use of Multiple Hardware Components for Image Synthesis*, sections 3.2.1 and
//! 3.3.6. Unlike there, packets may be answered in any order, and lost ones are noticed.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::lane::{Backoff, backup_of};
use crate::shared::{Attempt, Shared};
use crate::sync::lock;
use crate::work_bin::{Envelope, Pending};
use crate::{Activity, Failed, ResourceDescriptor, ResourceId, Work};

/// A resource that takes packets without answering at once. Called from a thread of its own.
pub trait WindowedResource<W: Work>: Send {
    /// What it is. Asked once, before the first packet.
    fn descriptor(&self) -> ResourceDescriptor;

    /// Sends a packet on its way; must not wait for its results. Its [`Reply`] may be used later, from any thread.
    fn send(&mut self, packet: Packet<W>);

    /// Makes the resource ready again after a failure, or says why that cannot be done yet.
    fn recover(&mut self) -> Result<(), String> {
        Ok(())
    }
}

/// How a far resource is served.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Packets that may be under way at once; at least 1.
    pub packets: usize,
    /// Most units in a packet; at least 1. More for a slow link.
    pub units_per_packet: usize,
    /// A packet without an answer for so long is lost, and with it the resource, until it has recovered. Also the
    /// longest time that shutting down waits for it.
    pub patience: Duration,
}

impl Default for Window {
    fn default() -> Self {
        Self { packets: 4, units_per_packet: 1, patience: Duration::from_secs(10) }
    }
}

/// Units that travel together.
pub struct Packet<W: Work> {
    /// Number of the packet; counts up by one for each that is sent to this resource.
    pub sequence: u64,
    /// What is to be done; may mix primitives.
    pub works: Vec<W>,
    /// Where the results go.
    pub reply: Reply<W>,
}

/// Takes the results of one packet. Dropped without use, it says that the packet is lost.
pub struct Reply<W: Work> {
    shared: Arc<Shared<W>>,
    lane: ResourceId,
    sequence: u64,
    answered: bool,
}

impl<W: Work> Reply<W> {
    /// Answers the packet: an outcome for each work, in the packet's order. Units beyond the end of `outcomes` count
    /// as lost; outcomes beyond the last unit are dropped.
    pub fn send(mut self, outcomes: Vec<Result<W::Output, Failed<W>>>) {
        self.answer(outcomes);
    }

    fn answer(&mut self, outcomes: Vec<Result<W::Output, Failed<W>>>) {
        self.answered = true;
        let answer = Answer { sequence: self.sequence, outcomes, at: Instant::now() };
        self.shared.lock().inboxes[self.lane.index()].push(answer);
        self.shared.wake(&[self.lane]);
    }
}

impl<W: Work> Drop for Reply<W> {
    fn drop(&mut self) {
        if !self.answered {
            self.answer(Vec::new());
        }
    }
}

/// What came back of a packet.
pub(crate) struct Answer<W: Work> {
    sequence: u64,
    outcomes: Vec<Result<W::Output, Failed<W>>>,
    at: Instant,
}

/// A packet under way.
struct Flight<W: Work> {
    sent: Instant,
    units: Vec<(Envelope<W>, Option<W>)>,
}

/// Serves `resource` until the allocator is shut down or the resource given up.
pub(crate) fn drive<W: Work>(
    shared: &Arc<Shared<W>>,
    id: ResourceId,
    resource: Box<dyn WindowedResource<W>>,
    window: Window,
) {
    let driver = Driver {
        shared,
        id,
        resource,
        window,
        flights: BTreeMap::new(),
        next_sequence: 0,
        last_answer: Instant::now(),
        backoff: Backoff::default(),
        resume: None,
        activity: Activity::Idle,
    };
    driver.run();
}

struct Driver<'a, W: Work> {
    shared: &'a Arc<Shared<W>>,
    id: ResourceId,
    resource: Box<dyn WindowedResource<W>>,
    window: Window,
    /// By sequence number, so the oldest first.
    flights: BTreeMap<u64, Flight<W>>,
    next_sequence: u64,
    last_answer: Instant,
    backoff: Backoff,
    /// While suspended: when to try again.
    resume: Option<Instant>,
    activity: Activity,
}

/// What there is to do.
enum Step<W: Work> {
    Read(Vec<Answer<W>>),
    Send(Vec<Pending<W>>),
    GiveUp,
    Recover,
    End,
}

impl<W: Work> Driver<'_, W> {
    fn run(mut self) {
        loop {
            self.book();
            let healthy = match self.next_step() {
                Step::Read(answers) => {
                    let mut healthy = true;
                    for answer in answers {
                        healthy &= self.read(answer);
                    }
                    healthy
                }
                Step::Send(units) => {
                    self.send(units);
                    true
                }
                Step::GiveUp => {
                    self.lose_oldest();
                    false
                }
                Step::Recover => {
                    self.resume = None;
                    matches!(catch_unwind(AssertUnwindSafe(|| self.resource.recover())), Ok(Ok(())))
                }
                Step::End => return,
            };
            if !healthy && !self.suspend() {
                return;
            }
        }
    }

    /// Waits until there is something to do.
    fn next_step(&self) -> Step<W> {
        let mut state = self.shared.lock();
        loop {
            let answers = std::mem::take(&mut state.inboxes[self.id.index()]);
            if !answers.is_empty() {
                return Step::Read(answers);
            }
            let now = Instant::now();
            let expires = self.flights.values().next().and_then(|oldest| oldest.sent.checked_add(self.window.patience));
            if expires.is_some_and(|expires| expires <= now) {
                return Step::GiveUp;
            }
            if state.closed && self.flights.is_empty() {
                return Step::End;
            }
            if !state.closed && self.resume.is_some_and(|resume| resume <= now) {
                return Step::Recover;
            }
            let hungry = !state.closed && self.resume.is_none() && self.flights.len() < self.window.packets.max(1);
            if hungry {
                let take = || self.shared.take(&mut state, self.id, now);
                let units: Vec<_> = std::iter::from_fn(take).take(self.window.units_per_packet.max(1)).collect();
                if !units.is_empty() {
                    return Step::Send(units);
                }
            }
            let resume = self.resume.filter(|_| !state.closed);
            let until = expires.into_iter().chain(resume).min();
            let patience = until.map(|until| until.saturating_duration_since(now));
            state = if hungry {
                self.shared.doze(state, self.id, patience)
            } else {
                self.shared.rest(state, self.id, patience)
            };
        }
    }

    fn send(&mut self, units: Vec<Pending<W>>) {
        let sequence = self.next_sequence;
        self.next_sequence += 1;
        let mut works = Vec::with_capacity(units.len());
        let mut flight = Flight { sent: Instant::now(), units: Vec::with_capacity(units.len()) };
        for Pending { work, envelope } in units {
            flight.units.push((envelope, backup_of(&work)));
            works.push(work);
        }
        self.flights.insert(sequence, flight);
        let reply = Reply { shared: Arc::clone(self.shared), lane: self.id, sequence, answered: false };
        let packet = Packet { sequence, works, reply };
        // A panic drops the reply, which says that the packet is lost.
        let _ = catch_unwind(AssertUnwindSafe(|| self.resource.send(packet)));
    }

    /// Settles the units of a packet. False: some failed.
    fn read(&mut self, answer: Answer<W>) -> bool {
        let Some(flight) = self.flights.remove(&answer.sequence) else {
            return true; // Given up before; its units are done elsewhere.
        };
        // The window hides the way there and back, so the time of a packet is that since the one before.
        let busy = answer.at.saturating_duration_since(flight.sent.max(self.last_answer));
        self.last_answer = self.last_answer.max(answer.at);
        let healthy = self.settle(flight, answer.outcomes, busy, "the packet was lost");
        if healthy {
            self.backoff.succeeded();
        }
        healthy
    }

    fn lose_oldest(&mut self) {
        if let Some((_, flight)) = self.flights.pop_first() {
            self.settle(flight, Vec::new(), Duration::ZERO, "no answer in time");
        }
    }

    fn settle(
        &self,
        flight: Flight<W>,
        outcomes: Vec<Result<W::Output, Failed<W>>>,
        busy: Duration,
        lost: &str,
    ) -> bool {
        let total = flight.units.iter().map(|(envelope, _)| envelope.size as f64).sum::<f64>().max(1.0);
        let mut outcomes = outcomes.into_iter();
        let mut healthy = true;
        for (envelope, backup) in flight.units {
            let attempt = match outcomes.next() {
                Some(Ok(output)) => Attempt::Done(output),
                Some(Err(failed)) => Attempt::GivenBack(failed),
                None => Attempt::Lost { reason: lost.to_owned(), backup },
            };
            let share = busy.mul_f64((envelope.size as f64 / total).min(1.0));
            healthy &= self.shared.settle(self.id, envelope, attempt, flight.sent, share);
        }
        healthy
    }

    /// After a failure: sends nothing for a while. False: the resource was given up.
    fn suspend(&mut self) -> bool {
        let Some(pause) = self.backoff.failed(&self.shared.config) else {
            while !self.flights.is_empty() {
                self.lose_oldest();
            }
            self.shared.retire(self.id);
            return false;
        };
        self.resume = Instant::now().checked_add(pause);
        self.shared.pass_on();
        true
    }

    /// Keeps the account of what the resource is at.
    fn book(&mut self) {
        let activity = if !self.flights.is_empty() {
            Activity::Working
        } else if self.resume.is_some() {
            Activity::Suspended
        } else {
            Activity::Idle
        };
        if activity != self.activity {
            self.activity = activity;
            lock(&self.shared.lanes[self.id.index()].account).enter(activity, Instant::now());
        }
    }
}
