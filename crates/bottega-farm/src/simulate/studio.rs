//! The world of a simulation: machines that paint, and the film.

use std::{collections::BTreeSet, sync::Arc, time::Duration};

use bottega_agents::{
    AgentId, Revision, Time,
    driver::{Random, World},
};
use rustc_hash::FxHashMap;

use super::{
    film::{FilmLog, digest, flaw, signed, unsigned},
    machines::{Machines, PaintJob},
    workpiece::Workpiece,
};
use crate::{
    AgentRow, FarmAgent, FarmCompletion, FarmEffect, PaintOrder, PaintResult, Progress, RelativePower, ResultRef,
    RoundSummary, Theft, ZoneId, ZoneRow, progress::Tally,
};

/// The time that a work was said to need still, at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeLeft {
    /// Virtual time since the start of the work.
    pub at: Duration,
    /// How much of its cost was done, 0..=1.
    pub done: f64,
    /// The time it was said to need still.
    pub said: Duration,
}

/// What an agent's benchmark takes.
const BENCHMARK: Duration = Duration::from_millis(6);
/// What it takes to look at two paintings of a zone.
const LOOK: Duration = Duration::from_millis(3);
/// How long a machine sees nothing of what others have done, in each stage of work that they share; beside that it takes a part and
/// tells of it, and gets the last one.
const LOOK_AT_OTHERS: Duration = Duration::from_millis(10);
const MESSAGES_OF_STAGE: u32 = 6;
/// By how much a machine that hangs becomes slower: what it paints in a run is less than a step of progress.
const HUNG: f64 = 1e-12;
/// Spans that are kept at most; more is counted, not shown.
pub const SPANS_MAX: usize = 1 << 22;

/// A piece of an agent's time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Index of the agent.
    pub agent: u32,
    /// What it had in hand.
    pub zone: ZoneId,
    /// When it was begun.
    pub begin: Time,
    /// When it ended.
    pub end: Time,
    /// What came of it.
    pub kind: SpanKind,
}

/// The occupation of an agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpanKind {
    /// It painted the first samples of a zone.
    Profiling,
    /// It painted the rest.
    Painting,
    /// It painted what failed, was lost with it, or nobody wanted any more.
    Lost,
}

/// An agent as the world sees it.
#[derive(Clone, Debug)]
pub(super) struct Seat {
    pub(super) machine: usize,
    /// When it comes.
    pub(super) joins: Duration,
    /// What its benchmark says.
    pub(super) power: RelativePower,
    pub(super) lanes: f64,
    /// Processor time spent, in seconds of its machine.
    pub(super) busy: f64,
    /// Orders done.
    pub(super) orders: u32,
    /// Share of its orders that fails.
    pub(super) breaks: f64,
    /// Share of its orders that it paints wrong.
    pub(super) lies: f64,
    /// Its clock goes so many times too slow: it takes itself to be so many times faster than it is.
    pub(super) boasts: f64,
    /// Its next order takes so many seconds longer.
    pub(super) loads: f64,
    /// Why its Master has left it out, if it has.
    pub(super) left_out: Option<String>,
    /// What its Master knows of it.
    pub(super) known: Option<Arc<AgentRow>>,
}

/// Machines, film, and what is seen of both.
#[derive(Debug)]
pub(super) struct SimulatedFarm {
    piece: Arc<Workpiece>,
    machines: Machines,
    /// A hash map, for speed: never gone through.
    index: FxHashMap<AgentId, usize>,
    pub(super) names: Vec<AgentId>,
    pub(super) seats: Vec<Seat>,
    /// Share of orders that fail.
    failures: f64,
    /// No two agents give the same bits.
    inexact: bool,
    fetch: Duration,
    /// What a message takes at least.
    latency: Duration,
    random: Random,
    /// Kept for its memory.
    done: Vec<PaintJob>,
    pub(super) spans: Vec<Span>,
    pub(super) spans_left_out: u64,
    /// Of the auction, as they ended.
    pub(super) rounds: Vec<RoundSummary>,
    pub(super) thefts: Vec<Theft>,
    /// It was told that there were too few machines to compare.
    pub(super) lacked_machines: bool,
    pub(super) film: FilmLog,
    /// Orders that agents have begun to paint.
    pub(super) orders_begun: u64,
    /// What is said of how long the work takes yet, where somebody wants to know.
    pub(super) tally: Option<Tally>,
    pub(super) times_left: Vec<TimeLeft>,
}

impl SimulatedFarm {
    /// - `fetch`: how long an agent takes to get the scene; `latency`: what a message takes at least.
    pub(super) fn new(
        piece: Arc<Workpiece>,
        [fetch, latency]: [Duration; 2],
        failures: f64,
        inexact: bool,
        seed: u64,
    ) -> Self {
        Self {
            film: FilmLog::new(piece.zone_count()),
            piece,
            machines: Machines::default(),
            index: FxHashMap::default(),
            names: Vec::new(),
            seats: Vec::new(),
            failures,
            inexact,
            fetch,
            latency,
            random: Random::new(seed ^ 0x57d1),
            done: Vec::new(),
            spans: Vec::new(),
            spans_left_out: 0,
            rounds: Vec::new(),
            thefts: Vec::new(),
            lacked_machines: false,
            orders_begun: 0,
            tally: None,
            times_left: Vec::new(),
        }
    }

