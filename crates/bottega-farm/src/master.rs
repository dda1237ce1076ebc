//! The Master: keeps the list of agents, assigns zones by auction, takes the results and has them composed.
//!
//! **Invariant:** its memory holds nothing that is not on the Blackboard, except for what can be lost without harm,
//! such as rounds of the auction and leases. A new Master reads the work's rows and continues.
//!
//! Every order is a compare-and-set on the zone's row. The new revision is the fencing token that the report must
//! carry; a report with an older one is refused. So a zone that was taken from a silent agent and given to another is
//! accepted once, from the first agent to finish with a valid token.
//!
//! The state is divided among values that know nothing of each other but their arguments. This file and `routing` know
//! all of them: this one on time (steps after each event, periodic checks), `routing` on messages and replies.
//!
//! | value | what it holds and decides |
//! |---|---|
//! | [`Assignments`] | which agent holds which zone: [rows](rows) and pending writes, counts over them ([ledger]), agents ([roster]) |
//! | [`Rounds`] | calls for proposals, bids and awards; without auctions: [deal] |
//! | [`Offcuts`] | pieces of zones without a row; takeovers at the end of a work: [tail] |
//! | [`Trust`] | excluded agents, and zones that depend on their word |
//! | [`Verification`] | comparing the paintings of untrusted agents |
//! | [`ZoneWorth`], [`Credits`] | measured costs of zones; kept promises of agents |
//! | [`Pass`] | passes over the picture, with a goal of time |
//! | [`Composition`] | zones on their way into the film |
//! | [`StallWatch`] | zones that wait although agents are free; orders without progress: [pace] |

mod assignments;
mod comparisons;
mod composition;
mod config;
mod credits;
mod deal;
mod ledger;
mod offcuts;
mod pace;
mod plan;
mod results;
mod roster;
mod rounds;
mod routing;
mod rows;
mod stall;
mod tail;
#[cfg(test)]
mod tests;
mod trust;
mod verify;
mod watched;
mod worth;

use std::sync::Arc;

use bottega_agents::{Performative, StateMachine, Time};

pub use self::config::{MasterConfig, Timing};
use self::{
    assignments::{Assignments, Departure},
    composition::Composition,
    credits::Credits,
    offcuts::Offcuts,
    plan::Pass,
    rounds::Rounds,
    rows::Rows,
    stall::{Stall, StallWatch},
    trust::Trust,
    verify::Verification,
    worth::ZoneWorth,
};
use crate::{
    Blackboard, FarmAction, FarmCompletion, FarmContent, FarmEffect, FarmEvent, FarmValue, LifeCycle, MemberId,
    Partition, WorkRow, ZoneId, ZoneRow, ZoneState, contents::message, directory::MASTER_SERVICES, protocol,
    registrant::Registrant,
};

/// The progress of the work as a whole.
#[derive(Clone, Copy, Debug, Default)]
struct Phase {
    /// All rows are known, and the film has begun.
    has_begun: bool,
    /// The user has requested a stop: no more zones are given out.
    is_stopping: bool,
    /// All zones are in the film or given up, or the work is abandoned.
    is_finished: bool,
}

impl Phase {
    /// Returns true if zones are given out.
    fn gives_out(self) -> bool {
        self.has_begun && !self.is_stopping
    }

    /// Returns true if zones are given out, and not all are finished.
    fn is_at_work(self) -> bool {
        self.gives_out() && !self.is_finished
    }
}

/// The state machine of a Master, which assigns the zones of one work and has them composed.
#[derive(Clone, Debug)]
pub struct Master {
    phase: Phase,
    assignments: Assignments,
    rounds: Rounds,
    offcuts: Offcuts,
    trust: Trust,
    verification: Verification,
    worth: ZoneWorth,
    credits: Credits,
    pass: Pass,
    composition: Composition,
    stalls: StallWatch,
    /// True after a stall: the Master restarts when the film has answered.
    must_restart: bool,
    next_check: Option<Time>,
    /// Until then agents that an earlier Master knew may report to this one.
    expects_until: Time,
    /// The registration at the directories, if there are any.
    registrant: Option<Box<Registrant>>,
}

