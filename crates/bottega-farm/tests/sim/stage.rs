//! The stage of these tests: the machines, the agents on them, and what must hold on the way and at the end.

use std::{
    cell::RefCell,
    collections::{BTreeMap, BTreeSet},
    rc::Rc,
    sync::Arc,
    time::Duration,
};

use bottega_agents::{
    AgentId, Revision, Time,
    bus::BlobId,
    driver::{Faults, Random, Simulator, World},
    wire::Calendar,
};
use bottega_farm::{
    AdaptationRule, Analyst, AnalystConfig, AuctionRule, ErrorUse, Expert, FarmAgent, FarmCompletion, FarmEffect, Goal,
    GoalRules, ImportanceFunction, Level, Master, MasterConfig, MasterSource, Optimization, PaintResult,
    PartitionSettings, RegistrationConfig, RelativePower, RenderAgent, RenderAgentConfig, ResultRef, Timing, WorkId,
    WorkSettings, ZoneId, ZoneRow, ZoneState, directory_service_names, directory_services,
};
use bottega_image::Rect;

use crate::sim::survey::{survey, tunables};

/// The content of the present Master's film.
#[derive(Debug, Default)]
pub(crate) struct ObservedAgent {
    pub(crate) zones: BTreeMap<ZoneId, ZoneRow>,
    pub(crate) composed: BTreeSet<ZoneId>,
    pub(crate) finished: Option<Vec<ZoneId>>,
    pub(crate) films: usize,
    pub(crate) surveyed: usize,
    /// Rounds of the auction, and their awards.
    pub(crate) rounds: usize,
    pub(crate) awards: usize,
}

/// Machines of given speeds that paint one zone after the other.
pub(crate) struct MachineWorld {
    /// V_cp by agent.
    pub(crate) power: BTreeMap<AgentId, f64>,
    /// The time at which each machine is free.
    pub(crate) free: BTreeMap<AgentId, Time>,
    /// Share of orders that fail.
    pub(crate) failures: f64,
    /// A slowdown: its time, the agent, and the factor.
    pub(crate) slows: Option<(Time, AgentId, f64)>,
    pub(crate) seen: Rc<RefCell<ObservedAgent>>,
    /// The paintings under way, by order, with their end.
    pub(crate) sittings: BTreeMap<(AgentId, ZoneId, Revision), (Time, Time)>,
    /// Reference-machine time painted, including discarded work.
    pub(crate) painted: Duration,
    /// Share of zones that are requested again once they are in the film, each once.
    pub(crate) requeues: f64,
    /// The zones that were requested again.
    pub(crate) requeued: BTreeMap<ZoneId, Revision>,
    pub(crate) survey_shrink: u32,
}

/// Survey pixels merged into one, along each axis, in tests with many seeds. The Analyst's result is the same
/// in each of them, and took a third of the time.
pub(crate) const SURVEY_SHRINK: u32 = 4;

impl MachineWorld {
    /// The cost of samples on the reference machine: a function of the pixels that no estimate knows exactly.
    pub(crate) fn cost(rect: &Rect, samples: u32) -> Duration {
        let center = |a: u32, b: u32| f64::from(a + b) / 2.0;
        let (x, y) = (center(rect.x0, rect.x1), center(rect.y0, rect.y1));
        let pixel = 1.0 + 12.0 * (x / 640.0) * (y / 480.0);
        Duration::from_secs_f64(rect.area() as f64 * f64::from(samples) * pixel * 2e-7)
    }
}

