//! The farm in virtual time: unequal agents, a bad network, agents that die and come back.

mod directories;
mod hostile;
mod stage;

use crate::common::survey;

use std::time::Duration;

use bottega_agents::{AgentId, Time, driver::Faults};
use bottega_farm::{AuctionRule, FarmAgent, Goal};
use bottega_image::Rect;

use stage::{MachineWorld, Play, Scene, assert_whole, play, play_watched, troubled};

#[test]
fn every_zone_is_composed_once_whatever_goes_wrong() {
    let mut films = 0;
    for seed in 0..1000 {
        let play = play(seed, &troubled(seed), false);
        assert_whole(&play, seed);
        films += play.seen.borrow().films;
    }
    assert!(films > 340, "Masters died and were followed by others: {films} films");
}

/// The same with stealing: zones are dealt out, and agents take waiting zones from each other.
#[test]
fn every_zone_is_composed_once_where_agents_steal_whatever_goes_wrong() {
    for seed in 0..400 {
        let play = play(seed, &Scene { auction: AuctionRule::Stealing, ..troubled(seed) }, false);
        assert_whole(&play, seed);
    }
}

/// Agents answer in microseconds, and a row takes milliseconds to be written: agents that would answer the same are not called again.
#[test]
fn agents_are_not_called_again_and_again_while_rows_are_written() {
    let network = Faults { latency_min: Duration::from_micros(5), ..Faults::NONE };
    for store_latency in [0, 3, 30].map(Duration::from_millis) {
        for (seed, auction) in (0..12).flat_map(|seed| [(seed, AuctionRule::FinishingTime), (seed, AuctionRule::Paper)])
        {
            let faults = Faults { store_latency, ..network.clone() };
            let powers = [&[1.0, 1.0][..], &[1.0, 3.0], &[0.5, 1.0, 8.0]][seed as usize % 3];
            let scene = Scene { auction, faults, zones: 2 + seed as u32 % 7, samples: 8, ..Scene::calm(powers) };
            let play = play(seed, &scene, false);
            assert_whole(&play, seed);
            let seen = play.seen.borrow();
            let [rounds, awards] = [seen.rounds, seen.awards];
            assert!(
                rounds <= 4 * awards + 8,
                "seed {seed}, {auction:?}, {store_latency:?}: {rounds} rounds for {awards} awards"
            );
        }
    }
}

/// Number of zones that were painted again on request.
fn painted_again(play: &Play) -> Vec<Rect> {
    let seen = play.seen.borrow();
    let requeued = play.simulator.world().requeued.iter();
    let again = requeued.filter(|(zone, fence)| seen.zones[zone].result.is_some_and(|it| it.fence != **fence));
    again.map(|(zone, _)| seen.zones[zone].rect).collect()
}

#[test]
fn a_zone_that_is_wanted_again_is_painted_once_more_and_the_film_is_whole() {
    let mut again = 0;
    for seed in 0..200 {
        // These seeds have no agent that fails three times by chance and is left out; with a coarse survey one has.
        let play = play(seed, &Scene { requeues: 0.2, survey_shrink: 1, ..troubled(seed) }, false);
        assert_whole(&play, seed);
        again += painted_again(&play).len();
    }
    assert!(again > 200, "{again} zones were painted again");
    // Without faults the cost is minimal: a repeated request counts once.
    let scene = Scene { requeues: 0.3, zones: 16, samples: 512, shares_tail: false, ..Scene::calm(&[1.0, 2.0]) };
    let play = play(9, &scene, false);
    assert_whole(&play, 9);
    let cost = |rect: &Rect| MachineWorld::cost(rect, 512).as_secs_f64();
    let first: f64 = play.seen.borrow().zones.values().map(|row| cost(&row.rect)).sum();
    let again = painted_again(&play);
    let wanted = first + again.iter().map(cost).sum::<f64>();
    let painted = play.simulator.world().painted.as_secs_f64();
    assert!(again.len() > 1 && (painted / wanted - 1.0).abs() < 1e-6, "{} zones: {painted} {wanted}", again.len());
}

