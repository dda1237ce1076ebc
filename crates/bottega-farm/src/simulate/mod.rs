//! The farm in virtual time: what N agents would have made of a work, with the very machines of state that paint it.
//!
//! A [`Workpiece`] says what zones cost: as a real run measured them (a [`Record`], made by a [`Recorder`]), or by a
//! distribution. A [`CrewSpec`] says who paints, how fast, and what befalls them. [`simulate`] runs Master and Render Agents
//! over them and tells how long it took, beside the least that it can take, and checks afterwards that nothing was lost,
//! painted twice or taken from one who had no right to it any more.

mod crew;
mod film;
mod invariants;
mod machines;
mod record;
mod record_json;
mod recorder;
mod studio;
mod workpiece;

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use bottega_agents::{
    AgentId, Performative, Time,
    bus::Bus,
    driver::{Faults, Simulator},
};

pub use self::{
    crew::{AgentSpec, CREW_MAX, CrewError, CrewSpec, Incident, IncidentKind, MachineSpec},
    record::{CELL_SIDE, CostGrid, Record, RecordError, RecordedRules, RecordedZone},
    recorder::Recorder,
    studio::{SPANS_MAX, Span, SpanKind, TimeLeft},
    workpiece::{SyntheticSpread, Workpiece, WorkpieceError, ZONES_MAX},
};
use self::{
    invariants::IdleWatch,
    studio::{Seat, SimulatedFarm},
};
use crate::{
    AdaptationRule, AuctionRule, Credit, Expert, FarmAgent, FarmContent, FarmValue, GoalRules, Master, MasterConfig,
    MasterSource, RelativePower, RenderAgent, RenderAgentConfig, RoundSummary, Theft, Timing, WorkKeys,
    contents::message, progress::Tally, protocol,
};

/// How long the platform is watched after the end, until everybody has gone home.
const AFTERWARDS: Duration = Duration::from_secs(20);

/// The plan of a simulation: who paints, over which network, by which rules.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Who paints.
    pub crew: CrewSpec,
    /// What goes wrong on the network. Agents that it kills come back; those of [`CrewSpec::incidents`] do not.
    pub faults: Faults,
    /// Whether it may kill the Master.
    pub master_may_crash: bool,
    /// Share of orders that fail, 0..1.
    pub failures: f64,
    /// By how much of itself an agent's benchmark may be wrong.
    pub benchmark_error: f64,
    /// How long an agent takes to get the scene.
    pub fetch: Duration,
    /// How winners are found.
    pub auction: AuctionRule,
    /// How agents learn their speed.
    pub adaptation: AdaptationRule,
    /// How far the promises of agents held in works before, by name.
    pub credits: Arc<BTreeMap<String, Credit>>,
    /// Zones that an agent has in hand at most.
    pub prefetch: u32,
    /// Whether zones are cut near the end, and slow agents' zones given to idle ones too: see
    /// [`MasterConfig::shares_tail`].
    pub shares_tail: bool,
    /// Agents that must make the same of a zone before it counts: see [`MasterConfig::verify`].
    pub verify: u32,
    /// Whether no two agents give the same bits: see [`MasterConfig::compares_by_look`].
    pub inexact: bool,
    /// How long is waited for what.
    pub timing: Timing,
    /// What agents know of rendering, in turn; empty: what those knew who painted what was recorded.
    pub experts: Vec<Expert>,
    /// Decides all chance.
    pub seed: u64,
    /// Whether to write down what happens.
    pub trace: bool,
    /// Whether to write down how long the work was said to take yet.
    pub tells_time_left: bool,
}

