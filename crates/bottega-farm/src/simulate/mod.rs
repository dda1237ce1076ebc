//! Simulation of the farm in virtual time, with the same state machines that paint real pictures.
//!
//! A [`Workpiece`] gives the costs of zones: measured in a real run (a [`Record`], made by a [`Recorder`]), or drawn
//! from a distribution. A [`FarmSpec`] gives the agents, their speeds and their faults. [`simulate`] runs a Master and
//! Render Agents over them. It returns the time taken and its lower bound, and checks that nothing was lost, painted
//! twice or accepted under an invalid order.

mod farm_spec;
mod film;
mod invariants;
mod machines;
mod outcome;
mod record;
mod record_json;
mod recorder;
mod simulated_farm;
mod workpiece;

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use bottega_agents::{
    AgentId, Performative, Time,
    bus::Bus,
    driver::{Faults, Simulator},
};

pub use self::{
    farm_spec::{AgentSpec, FarmSpec, FarmSpecError, Incident, IncidentKind, MachineSpec, SIMULATED_AGENTS_MAX},
    outcome::{AgentOutcome, SimulationOutcome},
    record::{CELL_SIDE, CostGrid, Record, RecordError, RecordedRules, RecordedZone},
    recorder::Recorder,
    simulated_farm::{SPANS_MAX, Span, SpanKind, TimeLeft},
    workpiece::{SyntheticSpread, Workpiece, WorkpieceError, ZONES_MAX},
};
use self::{
    invariants::IdleWatch,
    simulated_farm::{SimulatedFarm, SimulatedPainter},
};
use crate::{
    AdaptationRule, AuctionRule, Credit, Expert, FarmAgent, FarmContent, FarmValue, GoalRules, Master, MasterConfig,
    MasterSource, RelativePower, RenderAgent, RenderAgentConfig, Timing, WorkKeys, ZoneForecast, contents::message,
    progress::Tally, protocol,
};

/// Virtual time simulated after the end, until all agents have left.
const AFTERWARDS: Duration = Duration::from_secs(20);

/// The plan of a simulation: agents, network and rules.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The machines and the agents of the farm, with their incidents.
    pub farm: FarmSpec,
    /// Faults of the network. Agents that these faults kill come back; those of [`FarmSpec::incidents`] do not.
    pub faults: Faults,
    /// `true`: the faults may kill the Master.
    pub master_may_crash: bool,
    /// Share of all orders that fail, 0..1.
    pub failures: f64,
    /// Maximum relative error of an agent's benchmark.
    pub benchmark_error: f64,
    /// Time that an agent takes to fetch the scene.
    pub fetch: Duration,
    /// The rule of the auction.
    pub auction: AuctionRule,
    /// The rule that adapts V_cp.
    pub adaptation: AdaptationRule,
    /// Credit of the agents in earlier works, by name.
    pub credits: Arc<BTreeMap<String, Credit>>,
    /// V_cp of the agents as learned in earlier works, by name; others start from their benchmark.
    pub powers: Arc<BTreeMap<String, RelativePower>>,
    /// The times of all zones as predicted from earlier works, by id, in reference time; zones whose time is trusted are not
    /// profiled. Empty: nothing was learned.
    pub forecasts: Arc<[ZoneForecast]>,
    /// Number of zones that an agent works on at once.
    pub prefetch: u32,
    /// `true`: near the end, zones are cut and zones of slow agents also given to idle ones: see
    /// [`MasterConfig::shares_tail`].
    pub shares_tail: bool,
    /// Number of agents whose paintings of a zone must agree: see [`MasterConfig::verify`].
    pub verify: u32,
    /// `true`: agents are not bit-identical: see [`MasterConfig::compares_by_look`].
    pub inexact: bool,
    /// The timeouts of the Master.
    pub timing: Timing,
    /// The rules of the agents, assigned in rotation; empty: those of the recorded run.
    pub experts: Vec<Expert>,
    /// The seed of all random numbers.
    pub seed: u64,
    /// `true`: write a trace of all events.
    pub trace: bool,
    /// `true`: record predictions of the remaining time.
    pub tells_time_left: bool,
}

