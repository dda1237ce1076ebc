//! A farm of real processes on real NATS servers: the same bits, whichever machines paint and die.
//!
//! The servers are those that `BOTTEGA_NATS_SERVERS` names, or the system's. Without one the tests say that they are
//! skipped.

mod agents;
mod arrivals;
mod builds;
mod energy;
mod engines;
mod fixture;
mod guests;
#[path = "../../../bottega-agents/tests/support/mod.rs"]
mod jade;
mod jobs;
mod others;
mod owner;
mod platform;
mod ports;
mod requests;
mod room;
mod strangers;
mod web;

use crate::support;

use std::{
    collections::{BTreeMap, BTreeSet},
    thread,
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::NatsUplink;
use bottega_farm::FarmCodec;
use fixture::{FEW, Farm, MANY, PICTURE, Process, bits, link, painted};
use serde_json::Value;
use support::{servers, text};

#[test]
fn three_machines_and_any_server_give_the_bits_of_one() {
    for server in servers() {
        let farm = Farm::start(&server);
        let plain = farm.plain();
        let (mut one, mut two) = (farm.join("one"), farm.join("two"));
        assert!(farm.render("a.exr", &[]).wait(), "{}", farm.logs());
        assert!(bits(&farm.path("a.exr")) == plain, "{server:?}: {}", farm.logs());
        assert!(!farm.path("a.exr.bottega-journal").exists());
        assert_eq!(farm.job(1)["state"], "done");
        assert!(one.end() && two.end(), "{}", farm.logs());
        for machine in ["one", "two"] {
            assert!(painted(&farm.said(machine)) > 0.1, "{server:?}: {}", farm.logs());
        }
        // What was kept for it has gone; what a machine put there after the end, when somebody asks for the next one.
        assert!(farm.render("b.exr", &["--detach"]).wait(), "{}", farm.logs());
        let uplink = link(&farm);
        let left = uplink.payloads().folders();
        assert!(left.is_empty(), "{left:?}");
    }
}

#[test]
fn machines_that_are_compared_give_the_same_bits_and_one_alone_waits_for_another() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    let (path, is_loud) = (farm.path("a.exr"), |word: &&&str| **word != "--quiet");
    let words =
        ["render", "goblets.glb", "-o", text(&path), "--threads", "1", "--farm", FEW, "--verify", "2", "--json"];
    let words: Vec<&str> = words.iter().chain(PICTURE.iter().filter(is_loud)).copied().collect();
    let mut asker = farm.spawn(&words, "a.exr.log");
    farm.until_says("a.exr.log", "cannot compare the results of machines: 1 of 2 machines are present");
    assert!(!farm.path("a.exr").exists());
    let (mut one, mut two) = (farm.join("one"), farm.join("two"));
    assert!(asker.wait(), "{}", farm.logs());
    assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
    assert!(!farm.said("a.exr.log").contains("left out"), "{}", farm.logs());
    assert!(one.end() && two.end(), "{}", farm.logs());
}

#[test]
fn all_machines_cast_photons_and_agents_and_after_any_kill_the_bits_are_those_of_one() {
    /// Photons and agents are the same for any number of machines.
    const SAMPLES: &str = "--spp=64";
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let ways: [&[&str]; 2] = [
        &["--integrator", "photon", "--set", "photons.count=400000"],
        &["--integrator", "ala", "--set", "lighting_agents.cast=30000"],
    ];
    let (mut one, mut two) = (farm.join("one"), farm.join("two"));
    let uplink = link(&farm);
    for (number, way) in (1..).zip(ways) {
        let path = farm.path("alone.exr");
        farm.succeed(&[&["render", "goblets.glb", "-o", text(&path), SAMPLES], &PICTURE[..], way].concat());
        let before = parts_taken(&uplink);
        let mut asker = farm.render_by("a.exr", SAMPLES, way);
        hold_until_all_cast(&farm, &uplink, &before, &[(None, &asker), (Some("one"), &one), (Some("two"), &two)]);
        for process in [&asker, &one] {
            process.signal("-CONT");
        }
        if number == 1 {
            two.signal("-CONT");
        } else {
            two.kill();
        }
        assert!(asker.wait(), "{}", farm.logs());
        assert!(bits(&farm.path("a.exr")) == bits(&path), "{way:?}: {}", farm.logs());
        let log = farm.log_of(number);
        let shares: Vec<u32> = log
            .lines()
            .filter_map(|line| line.split_once(" did ")?.1.split_once(" of ")?.0.parse().ok())
            .filter(|&share| share > 0)
            .collect();
        assert!(shares.len() >= 2, "{way:?}: {log}");
    }
    // What was kept for them has gone; what a machine put there after the end, when somebody asks for the next one.
    assert!(farm.render("b.exr", &["--detach"]).wait(), "{}", farm.logs());
    assert!(parts_taken(&link(&farm)).is_empty());
    assert!(one.end(), "{}", farm.logs());
}

