//! Hostile agents and strangers beside honest ones: the work ends, the film is complete, and honest agents keep working.

mod agent;
mod cast;
mod world;

use std::{sync::Arc, time::Duration};

use bottega_agents::{AgentId, Random, Simulator, Time};
use bottega_farm::{
    Analyst, AnalystConfig, AuctionRule, Expert, FarmAgent, FarmValue, Goal, GoalRules, ImportanceFunction, Level,
    Master, MasterConfig, MasterSource, Optimization, PartitionSettings, RelativePower, RenderAgent, RenderAgentConfig,
    Timing, Visitor, VisitorConfig, WorkId, WorkKeys, WorkSettings, ZoneId, ZoneRow, ZoneState,
};
use bottega_image::Rect;

use self::{
    agent::{HostileAgent, HostileConfig, Vice},
    cast::AnyAgent,
    world::HostileWorld,
};
use crate::sim::{
    stage::{SURVEY_SHRINK, assert_pieces, bad_network},
    survey::tunables,
};

const WORK: WorkId = WorkId(1);
/// The time by which a work must have ended.
const LIMIT: Duration = Duration::from_secs(7 * 24 * 3600);

/// The agents, the network and the rules of a siege.
#[derive(Clone, Debug)]
struct Siege {
    honest: Vec<f64>,
    /// The vices of each hostile agent.
    hostile: Vec<Vec<Vice>>,
    polite: usize,
    rude: usize,
    faulty: bool,
    auction: AuctionRule,
    shares_tail: bool,
    verify: u32,
    optimization: Optimization,
    goal: Goal,
    zones: u32,
    /// Survey pixels merged into one, along each axis.
    survey_shrink: u32,
}

impl Siege {
    /// One hostile agent beside three honest ones, on a good network.
    fn by(vices: &[Vice]) -> Self {
        Self {
            honest: vec![1.0, 0.5, 2.0],
            hostile: vec![vices.to_vec()],
            polite: 0,
            rude: 0,
            faulty: false,
            auction: AuctionRule::FinishingTime,
            shares_tail: true,
            verify: 1,
            optimization: Optimization::Off,
            goal: Goal::Samples,
            zones: 10,
            survey_shrink: SURVEY_SHRINK,
        }
    }

    /// Any mixture of hostile and honest agents.
    fn of_seed(seed: u64) -> Self {
        let mut random = Random::new(seed ^ 0x4057);
        let vices = |random: &mut Random| {
            let count = 1 + random.below(4);
            (0..count).map(|_| Vice::ALL[random.below(Vice::ALL.len())]).collect()
        };
        let count = 1 + random.below(3);
        Self {
            hostile: (0..count).map(|_| vices(&mut random)).collect(),
            polite: random.below(2),
            rude: random.below(2),
            faulty: !seed.is_multiple_of(4),
            auction: if seed.is_multiple_of(2) { AuctionRule::FinishingTime } else { AuctionRule::Paper },
            shares_tail: random.unit() < 0.5,
            verify: if seed % 5 == 2 { 2 } else { 1 },
            optimization: if seed.is_multiple_of(3) { Optimization::Normal } else { Optimization::Off },
            goal: if seed % 7 == 3 { Goal::Time(Duration::from_secs(20)) } else { Goal::Samples },
            ..Self::by(&[])
        }
    }
}

impl Siege {
    /// The mixture of a seed that once found a fault, with the survey of that time, because another survey gives other zones.
    fn found_by(seed: u64) -> Self {
        Self { survey_shrink: 1, ..Self::of_seed(seed) }
    }
}

type Platform = Simulator<AnyAgent, HostileWorld>;

fn names(kind: &str, count: usize) -> Vec<AgentId> {
    (0..count).map(|index| AgentId::new(format!("{kind}-{index}"))).collect()
}