impl Plan {
    /// A crew on a fast and faithful network. The end of the work is shared where agents have machines of their own.
    pub fn calm(crew: CrewSpec, seed: u64) -> Self {
        Self {
            shares_tail: crew.machines.len() >= crew.agents.len(),
            crew,
            faults: Faults::NONE,
            master_may_crash: false,
            failures: 0.0,
            benchmark_error: 0.0,
            fetch: Duration::ZERO,
            auction: AuctionRule::default(),
            adaptation: AdaptationRule::default(),
            credits: Arc::default(),
            prefetch: 2,
            verify: 1,
            inexact: false,
            timing: Timing::default(),
            experts: Vec::new(),
            seed,
            trace: false,
            tells_time_left: false,
        }
    }
}

/// The outcome of a simulation.
#[derive(Clone, Debug)]
pub struct SimulationOutcome {
    /// When the picture was whole, from the start of the platform.
    pub makespan: Duration,
    /// The least time in which what is in the picture can be painted by those who are there, survey first; `None`: they cannot.
    pub least: Option<Duration>,
    /// What the dearest zone takes the fastest machine, in one piece, survey first.
    pub longest_zone: Duration,
    /// Processor time at speed 1 of all that is in the picture, painted once.
    pub work: Duration,
    /// Zones of the work.
    pub zones: usize,
    /// Zones that were given up.
    pub failed: usize,
    /// Zones of the picture that were painted wrong.
    pub wrong: usize,
    /// Whether zones ever waited for more machines than there were, to compare what these paint.
    pub lacked_machines: bool,
    /// Messages until the picture was whole.
    pub messages: u64,
    /// Films that were begun: one for each Master that lived.
    pub films: u32,
    /// Rounds of the auction, as they ended.
    pub rounds: Vec<RoundSummary>,
    /// What agents took from each other, as it happened.
    pub thefts: Vec<Theft>,
    /// The agents in the order of the crew.
    pub agents: Vec<AgentOutcome>,
    /// Who painted what when, in the order of their ends.
    pub spans: Vec<Span>,
    /// Spans that are not among them.
    pub spans_left_out: u64,
    /// What happened, a line each, if it was to be written down.
    pub trace: String,
    /// How long the work was said to take yet, if that was to be written down.
    pub times_left: Vec<TimeLeft>,
}

/// The outcome of an agent.
#[derive(Clone, Debug, PartialEq)]
pub struct AgentOutcome {
    /// Its name.
    pub name: String,
    /// Speed of its processors.
    pub speed: f64,
    /// Its share of the processors of its machine.
    pub lanes: f64,
    /// Processor time that it spent, in time of its machine.
    pub busy: Duration,
    /// Orders that it carried out.
    pub orders: u32,
    /// Why it was left out of the work, if it was.
    pub left_out: Option<String>,
    /// Its credit at the end.
    pub credit: Credit,
    /// V_cp at the end, as its Master knew it.
    pub power: RelativePower,
}

impl SimulationOutcome {
    /// How far the promises of the agents held, for [`Plan::credits`] of the next work.
    pub fn credits(&self) -> BTreeMap<String, Credit> {
        self.agents.iter().map(|agent| (agent.name.clone(), agent.credit)).collect()
    }

    /// The least time over the time taken, 0..=1.
    pub fn efficiency(&self) -> f64 {
        self.least.map_or(0.0, |least| least.as_secs_f64() / self.makespan.as_secs_f64().max(1e-12))
    }

    /// By which factor the time left was said wrong at most, too long or too short, from when so much of the work was done. What is
    /// wrong by less than a second, or by less than a twentieth of the whole time, is not wrong. `None`: nothing was said.
    ///
    /// - `from`: share of the cost, 0..1.
    pub fn worst_time_left(&self, from: f64) -> Option<f64> {
        let borne = 1.0_f64.max(self.makespan.as_secs_f64() / 20.0);
        let wrong = |told: &TimeLeft| {
            let (said, true_left) = (told.said.as_secs_f64(), self.makespan.saturating_sub(told.at).as_secs_f64());
            let factor = said.max(true_left) / said.min(true_left).max(1e-9);
            if (said - true_left).abs() <= borne { 1.0 } else { factor }
        };
        self.times_left.iter().filter(|told| told.done >= from).map(wrong).reduce(f64::max)
    }