impl Plan {
    /// Makes a plan with these agents on a fast network without faults. Zones are shared at the end if agents have
    /// machines of their own.
    ///
    /// - `seed`: the seed of all random numbers.
    pub fn calm(farm: FarmSpec, seed: u64) -> Self {
        Self {
            shares_tail: farm.machines.len() >= farm.agents.len(),
            farm,
            faults: Faults::NONE,
            master_may_crash: false,
            failures: 0.0,
            benchmark_error: 0.0,
            fetch: Duration::ZERO,
            auction: AuctionRule::default(),
            adaptation: AdaptationRule::default(),
            credits: Arc::default(),
            powers: Arc::default(),
            forecasts: [].into(),
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

    /// Returns the plan with the paper's auction and adaptation, and without our additions: agents hold one
    /// zone at a time, and the end of the work is not shared.
    #[must_use]
    pub fn as_in_paper(self) -> Self {
        let (auction, adaptation) = (AuctionRule::Paper, AdaptationRule::Paper);
        Self { auction, adaptation, prefetch: 1, shares_tail: false, ..self }
    }
}

/// The reason why a simulation has no outcome.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SimulationError {
    /// There are no agents.
    #[error("nobody paints")]
    NoAgents,
    /// The run did not end within a hundred times its lower bound plus an hour of virtual time, for example because no
    /// agent is left.
    #[error("no agent is left to paint: {painted} of {zones} zones were painted after {} s of virtual time", .after.as_secs())]
    Unfinished {
        /// Virtual time at which it was stopped.
        after: Duration,
        /// Number of zones in the picture by then.
        painted: usize,
        /// Number of zones.
        zones: usize,
    },
    /// The Master abandoned the work.
    #[error("the work was given up: {reason}")]
    Abandoned {
        /// The reason, as text for the user.
        reason: String,
    },
    /// An invariant does not hold: an error in this program.
    #[error("an invariant does not hold: {}", .broken.join("; "))]
    Broken {
        /// A description of each violation.
        broken: Vec<String>,
    },
}

/// Runs a work in virtual time, checks the invariants, and returns times and statistics.
///
/// The same arguments give the same run, event for event.
///
/// # Errors
/// There are no agents, the run does not end, the Master abandons the work, or an invariant is violated.
///
/// # Panics
/// If the machine of an agent or the agent of an incident does not exist, or if neither the plan nor the record has
/// rules for the agents.
pub fn simulate(piece: &Arc<Workpiece>, plan: &Plan) -> Result<SimulationOutcome, SimulationError> {
    let mut play = Play::new(piece, plan)?;
    let work: f64 = piece.zone_seconds().sum();
    let least = plan.farm.least_time(piece.survey, work);
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
    let least = plan.farm.least_time(piece.survey, work);
    let fastest = plan.farm.machines.iter().map(|machine| machine.speed).fold(f64::MIN_POSITIVE, f64::max);
    let longest = piece.zone_seconds().fold(0.0, f64::max) / fastest;
    let trace = play.simulator.trace();
    let world = play.simulator.world_mut();
    Ok(SimulationOutcome {
        makespan: end.elapsed(),
        least,
        longest_zone: piece.survey + Duration::from_secs_f64(longest),
        work: Duration::from_secs_f64(work),
        zones: piece.zone_count(),
        failed: failed.len(),
        wrong: world.film.wrong_count(),
        lacked_machines: world.lacked_machines,
        messages,
        films: world.film.films,
        rounds: std::mem::take(&mut world.rounds),
        thefts: std::mem::take(&mut world.thefts),
        spans: std::mem::take(&mut world.spans),
        spans_left_out: world.spans_left_out,
        times_left: std::mem::take(&mut world.times_left),
        agents: agents(plan, world),
        trace,
    })
}

/// Returns the processor time at speed 1 of the samples in the picture, in seconds; rules may have chosen other
/// numbers of samples than in the record.
fn painted_seconds(simulator: &Simulator<FarmAgent, SimulatedFarm>, piece: &Workpiece) -> f64 {
    let prefix = WorkKeys::new(piece.work.work).prefix();
    let seconds = |value: &FarmValue| match value {
        FarmValue::Zone(row) => piece.painted_seconds(row),
        _ => 0.0,
    };
    simulator.store().with_prefix(&prefix).map(|entry| seconds(&entry.value)).sum()
}

fn agents(plan: &Plan, world: &SimulatedFarm) -> Vec<AgentOutcome> {
    let outcome = |(name, simulated): (&AgentId, &SimulatedPainter)| AgentOutcome {
        name: name.to_string(),
        speed: plan.farm.machines[simulated.machine].speed,
        lanes: simulated.lanes,
        busy: Duration::from_secs_f64(simulated.busy),
        orders: simulated.orders,
        left_out: simulated.left_out.clone(),
        credit: simulated.known.as_ref().map(|row| row.credit).unwrap_or_default(),
        power: simulated.known.as_ref().map_or(simulated.power, |row| row.power),
        first_power: simulated.power,
    };
    world.names.iter().zip(&world.agents).map(outcome).collect()
}

/// An event at a given time, independent of the agents.
#[derive(Clone, Copy, Debug)]
enum Happening {
    /// The Analyst has finished: write its rows to the Blackboard.
    Analyzed,
    Joins(usize),
    Befalls(usize, IncidentKind),
}

struct Play<'a> {
    piece: &'a Workpiece,
    plan: &'a Plan,
    master: AgentId,
    simulator: Simulator<FarmAgent, SimulatedFarm>,
    /// The events with their times, the latest first.
    timeline: Vec<(Duration, Happening)>,
    idle: IdleWatch,
}