#[test]
fn unequal_agents_end_nearly_together() {
    let mut lines = Vec::new();
    for (name, powers) in [
        ("8 equal", vec![1.0; 8]),
        ("8 unequal", vec![0.25, 0.5, 0.5, 1.0, 1.0, 2.0, 4.0, 8.0]),
        ("1", vec![1.0]),
        ("64 unequal", (0..64).map(|i| [0.5, 1.0, 2.0, 4.0][i % 4]).collect()),
    ] {
        let zones = 8 * powers.len() as u32;
        let scene = Scene { zones: zones.max(16), samples: 2048, ..Scene::calm(&powers) };
        for auction in [AuctionRule::FinishingTime, AuctionRule::Paper, AuctionRule::Stealing] {
            let shares_tail = auction != AuctionRule::Paper;
            let play = play(7, &Scene { auction, shares_tail, ..scene.clone() }, true);
            assert_whole(&play, 7);
            let efficiency = play.lower_bound.as_secs_f64() / play.simulator.now().elapsed().as_secs_f64();
            let messages = play.simulator.trace().lines().filter(|line| line.contains("->")).count();
            let per_zone = messages as f64 / play.seen.borrow().zones.len() as f64;
            let makespan = play.simulator.now().elapsed().as_secs_f64();
            lines.push(format!(
                "{name}, {auction:?}: makespan {makespan:.1} s, efficiency {efficiency:.3}, {per_zone:.1} messages a zone"
            ));
            let least = match auction {
                AuctionRule::Paper => 0.2,
                AuctionRule::Stealing => 0.75,
                _ => 0.8,
            };
            assert!(efficiency > least, "{}", lines.join("\n"));
            assert!(per_zone < 40.0, "{}", lines.join("\n"));
        }
    }
    eprintln!("{}", lines.join("\n"));
}

#[test]
fn what_an_agent_that_becomes_slow_has_in_hand_is_taken_over() {
    let calm = Scene { zones: 16, samples: 2048, ..Scene::calm(&[1.0, 1.0, 1.0, 1.0]) };
    // Four equal agents need some 128 s; after 20 s one is twenty times slower.
    let slow = Scene { slows: Some((Duration::from_secs(20), 20.0)), ..calm.clone() };
    let alone = Scene { shares_tail: false, ..slow.clone() };
    let [calm, slow, alone] = [calm, slow, alone].map(|scene| {
        let play = play(11, &scene, false);
        assert_whole(&play, 11);
        play.simulator.now().elapsed().as_secs_f64()
    });
    eprintln!("{calm} {slow} {alone}");
    assert!(alone > 4.0 * calm, "without help all wait for the slow one: {alone} {calm}");
    // Three agents paint the rest, and one zone twice.
    assert!(slow < 1.6 * calm, "{slow} {calm}");
}

#[test]
fn an_agent_that_becomes_four_times_slower_is_known_after_three_zones() {
    let from = Time::since_start(Duration::from_secs(60));
    let scene = Scene { zones: 256, samples: 2048, slows: Some((from.elapsed(), 4.0)), ..Scene::calm(&[1.0, 2.0]) };
    let mut known = None;
    let agent = AgentId::new("agent-0");
    play_watched(5, &scene, |simulator| {
        let Some(FarmAgent::Render(it)) = simulator.machine(&agent) else { return };
        let now = simulator.now();
        if known.is_none() && now > from && (it.power().get() / 4.0 - 1.0).abs() < 0.3 {
            // Estimates have the error of the benchmark. Only zones that it began while slow are counted.
            let sittings = simulator.world().sittings.iter();
            let begun = sittings.filter(|((who, ..), (begin, end))| *who == agent && *begin >= from && *end <= now);
            known = Some(begun.count());
        }
    });
    assert!(known.is_some_and(|zones| zones <= 3), "known after {known:?} zones");
}

#[test]
fn a_work_with_an_error_stops_each_zone_when_it_has_it() {
    let scene = Scene { goal: Goal::Error(0.05), samples: 4096, ..Scene::calm(&[1.0, 2.0, 1.0]) };
    let play = play(4, &scene, false);
    assert_whole(&play, 4);
    for row in play.seen.borrow().zones.values() {
        // An error of 0.5 per sample is 0.05 with a hundred samples.
        let samples = row.result.unwrap().samples;
        assert!((100..160).contains(&samples) && row.error.unwrap() <= 0.05, "{samples}");
    }
}

#[test]
fn a_work_with_a_time_ends_within_a_twentieth_of_it() {
    for (seed, seconds, slows) in [(1, 20, None), (2, 120, None), (3, 60, Some((Duration::from_secs(15), 3.0)))] {
        let goal = Goal::Time(Duration::from_secs(seconds));
        let scene = Scene { goal, samples: 1 << 20, slows, ..Scene::calm(&[1.0, 0.5, 2.0, 1.0]) };
        let play = play(seed, &scene, false);
        assert_whole(&play, seed);
        let share = play.simulator.now().elapsed().as_secs_f64() / seconds as f64;
        assert!((0.95..1.05).contains(&share), "{seconds} s requested, {share} of it taken");
    }
}

#[test]
fn a_late_joiner_gets_zones_of_the_present_picture() {
    let scene = Scene { late: Duration::from_secs(10), samples: 1024, ..Scene::calm(&[1.0, 1.0]) };
    let play = play(3, &scene, false);
    assert_whole(&play, 3);
    let of_late = AgentId::new("agent-1");
    let zones = play.seen.borrow().zones.values().filter(|row| row.agent.as_ref() == Some(&of_late)).count();
    assert!(zones > 10, "{zones}");
}

