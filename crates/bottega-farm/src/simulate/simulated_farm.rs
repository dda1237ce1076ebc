//! The environment of a simulation: machines that paint, and the film.

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

/// A prediction of the remaining time, at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeLeft {
    /// Virtual time since the start of the platform.
    pub at: Duration,
    /// Share of the cost done, 0..=1.
    pub done: f64,
    /// The predicted remaining time.
    pub said: Duration,
}

/// Duration of an agent's benchmark.
const BENCHMARK: Duration = Duration::from_millis(6);
/// Duration of a comparison of two paintings.
const LOOK: Duration = Duration::from_millis(3);
/// Delay, per stage of shared preparation, until a machine sees the results of others: it claims a part, publishes it
/// and receives the last one.
const LOOK_AT_OTHERS: Duration = Duration::from_millis(10);
const MESSAGES_OF_STAGE: u32 = 6;
/// Factor on the speed of a machine that hangs: it paints less than one step of progress in a run.
const HUNG: f64 = 1e-12;
/// Maximum number of spans kept; further ones are only counted.
pub const SPANS_MAX: usize = 1 << 22;

/// A span of an agent's time, spent on one zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Index of the agent.
    pub agent: u32,
    /// The zone that the agent painted.
    pub zone: ZoneId,
    /// Virtual time of the beginning.
    pub begin: Time,
    /// Virtual time of the end.
    pub end: Time,
    /// The kind of work done in the span.
    pub kind: SpanKind,
}

/// The kind of work that an agent does in a span.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpanKind {
    /// First samples of a zone.
    Profiling,
    /// Painting of the samples that the profile left.
    Painting,
    /// Lost work: an order that failed, was lost with the agent, or was cancelled.
    Lost,
}

/// The state of an agent in the environment.
#[derive(Clone, Debug)]
pub(super) struct SimulatedPainter {
    pub(super) machine: usize,
    /// The time at which the agent joins.
    pub(super) joins: Duration,
    /// V_cp from the agent's benchmark.
    pub(super) power: RelativePower,
    pub(super) lanes: f64,
    /// Processor time spent, in seconds of its machine.
    pub(super) busy: f64,
    /// Number of finished orders.
    pub(super) orders: u32,
    /// Share of the agent's orders that fails.
    pub(super) breaks: f64,
    /// Share of the agent's paintings that is wrong.
    pub(super) lies: f64,
    /// Factor by which the agent's clock runs slow, so that it claims to be faster.
    pub(super) boasts: f64,
    /// Additional seconds of its next order.
    pub(super) loads: f64,
    /// The reason why the Master has excluded the agent; `None`: it has not.
    pub(super) left_out: Option<String>,
    /// The row of the agent, as its Master last wrote it.
    pub(super) known: Option<Arc<AgentRow>>,
}

/// The environment: machines, film and all observations.
#[derive(Debug)]
pub(super) struct SimulatedFarm {
    piece: Arc<Workpiece>,
    machines: Machines,
    /// A hash map for speed; never iterated.
    index: FxHashMap<AgentId, usize>,
    pub(super) names: Vec<AgentId>,
    pub(super) agents: Vec<SimulatedPainter>,
    /// Share of all orders that fails.
    failures: f64,
    /// `true`: agents are not bit-identical.
    inexact: bool,
    fetch: Duration,
    /// Minimum latency of a message.
    latency: Duration,
    random: Random,
    /// Scratch space, kept to avoid allocations.
    done: Vec<PaintJob>,
    pub(super) spans: Vec<Span>,
    pub(super) spans_left_out: u64,
    /// The rounds of the auction, as they ended.
    pub(super) rounds: Vec<RoundSummary>,
    pub(super) thefts: Vec<Theft>,
    /// `true`: the Master reported too few machines to compare paintings.
    pub(super) lacked_machines: bool,
    pub(super) film: FilmLog,
    /// Number of orders that agents have begun.
    pub(super) orders_begun: u64,
    /// The predictor of the remaining time, if requested.
    pub(super) tally: Option<Tally>,
    pub(super) times_left: Vec<TimeLeft>,
}

impl SimulatedFarm {
    /// Makes the environment of a simulation.
    ///
    /// - `fetch`: time to fetch the scene; `latency`: minimum latency of a message.
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
            agents: Vec::new(),
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