fn add_master(platform: &mut Platform, siege: &Siege, seed: u64) {
    let config = MasterConfig {
        id: AgentId::new("master"),
        work: WORK,
        auction: siege.auction,
        prefetch: 2,
        shares_tail: siege.shares_tail,
        verify: siege.verify,
        compares_by_look: false,
        secret: seed,
        credits: Arc::default(),
        goals: GoalRules::default(),
        timing: Timing::default(),
        registration: None,
    };
    platform.add(&config.id.clone(), siege.faulty, move || AnyAgent::Farm(Master::new(config.clone()).into()));
    let frame = frame();
    let config = AnalystConfig {
        id: AgentId::new("analyst"),
        master: AgentId::new("master"),
        work: WORK,
        settings: WorkSettings {
            picture: frame,
            frame,
            samples: 64,
            goal: siege.goal,
            tunables: tunables(),
            optimization: siege.optimization,
        },
        importance: ImportanceFunction::default(),
        partition: PartitionSettings {
            zone_count: siege.zones,
            ..PartitionSettings::for_agents(Level::Balanced, 3, frame)
        },
        registration: None,
        knowledge: bottega_farm::Foreknowledge::default(),
        trusts_forecasts: true,
    };
    platform.add(&config.id.clone(), siege.faulty, move || AnyAgent::Farm(Analyst::new(config.clone()).into()));
}

fn add_honest(platform: &mut Platform, siege: &Siege) {
    for id in names("agent", siege.honest.len()) {
        let config = RenderAgentConfig {
            id: id.clone(),
            master: MasterSource::Known(AgentId::new("master")),
            adaptation: Default::default(),
            prefetch: 2,
            auction: siege.auction,
            heartbeat: Timing::default().heartbeat,
            expert: Expert::path_tracing(),
            knowledge: bottega_farm::Foreknowledge::default(),
        };
        platform.add(&id, siege.faulty, move || AnyAgent::Farm(RenderAgent::new(config.clone()).into()));
    }
}

fn add_strangers(platform: &mut Platform, siege: &Siege, seed: u64) {
    let strangers = names("polite", siege.polite).into_iter().chain(names("rude", siege.rude));
    for id in strangers {
        let config = VisitorConfig {
            id: id.clone(),
            master: AgentId::new("master"),
            power: RelativePower::REFERENCE,
            lanes: 1.0,
            adaptation: Default::default(),
            expert: Expert::path_tracing(),
            timing: Timing::default(),
        };
        platform.add(&id, siege.faulty, move || AnyAgent::Visitor(Box::new(Visitor::new(config.clone()))));
    }
    for (index, vices) in siege.hostile.iter().enumerate() {
        let config = HostileConfig {
            id: AgentId::new(format!("hostile-{index}")),
            master: AgentId::new("master"),
            honest: names("agent", siege.honest.len()),
            vices: vices.clone(),
            pace: Duration::from_millis(300),
            tires: Time::since_start(Duration::from_secs(40)),
            seed: seed ^ (index as u64) << 32,
        };
        platform.add(&config.id.clone(), siege.faulty, move || {
            AnyAgent::Hostile(Box::new(HostileAgent::new(config.clone())))
        });
    }
}

fn frame() -> Rect {
    Rect::of_size(640, 480)
}

/// The result of a siege.
struct SiegeOutcome {
    took: Duration,
    zones: usize,
    failed: usize,
    missing: usize,
    left_out: usize,
}

/// Runs a work, and checks that it ends as it must.
fn withstand(siege: &Siege, seed: u64) -> SiegeOutcome {
    let mut world = HostileWorld::new(siege.survey_shrink);
    world.power.extend(names("agent", siege.honest.len()).into_iter().zip(siege.honest.iter().copied()));
    world.power.extend(names("polite", siege.polite).into_iter().map(|id| (id, 1.0)));
    world.rude.extend(names("rude", siege.rude));
    let faults = if siege.faulty { bad_network(seed) } else { bottega_agents::Faults::NONE };
    let mut platform = Simulator::new(seed, faults, world);
    if std::env::var_os("TRACE").is_some() {
        platform.record_trace();
    }
    add_master(&mut platform, siege, seed);
    add_honest(&mut platform, siege);
    add_strangers(&mut platform, siege, seed);
    let end = Time::since_start(LIMIT);
    let ended = platform.run_while(end, |platform| platform.world().finished.is_none());
    if std::env::var_os("TRACE").is_some() {
        eprintln!("{}", platform.trace());
    }
    let took = platform.now().elapsed();
    let world = platform.world();
    let open: Vec<&ZoneRow> = world.zones.values().filter(|row| !world.composed.contains_key(&row.zone)).collect();
    assert!(ended, "seed {seed} does not end: {siege:?}: {open:?}");
    assert_whole(&platform, siege, seed);
    let world = platform.world();
    let failed = world.finished.as_ref().map_or(0, Vec::len);
    SiegeOutcome { took, zones: world.zones.len(), failed, missing: world.missing, left_out: world.left_out.len() }
}

