//! Settlement of units: an answer, or another attempt.

use std::time::Duration;

use super::clients::{ClientId, Clients};
use super::shared::{AllocatorState, LaneEnd, UnitPayload};
use super::sync::lock;
use crate::policy::core::{Core, FollowUps, LandedPacket, PacketLanding};
use crate::policy::faults::GiveUp;
use crate::policy::incident::Fault;
use crate::policy::time::Time;
use crate::policy::unit::Unit;
use crate::{Completed, ResourceId, UnitError, Work};

/// The result of an attempt at a unit.
pub(crate) enum Attempt<W: Work> {
    Done(W::Output),
    /// The unit was not begun.
    Untouched(W),
    Failed {
        fault: Fault,
        reason: String,
        work: Option<W>,
    },
}

/// A packet with its results.
pub(crate) struct SettledWork<W: Work> {
    pub(crate) landing: PacketLanding,
    undone: Vec<UnfinishedWork<W>>,
    mail: Mail<W>,
}

/// A unit that was not done; it can be done again if it contains its work.
struct UnfinishedWork<W: Work> {
    unit: Unit<UnitPayload<W>>,
    /// The reason, if it was attempted.
    failed: Option<String>,
}

/// Answers grouped by client, so that each results bin is locked once for several.
struct Mail<W: Work>(Vec<Letter<W>>);

/// Answers to one client.
type Letter<W> = (ClientId, Vec<Completed<<W as Work>::Output>>);

impl<W: Work> Mail<W> {
    /// Adds an answer; up to `more` further ones are expected.
    fn add(&mut self, client: ClientId, answer: Completed<W::Output>, more: usize) {
        match self.0.last_mut() {
            Some((last, answers)) if *last == client => answers.push(answer),
            _ => {
                let mut answers = Vec::with_capacity(1 + more);
                answers.push(answer);
                self.0.push((client, answers));
            }
        }
    }

    /// Delivers the answers to existing clients. Outputs of units whose life time has ended are withheld; returns their
    /// number.
    fn send(self, clients: &Clients<W::Output>) -> u64 {
        let mut late = 0;
        for (client, mut answers) in self.0 {
            let Some(results) = clients.results(client) else { continue };
            if results.is_over() {
                for answer in answers.iter_mut().filter(|answer| answer.output.is_ok()) {
                    answer.output = Err(UnitError::Expired);
                    late += 1;
                }
            }
            results.deliver(answers);
        }
        late
    }
}

impl<W: Work> AllocatorState<W> {
    /// Makes answers for finished units and sorts the others. `sent`: sending time of the packet; `busy`: time of each
    /// unit.
    pub(crate) fn sort(
        &self,
        id: ResourceId,
        units: Vec<Unit<UnitPayload<W>>>,
        attempts: impl IntoIterator<Item = (Attempt<W>, Duration)>,
        sent: Time,
    ) -> SettledWork<W> {
        let now = self.now();
        let mut settled = SettledWork { landing: PacketLanding::default(), undone: Vec::new(), mail: Mail(Vec::new()) };
        let mut attempts = attempts.into_iter();
        let mut more = units.len();
        for mut unit in units {
            more -= 1;
            let (attempt, busy) = attempts.next().unwrap_or_else(|| (lost("the packet was lost"), Duration::ZERO));
            let attempt = match attempt {
                Attempt::Done(output) => match W::check(&output, unit.meta.size) {
                    Ok(()) => Attempt::Done(output),
                    Err(reason) => Attempt::Failed { fault: Fault::Garbage, reason, work: None },
                },
                attempt => attempt,
            };
            match attempt {
                Attempt::Done(output) => {
                    settled.landing.done += 1;
                    settled.landing.done_items = settled.landing.done_items.saturating_add(unit.meta.size);
                    let is_late = unit.meta.expires <= now;
                    settled.landing.expired += u64::from(is_late);
                    let output = if is_late { Err(UnitError::Expired) } else { Ok(output) };
                    let answer = completed(&unit, output, Some(id), sent, busy);
                    settled.mail.add(unit.load.client, answer, more);
                }
                Attempt::Untouched(work) => {
                    unit.load.work = Some(work);
                    settled.undone.push(UnfinishedWork { unit, failed: None });
                }
                Attempt::Failed { fault, reason, work } => {
                    settled.landing.failed += 1;
                    settled.landing.fault.get_or_insert_with(|| (fault, reason.clone()));
                    unit.load.work = work.or(unit.load.work);
                    settled.undone.push(UnfinishedWork { unit, failed: Some(reason) });
                }
            }
        }
        settled
    }

    /// Reports the result of a packet to the policy, puts back unfinished units, and answers the others. Returns the
    /// consequences, and the result of `then`.
    pub(crate) fn land<R>(
        &self,
        id: ResourceId,
        sequence: u64,
        settled: SettledWork<W>,
        then: impl FnOnce(&mut Core<UnitPayload<W>>, Time, &mut FollowUps<UnitPayload<W>>) -> R,
    ) -> (Option<LandedPacket>, R) {
        let SettledWork { landing, undone, mail } = settled;
        let mut answers = Vec::new();
        let (landed, then) = self.with_core(|core, now, out| {
            let landed = core.landed(now, id, sequence, landing, out);
            let blamed = landed.as_ref().is_none_or(|landed| landed.blamed);
            answers = self.try_again(core, now, id, undone, blamed, out);
            (landed, then(core, now, out))
        });
        // Answer after the accounts are updated, so that a client with its answer finds it in the report
        let late = mail.send(&self.clients);
        if late > 0 {
            self.with_core(|core, now, _| core.note_late(now, late));
        }
        self.answer_failed(id, answers);
        (landed, then)
    }