impl World<FarmAgent> for MachineWorld {
    fn perform(
        &mut self,
        now: Time,
        agent: &AgentId,
        effect: FarmEffect,
        random: &mut Random,
        reports: &mut Vec<(Duration, FarmCompletion)>,
    ) {
        let mut seen = self.seen.borrow_mut();
        let power = self.power.get(agent).copied().unwrap_or(1.0);
        match effect {
            FarmEffect::Survey { width, height, .. } => {
                seen.surveyed += 1;
                let (width, height) = (width / self.survey_shrink, height / self.survey_shrink);
                let survey = FarmCompletion::Surveyed(Ok(Arc::new(survey(width, height))));
                reports.push((Duration::from_millis(100), survey));
            }
            FarmEffect::Benchmark => {
                // A benchmark is off by up to a third.
                let power = RelativePower::new(power * (0.75 + 0.5 * random.unit()));
                reports.push((Duration::from_millis(20), FarmCompletion::Benchmarked { power, lanes: 1.0 }));
            }
            FarmEffect::Fetch(work) => reports.push((Duration::from_millis(50), FarmCompletion::Fetched(work))),
            FarmEffect::Paint(order) => {
                let cost = Self::cost(&order.rect, order.samples.end - order.samples.start);
                self.painted += cost;
                let begin = self.free.get(agent).copied().unwrap_or_default().max(now);
                let slow = self.slows.as_ref().filter(|(from, who, _)| begin >= *from && who == agent);
                let power = power * slow.map_or(1.0, |(_, _, times)| *times);
                let busy = cost.mul_f64(power * (0.9 + 0.2 * random.unit()));
                self.free.insert(agent.clone(), begin + busy);
                self.sittings.insert((agent.clone(), order.zone, order.fence), (begin, begin + busy));
                let (zone, fence) = (order.zone, order.fence);
                let outcome = if random.unit() < self.failures {
                    Err("out of memory".to_owned())
                } else {
                    let mut digest = [0; 32];
                    digest[..4].copy_from_slice(&zone.0.to_le_bytes());
                    digest[4..8].copy_from_slice(&order.samples.end.to_le_bytes());
                    let result = ResultRef { fence, samples: order.samples.end, digest: BlobId(digest) };
                    // Two halves that differ as by chance, from a sample error of a half.
                    let error = 0.5 / f64::from(order.samples.end).sqrt();
                    let goes_on = match order.error_use {
                        ErrorUse::Stops(wanted) => error > wanted && order.samples.end < order.samples_max,
                        ErrorUse::None | ErrorUse::Weighs => true,
                    };
                    let (error, unfinished) = (Some(error), f64::from(u8::from(goes_on)));
                    Ok(PaintResult { result, busy, is_measured: true, error, unfinished })
                };
                reports.push((begin + busy - now, FarmCompletion::Painted { zone, fence, outcome }));
            }
            FarmEffect::BeginFilm(_) => {
                seen.films += 1;
                seen.composed.clear();
            }
            FarmEffect::Drop { .. } | FarmEffect::Dismissed { .. } => {}
            FarmEffect::Look(orders) => {
                let progress = |(zone, fence)| {
                    let (begin, end) = *self.sittings.get(&(agent.clone(), zone, fence))?;
                    let painted = now.min(end).since(begin.min(now));
                    Some((zone, fence, painted.as_nanos() as u64))
                };
                let found = orders.into_iter().filter_map(progress).collect();
                reports.push((Duration::ZERO, FarmCompletion::Looked(found)));
            }
            FarmEffect::TooFew { .. } => {}
            FarmEffect::Stalled { waited, zones, free } => {
                panic!("{zones} zones waited for {waited:?} while {free} agents were free")
            }
            FarmEffect::Compare { zone, .. } => panic!("{zone} is compared, and everybody is trusted"),
            FarmEffect::LeftOut { agent, reason } => panic!("{agent} is left out: {reason}"),
            FarmEffect::ZoneChanged(row) => _ = seen.zones.insert(row.zone, (*row).clone()),
            FarmEffect::Compose { zone, result, .. } => {
                assert!(seen.composed.insert(zone), "{zone} is composed twice");
                let row = &seen.zones[&zone];
                assert_eq!((row.state, row.result), (ZoneState::Done, Some(result)));
                reports.push((Duration::from_millis(1), FarmCompletion::Composed { zone, outcome: Ok(()) }));
                if self.requeues > 0.0 && !self.requeued.contains_key(&zone) && random.unit() < self.requeues {
                    self.requeued.insert(zone, result.fence);
                    let fence = Some(result.fence);
                    // A client may repeat its request.
                    let delays = [50, 250].map(Duration::from_millis);
                    reports.extend(delays.map(|later| (later, FarmCompletion::Requeue { zone, fence })));
                }
            }
            FarmEffect::Finish { failed } => {
                assert!(seen.finished.is_none(), "the work ends once");
                seen.finished = Some(failed);
            }
            FarmEffect::RoundClosed(round) => {
                seen.rounds += 1;
                seen.awards += round.awards as usize;
            }
            FarmEffect::AgentChanged(_) | FarmEffect::Stolen(_) | FarmEffect::Analyzed { .. } => {}
            FarmEffect::Abandon { reason } => panic!("{reason}"),
        }
    }
}