/// Checks that all zones are in the film or given up, that their pixels were painted, and that honest agents still work.
fn assert_whole(platform: &Platform, siege: &Siege, seed: u64) {
    let world = platform.world();
    let failed = world.finished.clone().expect("it has ended");
    let rows: Vec<ZoneRow> = platform
        .store()
        .with_prefix(&WorkKeys::new(WORK).prefix())
        .filter_map(|entry| match &entry.value {
            FarmValue::Zone(row) => Some((**row).clone()),
            _ => None,
        })
        .collect();
    let of_state = |state: ZoneState| -> Vec<ZoneId> {
        let mut zones: Vec<ZoneId> = rows.iter().filter(|row| row.state == state).map(|row| row.zone).collect();
        zones.sort_unstable();
        zones
    };
    assert_eq!(of_state(ZoneState::Failed), failed, "seed {seed}");
    assert_eq!(of_state(ZoneState::Done), world.composed.keys().copied().collect::<Vec<_>>(), "seed {seed}");
    assert_eq!(world.composed.len() + failed.len(), rows.len(), "seed {seed}");
    if failed.is_empty() {
        for (x, y) in frame().pixels().step_by(167) {
            let composed = world.composed.values().filter(|(_, rect)| rect.contains(x, y));
            let sum: f32 = composed.map(|(mask, _)| mask.weight(x, y)).sum();
            assert!((sum - 1.0).abs() < 1e-4, "seed {seed}: the weights at {x}, {y} sum to {sum}");
        }
        assert_pieces(&rows.into_iter().map(|row| (row.zone, row)).collect(), frame(), seed);
    }
    let honest = names("agent", siege.honest.len()).into_iter().chain(names("polite", siege.polite));
    for id in honest {
        // Two agents that agree are believed: --verify 2 does not protect against two that are hostile together.
        let by_two = |reason: &str| reason.contains("is not what") && reason.matches("hostile-").count() == 2;
        let left_out = world.left_out.get(&id).filter(|reason| !by_two(reason));
        assert_eq!(left_out, None, "seed {seed}: {id} is left out");
        let Some(AnyAgent::Farm(FarmAgent::Render(agent))) = platform.machine(&id) else { continue };
        for (zone, fence) in agent.held_zones() {
            let is_taken = world.zones[&zone].result.is_some_and(|result| result.fence == fence);
            assert!(!is_taken, "seed {seed}: {id} has {zone} in hand, and it is composed of that");
        }
    }
}

#[test]
fn the_work_ends_and_the_film_is_whole_with_any_agents() {
    let (mut failed, mut zones, mut missing, mut left_out) = (0, 0, 0, 0);
    let mut longest = Duration::ZERO;
    for seed in 0..1000 {
        let aftermath = withstand(&Siege::of_seed(seed), seed);
        failed += aftermath.failed;
        zones += aftermath.zones;
        missing += aftermath.missing;
        left_out += aftermath.left_out;
        longest = longest.max(aftermath.took);
    }
    eprintln!("{failed} of {zones} zones given up; {missing} tiles missing; {left_out} left out; longest {longest:?}");
    assert!(failed * 500 < zones && missing > 100 && left_out > 500, "{failed} of {zones}, {missing}, {left_out}");
}

