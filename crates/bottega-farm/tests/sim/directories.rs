//! Agents that register in the directories of their platform, and find their Master there.

use std::{collections::BTreeSet, time::Duration};

use bottega_agents::{AgentId, Key, Time, platform::LifeCycleState};
use bottega_farm::{FarmAgent, FarmValue, service_type};

use crate::sim::stage::{Play, SURVEY_SHRINK, Scene, assert_whole, bad_network, check, play, stage};

/// The content of the directories: the names of entries that hold text.
fn pages(play: &Play) -> BTreeSet<String> {
    let all = ["ams/agent/", "df/agent/"].map(Key::from);
    let held = all.iter().flat_map(|folder| play.simulator.store().with_prefix(folder));
    let names = held.filter(|entry| matches!(&entry.value, FarmValue::Page(text) if !text.is_empty()));
    names.map(|entry| entry.key.to_string()).collect()
}

fn page(play: &Play, key: &str) -> String {
    let key = Key::from(key);
    let mut found = play.simulator.store().with_prefix(&key);
    match found.next().map(|entry| entry.value.clone()) {
        Some(FarmValue::Page(text)) => text.to_string(),
        other => panic!("{key}: {other:?}"),
    }
}

fn run_for(play: &mut Play, seconds: f64) {
    let end = play.simulator.now() + Duration::from_secs_f64(seconds);
    let seen = std::rc::Rc::clone(&play.seen);
    play.simulator.run_while(end, |simulator| {
        check(simulator);
        seen.borrow().finished.is_none()
    });
}

/// Number of zones that an agent holds.
fn hands(play: &Play, agent: &str) -> usize {
    match play.simulator.machine(&AgentId::new(agent)) {
        Some(FarmAgent::Render(agent)) => agent.held_zones().count(),
        _ => 0,
    }
}

/// Changes the state of an agent through the AMS, as another process of the platform does.
fn change_state(play: &mut Play, agent: &str, from: LifeCycleState, to: LifeCycleState) {
    let key = format!("ams/agent/{agent}");
    let text = page(play, &key);
    let state = |state: LifeCycleState| format!(":state {}", state.word());
    assert!(text.contains(&state(from)), "{text}");
    play.simulator.put(key.into(), FarmValue::Page(text.replace(&state(from), &state(to)).into()));
}