#[derive(Clone)]
pub(crate) struct Scene {
    pub(crate) powers: Vec<f64>,
    pub(crate) auction: AuctionRule,
    pub(crate) faults: Faults,
    pub(crate) failures: f64,
    /// The time from which the first agent is slower, and the factor.
    pub(crate) slows: Option<(Duration, f64)>,
    pub(crate) zones: u32,
    pub(crate) samples: u32,
    pub(crate) optimization: Optimization,
    pub(crate) goal: Goal,
    pub(crate) master_may_crash: bool,
    pub(crate) shares_tail: bool,
    /// Number of agents that must agree on a zone.
    pub(crate) verify: u32,
    /// The time at which the last agent joins.
    pub(crate) late: Duration,
    /// The time at which the directories start, in which agents find their Master; the longest time: never.
    pub(crate) directories: Option<Duration>,
    /// Share of zones that are painted again on request.
    pub(crate) requeues: f64,
    /// Survey pixels merged into one, along each axis.
    pub(crate) survey_shrink: u32,
}

impl Scene {
    pub(crate) fn calm(powers: &[f64]) -> Self {
        Self {
            powers: powers.to_vec(),
            auction: AuctionRule::FinishingTime,
            faults: Faults::NONE,
            failures: 0.0,
            slows: None,
            zones: 64,
            samples: 256,
            optimization: Optimization::Off,
            goal: Goal::Samples,
            master_may_crash: false,
            shares_tail: true,
            verify: 1,
            late: Duration::ZERO,
            directories: None,
            requeues: 0.0,
            survey_shrink: 1,
        }
    }
}

pub(crate) struct Play {
    pub(crate) simulator: Simulator<FarmAgent, MachineWorld>,
    pub(crate) seen: Rc<RefCell<ObservedAgent>>,
    pub(crate) lower_bound: Duration,
}

pub(crate) fn play(seed: u64, scene: &Scene, trace: bool) -> Play {
    run(seed, scene, trace, |_| {})
}

pub(crate) fn play_watched(seed: u64, scene: &Scene, watch: impl FnMut(&Simulator<FarmAgent, MachineWorld>)) -> Play {
    run(seed, scene, false, watch)
}