/// The same with stealing: zones are dealt out, and agents take waiting zones from each other.
#[test]
fn the_work_ends_and_the_film_is_whole_with_any_agents_that_steal() {
    let (mut failed, mut zones) = (0, 0);
    for seed in 0..400 {
        let mut siege = Siege { auction: AuctionRule::Stealing, ..Siege::of_seed(seed) };
        siege.hostile.iter_mut().for_each(|vices| vices.push(Vice::Robs));
        let aftermath = withstand(&siege, seed);
        failed += aftermath.failed;
        zones += aftermath.zones;
    }
    eprintln!("{failed} of {zones} zones given up");
    assert!(failed * 500 < zones, "{failed} of {zones}");
}

/// Three honest agents need some 12 s. A hostile one may delay the end by its timeouts, and no more.
#[test]
fn one_hostile_agent_has_no_zone_given_up_and_cannot_hold_the_work_up() {
    let mut lines = Vec::new();
    for vice in Vice::ALL {
        let limit = match vice {
            Vice::Vanishes | Vice::Forges | Vice::Fails | Vice::Leaves | Vice::Usurps => 100,
            // Timeouts of agents that share a processor are up to thirty-two times longer; after three orders it is left out.
            Vice::Mumbles => 3 * 32 * 600 + 100,
            // An order with reported progress has the longest timeout.
            Vice::Claims => 5 * 3600,
            // An order that is not begun times out after ten minutes, and one without progress after at most half an hour.
            _ => 1920,
        };
        let mut longest = Duration::ZERO;
        for seed in 0..20 {
            let siege = Siege { shares_tail: false, ..Siege::by(&[vice]) };
            let aftermath = withstand(&siege, seed);
            longest = longest.max(aftermath.took);
            lines.push(format!("{vice:?} {seed}: {:?} {} given up", aftermath.took, aftermath.failed));
            assert_eq!(aftermath.failed, 0, "{vice:?}, seed {seed}");
        }
        eprintln!("{vice:?}: {longest:?}");
        assert!(longest < Duration::from_secs(limit), "{vice:?}: {longest:?}");
    }
}

#[test]
fn visitors_that_keep_to_the_rules_paint_a_picture_among_those_that_do_not() {
    for seed in 0..100 {
        let siege = Siege { honest: Vec::new(), hostile: Vec::new(), polite: 3, rude: 1, ..Siege::by(&[]) };
        let aftermath = withstand(&siege, seed);
        assert_eq!(aftermath.failed, 0, "seed {seed}");
        assert!(aftermath.took < Duration::from_secs(900), "seed {seed}: {:?}", aftermath.took);
    }
}

/// The zone's turn among those with bands had passed when its failures were forgiven, and the film waited for it
/// for ever.
#[test]
fn a_zone_that_was_given_up_and_is_painted_after_all_goes_into_the_film() {
    for seed in [1113, 1158, 1371, 1488, 1509, 2259] {
        withstand(&Siege::found_by(seed), seed);
    }
}

/// An agent was found wrong and its zones were being opened when the film reported that one of its tiles is missing.
#[test]
fn a_tile_may_be_missing_while_its_zone_is_opened_again() {
    for seed in [819, 846] {
        withstand(&Siege::found_by(seed), seed);
    }
}

#[test]
#[ignore = "prints the run of one seed: SEED=7; with TRACE=1 its messages; or runs many: SEED=1000 COUNT=5000"]
fn one_siege() {
    let number = |name: &str, default: u64| std::env::var(name).map_or(default, |it| it.parse().expect("a number"));
    let (first, count) = (number("SEED", 7), number("COUNT", 1));
    for seed in first..first + count {
        let siege = Siege::of_seed(seed);
        let aftermath = std::panic::catch_unwind(|| withstand(&siege, seed));
        match aftermath {
            Ok(it) if count == 1 || it.failed > 0 => {
                eprintln!("{seed}: {:?} {} given up {siege:?}", it.took, it.failed);
            }
            Ok(_) => {}
            Err(_) => eprintln!("{seed}: broken"),
        }
    }
}