impl Master {
    /// Makes a Master, which continues from what it finds on the Blackboard when it starts.
    pub fn new(config: MasterConfig) -> Self {
        let place = config.registration.clone();
        let registrant = place.map(|place| Box::new(Registrant::new(config.id.clone(), place, &MASTER_SERVICES)));
        let rows = Rows::new(config.work);
        Self { registrant, ..Self::with_rows(Arc::new(config), rows) }
    }

    /// Makes a Master that resumes a work from stored rows, on an empty Blackboard.
    ///
    /// Zones in hand are open again; finished zones stay finished.
    pub fn recover(config: MasterConfig, work: WorkRow, rows: impl IntoIterator<Item = ZoneRow>) -> Self {
        let mut master = Self::new(config);
        let rows = rows.into_iter().map(|row| FarmValue::Zone(Arc::new(row.resumed())));
        for value in std::iter::once(FarmValue::Work(Arc::new(work))).chain(rows) {
            master.assignments.rows.restore(value);
        }
        master
    }

    /// Makes a Master that knows nothing but `rows`, and is not registered.
    fn with_rows(config: Arc<MasterConfig>, rows: Rows) -> Self {
        Self {
            phase: Phase::default(),
            rounds: Rounds::default(),
            offcuts: Offcuts::default(),
            trust: Trust::new(config.verifies()),
            verification: Verification::new(Arc::clone(&config)),
            worth: ZoneWorth::default(),
            credits: Credits::default(),
            pass: Pass::new(Time::ZERO),
            composition: Composition::default(),
            stalls: StallWatch::default(),
            must_restart: false,
            next_check: None,
            expects_until: Time::ZERO,
            registrant: None,
            assignments: Assignments::new(config, rows),
        }
    }

    /// Returns the Master's view of the Blackboard.
    pub fn board(&self) -> &Blackboard {
        self.assignments.rows.board()
    }

    /// Returns true if all zones are in the film or given up, or if the work was abandoned.
    pub fn is_finished(&self) -> bool {
        self.phase.is_finished
    }

    /// Returns the number of zones that wait for an agent.
    pub(crate) fn waiting_count(&self) -> usize {
        if self.phase.gives_out() { self.assignments.ledger.waiting_count() } else { 0 }
    }

    fn assert_invariants(&self) {
        self.assignments.assert_invariants();
        self.composition.assert_invariants();
    }

    /// Takes all steps that follow from the current state. Called after each event.
    fn advance(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        let rows = &self.assignments.rows;
        if !rows.is_caught_up() || !rows.board().is_complete() || self.phase.is_finished {
            return;
        }
        // Start when the rows are complete
        if !self.phase.has_begun {
            self.begin(now, actions);
        }
        let assignments = &mut self.assignments;
        if self.phase.gives_out() {
            // Write the rows of cut pieces, and discard the samples of agents found wrong
            self.offcuts.write(now, assignments, actions);
            self.trust.repaint_dubious(now, assignments, actions);
            // Plan the next pass, with a goal of time
            self.pass.plan_next(now, assignments, actions);
            // Order profiles of zones without samples
            assignments.order_profiles(now, actions);
            // Award the zones of rounds that have ended
            self.rounds.close_ended(now, assignments, actions);
            // Order second paintings to compare
            self.verification.order_comparisons(now, assignments, actions);
            // Deal zones out, or open new rounds
            if assignments.config.deals() {
                deal::deal(now, assignments, actions);
            } else {
                self.rounds.recall(now, assignments);
                while self.rounds.open(now, assignments, actions) {}
            }
        }
        // Hand painted zones to the film, and end when all are composed
        if self.phase.has_begun {
            let board = assignments.rows.board();
            let all_chosen = board.zone_count() == assignments.ledger.chosen_count();
            self.composition.hand_over(board, all_chosen, actions);
            self.finish(actions);
        }
    }