    pub(super) fn add_agent(&mut self, name: AgentId, simulated: SimulatedPainter) {
        self.index.insert(name.clone(), self.agents.len());
        self.names.push(name);
        self.agents.push(simulated);
    }

    /// Returns the time of preparation for an agent that joins now: its shared part is divided among the machines
    /// present.
    fn preparation(&self, now: Time) -> Duration {
        let Workpiece { preparation, shared_preparation, shared_stages, .. } = *self.piece;
        let is_there = |simulated: &&SimulatedPainter| Time::ZERO + simulated.joins <= now;
        let there: BTreeSet<usize> = self.agents.iter().filter(is_there).map(|simulated| simulated.machine).collect();
        let peers = there.len().max(1) as u32;
        let of_stage = if peers > 1 { LOOK_AT_OTHERS + MESSAGES_OF_STAGE * self.latency } else { Duration::ZERO };
        self.fetch + preparation - shared_preparation + shared_preparation / peers + shared_stages * of_stage
    }

    /// Slows the agent's machine down by a factor.
    pub(super) fn slow_down(&mut self, now: Time, agent: usize, factor: f64) {
        self.machines.set_speed(now, self.agents[agent].machine, factor.recip());
    }

    /// Makes the agent's machine hang.
    pub(super) fn hang(&mut self, now: Time, agent: usize) {
        self.machines.set_speed(now, self.agents[agent].machine, HUNG);
    }

    /// Returns the progress of an order, in millionths of a second of finished work.
    fn progress(&mut self, now: Time, agent: usize, zone: ZoneId, fence: Revision) -> Option<u64> {
        let left = self.machines.left(now, self.agents[agent].machine, zone, fence)?;
        Some((1_u64 << 50).saturating_sub((left.max(0.0) * 1e6) as u64))
    }

    fn begin(&mut self, now: Time, agent: usize, order: &PaintOrder) {
        self.orders_begun += 1;
        self.film.order(order.zone, order.fence, agent);
        let (mut left, width) = self.piece.cost(order);
        let simulated = &mut self.agents[agent];
        left += std::mem::take(&mut simulated.loads) * self.machines.speed(simulated.machine) * simulated.lanes;
        let (zone, fence, samples) = (order.zone, order.fence, order.samples.end);
        let first = order.samples.start == 0;
        let flaw = order.from.map_or(0, |from| flaw(&from.digest));
        let job = PaintJob { agent, zone, fence, samples, flaw, first, begun: now, left, width, busy: 0.0 };
        self.machines.begin(now, self.agents[agent].machine, job);
    }

    fn tell_time_left(&mut self, now: Time, row: &ZoneRow) {
        let Some(tally) = &mut self.tally else { return };
        tally.see(now, row, self.piece.work.settings.samples, 0);
        let Progress { cost_done, left, .. } = tally.progress();
        self.times_left.extend(left.map(|said| TimeLeft { at: now.elapsed(), done: cost_done, said }));
    }

    fn end(&mut self, now: Time, job: &PaintJob, kind: SpanKind) {
        let simulated = &mut self.agents[job.agent];
        simulated.busy += job.busy;
        simulated.orders += u32::from(kind != SpanKind::Lost);
        if self.spans.len() < SPANS_MAX {
            self.spans.push(Span { agent: job.agent as u32, zone: job.zone, begin: job.begun, end: now, kind });
        } else {
            self.spans_left_out += 1;
        }
    }

    fn finished(&mut self, now: Time, job: &PaintJob) -> FarmCompletion {
        let (zone, fence) = (job.zone, job.fence);
        let SimulatedPainter { breaks, lies, boasts, .. } = self.agents[job.agent];
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
                let SimulatedPainter { power, lanes, boasts, .. } = self.agents[index];
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
                // A piece takes at most as long as its zone
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
                // The zones are given: there is no Analyst
                reports.push((Duration::ZERO, FarmCompletion::Surveyed(Err("nobody looks".to_owned()))));
            }
            (FarmEffect::Drop { zone, fence }, Some(index)) => {
                let machine = self.agents[index].machine;
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
                    self.agents[index].left_out = Some(reason);
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
                    self.agents[index].known = Some(row);
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
        for job in self.machines.drop_jobs(now, self.agents[index].machine, |job| job.agent == index) {
            self.end(now, &job, SpanKind::Lost);
        }
    }
}
