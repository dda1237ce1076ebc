//! Works in virtual time, over many seeds: what must hold after every run is checked by [`simulate`] itself.

use std::{sync::Arc, time::Duration};

use bottega_agents::{
    Time,
    driver::{Faults, Random},
};
use bottega_farm::{
    AuctionRule, AuctionTally,
    simulate::{
        FarmSpec, Incident, IncidentKind, Plan, SimulationError, SimulationOutcome, SyntheticSpread, Workpiece,
        simulate,
    },
};

fn piece(zones: usize, mean_seconds: f64, seed: u64) -> Arc<Workpiece> {
    let spread = SyntheticSpread { mean_seconds, ..SyntheticSpread::default() };
    Arc::new(Workpiece::synthetic(zones, &spread, seed).expect("so many zones can be"))
}

fn run(piece: &Arc<Workpiece>, plan: &Plan) -> SimulationOutcome {
    simulate(piece, plan).unwrap_or_else(|error| panic!("seed {}: {error}", plan.seed))
}

/// Late, lost and doubled messages; agents, including the Master, that die and come back; cuts; orders that fail.
fn troubled(seed: u64) -> Plan {
    let mut random = Random::new(seed ^ 0x5eed);
    let mut farm: FarmSpec = "2x1.0,1x0.5,1x2.0,1x0.33".parse().expect("a farm");
    farm.agents[4].joins = Duration::from_secs(seed % 6);
    let at = Duration::from_secs(4 + seed % 9);
    let kind = [IncidentKind::Slow(4.0), IncidentKind::Fail, IncidentKind::Leave][(seed % 3) as usize];
    farm.incidents.push(Incident { at, agent: (seed % 4) as usize, kind });
    let faults = Faults {
        latency_min: Duration::from_millis(1),
        latency_extra_mean: Duration::from_millis(40),
        store_latency: Duration::ZERO,
        loss: 0.15 * random.unit(),
        duplication: 0.15 * random.unit(),
        crash_every: (!seed.is_multiple_of(3)).then(|| Duration::from_secs(8)),
        down_max: Duration::from_secs(9),
        partition_every: (seed % 4 == 1).then(|| Duration::from_secs(12)),
        partition_max: Duration::from_secs(6),
        until: Time::since_start(Duration::from_secs(45)),
    };
    let auction = if seed.is_multiple_of(2) { AuctionRule::FinishingTime } else { AuctionRule::Paper };
    let trouble = Plan { faults, auction, master_may_crash: true, failures: 0.01, ..Plan::calm(farm, seed) };
    Plan { benchmark_error: 0.25, fetch: Duration::from_millis(50), ..trouble }
}

/// Faults of agents that come back are tested in `sim`, over a thousand seeds; here are agents that do not.
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

/// Agents that hang while they send heartbeats, and agents of which most orders fail, among honest ones that
/// fail sometimes.
#[test]
fn who_hangs_or_breaks_is_left_out_and_nobody_else() {
    let (mut hung, mut broken) = (0, 0);
    for seed in 0..300 {
        let mut farm: FarmSpec = "3x1.0,1x0.5,2x1.0".parse().expect("a farm");
        let at = Duration::from_secs(seed % 7);
        farm.incidents.push(Incident { at, agent: 4, kind: IncidentKind::Hang });
        farm.incidents.push(Incident { at, agent: 5, kind: IncidentKind::Break(1.0) });
        let faults = Faults { loss: 0.05, latency_extra_mean: Duration::from_millis(20), ..Faults::NONE };
        let calm = Plan::calm(farm, seed);
        // Without takeovers, only missing progress detects the agent.
        let plan = Plan { faults, failures: 0.002, shares_tail: seed % 2 == 0, ..calm };
        let outcome = run(&piece(400, 2.0, seed), &plan);
        assert_eq!(outcome.failed, 0, "seed {seed}");
        for (index, agent) in outcome.agents.iter().enumerate() {
            assert!(index >= 4 || agent.left_out.is_none(), "seed {seed}: {agent:?}");
        }
        hung += u32::from(outcome.agents[4].left_out.is_some());
        broken += u32::from(outcome.agents[5].left_out.is_some());
    }
    assert!(hung > 150 && broken == 300, "{hung} {broken}");
}