/// All agents, before anything has been painted.
pub(crate) fn stage(seed: u64, scene: &Scene, trace: bool) -> Play {
    let frame = Rect::of_size(640, 480);
    let (master, analyst) = (AgentId::new("master"), AgentId::new("analyst"));
    let agents: Vec<AgentId> = (0..scene.powers.len()).map(|i| AgentId::new(format!("agent-{i}"))).collect();
    let seen = Rc::new(RefCell::new(ObservedAgent::default()));
    let machines = MachineWorld {
        power: agents.iter().cloned().zip(scene.powers.iter().copied()).collect(),
        free: BTreeMap::new(),
        failures: scene.failures,
        slows: scene.slows.map(|(from, times)| (Time::since_start(from), agents[0].clone(), times)),
        seen: Rc::clone(&seen),
        sittings: BTreeMap::new(),
        painted: Duration::ZERO,
        requeues: scene.requeues,
        requeued: BTreeMap::new(),
        survey_shrink: scene.survey_shrink,
    };
    let mut simulator = Simulator::new(seed, scene.faults.clone(), machines);
    if trace {
        simulator.record_trace();
    }
    let timing = Timing::default();
    let work = WorkId(1);
    let place = scene.directories.map(|_| RegistrationConfig {
        master_home: Some("master".to_owned()),
        ..RegistrationConfig::new(work, Some(7))
    });
    let config = MasterConfig {
        id: master.clone(),
        work,
        auction: scene.auction,
        prefetch: 2,
        shares_tail: scene.shares_tail,
        verify: scene.verify,
        compares_by_look: false,
        secret: seed,
        credits: Arc::default(),
        goals: GoalRules::default(),
        timing,
        registration: place.clone(),
    };
    simulator.add(&master, scene.master_may_crash, move || Master::new(config.clone()).into());
    let config = AnalystConfig {
        id: analyst.clone(),
        master: master.clone(),
        work,
        settings: WorkSettings {
            picture: frame,
            frame,
            samples: scene.samples,
            goal: scene.goal,
            tunables: tunables(),
            optimization: scene.optimization,
        },
        importance: ImportanceFunction::default(),
        partition: PartitionSettings {
            zone_count: scene.zones,
            ..PartitionSettings::for_agents(Level::Balanced, agents.len(), frame)
        },
        registration: place.clone(),
        knowledge: bottega_farm::Foreknowledge::default(),
        trusts_forecasts: true,
    };
    simulator.add(&analyst, true, move || Analyst::new(config.clone()).into());
    let (last, others) = agents.split_last().expect("somebody paints");
    let auction = scene.auction;
    let add = |simulator: &mut Simulator<FarmAgent, MachineWorld>, id: &AgentId| {
        let own = id.clone();
        let source = place.clone().map_or_else(|| MasterSource::Known(master.clone()), MasterSource::Directory);
        simulator.add(id, true, move || {
            RenderAgent::new(RenderAgentConfig {
                id: own.clone(),
                master: source.clone(),
                adaptation: AdaptationRule::MedianRatio,
                prefetch: 2,
                auction,
                heartbeat: timing.heartbeat,
                expert: Expert::path_tracing(),
                knowledge: bottega_farm::Foreknowledge::default(),
            })
            .into()
        });
    };
    others.iter().for_each(|id| add(&mut simulator, id));
    if let Some(late) = scene.directories.filter(|late| *late <= scene.late) {
        simulator.run_until(Time::since_start(late));
        add_directories(&mut simulator);
    }
    simulator.run_until(Time::since_start(scene.late));
    add(&mut simulator, last);
    if let Some(late) = scene.directories.filter(|late| *late > scene.late && *late < Duration::MAX) {
        simulator.run_until(Time::since_start(late));
        add_directories(&mut simulator);
    }
    let all = MachineWorld::cost(&frame, scene.samples);
    let speed: f64 = scene.powers.iter().map(|power| power.recip()).sum();
    Play { simulator, seen, lower_bound: all.div_f64(speed) }
}

/// One Start Service, AMS and DF for all agents. They may die as the agents do, and know the pages when they come back.
fn add_directories(simulator: &mut Simulator<FarmAgent, MachineWorld>) {
    for name in directory_service_names() {
        let own = name.clone();
        simulator.add(&name, true, move || {
            let services = directory_services(Calendar::default(), 1);
            let (_, service) = services.into_iter().find(|(name, _)| *name == own).expect("it is one of them");
            service.into()
        });
    }
}

fn run(seed: u64, scene: &Scene, trace: bool, mut watch: impl FnMut(&Simulator<FarmAgent, MachineWorld>)) -> Play {
    let mut play = stage(seed, scene, trace);
    let seen = Rc::clone(&play.seen);
    let end = Time::since_start(Duration::from_secs(3600));
    play.simulator.run_while(end, |simulator| {
        check(simulator);
        watch(simulator);
        seen.borrow().finished.is_none()
    });
    play
}