    /// Puts back units for another attempt. Returns the others, with the reasons.
    fn try_again(
        &self,
        core: &mut Core<UnitPayload<W>>,
        now: Time,
        id: ResourceId,
        undone: Vec<UnfinishedWork<W>>,
        blamed: bool,
        out: &mut FollowUps<UnitPayload<W>>,
    ) -> Vec<AbandonedUnit<W>> {
        let mut answers = Vec::new();
        for UnfinishedWork { unit, failed } in undone {
            let blamed = blamed && failed.is_some();
            let reason = failed.unwrap_or_default();
            if unit.load.work.is_none() {
                answers.push(AbandonedUnit { unit, error: UnitError::Lost { reason } });
                continue;
            }
            // A leaving client removes itself before it cancels its units, so one of the two sees the unit
            let abandoned = !self.clients.has(unit.load.client);
            let given_up =
                if abandoned { Some((unit, GiveUp::Closed)) } else { core.give_back(now, id, unit, blamed, out) };
            if let Some((unit, why)) = given_up {
                let error = match why {
                    GiveUp::Failed => UnitError::Failed { attempts: unit.meta.attempts, reason },
                    GiveUp::NoResource => UnitError::NoResource(unit.meta.primitive),
                    GiveUp::Closed => UnitError::Closed,
                    GiveUp::Expired => UnitError::Expired,
                };
                answers.push(AbandonedUnit { unit, error });
            }
        }
        answers
    }

    fn answer_failed(&self, id: ResourceId, answers: Vec<AbandonedUnit<W>>) {
        let now = self.now();
        for AbandonedUnit { unit, error } in answers {
            let mut mail = Mail::<W>(Vec::new());
            mail.add(unit.load.client, completed(&unit, Err(error), Some(id), now, Duration::ZERO), 0);
            drop(unit); // Drop it before its answer arrives: it may hold data that the client waits for.
            mail.send(&self.clients);
        }
    }

    /// Answers units that were never started; by default because no resource can do them.
    pub(crate) fn answer_unstarted(&self, units: Vec<Unit<UnitPayload<W>>>, error: Option<&UnitError>) {
        let now = self.now();
        let mut mail = Mail::<W>(Vec::new());
        let mut more = units.len();
        for unit in units {
            more -= 1;
            let nobody = || {
                if self.room.is_closed() { UnitError::Closed } else { UnitError::NoResource(unit.meta.primitive) }
            };
            let error = error.cloned().unwrap_or_else(nobody);
            let last = unit.meta.failed_on.last().copied();
            let answer = completed(&unit, Err(error), last, now, Duration::ZERO);
            mail.add(unit.load.client, answer, more);
        }
        mail.send(&self.clients);
    }

    /// Gives up an overdue packet: its units are done elsewhere. A near resource whose units cannot be done again is
    /// waited for, except at shutdown.
    ///
    /// - `blamed`: true if this counts as an attempt at the units.
    pub(crate) fn give_up(&self, id: ResourceId, sequence: u64, blamed: bool) {
        let lane = &self.lanes[id.index()];
        let units = {
            let mut ledger = lock(&lane.ledger);
            let lacks_backup = |units: &[Unit<UnitPayload<W>>]| units.iter().any(|unit| unit.load.work.is_none());
            if !lane.is_far && !self.room.is_closed() && ledger.look(sequence).is_some_and(lacks_backup) {
                drop(ledger);
                return self.with_core(|core, now, _| core.spare(now, id, sequence));
            }
            ledger.settle(sequence)
        };
        let undone: Vec<_> = units
            .into_iter()
            .flatten()
            .map(|unit| UnfinishedWork { unit, failed: Some("no answer in time".to_owned()) })
            .collect();
        let mut answers = Vec::new();
        self.with_core(|core, now, out| {
            core.hung(now, id, sequence, out);
            answers = self.try_again(core, now, id, undone, blamed, out);
        });
        self.answer_failed(id, answers);
        // A near resource blocks its thread, a far one may block it at the next call
        self.set_end(id, LaneEnd::Over);
        lane.post.wake();
    }

    /// Gives up a doubtful packet, the last one pending: its units are done elsewhere if they can be done again.
    pub(crate) fn do_elsewhere(&self, id: ResourceId, sequence: u64) {
        let can_be_done_again = |units: &[Unit<UnitPayload<W>>]| units.iter().all(|unit| unit.load.work.is_some());
        if lock(&self.lanes[id.index()].ledger).look(sequence).is_some_and(can_be_done_again) {
            self.give_up(id, sequence, false);
        }
    }
}

/// A unit that is not attempted again, and the reason. Its work is dropped outside of all locks.
struct AbandonedUnit<W: Work> {
    unit: Unit<UnitPayload<W>>,
    error: UnitError,
}

/// Returns the attempt of a resource that was lost together with the work.
pub(crate) fn lost<W: Work>(reason: &str) -> Attempt<W> {
    Attempt::Failed { fault: Fault::Died, reason: reason.to_owned(), work: None }
}

fn completed<W: Work>(
    unit: &Unit<UnitPayload<W>>,
    output: Result<W::Output, UnitError>,
    resource: Option<ResourceId>,
    started: Time,
    busy: Duration,
) -> Completed<W::Output> {
    Completed { ticket: unit.load.ticket, output, busy, waited: started.since(unit.meta.submitted), resource }
}