#[test]
fn the_only_agent_is_not_left_out_and_failed_zones_are_reported() {
    let farm: FarmSpec = "1,agent-0@break=0s".parse().expect("a farm");
    let outcome = run(&piece(6, 1.0, 1), &Plan::calm(farm, 1));
    assert_eq!((outcome.failed, &outcome.agents[0].left_out), (6, &None));
    let farm: FarmSpec = "2,agent-0@break=0s,agent-1@break=0s".parse().expect("a farm");
    let outcome = run(&piece(6, 1.0, 1), &Plan::calm(farm, 1));
    assert_eq!(outcome.failed, 6);
    assert_eq!(outcome.agents.iter().filter(|agent| agent.left_out.is_some()).count(), 1);
}

/// Four honest agents of which one order in 500 fails (three in a row by chance would be left out), one that always lies, one that lies now and then, and one that begins to when it
/// is believed; on a bad network, under Masters that die.
#[test]
fn where_agents_are_compared_liars_are_left_out_and_what_they_painted_is_not_in_the_picture() {
    let (mut wrong, mut zones, mut caught) = (0, 0, [0; 3]);
    for seed in 0..200 {
        let mut farm: FarmSpec = "2x1.0,1x0.5,1x2.0,3x1.0".parse().expect("a farm");
        let lies = [(4, 0, 1.0), (5, 0, 0.2), (6, 60, 0.3)];
        for (agent, at, share) in lies {
            let at = Duration::from_secs(at);
            farm.incidents.push(Incident { at, agent, kind: IncidentKind::Lie(share) });
        }
        let faults = Faults {
            crash_every: (seed % 3 == 0).then(|| Duration::from_secs(20)),
            down_max: Duration::from_secs(3),
            loss: 0.05,
            duplication: 0.05,
            latency_extra_mean: Duration::from_millis(20),
            until: Time::since_start(Duration::from_secs(100)),
            ..Faults::NONE
        };
        let calm = Plan::calm(farm, seed);
        let verify = 2 + (seed % 2) as u32;
        // Every second farm has engines of which no two give the same bits.
        let inexact = seed / 2 % 2 == 1;
        let plan = Plan { faults, failures: 0.002, verify, inexact, master_may_crash: true, ..calm };
        let outcome = run(&piece(300, 2.0, seed), &plan);
        assert_eq!(outcome.failed, 0, "seed {seed}");
        assert!(!outcome.lacked_machines || seed % 3 == 0, "seed {seed}");
        for (index, agent) in outcome.agents.iter().enumerate() {
            assert!(index >= 4 || agent.left_out.is_none(), "seed {seed}: {agent:?}");
        }
        for (count, agent) in caught.iter_mut().zip(&outcome.agents[4..]) {
            *count += usize::from(agent.left_out.is_some());
        }
        (wrong, zones) = (wrong + outcome.wrong, zones + outcome.zones);
    }
    eprintln!("{wrong} of {zones} zones are wrong; caught {caught:?} of 200");
    assert_eq!(caught[0], 200);
    assert!(caught[1] >= 199 && caught[2] >= 190, "{caught:?}");
    // Wrong zones came from a believed agent that was not found: `simulate` has checked this.
    assert!(f64::from(wrong as u32) < 1e-3 * zones as f64, "{wrong} of {zones}");
}

#[test]
fn honest_agents_are_believed_after_a_while_and_then_comparing_costs_little() {
    let farm = || FarmSpec::equal(8);
    let piece = piece(2_000, 2.0, 3);
    let alone = run(&piece, &Plan::calm(farm(), 3));
    let compared = run(&piece, &Plan { verify: 2, ..Plan::calm(farm(), 3) });
    assert_eq!((compared.wrong, compared.failed, compared.lacked_machines), (0, 0, false));
    let ratio = compared.makespan.as_secs_f64() / alone.makespan.as_secs_f64();
    eprintln!("two of each at first: {ratio:.3} of the time");
    assert!(ratio < 1.35, "{ratio}");
}