    /// Messages for each zone.
    pub fn messages_per_zone(&self) -> f64 {
        self.messages as f64 / self.zones.max(1) as f64
    }
}

/// Why a simulation came to nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SimulationError {
    /// There is nobody.
    #[error("nobody paints")]
    NoAgents,
    /// It does not end: nobody is left to paint, say.
    #[error("after {} s of virtual time {painted} of {zones} zones were in the picture: is anybody left to paint?", .after.as_secs())]
    Unfinished {
        /// When it was given up.
        after: Duration,
        /// Zones in the picture by then.
        painted: usize,
        /// Zones of the work.
        zones: usize,
    },
    /// The Master gave the work up.
    #[error("the work was given up: {reason}")]
    Abandoned {
        /// Why.
        reason: String,
    },
    /// Something that must hold does not: a fault of this program.
    #[error("what must hold after every run does not: {}", .broken.join("; "))]
    Broken {
        /// What.
        broken: Vec<String>,
    },
}

/// Runs a work in virtual time, and checks afterwards what must hold after every run.
///
/// The same arguments give the same run, event for event.
///
/// # Errors
/// When it does not end, or ends in a state that must not be.
pub fn simulate(piece: &Arc<Workpiece>, plan: &Plan) -> Result<SimulationOutcome, SimulationError> {
    let mut play = Play::new(piece, plan)?;
    let work: f64 = piece.zone_seconds().sum();
    let least = plan.crew.least_time(piece.survey, work);
    let limit = least.unwrap_or(piece.survey).saturating_mul(100).saturating_add(Duration::from_secs(3600));
    play.run(Time::since_start(limit));
    if let Some(broken) = play.idle.broken.take() {
        return Err(SimulationError::Broken { broken: vec![broken] });
    }
    let messages = play.simulator.message_count();
    let film = &play.simulator.world().film;
    if let Some(reason) = &film.abandoned {
        return Err(SimulationError::Abandoned { reason: reason.clone() });
    }
    let Some((end, failed)) = film.finished.clone() else {
        let painted = film.composed_count();
        return Err(SimulationError::Unfinished { after: limit, painted, zones: piece.zone_count() });
    };
    play.simulator.run_until(end + AFTERWARDS);
    let broken = invariants::check(&play.simulator, &piece.work, plan.verify);
    if !broken.is_empty() {
        return Err(SimulationError::Broken { broken });
    }
    let work = painted_seconds(&play.simulator, piece);
    let least = plan.crew.least_time(piece.survey, work);
    let fastest = plan.crew.machines.iter().map(|machine| machine.speed).fold(f64::MIN_POSITIVE, f64::max);
    let longest = piece.zone_seconds().fold(0.0, f64::max) / fastest;
    let trace = play.simulator.trace();
    let studio = play.simulator.world_mut();
    Ok(SimulationOutcome {
        makespan: end.elapsed(),
        least,
        longest_zone: piece.survey + Duration::from_secs_f64(longest),
        work: Duration::from_secs_f64(work),
        zones: piece.zone_count(),
        failed: failed.len(),
        wrong: studio.film.wrong_count(),
        lacked_machines: studio.lacked_machines,
        messages,
        films: studio.film.films,
        rounds: std::mem::take(&mut studio.rounds),
        thefts: std::mem::take(&mut studio.thefts),
        spans: std::mem::take(&mut studio.spans),
        spans_left_out: studio.spans_left_out,
        times_left: std::mem::take(&mut studio.times_left),
        agents: agents(plan, studio),
        trace,
    })
}

/// Processor time at speed 1 of what is in the picture, in seconds: rules may have asked for less than was recorded, or for more.
fn painted_seconds(simulator: &Simulator<FarmAgent, SimulatedFarm>, piece: &Workpiece) -> f64 {
    let prefix = WorkKeys::new(piece.work.work).prefix();
    let seconds = |value: &FarmValue| match value {
        FarmValue::Zone(row) => piece.painted_seconds(row),
        _ => 0.0,
    };
    simulator.store().with_prefix(&prefix).map(|entry| seconds(&entry.value)).sum()
}