    pub(super) fn add_machine(&mut self, processors: f64, speed: f64) {
        self.machines.add(processors, speed);
    }

    pub(super) fn add_agent(&mut self, name: AgentId, seat: Seat) {
        self.index.insert(name.clone(), self.seats.len());
        self.names.push(name);
        self.seats.push(seat);
    }

    /// How long an agent that comes to a work now takes until it can paint: work of all zones is shared by the machines that are there.
    fn preparation(&self, now: Time) -> Duration {
        let Workpiece { preparation, shared_preparation, shared_stages, .. } = *self.piece;
        let is_there = |seat: &&Seat| Time::ZERO + seat.joins <= now;
        let there: BTreeSet<usize> = self.seats.iter().filter(is_there).map(|seat| seat.machine).collect();
        let peers = there.len().max(1) as u32;
        let of_stage = if peers > 1 { LOOK_AT_OTHERS + MESSAGES_OF_STAGE * self.latency } else { Duration::ZERO };
        self.fetch + preparation - shared_preparation + shared_preparation / peers + shared_stages * of_stage
    }

    /// The agent's machine becomes so many times slower.
    pub(super) fn slow_down(&mut self, now: Time, agent: usize, factor: f64) {
        self.machines.set_speed(now, self.seats[agent].machine, factor.recip());
    }

    /// The agent's machine hangs.
    pub(super) fn hang(&mut self, now: Time, agent: usize) {
        self.machines.set_speed(now, self.seats[agent].machine, HUNG);
    }

    /// How far an order of an agent is, in millionths of a second of work that are done; more comes with time.
    fn progress(&mut self, now: Time, agent: usize, zone: ZoneId, fence: Revision) -> Option<u64> {
        let left = self.machines.left(now, self.seats[agent].machine, zone, fence)?;
        Some((1_u64 << 50).saturating_sub((left.max(0.0) * 1e6) as u64))
    }

    fn begin(&mut self, now: Time, agent: usize, order: &PaintOrder) {
        self.orders_begun += 1;
        self.film.order(order.zone, order.fence, agent);
        let (mut left, width) = self.piece.cost(order);
        let seat = &mut self.seats[agent];
        left += std::mem::take(&mut seat.loads) * self.machines.speed(seat.machine) * seat.lanes;
        let (zone, fence, samples) = (order.zone, order.fence, order.samples.end);
        let first = order.samples.start == 0;
        let flaw = order.from.map_or(0, |from| flaw(&from.digest));
        let job = PaintJob { agent, zone, fence, samples, flaw, first, begun: now, left, width, busy: 0.0 };
        self.machines.begin(now, self.seats[agent].machine, job);
    }

    fn tell_time_left(&mut self, now: Time, row: &ZoneRow) {
        let Some(tally) = &mut self.tally else { return };
        tally.see(now, row, self.piece.work.settings.samples, 0);
        let Progress { cost_done, left, .. } = tally.progress();
        self.times_left.extend(left.map(|said| TimeLeft { at: now.elapsed(), done: cost_done, said }));
    }

    fn end(&mut self, now: Time, job: &PaintJob, kind: SpanKind) {
        let seat = &mut self.seats[job.agent];
        seat.busy += job.busy;
        seat.orders += u32::from(kind != SpanKind::Lost);
        if self.spans.len() < SPANS_MAX {
            self.spans.push(Span { agent: job.agent as u32, zone: job.zone, begin: job.begun, end: now, kind });
        } else {
            self.spans_left_out += 1;
        }
    }

    fn finished(&mut self, now: Time, job: &PaintJob) -> FarmCompletion {
        let (zone, fence) = (job.zone, job.fence);
        let Seat { breaks, lies, boasts, .. } = self.seats[job.agent];
        let failures = self.failures.max(breaks);
        let failed = failures > 0.0 && self.random.unit() < failures;
        let lie = if lies > 0.0 && self.random.unit() < lies { 1 + self.random.below(1 << 30) as u64 } else { 0 };
        let kind = match (failed, job.first) {
            (true, _) => SpanKind::Lost,
            (_, true) => SpanKind::Profiling,
            _ => SpanKind::Painting,
        };
        self.end(now, job, kind);
        let outcome = if failed {
            Err("out of memory".to_owned())
        } else {
            let digest = digest(zone, job.samples, job.flaw ^ lie);
            let digest = if self.inexact { signed(digest, job.agent) } else { digest };
            let result = ResultRef { fence, samples: job.samples, digest };
            let busy = Duration::from_secs_f64(job.busy / boasts);
            Ok(PaintResult { result, busy, is_measured: true, error: None, unfinished: 1.0 })
        };
        FarmCompletion::Painted { zone, fence, outcome }
    }
}