#[test]
fn an_agent_without_others_to_compare_is_reported() {
    let plan = Plan { verify: 3, ..Plan::calm(FarmSpec::equal(2), 1) };
    let error = simulate(&piece(4, 1.0, 1), &plan).expect_err("two are not three");
    assert!(matches!(error, SimulationError::Unfinished { painted: 0, .. }), "{error}");
    // When the third agent joins, the work continues.
    let mut farm = FarmSpec::equal(3);
    farm.agents[2].joins = Duration::from_secs(30);
    let outcome = run(&piece(4, 1.0, 1), &Plan { verify: 3, ..Plan::calm(farm, 1) });
    assert!(outcome.lacked_machines && outcome.makespan > Duration::from_secs(30), "{outcome:?}");
}

#[test]
fn a_thousand_unequal_agents_of_whom_some_fail_lose_a_tenth_at_most() {
    for seed in 0..2 {
        let mut farm: FarmSpec = "250x0.5,250x1.0,250x2.0,250x4.0".parse().expect("a farm");
        let piece = piece(16_000, 20.0, seed);
        let until = farm.least_time(Duration::ZERO, piece.zone_seconds().sum()).expect("it can be painted");
        farm.fail_some(0.05, until, seed);
        let outcome = run(&piece, &Plan { benchmark_error: 0.25, ..Plan::calm(farm, seed) });
        let (efficiency, messages) = (outcome.efficiency(), outcome.messages_per_zone());
        eprintln!("seed {seed}: {:?}, efficiency {efficiency:.3}, {messages:.1} messages a zone", outcome.makespan);
        assert_eq!(outcome.failed, 0);
        assert!(efficiency >= 0.9, "seed {seed}: {efficiency}");
    }
}

#[test]
fn a_work_that_cannot_finish_is_reported() {
    let farm: FarmSpec = "1,agent-0@fail=3s".parse().expect("a farm");
    let error = simulate(&piece(16, 10.0, 1), &Plan::calm(farm, 1)).expect_err("nobody is left");
    assert!(matches!(error, SimulationError::Unfinished { zones: 16, .. }), "{error}");
}

/// A bidder for the last zone that another agent is expected to finish sooner is called again when that one has ended, not at the next
/// heartbeat, which comes each second.
#[test]
fn a_short_work_does_not_wait_for_a_heartbeat() {
    for (seed, spec) in (0..300).flat_map(|seed| [(seed, "4"), (seed, "2x0.5,2x1.0,1x3.0")]) {
        for auction in [AuctionRule::FinishingTime, AuctionRule::Paper] {
            let farm: FarmSpec = spec.parse().expect("a farm");
            let spread = SyntheticSpread { mean_seconds: 0.05, profiling: 0.2, ..SyntheticSpread::default() };
            let piece = Arc::new(Workpiece::synthetic(12, &spread, seed).expect("so many zones can be"));
            let least = farm.least_time(Duration::ZERO, piece.zone_seconds().sum()).expect("it can be painted");
            let outcome = run(&piece, &Plan { auction, ..Plan::calm(farm, seed) });
            let late = outcome.makespan.saturating_sub(least);
            assert!(late < Duration::from_millis(700), "seed {seed}, {spec}, {auction:?}: {late:?} after {least:?}");
        }
    }
}

/// With slow messages no agent waits for a round.
#[test]
fn who_steals_is_done_sooner_than_who_bids_where_the_way_is_long() {
    let took = |auction: AuctionRule| -> f64 {
        let sum = (0..10).map(|seed| {
            let faults = Faults { latency_min: Duration::from_millis(50), ..Faults::NONE };
            let plan = Plan { auction, faults, ..Plan::calm(FarmSpec::equal(8), seed) };
            let outcome = run(&piece(200, 0.2, seed), &plan);
            assert_eq!(outcome.rounds.is_empty(), auction == AuctionRule::Stealing);
            assert_eq!(outcome.thefts.is_empty(), auction != AuctionRule::Stealing);
            outcome.makespan.as_secs_f64()
        });
        sum.sum()
    };
    let [stealing, bidding] = [AuctionRule::Stealing, AuctionRule::FinishingTime].map(took);
    eprintln!("{stealing:.1} s by stealing, {bidding:.1} s by auctions");
    assert!(stealing < 0.75 * bidding, "{stealing} {bidding}");
}