#[test]
fn agents_register_find_their_master_subscribe_and_are_gone_from_the_pages_at_the_end() {
    let scene = Scene { zones: 3, samples: 8, directories: Some(Duration::ZERO), ..Scene::calm(&[1.0, 2.0]) };
    let mut play = stage(1, &scene, true);
    run_for(&mut play, 0.05);
    let names = ["agent-0", "agent-1", "analyst", "master"];
    let both = |name: &&str| ["ams", "df"].map(|which| format!("{which}/agent/{name}"));
    assert_eq!(pages(&play), names.iter().flat_map(both).collect());
    let offer = page(&play, "df/agent/master");
    for word in [
        service_type::MASTER,
        service_type::BLACKBOARD,
        service_type::MODEL_REPOSITORY,
        ":name job",
        "fipa-contract-net",
        "bottega-farm",
        "bottega-typed",
    ] {
        assert!(offer.contains(word), "{word}: {offer}");
    }
    let trace: Vec<String> = play.simulator.trace().lines().map(|line| line.trim_start().to_owned()).collect();
    let of_agent: Vec<&str> =
        trace.iter().filter(|line| line.contains("agent-0 ->")).map(|line| line[12..].trim()).collect();
    expect_test::expect![[r#"
        agent-0 -> start@bottega  request #1
        agent-0 -> ams@bottega  request #2
        agent-0 -> df@bottega  request #3
        agent-0 -> df@bottega  request #4
        agent-0 -> master  subscribe #0"#]]
    .assert_eq(&of_agent.join("\n"));
    run_for(&mut play, 100.0);
    assert_whole(&play, 1);
    let end = play.simulator.now() + Duration::from_millis(100);
    play.simulator.run_until(end);
    // The Analyst stays while its process has a part in the work.
    assert_eq!(pages(&play), both(&"analyst").into());
}

#[test]
fn who_is_not_in_the_directory_is_not_found() {
    let never = Scene { directories: Some(Duration::MAX), ..Scene::calm(&[1.0, 1.0]) };
    let mut play = stage(2, &never, true);
    run_for(&mut play, 60.0);
    assert!(play.seen.borrow().composed.is_empty());
    assert!(!play.simulator.trace().contains("subscribe"), "nobody subscribes to whom it has not found");
    let late = Scene { directories: Some(Duration::from_secs(60)), ..never };
    let play = self::play(2, &late, false);
    assert_whole(&play, 2);
    assert!(play.simulator.now() > Time::since_start(Duration::from_secs(60)));
}

#[test]
fn who_only_says_that_it_is_the_master_is_not_believed() {
    let scene = Scene { directories: Some(Duration::ZERO), ..Scene::calm(&[1.0]) };
    let mut play = stage(4, &scene, true);
    run_for(&mut play, 0.005);
    let offer = page(&play, "df/agent/master");
    // The false entry is listed before the true one.
    play.simulator.put("df/agent/a-liar".into(), FarmValue::Page(offer.replace(":name master", ":name a-liar").into()));
    run_for(&mut play, 3600.0);
    assert_whole(&play, 4);
    assert!(!play.simulator.trace().contains("-> a-liar"), "{}", play.simulator.trace());
}

#[test]
fn a_suspended_agent_hands_back_what_it_has_and_paints_again_when_it_is_resumed() {
    let scene = Scene { zones: 64, samples: 4096, directories: Some(Duration::ZERO), ..Scene::calm(&[1.0, 1.0, 1.0]) };
    let mut play = stage(3, &scene, false);
    run_for(&mut play, 30.0);
    assert!(hands(&play, "agent-1") > 0);
    change_state(&mut play, "agent-1", LifeCycleState::Active, LifeCycleState::Suspended);
    run_for(&mut play, 0.5);
    let held_by = |play: &Play| {
        let seen = play.seen.borrow();
        let is_its = |row: &&bottega_farm::ZoneRow| row.is_in_hand() && row.agent == Some(AgentId::new("agent-1"));
        seen.zones.values().filter(is_its).count()
    };
    assert_eq!((hands(&play, "agent-1"), held_by(&play)), (0, 0));
    let done = play.seen.borrow().composed.len();
    run_for(&mut play, 60.0);
    assert_eq!(hands(&play, "agent-1"), 0, "it stays away");
    assert!(play.seen.borrow().composed.len() > done, "the others go on");
    assert!(pages(&play).contains("df/agent/agent-1"), "it is still one of the agents");
    change_state(&mut play, "agent-1", LifeCycleState::Suspended, LifeCycleState::Active);
    run_for(&mut play, 5.0);
    assert!(hands(&play, "agent-1") > 0, "it paints again");
    run_for(&mut play, 3600.0);
    assert_whole(&play, 3);
}

#[test]
fn a_work_waits_while_all_are_suspended_and_goes_on_in_any_weather() {
    for seed in 0..200 {
        let scene = Scene {
            faults: bad_network(seed),
            directories: Some(Duration::from_millis(seed % 700)),
            master_may_crash: true,
            zones: 24,
            samples: 512,
            survey_shrink: SURVEY_SHRINK,
            ..Scene::calm(&[1.0, 0.5])
        };
        let mut play = stage(seed, &scene, false);
        run_for(&mut play, 20.0);
        let suspends = |play: &Play, agent: &str| {
            let key = format!("ams/agent/{agent}");
            pages(play).contains(&key) && page(play, &key).contains(":state active")
        };
        for agent in ["agent-0", "agent-1"] {
            if play.seen.borrow().finished.is_none() && suspends(&play, agent) {
                change_state(&mut play, agent, LifeCycleState::Active, LifeCycleState::Suspended);
            }
        }
        // Until the network works again, and all dead processes are back.
        run_for(&mut play, 60.0);
        for agent in ["agent-0", "agent-1"] {
            let key = format!("ams/agent/{agent}");
            if play.seen.borrow().finished.is_none()
                && pages(&play).contains(&key)
                && page(&play, &key).contains("suspended")
            {
                assert_eq!(hands(&play, agent), 0, "seed {seed}: {agent} is suspended, whatever befell it");
                change_state(&mut play, agent, LifeCycleState::Suspended, LifeCycleState::Active);
            }
        }
        run_for(&mut play, 3600.0);
        assert_whole(&play, seed);
    }
}