/// The parts of work before a picture that were taken, with their machines.
fn parts_taken(uplink: &NatsUplink<FarmCodec>) -> BTreeMap<String, String> {
    let parts = uplink.notices().all("cast/").into_iter();
    parts
        .filter_map(|part| {
            let notice: Value = serde_json::from_slice(&part.text).ok()?;
            Some((part.name, notice["by"].as_str()?.to_owned()))
        })
        .collect()
}

/// Stops each process at its first part until all have one, so that no process does all of them, however fast it is.
///
/// - `before`: parts of pictures that are painted.
/// - `processes`: each with the log that has its name; that of the process that asks has none.
fn hold_until_all_cast(
    farm: &Farm,
    uplink: &NatsUplink<FarmCodec>,
    before: &BTreeMap<String, String>,
    processes: &[(Option<&str>, &Process)],
) {
    let names: Vec<Option<String>> = processes.iter().map(|(log, _)| log.map(|log| farm.name_of(log))).collect();
    let mut held = BTreeSet::new();
    farm.until("each takes a part", || {
        let parts = parts_taken(uplink);
        for by in parts.iter().filter(|(part, _)| !before.contains_key(*part)).map(|(_, by)| by) {
            let number = names.iter().position(|name| name.as_ref() == Some(by));
            let number = number.or_else(|| names.iter().position(Option::is_none)).expect("one of them");
            if held.insert(number) {
                processes[number].1.signal("-STOP");
            }
        }
        held.len() == processes.len()
    });
}

#[test]
fn a_machine_that_is_killed_costs_time_and_no_pixel() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    let (mut one, _two) = (farm.join("one"), farm.join("two"));
    let mut render = farm.render("a.exr", &[]);
    farm.until_painted(1, 0.2);
    one.kill();
    assert!(render.wait(), "{}", farm.logs());
    assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
}

#[test]
fn when_the_one_who_leads_is_killed_another_goes_on_with_what_is_painted() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start_alone(&server);
    let plain = farm.plain();
    let (_one, _two) = (farm.join("one"), farm.join("two"));
    let mut render = farm.render("a.exr", &[]);
    farm.until_painted(1, 0.3);
    let before = farm.job(1)["zones_done"].as_u64().expect("a number");
    render.kill();
    let killed = Instant::now();
    farm.until("somebody else leads", || farm.log_of(1).matches(" leads").count() == 2);
    assert!(killed.elapsed() < Duration::from_secs(5), "{:?}", killed.elapsed());
    farm.until("it knows what is painted", || farm.job(1)["zones_done"].as_u64() >= Some(before));
    farm.until_state(1, "done");
    let path = farm.path("b.exr");
    farm.succeed(&["jobs", "fetch", "1", "-o", text(&path)]);
    assert!(bits(&path) == plain, "{}", farm.logs());
    // The journal is removed when the picture is complete; that of another picture stays.
    let journals = ["a.exr.bottega-journal", "b.exr.bottega-journal"].map(|name| farm.path(name));
    std::fs::write(&journals[1], "another").expect("a journal");
    assert!(journals[0].exists(), "it was killed");
    for name in ["a.exr", "b.exr"] {
        farm.succeed(&["jobs", "fetch", "1", "-o", text(&farm.path(name))]);
    }
    assert!(!journals[0].exists() && journals[1].exists());
    assert_eq!(farm.job(1)["machines"], 0, "a machine that was killed paints nothing that is over");
    farm.succeed(&["jobs", "remove", "1"]);
    assert!(farm.succeed(&["jobs", "list", "--json"]).is_empty());
}

#[test]
fn when_the_server_goes_all_wait_and_go_on_when_it_is_back() {
    let Some(server) = servers().pop() else { return };
    let mut farm = Farm::start(&server);
    let plain = farm.plain();
    let _one = farm.join("one");
    let mut render = farm.render("a.exr", &[]);
    farm.until_painted(1, 0.2);
    assert!(farm.up.take().expect("a server").end());
    // Longer than leases last.
    thread::sleep(Duration::from_secs(10));
    farm.up();
    assert!(render.wait(), "{}", farm.logs());
    assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
}