    /// Starts the work: checks the zones, begins the film and introduces the scene to the agents.
    fn begin(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        let board = self.assignments.rows.board();
        let Some(work) = board.work().cloned() else { return };
        let zones = board.zones().filter(|row| row.root.is_none());
        let rects: Vec<_> = zones.map(|row| row.rect).collect();
        let in_order = rects.is_sorted_by_key(|rect| (rect.y0, rect.x0));
        if !in_order || !Partition::covers(work.settings.frame, &rects) {
            let reason = "the zones on the blackboard are not a partition of the frame".to_owned();
            actions.push(FarmAction::Effect(FarmEffect::Abandon { reason }));
            actions.push(FarmAction::Stop);
            self.phase.is_finished = true;
            return;
        }
        self.phase.has_begun = true;
        self.pass = Pass::new(now);
        actions.push(FarmAction::Effect(FarmEffect::BeginFilm(work)));
        self.introduce(&self.assignments.roster.present(), actions);
        self.trust.doubt_all(self.assignments.rows.board());
    }

    /// Workflow, step 8: ends the work when the picture is complete.
    fn finish(&mut self, actions: &mut Vec<FarmAction>) {
        let Assignments { config, rows, ledger, roster, .. } = &self.assignments;
        let zone_count = rows.board().zone_count();
        let is_settled = ledger.settled_count() >= zone_count && !rows.has_writes() && self.offcuts.is_empty();
        if self.composition.is_stale() || !is_settled {
            return;
        }
        let failed = rows.board().zones().filter(|row| row.state == ZoneState::Failed);
        let failed: Vec<ZoneId> = failed.map(|row| row.zone).collect();
        if self.composition.composed_count() + failed.len() < zone_count {
            return;
        }
        self.phase.is_finished = true;
        actions.push(FarmAction::Effect(FarmEffect::Finish { failed }));
        let to = roster.present();
        if !to.is_empty() {
            let end = FarmContent::LifeCycle(LifeCycle::Terminate);
            let request = message(Performative::Request, protocol::REQUEST, &config.id, to, end);
            actions.push(FarmAction::Send(request));
        }
        if let Some(registrant) = &mut self.registrant {
            registrant.leave(actions);
        }
        actions.push(FarmAction::Stop);
    }

    /// The periodic check: stalls, expired leases, hanging orders, credits to write, idle agents.
    fn check(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        let timing = self.assignments.config.timing;
        self.next_check = Some(now + timing.heartbeat);
        // Restart after a stall
        self.check_stall(now, actions);
        // Call again the agents that refused or lost
        let roster = &mut self.assignments.roster;
        roster.wake(now);
        self.rounds.call_all_again(roster);
        roster.rest_orders();
        // Dismiss the agents whose lease is over
        if now.elapsed() > timing.lease {
            for agent in roster.silent(Time::since_start(now.elapsed() - timing.lease)) {
                self.dismiss_silent(now, agent, actions);
            }
        }
        // Take back zones of agents that have not subscribed again after a restart
        let Assignments { ledger, roster, .. } = &self.assignments;
        let is_lost = |agent: &MemberId| now >= self.expects_until && roster.get(*agent).is_none();
        let strangers: Vec<MemberId> = ledger.holders().filter(is_lost).collect();
        for agent in strangers {
            self.assignments.take_all_back(now, agent, Departure::Silence, actions);
        }
        // Take back orders without progress: an agent may send messages without mentioning its orders
        let holders: Vec<MemberId> = self.assignments.ledger.holders().collect();
        for agent in holders {
            self.watch_orders(now, agent, &[], actions);
        }
        let Assignments { rows, roster, .. } = &mut self.assignments;
        self.credits.write(roster, rows, actions);
        if self.phase.gives_out() {
            tail::help_all(now, &mut self.assignments, actions);
        }
        if self.phase.has_begun && !self.phase.is_finished {
            self.verification.count_machines(&self.assignments, actions);
        }
    }