#[test]
fn the_conversation_of_a_small_work_reads_as_the_paper_tells_it() {
    let scene = Scene { zones: 3, samples: 8, ..Scene::calm(&[1.0, 2.0]) };
    let play = play(1, &scene, true);
    assert_whole(&play, 1);
    let trace: Vec<String> = play.simulator.trace().lines().map(|line| line.trim_start().to_owned()).collect();
    let trace = trace.join("\n");
    expect_test::expect![[r#"
        [     0.000] master starts
        [     0.000] analyst starts
        [     0.000] agent-0 starts
        [     0.000] agent-1 starts
        [    21.000] agent-0 -> master  subscribe #0
        [    21.000] agent-1 -> master  subscribe #0
        [    22.000] master -> agent-0  agree #0
        [    22.000] master -> agent-1  agree #0
        [   104.000] analyst stops
        [   105.000] analyst -> master  inform #0
        [   105.000] master -> agent-0  inform #0
        [   105.000] master -> agent-1  inform #0
        [   107.000] master -> agent-0  request #3
        [   107.000] master -> agent-0  request #5
        [   107.000] master -> agent-1  request #7
        [   218.781] agent-0 -> master  inform #5
        [   221.781] master -> agent-0  confirm #5
        [   294.815] agent-0 -> master  inform #3
        [   295.815] master -> agent-0  cfp #11
        [   295.815] master -> agent-1  cfp #11
        [   296.815] agent-0 -> master  propose #11
        [   296.815] agent-1 -> master  propose #11
        [   297.815] master -> agent-0  confirm #3
        [   299.815] master -> agent-0  accept-proposal #11
        [   299.815] master -> agent-1  accept-proposal #11
        [   395.812] agent-1 -> master  inform #7
        [   398.812] master -> agent-1  confirm #7
        [   507.260] agent-1 -> master  inform #11
        [   508.260] master -> agent-1  cfp #18
        [   508.260] master -> agent-0  cfp #18
        [   509.260] agent-1 -> master  propose #18
        [   509.260] agent-0 -> master  propose #18
        [   510.260] master -> agent-1  confirm #11
        [   512.260] master -> agent-1  accept-proposal #18
        [   512.260] master -> agent-0  accept-proposal #18
        [   512.260] master -> agent-1  accept-proposal #18
        [   646.715] agent-0 -> master  inform #11
        [   649.715] master -> agent-0  confirm #11
        [   863.751] agent-1 -> master  inform #18
        [   866.751] master -> agent-1  confirm #18
        [   876.975] master -> agent-0  cfp #25
        [   876.975] master -> agent-1  cfp #25
        [   877.975] agent-0 -> master  propose #25
        [   877.975] agent-1 -> master  propose #25
        [   878.975] master -> agent-1  reject-proposal #25
        [   880.975] master -> agent-0  accept-proposal #25
        [   987.119] agent-0 -> master  inform #18
        [   990.119] master -> agent-0  confirm #18
        [  1021.000] agent-0 -> master  inform #0
        [  1021.000] agent-1 -> master  inform #0
        [  1096.554] agent-1 -> master  inform #18
        [  1097.554] master -> agent-1  cfp #32
        [  1097.554] master -> agent-0  cfp #32
        [  1098.554] agent-1 -> master  propose #32
        [  1098.554] agent-0 -> master  propose #32
        [  1099.554] master -> agent-1  confirm #18
        [  1099.554] master -> agent-0  reject-proposal #32
        [  1101.554] master -> agent-1  accept-proposal #32
        [  1177.214] master -> agent-0  cfp #35
        [  1177.214] master -> agent-1  cfp #35
        [  1178.214] agent-0 -> master  propose #35
        [  1178.214] agent-1 -> master  propose #35
        [  1179.214] master -> agent-1  reject-proposal #35
        [  1181.214] master -> agent-0  accept-proposal #35
        [  1254.625] agent-0 -> master  inform #25
        [  1257.625] master -> agent-0  confirm #25
        [  1421.133] agent-1 -> master  inform #32
        [  1424.133] master -> agent-1  confirm #32
        [  1489.205] agent-0 -> master  inform #35
        [  1492.205] master -> agent-0  confirm #35
        [  1492.205] master stops"#]]
    .assert_eq(&trace);
}

#[test]
#[ignore = "prints the run of one seed: SEED=7"]
fn one_seed() {
    let seed = std::env::var("SEED").map_or(7, |seed| seed.parse().unwrap());
    let play = play(seed, &troubled(seed), true);
    let trace = play.simulator.trace();
    let lines: Vec<&str> = trace.lines().collect();
    let informs = |line: &&&str| !line.ends_with("inform #0");
    lines.iter().filter(informs).take(2000).for_each(|line| eprintln!("{line}"));
    for row in play.seen.borrow().zones.values() {
        eprintln!("{row:?}");
    }
    eprintln!("now {:?} {:?}", play.simulator.now(), play.seen.borrow().finished);
}
