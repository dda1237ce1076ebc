//! Works in virtual time, over many seeds: what must hold after every run is checked by [`simulate`] itself.

use std::{sync::Arc, time::Duration};

use bottega_agents::{
    Time,
    driver::{Faults, Random},
};
use bottega_farm::{
    AuctionRule,
    simulate::{Crew, Incident, IncidentKind, Outcome, Plan, SimulationError, SyntheticSpread, Workpiece, simulate},
};

fn piece(zones: usize, mean_seconds: f64, seed: u64) -> Arc<Workpiece> {
    let spread = SyntheticSpread { mean_seconds, ..SyntheticSpread::default() };
    Arc::new(Workpiece::synthetic(zones, &spread, seed).expect("so many zones can be"))
}

fn run(piece: &Arc<Workpiece>, plan: &Plan) -> Outcome {
    simulate(piece, plan).unwrap_or_else(|error| panic!("seed {}: {error}", plan.seed))
}

/// Late, lost and doubled messages; agents, the Master too, that die and come back; cuts; orders that fail.
fn troubled(seed: u64) -> Plan {
    let mut random = Random::new(seed ^ 0x5eed);
    let mut crew: Crew = "2x1.0,1x0.5,1x2.0,1x0.33".parse().expect("a crew");
    crew.agents[4].joins = Duration::from_secs(seed % 6);
    let at = Duration::from_secs(4 + seed % 9);
    let kind = [IncidentKind::Slow(4.0), IncidentKind::Fail, IncidentKind::Leave][(seed % 3) as usize];
    crew.incidents.push(Incident { at, agent: (seed % 4) as usize, kind });
    let faults = Faults {
        latency_min: Duration::from_millis(1),
        latency_extra_mean: Duration::from_millis(40),
        loss: 0.15 * random.unit(),
        duplication: 0.15 * random.unit(),
        crash_every: (!seed.is_multiple_of(3)).then(|| Duration::from_secs(8)),
        down_max: Duration::from_secs(9),
        partition_every: (seed % 4 == 1).then(|| Duration::from_secs(12)),
        partition_max: Duration::from_secs(6),
        until: Time::since_start(Duration::from_secs(45)),
    };
    let auction = if seed.is_multiple_of(2) { AuctionRule::FinishingTime } else { AuctionRule::Paper };
    let trouble = Plan { faults, auction, master_may_crash: true, failures: 0.01, ..Plan::calm(crew, seed) };
    Plan { benchmark_error: 0.25, fetch: Duration::from_millis(50), ..trouble }
}

/// What goes wrong with agents that come back, over a thousand seeds, is in `sim`; here are those who do not.
#[test]
fn who_goes_for_good_takes_nothing_along() {
    let mut films = 0;
    for seed in 0..1_000 {
        let outcome = run(&piece(16, 1.0, seed), &troubled(seed));
        assert_eq!(outcome.failed, 0, "seed {seed}");
        films += outcome.films;
    }
    assert!(films > 1_040, "Masters died and were followed by others: {films} films");
}

#[test]
fn the_same_seed_gives_the_same_run() {
    let plan = Plan { trace: true, ..troubled(5) };
    let (first, second) = (run(&piece(16, 1.0, 5), &plan), run(&piece(16, 1.0, 5), &plan));
    assert_eq!((first.trace, first.spans), (second.trace, second.spans));
}

#[test]
fn a_thousand_unequal_agents_of_whom_some_fail_lose_a_tenth_at_most() {
    for seed in 0..2 {
        let mut crew: Crew = "250x0.5,250x1.0,250x2.0,250x4.0".parse().expect("a crew");
        let piece = piece(16_000, 20.0, seed);
        let until = crew.least_time(Duration::ZERO, piece.zone_seconds().sum()).expect("it can be painted");
        crew.fail_some(0.05, until, seed);
        let outcome = run(&piece, &Plan { benchmark_error: 0.25, ..Plan::calm(crew, seed) });
        let (efficiency, messages) = (outcome.efficiency(), outcome.messages_per_zone());
        eprintln!("seed {seed}: {:?}, efficiency {efficiency:.3}, {messages:.1} messages a zone", outcome.makespan);
        assert_eq!(outcome.failed, 0);
        assert!(efficiency >= 0.9, "seed {seed}: {efficiency}");
    }
}

#[test]
fn who_cannot_finish_is_told() {
    let crew: Crew = "1,agent-0@fail=3s".parse().expect("a crew");
    let error = simulate(&piece(16, 10.0, 1), &Plan::calm(crew, 1)).expect_err("nobody is left");
    assert!(matches!(error, SimulationError::Unfinished { zones: 16, .. }), "{error}");
}