/// A third of the agents promise twice their speed: their clocks are too slow. It is their second work, so their
/// credit is known.
#[test]
fn credit_finds_out_who_promises_more_than_it_holds() {
    let works = 40;
    let mut sums = [[0.0; 2]; 2];
    for seed in 0..works {
        let mut farm = FarmSpec::equal(9);
        for agent in [0, 3, 6] {
            farm.incidents.push(Incident { at: Duration::ZERO, agent, kind: IncidentKind::Boast(2.0) });
        }
        let spread = SyntheticSpread { zones: 0.3, ..SyntheticSpread::default() };
        let piece = |seed| Arc::new(Workpiece::synthetic(18, &spread, seed).expect("so many zones can be"));
        for (sums, auction) in sums.iter_mut().zip([AuctionRule::FinishingTime, AuctionRule::Promised]) {
            let plan = Plan { auction, ..Plan::calm(farm.clone(), seed) };
            let first = run(&piece(seed), &plan);
            let second = run(&piece(seed + works), &Plan { credits: Arc::new(first.credits()), ..plan });
            sums[0] += first.makespan.as_secs_f64();
            sums[1] += second.makespan.as_secs_f64();
            let is_boaster = |index: usize| index.is_multiple_of(3);
            for (index, agent) in second.agents.iter().enumerate() {
                let reliability = agent.credit.reliability();
                let right = if is_boaster(index) { 0.4..0.75 } else { 0.75..2.01 };
                assert!(right.contains(&reliability), "seed {seed}, agent-{index}: {reliability}");
            }
        }
    }
    let [believed_by_credit, at_their_word] = sums;
    let [first, second] = [0, 1].map(|work| at_their_word[work] / believed_by_credit[work]);
    eprintln!("at their word they take {first:.3} of the time in their first work, {second:.3} in their second");
    assert!(first > 1.0 && second > 1.1, "{first} {second}");
}

#[test]
fn rounds_have_several_bidders_and_little_time_is_lost_by_them() {
    for spec in ["8", "2x0.5,4x1.0,2x2.0"] {
        let (mut contested, mut efficiency) = (0.0, 0.0);
        for seed in 0..10 {
            let outcome = run(&piece(64, 1.0, seed), &Plan::calm(spec.parse().expect("a farm"), seed));
            contested += AuctionTally::contested_of_first_half(&outcome.rounds) / 10.0;
            efficiency += outcome.efficiency() / 10.0;
            assert!(outcome.rounds.iter().all(|round| round.bidders <= round.called && round.bids >= round.bidders));
        }
        eprintln!("{spec}: {contested:.2} of the first half contested, efficiency {efficiency:.3}");
        assert!(contested >= 0.5 && efficiency >= 0.95, "{spec}: {contested} {efficiency}");
    }
}

