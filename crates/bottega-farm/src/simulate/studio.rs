//! The world of a simulation: machines that paint, and the film.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
    time::Duration,
};

use bottega_agents::{
    AgentId, Revision, Time,
    bus::BlobId,
    driver::{Random, World},
};

use super::{
    machines::{Job, Machines},
    workpiece::Workpiece,
};
use crate::{FarmAgent, FarmCompletion, FarmEffect, PaintOrder, PaintResult, RelativePower, ResultRef, ZoneId};

/// What an agent's benchmark takes.
const BENCHMARK: Duration = Duration::from_millis(6);
/// Spans that are kept at most; more is counted, not shown.
pub const SPANS_MAX: usize = 1 << 22;
/// Broken invariants that are told.
pub(super) const BROKEN_MAX: usize = 16;

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

/// What an agent did.
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
    /// What its benchmark says.
    pub(super) power: RelativePower,
    pub(super) lanes: f64,
    /// Processor time spent, in seconds of its machine.
    pub(super) busy: f64,
    /// Orders done.
    pub(super) orders: u32,
}

/// Machines, film, and what is seen of both.
#[derive(Debug)]
pub(super) struct Studio {
    piece: Arc<Workpiece>,
    machines: Machines,
    index: BTreeMap<AgentId, usize>,
    pub(super) names: Vec<AgentId>,
    pub(super) seats: Vec<Seat>,
    /// Share of orders that fail.
    failures: f64,
    fetch: Duration,
    random: Random,
    /// Kept for its memory.
    done: Vec<Job>,
    pub(super) spans: Vec<Span>,
    pub(super) spans_left_out: u64,
    pub(super) film: FilmLog,
}

/// What the film of the present Master has been told.
#[derive(Debug, Default)]
pub(super) struct FilmLog {
    /// Films that were begun: one for each life of a Master that got so far.
    pub(super) films: u32,
    pub(super) composed: BTreeSet<ZoneId>,
    /// The orders that were begun, and whose they were, by index.
    pub(super) orders: BTreeMap<(ZoneId, Revision), usize>,
    /// Orders that count though there are later ones, because a zone was taken over.
    rivals: BTreeSet<(ZoneId, Revision)>,
    pub(super) finished: Option<(Time, Vec<ZoneId>)>,
    pub(super) abandoned: Option<String>,
    pub(super) broken: Vec<String>,
}

impl FilmLog {
    pub(super) fn is_over(&self) -> bool {
        self.finished.is_some() || self.abandoned.is_some()
    }

    pub(super) fn must(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds && self.broken.len() < BROKEN_MAX {
            self.broken.push(what());
        }
    }

    fn compose(&mut self, zone: ZoneId, result: &ResultRef) {
        let fresh = self.composed.insert(zone);
        self.must(fresh, || format!("{zone} is composed twice"));
        let painted = result.digest == digest(zone, result.samples, result.fence);
        self.must(painted, || format!("{zone} is composed of samples that nobody painted"));
        let valid = self.is_valid(zone, result.fence);
        self.must(valid, || format!("{zone} is composed under {:?}, and there is a later order", result.fence));
    }

    /// Whether two agents had a valid order for a zone at a time.
    pub(super) fn is_taken_over(&self, zone: ZoneId) -> bool {
        self.rivals.range((zone, Revision(0))..=(zone, Revision(u64::MAX))).next().is_some()
    }

    /// Whether samples of this order may be used: it is the latest that was begun, or counts beside that.
    pub(super) fn is_valid(&self, zone: ZoneId, fence: Revision) -> bool {
        let mut orders = self.orders.range((zone, Revision(0))..=(zone, Revision(u64::MAX)));
        let newest = orders.next_back().map(|((_, newest), _)| *newest);
        newest == Some(fence) || self.rivals.contains(&(zone, fence))
    }
}

/// Stands for the samples that were painted under an order.
fn digest(zone: ZoneId, samples: u32, fence: Revision) -> BlobId {
    let mut digest = [0; 32];
    digest[..4].copy_from_slice(&zone.0.to_le_bytes());
    digest[4..8].copy_from_slice(&samples.to_le_bytes());
    digest[8..16].copy_from_slice(&fence.0.to_le_bytes());
    BlobId(digest)
}