impl<'a> Play<'a> {
    fn new(piece: &'a Arc<Workpiece>, plan: &'a Plan) -> Result<Self, SimulationError> {
        let FarmSpec { machines, agents, incidents } = &plan.farm;
        if agents.is_empty() {
            return Err(SimulationError::NoAgents);
        }
        let mut world = SimulatedFarm::new(
            Arc::clone(piece),
            [plan.fetch, plan.faults.latency_min],
            plan.failures,
            plan.inexact,
            plan.seed,
        );
        world.tally = plan.tells_time_left.then(|| Tally::new(false, plan.auction.at_once(plan.prefetch)));
        for machine in machines {
            world.add_machine(f64::from(machine.processors), machine.speed);
        }
        let mut neighbors = vec![0_u32; machines.len()];
        agents.iter().for_each(|agent| neighbors[agent.machine] += 1);
        let mut random = bottega_agents::driver::Random::new(plan.seed ^ 0xbe7c);
        for (index, agent) in agents.iter().enumerate() {
            let MachineSpec { processors, speed } = machines[agent.machine];
            let error = 1.0 + plan.benchmark_error * (2.0 * random.unit() - 1.0);
            let benchmark = RelativePower::new(piece.relative_power / speed * error);
            let name = AgentId::new(format!("agent-{index}"));
            let simulated = SimulatedPainter {
                machine: agent.machine,
                joins: agent.joins,
                power: plan.powers.get(&name.to_string()).copied().unwrap_or(benchmark),
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
            world.add_agent(name, simulated);
        }
        let joins = agents.iter().enumerate().map(|(index, agent)| (agent.joins, Happening::Joins(index)));
        let befall = incidents.iter().map(|incident| (incident.at, Happening::Befalls(incident.agent, incident.kind)));
        let mut timeline: Vec<_> =
            std::iter::once((piece.survey, Happening::Analyzed)).chain(befall).chain(joins).collect();
        timeline.sort_by_key(|(at, _)| *at);
        timeline.reverse();
        let mut simulator = Simulator::new(plan.seed, plan.faults.clone(), world);
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
                let zones = self.piece.rows(&self.plan.forecasts).map(|row| FarmValue::Zone(Arc::new(row)));
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
                    auction: plan.auction,
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
                self.simulator.world_mut().agents[index].breaks = share;
            }
            Happening::Befalls(index, IncidentKind::Boast(factor)) => {
                self.simulator.world_mut().agents[index].boasts = factor;
            }
            Happening::Befalls(index, IncidentKind::Load(seconds)) => {
                self.simulator.world_mut().agents[index].loads = seconds;
            }
            Happening::Befalls(index, IncidentKind::Lie(share)) => {
                self.simulator.world_mut().agents[index].lies = share;
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