fn agents(plan: &Plan, studio: &SimulatedFarm) -> Vec<AgentOutcome> {
    let outcome = |(name, seat): (&AgentId, &Seat)| AgentOutcome {
        name: name.to_string(),
        speed: plan.crew.machines[seat.machine].speed,
        lanes: seat.lanes,
        busy: Duration::from_secs_f64(seat.busy),
        orders: seat.orders,
        left_out: seat.left_out.clone(),
        credit: seat.known.as_ref().map(|row| row.credit).unwrap_or_default(),
        power: seat.known.as_ref().map_or(seat.power, |row| row.power),
    };
    studio.names.iter().zip(&studio.seats).map(outcome).collect()
}

/// What happens at a given time, by no choice of the agents.
#[derive(Clone, Copy, Debug)]
enum Happening {
    /// The Analyst has finished: its rows are on the Blackboard.
    Analyzed,
    Joins(usize),
    Befalls(usize, IncidentKind),
}

struct Play<'a> {
    piece: &'a Workpiece,
    plan: &'a Plan,
    master: AgentId,
    simulator: Simulator<FarmAgent, SimulatedFarm>,
    /// What happens when, latest first.
    timeline: Vec<(Duration, Happening)>,
    idle: IdleWatch,
}

impl<'a> Play<'a> {
    fn new(piece: &'a Arc<Workpiece>, plan: &'a Plan) -> Result<Self, SimulationError> {
        let CrewSpec { machines, agents, incidents } = &plan.crew;
        if agents.is_empty() {
            return Err(SimulationError::NoAgents);
        }
        let mut studio = SimulatedFarm::new(
            Arc::clone(piece),
            [plan.fetch, plan.faults.latency_min],
            plan.failures,
            plan.inexact,
            plan.seed,
        );
        studio.tally = plan.tells_time_left.then(|| Tally::new(false, plan.auction == AuctionRule::Stealing));
        for machine in machines {
            studio.add_machine(f64::from(machine.processors), machine.speed);
        }
        let mut neighbors = vec![0_u32; machines.len()];
        agents.iter().for_each(|agent| neighbors[agent.machine] += 1);
        let mut random = bottega_agents::driver::Random::new(plan.seed ^ 0xbe7c);
        for (index, agent) in agents.iter().enumerate() {
            let MachineSpec { processors, speed } = machines[agent.machine];
            let error = 1.0 + plan.benchmark_error * (2.0 * random.unit() - 1.0);
            let seat = Seat {
                machine: agent.machine,
                joins: agent.joins,
                power: RelativePower::new(piece.relative_power / speed * error),
                lanes: f64::from(processors) / f64::from(neighbors[agent.machine]),
                busy: 0.0,
                orders: 0,
                breaks: 0.0,
                lies: 0.0,
                boasts: 1.0,
                loads: 0.0,
                left_out: None,
                known: None,
            };
            studio.add_agent(AgentId::new(format!("agent-{index}")), seat);
        }
        let joins = agents.iter().enumerate().map(|(index, agent)| (agent.joins, Happening::Joins(index)));
        let befall = incidents.iter().map(|incident| (incident.at, Happening::Befalls(incident.agent, incident.kind)));
        let mut timeline: Vec<_> =
            std::iter::once((piece.survey, Happening::Analyzed)).chain(befall).chain(joins).collect();
        timeline.sort_by_key(|(at, _)| *at);
        timeline.reverse();
        let mut simulator = Simulator::new(plan.seed, plan.faults.clone(), studio);
        if plan.trace {
            simulator.record_trace();
        }
        let master = AgentId::new("master");
        let Plan { auction, prefetch, shares_tail, timing, verify, inexact, .. } = *plan;
        let config = MasterConfig {
            id: master.clone(),
            work: piece.work.work,
            auction,
            prefetch,
            shares_tail,
            verify,
            compares_by_look: inexact,
            secret: plan.seed ^ 0x5ec7e7,
            credits: Arc::clone(&plan.credits),
            goals: GoalRules::default(),
            timing,
            registration: None,
        };
        simulator.add(&master, plan.master_may_crash, move || Master::new(config.clone()).into());
        let idle = IdleWatch::new(master.clone());
        Ok(Self { piece, plan, master, simulator, timeline, idle })
    }