impl Studio {
    pub(super) fn new(piece: Arc<Workpiece>, fetch: Duration, failures: f64, seed: u64) -> Self {
        Self {
            piece,
            machines: Machines::default(),
            index: BTreeMap::new(),
            names: Vec::new(),
            seats: Vec::new(),
            failures,
            fetch,
            random: Random::new(seed ^ 0x57d1),
            done: Vec::new(),
            spans: Vec::new(),
            spans_left_out: 0,
            film: FilmLog::default(),
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

    /// The agent's machine becomes so many times slower.
    pub(super) fn slow_down(&mut self, now: Time, agent: usize, factor: f64) {
        self.machines.set_speed(now, self.seats[agent].machine, factor.recip());
    }

    fn begin(&mut self, now: Time, agent: usize, order: &PaintOrder) {
        self.film.orders.insert((order.zone, order.fence), agent);
        let (left, width) = self.piece.cost(order);
        let (zone, fence, samples) = (order.zone, order.fence, order.samples.end);
        let first = order.samples.start == 0;
        let job = Job { agent, zone, fence, samples, first, begun: now, left, width, busy: 0.0 };
        self.machines.begin(now, self.seats[agent].machine, job);
    }

    fn end(&mut self, now: Time, job: &Job, kind: SpanKind) {
        let seat = &mut self.seats[job.agent];
        seat.busy += job.busy;
        seat.orders += u32::from(kind != SpanKind::Lost);
        if self.spans.len() < SPANS_MAX {
            self.spans.push(Span { agent: job.agent as u32, zone: job.zone, begin: job.begun, end: now, kind });
        } else {
            self.spans_left_out += 1;
        }
    }

    fn finished(&mut self, now: Time, job: &Job) -> FarmCompletion {
        let (zone, fence) = (job.zone, job.fence);
        let failed = self.failures > 0.0 && self.random.unit() < self.failures;
        let kind = match (failed, job.first) {
            (true, _) => SpanKind::Lost,
            (_, true) => SpanKind::Profiling,
            _ => SpanKind::Painting,
        };
        self.end(now, job, kind);
        let outcome = if failed {
            Err("out of memory".to_owned())
        } else {
            let result = ResultRef { fence, samples: job.samples, digest: digest(zone, job.samples, fence) };
            Ok(PaintResult { result, busy: Duration::from_secs_f64(job.busy), error: None })
        };
        FarmCompletion::Painted { zone, fence, outcome }
    }
}

impl World<FarmAgent> for Studio {
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
                let Seat { power, lanes, .. } = self.seats[index];
                reports.push((BENCHMARK, FarmCompletion::Benchmarked { power, lanes }));
            }
            (FarmEffect::Fetch(work), _) => {
                reports.push((self.fetch + self.piece.preparation, FarmCompletion::Fetched(work)));
            }
            (FarmEffect::Paint(order), Some(index)) => self.begin(now, index, &order),
            (FarmEffect::BeginFilm(_), _) => {
                self.film.films += 1;
                self.film.composed.clear();
            }
            (FarmEffect::Compose { zone, result, .. }, _) => {
                self.film.compose(zone, &result);
                // A piece takes as long as its zone at most.
                let pixels = self.piece.rows.get(zone.index()).map_or(0, crate::ZoneRow::size);
                let time = Duration::from_secs_f64(self.piece.composition_per_pixel * pixels as f64);
                reports.push((time, FarmCompletion::Composed { zone, outcome: Ok(()) }));
            }
            (FarmEffect::Finish { failed }, _) => {
                let first = self.film.finished.is_none();
                self.film.must(first, || "the work ends twice".to_owned());
                self.film.finished = Some((now, failed));
            }
            (FarmEffect::Abandon { reason }, _) => self.film.abandoned = Some(reason),
            (FarmEffect::Survey { .. }, _) => {
                // The zones come from outside: there is no Analyst.
                reports.push((Duration::ZERO, FarmCompletion::Surveyed(Err("nobody looks".to_owned()))));
            }
            (FarmEffect::Drop { zone, fence }, Some(index)) => {
                let machine = self.seats[index].machine;
                let unwanted = |job: &Job| (job.agent, job.zone, job.fence) == (index, zone, fence);
                for job in self.machines.drop_jobs(now, machine, unwanted) {
                    self.end(now, &job, SpanKind::Lost);
                }
            }
            (FarmEffect::ZoneChanged(row), _) => {
                self.film.rivals.extend(row.rival.as_ref().map(|rival| (row.zone, rival.fence)));
            }
            (FarmEffect::Analyzed { .. }, _)
            | (FarmEffect::Benchmark | FarmEffect::Paint(_) | FarmEffect::Drop { .. }, None) => {}
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