#[test]
fn the_picture_has_the_same_bits_though_processes_are_killed_every_few_seconds() {
    /// Kills each machine once, and the server and `bottega up` as often as all of them: if a machine takes longer to restart than the next
    /// one keeps running, nothing is ever painted.
    const KILLED_MAX: usize = 9;
    let Some(server) = servers().pop() else { return };
    let mut farm = Farm::start(&server);
    let plain = farm.plain_by(MANY);
    let mut machines = [farm.join("m0"), farm.join("m1"), farm.join("m2")];
    assert!(farm.render_by("a.exr", MANY, &["--detach"]).wait(), "{}", farm.logs());
    let mut killed = Vec::new();
    for turn in 0..KILLED_MAX {
        // Wait for progress, not for time: so some work is left to disturb on any machine. But after some seconds
        // kill the next one, because a process may lose the same work each time.
        let (begun, share) = (Instant::now(), 0.15 * (turn + 1) as f64);
        let mut job = Value::Null;
        while begun.elapsed() < Duration::from_secs(3) && job["state"] != "done" && job["done"].as_f64() < Some(share) {
            thread::sleep(Duration::from_millis(50));
            let shown = farm.run(&["jobs", "show", "1", "--json"]);
            job = serde_json::from_slice(&shown.stdout).unwrap_or_default();
        }
        if job["state"] == "done" {
            break;
        }
        match turn % 3 {
            0 => {
                let leader = job["leader"].as_str().unwrap_or_default().to_owned();
                killed.push(format!("machine, while {leader} led"));
                let next = turn / 3 % 3;
                machines[next].kill();
                machines[next] = farm.join(&format!("m{next}-{turn}"));
            }
            1 => {
                killed.push("server".to_owned());
                farm.kill_server();
            }
            _ => {
                killed.push("up".to_owned());
                farm.up = None;
                farm.up();
            }
        }
    }
    assert!(killed.len() >= 2, "it was painted too soon: {killed:?}");
    farm.until_state(1, "done");
    let path = farm.path("a.exr");
    farm.succeed(&["jobs", "fetch", "1"]);
    assert!(bits(&path) == plain, "{}", farm.logs());
}

#[test]
fn what_a_machine_that_was_stopped_for_a_while_brings_is_refused_and_painted_by_others() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain_by(MANY);
    let one = farm.join("one");
    let trace = farm.path("trace");
    let mut render = farm.render_by("a.exr", MANY, &["--trace", text(&trace)]);
    // At first it holds several short orders: some of them are done before it learns that they are not
    // valid any more.
    let confirmed = format!("@{} Confirm", farm.name_of("one"));
    farm.until("it has carried out an order", || farm.said("trace").contains(&confirmed));
    one.signal("-STOP");
    // Longer than a machine may be silent.
    thread::sleep(Duration::from_secs(4));
    assert_eq!(farm.job(1)["state"], "active", "it was painted too soon to disturb it");
    one.signal("-CONT");
    assert!(render.wait(), "{}", farm.logs());
    let refused = "the order is no longer valid";
    let is_refused = |line: &str| line.contains("Disconfirm") && line.contains(refused);
    assert!(farm.said("trace").lines().any(is_refused), "{}", farm.logs());
    assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
}

#[test]
fn a_leader_that_was_stopped_for_a_while_finds_another_and_does_no_harm() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    let _one = farm.join("one");
    let mut render = farm.render("a.exr", &[]);
    farm.until_painted(1, 0.2);
    render.signal("-STOP");
    farm.until("another one leads", || farm.log_of(1).matches(" leads").count() == 2);
    render.signal("-CONT");
    assert!(render.wait(), "{}", farm.logs());
    assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
}

#[test]
fn an_animation_has_the_pictures_of_its_frames() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let (_one, _two) = (farm.join("one"), farm.join("two"));
    let alone = farm.path("alone-##.exr");
    let picture = ["--size", "48x36", "--spp", "64", "--quiet"];
    let frames = ["render", "goblets.glb", "--frames", "3..6", "--fps", "12"];
    farm.succeed(&[&frames[..], &picture, &["-o", text(&alone)]].concat());
    let together = farm.path("together.exr");
    farm.succeed(&[&frames[..], &picture, &["-o", text(&together), "--farm", "--threads", "1"]].concat());
    for frame in 3..=6 {
        let alone = bits(&farm.path(&format!("alone-{frame:02}.exr")));
        assert!(bits(&farm.path(&format!("together.{frame:04}.exr"))) == alone, "{frame}: {}", farm.logs());
    }
    assert!(farm.succeed(&["jobs", "list", "--json"]).is_empty(), "nobody needs the jobs any more");
    farm.until_says("one", "done");
}