    /// Runs until the work is over, or until `limit`.
    fn run(&mut self, limit: Time) {
        let goes_on = |idle: &mut IdleWatch, simulator: &Simulator<FarmAgent, SimulatedFarm>| {
            idle.look(simulator);
            !simulator.world().film.is_over()
        };
        while let Some((at, what)) = self.timeline.pop() {
            let at = Time::since_start(at);
            if at > limit || self.simulator.run_while(at, |simulator| goes_on(&mut self.idle, simulator)) {
                break;
            }
            self.simulator.run_until(at);
            self.happen(what);
        }
        self.simulator.run_while(limit, |simulator| goes_on(&mut self.idle, simulator));
    }

    fn happen(&mut self, what: Happening) {
        let name = |index: usize| self.simulator.world().names[index].clone();
        match what {
            Happening::Analyzed => {
                let work = FarmValue::Work(Arc::new(self.piece.work.clone()));
                let zones = self.piece.rows().map(|row| FarmValue::Zone(Arc::new(row)));
                let keys = WorkKeys::new(self.piece.work.work);
                for value in zones.chain([work]) {
                    self.simulator.put(keys.of(&value), value);
                }
            }
            Happening::Joins(index) => {
                let (plan, id) = (self.plan, name(index));
                let experts = if plan.experts.is_empty() { &self.piece.experts } else { &plan.experts };
                let config = RenderAgentConfig {
                    id: id.clone(),
                    master: MasterSource::Known(self.master.clone()),
                    adaptation: plan.adaptation,
                    prefetch: plan.prefetch,
                    steals: plan.auction == AuctionRule::Stealing,
                    heartbeat: plan.timing.heartbeat,
                    expert: experts[index % experts.len()].clone(),
                    knowledge: crate::Foreknowledge::default(),
                };
                self.simulator.add(&id, true, move || RenderAgent::new(config.clone()).into());
            }
            Happening::Befalls(index, IncidentKind::Slow(factor)) => {
                let now = self.simulator.now();
                self.simulator.world_mut().slow_down(now, index, factor);
            }
            Happening::Befalls(index, IncidentKind::Hang) => {
                let now = self.simulator.now();
                self.simulator.world_mut().hang(now, index);
            }
            Happening::Befalls(index, IncidentKind::Break(share)) => {
                self.simulator.world_mut().seats[index].breaks = share;
            }
            Happening::Befalls(index, IncidentKind::Boast(factor)) => {
                self.simulator.world_mut().seats[index].boasts = factor;
            }
            Happening::Befalls(index, IncidentKind::Load(seconds)) => {
                self.simulator.world_mut().seats[index].loads = seconds;
            }
            Happening::Befalls(index, IncidentKind::Lie(share)) => {
                self.simulator.world_mut().seats[index].lies = share;
            }
            Happening::Befalls(index, IncidentKind::Fail) => {
                let id = name(index);
                self.simulator.retire(&id);
            }
            Happening::Befalls(index, IncidentKind::Leave) => {
                let (id, to) = (name(index), vec![self.master.clone()]);
                let content = FarmContent::Unsubscription;
                let goodbye = message(Performative::Cancel, protocol::SUBSCRIBE, &id, to, content);
                self.simulator.bus().publish(goodbye);
                self.simulator.retire(&id);
            }
        }
    }
}