    /// Dismisses an agent whose lease is over, and counts a failure if it held orders.
    fn dismiss_silent(&mut self, now: Time, agent: MemberId, actions: &mut Vec<FarmAction>) {
        let name = self.assignments.roster.name(agent).clone();
        tracing::info!(agent = %name, "agent fell silent");
        if let Some(order) = self.assignments.orders_of(agent, &[]).first() {
            self.count_failure(now, &name, (order.zone, order.fence), "it fell silent", actions);
        }
        self.dismiss(now, agent, Departure::Silence, actions);
    }

    /// Restarts this Master from the Blackboard after a stall.
    fn check_stall(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if let Some(stall) = self.stalls.check(now, self.phase.is_at_work(), &self.assignments) {
            let Stall { waited, zones, free } = stall;
            tracing::warn!(zones, free, "nothing begins, so the Master begins again from the Blackboard");
            actions.push(FarmAction::Effect(FarmEffect::Stalled { waited, zones, free }));
            self.must_restart = true;
        }
        // Wait until the film has answered, so that no tile of the old film enters the next one
        if self.must_restart && self.composition.composing_count() == 0 {
            self.restart(now, actions);
        }
    }

    /// Resets this Master to its initial state and reads the Blackboard again.
    fn restart(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        let config = Arc::clone(&self.assignments.config);
        let mut rows = std::mem::replace(&mut self.assignments.rows, Rows::new(config.work));
        rows.reset(config.work);
        rows.subscribe(actions);
        *self = Self {
            registrant: self.registrant.take(),
            next_check: self.next_check,
            expects_until: now + config.timing.lease,
            ..Self::with_rows(config, rows)
        };
    }
}

impl StateMachine for Master {
    type Content = FarmContent;
    type Value = FarmValue;
    type Effect = FarmEffect;
    type Completion = FarmCompletion;

    fn handle(&mut self, now: Time, event: FarmEvent, actions: &mut Vec<FarmAction>) {
        let mut has_changed = true;
        match event {
            FarmEvent::Start => {
                let timing = self.assignments.config.timing;
                self.assignments.rows.start(actions);
                self.next_check = Some(now + timing.heartbeat);
                self.expects_until = now + timing.lease;
            }
            FarmEvent::Message(message) if let FarmContent::Management(_) = message.content => {
                self.registrant.as_mut().and_then(|registrant| registrant.hear(now, &message));
                has_changed = false;
            }
            FarmEvent::Message(message) => self.handle_message(now, &message, actions),
            FarmEvent::Store { ticket, reply } => has_changed = self.handle_store(now, ticket, reply, actions),
            FarmEvent::Completed(FarmCompletion::Composed { zone, outcome }) => {
                self.composed(now, zone, outcome, actions);
            }
            FarmEvent::Completed(FarmCompletion::Compared { zone, results, outcome }) => {
                self.compared(now, zone, results, outcome, actions);
            }
            FarmEvent::Completed(FarmCompletion::Requeue { zone, fence }) => self.requeue(now, zone, fence, actions),
            FarmEvent::Completed(FarmCompletion::Stop) => {
                self.phase.is_stopping = true;
                self.rounds.clear();
            }
            FarmEvent::Completed(_) | FarmEvent::Presence { .. } | FarmEvent::Deadline => {}
        }
        if self.next_check.is_some_and(|at| at <= now) {
            self.check(now, actions);
            has_changed = true;
        }
        if let Some(registrant) = self.registrant.as_mut().filter(|_| !self.phase.is_finished) {
            registrant.tick(now, actions);
        }
        if has_changed {
            self.advance(now, actions);
            self.assert_invariants();
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        let Assignments { config, ledger, roster, .. } = &self.assignments;
        let calls = !config.deals() && self.phase.gives_out() && ledger.open.has_waiting();
        let due = roster.next_due().filter(|_| calls);
        let directories = self.registrant.as_ref().and_then(|registrant| registrant.next_deadline());
        [self.next_check, self.rounds.next_deadline(), due, directories].into_iter().flatten().min()
    }
}