impl World<FarmAgent> for SimulatedFarm {
    fn perform(
        &mut self,
        now: Time,
        agent: &AgentId,
        effect: FarmEffect,
        _random: &mut Random,
        reports: &mut Vec<(Duration, FarmCompletion)>,
    ) {
        let index = self.index.get(agent).copied();
        match (effect, index) {
            (FarmEffect::Benchmark, Some(index)) => {
                let Seat { power, lanes, boasts, .. } = self.seats[index];
                let power = RelativePower::new(power.get() / boasts);
                reports.push((BENCHMARK, FarmCompletion::Benchmarked { power, lanes }));
            }
            (FarmEffect::Fetch(work), _) => {
                reports.push((self.preparation(now), FarmCompletion::Fetched(work)));
            }
            (FarmEffect::Paint(order), Some(index)) => self.begin(now, index, &order),
            (FarmEffect::BeginFilm(_), _) => {
                self.film.begin();
            }
            (FarmEffect::Compose { zone, result, .. }, _) => {
                self.film.compose(zone, &result);
                // A piece takes as long as its zone at most.
                let pixels = self.piece.rect(zone).map_or(0, |rect| rect.area());
                let time = Duration::from_secs_f64(self.piece.composition_per_pixel * pixels as f64);
                reports.push((time, FarmCompletion::Composed { zone, outcome: Ok(()) }));
            }
            (FarmEffect::Compare { zone, results }, _) => {
                let lost = self.failures > 0.0 && self.random.unit() < self.failures;
                let [one, other] = results.map(|result| unsigned(result.digest));
                let outcome = if lost { Err(results[self.random.below(2)]) } else { Ok(one == other) };
                reports.push((LOOK, FarmCompletion::Compared { zone, results, outcome }));
            }
            (FarmEffect::Finish { failed }, _) => {
                self.film.finish(now, failed);
            }
            (FarmEffect::Abandon { reason }, _) => self.film.abandoned = Some(reason),
            (FarmEffect::Survey { .. }, _) => {
                // The zones come from outside: there is no Analyst.
                reports.push((Duration::ZERO, FarmCompletion::Surveyed(Err("nobody looks".to_owned()))));
            }
            (FarmEffect::Drop { zone, fence }, Some(index)) => {
                let machine = self.seats[index].machine;
                let unwanted = |job: &PaintJob| (job.agent, job.zone, job.fence) == (index, zone, fence);
                for job in self.machines.drop_jobs(now, machine, unwanted) {
                    self.end(now, &job, SpanKind::Lost);
                }
            }
            (FarmEffect::ZoneChanged(row), _) => {
                if let Some(rival) = &row.rival {
                    self.film.take_over(row.zone, rival.fence);
                }
                self.tell_time_left(now, &row);
            }
            (FarmEffect::Look(orders), Some(index)) => {
                let look = |(zone, fence)| Some((zone, fence, self.progress(now, index, zone, fence)?));
                let found = orders.into_iter().filter_map(look).collect();
                reports.push((Duration::ZERO, FarmCompletion::Looked(found)));
            }
            (FarmEffect::LeftOut { agent, reason }, _) => {
                if let Some(&index) = self.index.get(&agent) {
                    self.seats[index].left_out = Some(reason);
                }
            }
            (FarmEffect::TooFew { .. }, _) => self.lacked_machines = true,
            (FarmEffect::Stalled { waited, zones, free }, _) => self.film.must(false, || {
                format!("{zones} zones waited for {} s, and {free} agents were free", waited.as_secs())
            }),
            (FarmEffect::RoundClosed(round), _) => self.rounds.push(round),
            (FarmEffect::Stolen(theft), _) => self.thefts.push(theft),
            (FarmEffect::AgentChanged(row), _) => {
                if let Some(tally) = &mut self.tally {
                    tally.see_agent(&row);
                }
                if let Some(&index) = self.index.get(&row.agent) {
                    self.seats[index].known = Some(row);
                }
            }
            (FarmEffect::Analyzed { .. } | FarmEffect::Dismissed { .. }, _)
            | (FarmEffect::Benchmark | FarmEffect::Paint(_) | FarmEffect::Drop { .. } | FarmEffect::Look(_), None) => {}
        }
    }

    fn next_change(&self) -> Option<Time> {
        self.machines.next()
    }

    fn change(&mut self, now: Time, reports: &mut Vec<(AgentId, FarmCompletion)>) {
        let mut done = std::mem::take(&mut self.done);
        self.machines.take_done(now, &mut done);
        for job in done.drain(..) {
            let completion = self.finished(now, &job);
            reports.push((self.names[job.agent].clone(), completion));
        }
        self.done = done;
    }

    fn gone(&mut self, now: Time, agent: &AgentId) {
        let Some(&index) = self.index.get(agent) else { return };
        for job in self.machines.drop_jobs(now, self.seats[index].machine, |job| job.agent == index) {
            self.end(now, &job, SpanKind::Lost);
        }
    }
}