/// Checks the invariants of every step: a zone that is done stays done with the same samples, and the store agrees with the film.
pub(crate) fn check(simulator: &Simulator<FarmAgent, MachineWorld>) {
    let Some(FarmAgent::Master(master)) = simulator.machine(&AgentId::new("master")) else { return };
    let seen = simulator.world().seen.borrow();
    for zone in &seen.composed {
        // A zone that is painted again leaves the film when the next film begins.
        if simulator.world().requeued.contains_key(zone) {
            continue;
        }
        if let Some((_, row)) = master.board().zone(*zone) {
            assert_eq!(row.state, ZoneState::Done, "{zone} is in the film and no longer done");
        }
    }
}

pub(crate) fn assert_whole(play: &Play, seed: u64) {
    let seen = play.seen.borrow();
    assert_eq!(seen.finished, Some(Vec::new()), "seed {seed}: {} of {}", seen.composed.len(), seen.zones.len());
    assert_eq!(seen.composed.len(), seen.zones.len(), "seed {seed}");
    assert!(seen.zones.values().all(|row| row.state == ZoneState::Done), "seed {seed}");
    if seen.zones.len() < 1000 {
        assert_pieces(&seen.zones, Rect::of_size(640, 480), seed);
    }
}

/// The pieces of each zone cover it with its band, once.
pub(crate) fn assert_pieces(zones: &BTreeMap<ZoneId, ZoneRow>, frame: Rect, seed: u64) {
    let mut left: BTreeMap<ZoneId, u64> = BTreeMap::new();
    for row in zones.values().filter(|row| row.root.is_none()) {
        let choice = row.choice.expect("a painted zone has a choice");
        left.insert(row.zone, row.rect.grown_by(choice.bands, &frame).area());
    }
    let rows: Vec<&ZoneRow> = zones.values().collect();
    for (i, row) in rows.iter().enumerate() {
        let painted = row.painted(&row.choice.expect("a painted piece has a choice"), &frame);
        *left.get_mut(&row.root()).expect("a piece is of a zone") -= painted.area();
        for other in &rows[..i] {
            let theirs = other.painted(&other.choice.unwrap(), &frame);
            let overlap = other.root() == row.root() && theirs.intersection(&painted).is_some();
            assert!(!overlap, "seed {seed}: {} and {} overlap", row.zone, other.zone);
        }
    }
    assert!(left.values().all(|&pixels| pixels == 0), "seed {seed}: pixels that no piece has");
}

pub(crate) fn bad_network(seed: u64) -> Faults {
    let mut random = Random::new(seed ^ 0x5eed);
    Faults {
        latency_min: Duration::from_millis(1),
        latency_extra_mean: Duration::from_millis(40),
        store_latency: Duration::from_millis(30 * (seed % 2)),
        loss: 0.15 * random.unit(),
        duplication: 0.15 * random.unit(),
        crash_every: (!seed.is_multiple_of(3)).then(|| Duration::from_secs(8)),
        down_max: Duration::from_secs(9),
        partition_every: (seed % 4 == 1).then(|| Duration::from_secs(12)),
        partition_max: Duration::from_secs(6),
        until: Time::since_start(Duration::from_secs(45)),
    }
}

pub(crate) fn troubled(seed: u64) -> Scene {
    Scene {
        powers: vec![1.0, 0.5, 2.0, 3.0, 1.0],
        faults: bad_network(seed),
        auction: if seed.is_multiple_of(2) { AuctionRule::FinishingTime } else { AuctionRule::Paper },
        failures: 0.01,
        slows: seed.is_multiple_of(4).then(|| (Duration::from_secs(2), 20.0)),
        zones: 20,
        samples: 64,
        optimization: if seed.is_multiple_of(5) { Optimization::Normal } else { Optimization::Off },
        goal: match seed % 11 {
            3 => Goal::Error(0.08),
            5 => Goal::Time(Duration::from_secs(20)),
            _ => Goal::Samples,
        },
        master_may_crash: true,
        shares_tail: !seed.is_multiple_of(7),
        verify: 1,
        late: Duration::from_secs(seed % 6),
        directories: (seed % 2 == 1).then(|| Duration::from_secs(seed % 9)),
        requeues: 0.0,
        survey_shrink: SURVEY_SHRINK,
    }
}