/// Two to four unequal machines: agents with full hands are called, too, and bid for a zone to paint later.
#[test]
fn in_a_small_society_most_rounds_have_several_bidders_and_zones_are_outbid() {
    for spec in ["1x1.0,1x0.5", "1x1.0,1x0.25", "1x1.0,1x0.5,1x0.25", "1x4.0,2x1.0", "2x1.0,1x0.5,1x0.25"] {
        let (mut contested, mut efficiency, mut outbid, mut works) = (0.0, 0.0, 0, 0);
        for (seed, zones) in (0..12).map(|seed| (seed, [16, 64, 200][seed as usize % 3])) {
            let latency_min = Duration::from_micros([500, 5_000][seed as usize / 3 % 2]);
            let faults = Faults { latency_min, store_latency: latency_min / 2, ..Faults::NONE };
            let plan = Plan { faults, benchmark_error: 0.1, ..Plan::calm(spec.parse().expect("a farm"), seed) };
            let outcome = run(&piece(zones, 1.0, seed), &plan);
            contested += AuctionTally::contested_of_first_half(&outcome.rounds);
            outbid += AuctionTally::of(&outcome.rounds).outbid;
            efficiency += outcome.efficiency();
            works += 1;
        }
        let [contested, efficiency] = [contested, efficiency].map(|sum| sum / f64::from(works));
        eprintln!(
            "{spec}: {contested:.2} of the first half contested, {outbid} zones outbid, efficiency {efficiency:.3}"
        );
        assert!(contested >= 0.75 && outbid > 60 && efficiency >= 0.93, "{spec}: {contested} {outbid} {efficiency}");
    }
}

#[test]
fn a_single_agent_has_no_auction() {
    let outcome = run(&piece(64, 1.0, 1), &Plan::calm(FarmSpec::equal(1), 1));
    assert!(outcome.rounds.is_empty(), "{:?}", outcome.rounds);
}

/// An agent that reads the scene while it profiles its first zone, and reports that as painting: seen with a stranger's Mitsuba, which
/// gained 128 s of credit in a picture of 25 s.
#[test]
fn who_takes_loading_for_painting_gains_no_more_than_its_zones_are_worth() {
    for seed in 0..40 {
        let farm: FarmSpec = "3x1.0,1x1.0,agent-3@load=0s:7".parse().expect("a farm");
        let piece = piece(24, 3.0, seed);
        let outcome = run(&piece, &Plan::calm(farm, seed));
        let all: f64 = piece.zone_seconds().sum();
        let gained = outcome.agents[3].credit.sum;
        // T_est of the zone was some 130 s too long: the credit is one zone at most.
        assert!(gained < 3.0 * all / 24.0, "seed {seed}: {gained} s");
    }
}

#[test]
fn whatever_rules_are_simulated_nothing_is_painted_in_less_than_the_least_time() {
    for seed in 0..40 {
        let farm: FarmSpec = ["1", "4", "3x1.0,1x0.25", "8:2"][seed as usize % 4].parse().expect("a farm");
        let outcome = run(&piece(60, 1.0, seed), &Plan::calm(farm, seed));
        assert!(outcome.efficiency() <= 1.0, "seed {seed}: {}", outcome.efficiency());
    }
}

/// Ten pictures: of many zones and few, by equal machines and unequal ones, one that comes late, one that becomes slow, one that promises
/// too much, agents that share a machine.
#[test]
fn the_time_left_is_known_within_a_third_from_a_tenth_on_in_eight_of_ten_pictures() {
    let specs = [
        "2",
        "4",
        "8",
        "3x1.0,1x0.25",
        "2x1:4",
        "1x2.0,2x0.5",
        "4,agent-3@join=8s",
        "4,agent-0@boast=0s:2",
        "3,agent-1@slow=20s:3",
        "6x1.0,2x0.33",
    ];
    let mut good = 0;
    for (seed, spec) in (0..).zip(specs) {
        let mut farm: FarmSpec = spec.parse().expect("a farm");
        if seed == 5 {
            // Processes of one machine say that each has it for itself.
            let shared = FarmSpec::sharing(3, 1);
            farm.machines = shared.machines;
            farm.agents.iter_mut().for_each(|agent| agent.machine = 0);
        }
        let zones = [24, 40, 64, 120][seed as usize % 4];
        let plan = Plan { tells_time_left: true, benchmark_error: 0.2, ..Plan::calm(farm, seed) };
        let outcome = run(&piece(zones, 2.0, seed), &plan);
        let worst = outcome.worst_time_left(0.1).expect("it was estimated");
        eprintln!("{seed}: wrong by {worst:.2} at most");
        assert!(outcome.times_left.iter().all(|estimate| !estimate.said.is_zero()), "seed {seed}");
        good += u32::from(worst <= 1.3);
    }
    assert!(good >= 8, "{good} of 10");
}
