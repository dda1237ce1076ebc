//! Jobs that are steered, and requests that are refused.

use std::fs;

use serde_json::Value;

use super::{
    fixture::{FEW, Farm, PICTURE, bits, link},
    support::{servers, text},
};

#[test]
fn jobs_are_submitted_paused_resumed_cancelled_and_fetched() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    assert!(farm.render("a.exr", &["--detach"]).wait(), "{}", farm.logs());
    assert!(farm.render("b.exr", &["--detach", "--priority", "30"]).wait(), "{}", farm.logs());
    farm.succeed(&["jobs", "pause", "1"]);
    let _one = farm.join("one");
    farm.until_painted(2, 0.1);
    farm.until("the remaining time is known", || farm.job(2)["seconds_left"].as_f64() > Some(0.0));
    assert_eq!((farm.job(1)["machines"].as_u64(), farm.job(2)["machines"].as_u64()), (Some(0), Some(1)));
    farm.succeed(&["jobs", "pause", "2"]);
    farm.until("nobody paints it", || farm.job(2)["leader"].is_null());
    farm.succeed(&["jobs", "resume", "2"]);
    farm.until_state(2, "done");
    assert!(farm.job(2)["seconds_left"].is_null(), "nothing is left");
    let path = farm.path("b.exr");
    farm.succeed(&["jobs", "fetch", "2"]);
    assert!(bits(&path) == plain, "{}", farm.logs());
    // Its last rows, and the result of its auction.
    let zones = zones(&farm, "2");
    assert!(!zones.is_empty() && zones.iter().all(|zone| zone["state"] == "done" && zone["reasons"].is_null()));
    let society = &farm.job(2)["society"];
    // A single agent has no competitor, so there is no auction.
    let agents = society["agents"].as_array().map_or(0, Vec::len);
    let awards = society["auction"]["awards"].as_u64().unwrap_or_default();
    assert!(if agents > 1 { awards >= zones.len() as u64 / 2 } else { awards == 0 }, "{society}");
    assert!(society["agents"].as_array().is_some_and(|agents| !agents.is_empty()), "{society}");
    // What its machine has learnt stays with the farm, until it is forgotten.
    let agent = society["agents"][0]["agent"].as_str().expect("a name");
    let machine = agent.rsplit('@').next().and_then(|process| process.split('.').next()).expect("a machine");
    let learnt =
        || -> Value { serde_json::from_str(&farm.succeed(&["machines", "show", machine, "--json"])).expect("JSON") };
    // Its credit is written when it has given up the lead.
    farm.until("its credit is kept", || learnt()["reliability"].is_number());
    let learnt = learnt();
    let shown = farm.succeed(&["machines", "show", agent]);
    assert!(shown.starts_with(&format!("{machine}: ")), "an agent's name says which machine: {shown}");
    // The job was paused: each part with whole zones adds experience.
    assert!(
        learnt["jobs"].as_u64() >= Some(1) && learnt["factors"].as_array().is_some_and(|all| all.len() > 3),
        "{learnt}"
    );
    assert!(farm.log_of(2).contains("learnt: the times of zones, "), "{}", farm.log_of(2));
    let of_all: Value = serde_json::from_str(&farm.succeed(&["machines", "export", "all-machines"])).expect("JSON");
    assert_eq!(of_all["jobs"], learnt["jobs"]);
    farm.succeed(&["machines", "forget", machine]);
    assert!(!farm.run(&["machines", "show", machine]).status.success());
    assert!(!farm.run(&["jobs", "remove", "1"]).status.success(), "it is not over");
    farm.succeed(&["jobs", "cancel", "1"]);
    assert_eq!(farm.job(1)["state"], "cancelled");
    for (arguments, words) in [
        (["jobs", "fetch", "1"], "the job is cancelled"),
        (["jobs", "resume", "1"], "is over: cancelled"),
        (["jobs", "show", "7"], "has no job 7"),
    ] {
        let output = farm.run(&arguments);
        let stderr = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");
        assert!(output.status.code() == Some(1) && stderr.contains(words), "{arguments:?}: {stderr}");
    }
    // The submitter reports the whole picture, even if another one leads in the end.
    let notification = farm.path("notification.json");
    let mut asker = farm.render("c.exr", &["--on", &format!("done=cat > {}", text(&notification))]);
    farm.until_painted(3, 0.2);
    farm.succeed(&["jobs", "pause", "3"]);
    farm.until("nobody paints it", || farm.job(3)["leader"].is_null());
    farm.succeed(&["jobs", "resume", "3"]);
    assert!(asker.wait(), "{}", farm.logs());
    let event: Value =
        serde_json::from_str(&fs::read_to_string(&notification).expect("it was reported")).expect("JSON");
    assert!(event["zones"].as_u64() > Some(0) && event["zones_done"] == event["zones"], "{event}");
}

/// The rows of a job's zones, as `bottega blackboard` prints them.
fn zones(farm: &Farm, job: &str) -> Vec<Value> {
    let output = farm.succeed(&["blackboard", job, "--json"]);
    let rows = output.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    rows.filter(|row| row["event"] == "zone").collect()
}

#[test]
fn a_machine_that_brings_its_own_rules_paints_by_them() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let own = farm.path("own.fcl");
    let rules = include_str!("../../../../rules/paper.fcl");
    fs::write(&own, rules.replace("FUNCTION_BLOCK paper", "FUNCTION_BLOCK of_this_machine")).unwrap();
    let [line, _] = farm.lines();
    let _one = farm.spawn_in("state-of-one", &["join", &line, "--threads", "1", "--rules", text(&own)], "one");
    let dark = ["--detach", "--optimize", "b", "--exposure=-30"];
    assert!(farm.render("a.png", &dark).wait(), "{}", farm.logs());
    farm.until_state(1, "done");
    for zone in zones(&farm, "1") {
        let reasons = zone["reasons"].as_str().unwrap_or_default();
        assert!(reasons.starts_with("of_this_machine: "), "{zone}");
    }
    // The submitter is warned that nothing can be seen.
    assert!(farm.log_of(1).contains("the picture is nearly black"), "{}", farm.log_of(1));
}

#[test]
fn the_rules_of_the_one_who_asks_are_those_of_all() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let rules = include_str!("../../../../rules/path-tracing.fcl");
    // The strongest settings, so that other rules give another picture.
    let low = farm.path("low.fcl");
    fs::write(&low, rules.replace("samples IS VB", "samples IS VS").replace("samples IS B", "samples IS S")).unwrap();
    let more = ["--optimize", "b", "--rules", text(&low)];
    let plain = farm.path("plain.exr");
    farm.succeed(&[&["render", "goblets.glb", "-o", text(&plain), FEW], &PICTURE[..], &more].concat());
    let _one = farm.join("one");
    assert!(farm.render("a.exr", &[&more[..], &["--detach"]].concat()).wait(), "{}", farm.logs());
    farm.until_state(1, "done");
    farm.succeed(&["jobs", "fetch", "1"]);
    assert!(bits(&farm.path("a.exr")) == bits(&plain), "{}", farm.logs());
    assert!(bits(&plain) != farm.plain(), "the rules say something");
}

#[test]
fn impossible_commands_are_refused() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let [line, guest_line] = farm.lines();
    let wrong_secret = line.replacen("://t", "://t0123", 1).replacen(&line[14..18], "", 1);
    let wrong_server =
        line.replacen(&line[line.find('@').expect("an @") - 4..], &format!("0000@127.0.0.1:{}", farm.port), 1);
    let other = format!("nats://x@127.0.0.1:{}", farm.port);
    let as_guest = format!("--farm={guest_line}");
    let elsewhere = format!("--state={}", text(&farm.path("elsewhere")));
    for (arguments, code, words) in [
        (vec!["join", &wrong_secret], 1, "the line that it printed"),
        (vec!["join", &wrong_server], 1, "the line that it printed"),
        (vec!["join", &other], 1, "the line that it printed"),
        (vec!["join", &line[..40]], 2, "copy the whole line"),
        (vec!["join", &line, "--creds", "x"], 2, "leave out --creds"),
        (vec!["render", "goblets.glb", "-o", "/tmp/x.exr", &as_guest], 1, "may paint for the farm"),
        (vec!["jobs", "list", "--farm", &other, "--nkey", "/nowhere"], 1, "cannot read"),
        (vec!["join", "nats://127.0.0.1:1"], 1, "bottega up"),
        (vec!["join", "http://x"], 2, "an address such as"),
        (vec!["jobs", "list", "--farm", "nats://x@127.0.0.1:1/a b"], 1, "letters, digits"),
        (vec!["up", "--listen", "127.0.0.1:0", "--server", "/nowhere", &elsewhere], 1, "cannot start"),
        (vec!["render", "goblets.glb", "-o", "/tmp/x.exr", "--detach"], 2, "--farm"),
        (vec!["render", "goblets.glb", "-o", "/tmp/x.exr", "--verify", "2"], 2, "--farm"),
    ] {
        let output = farm.run(&arguments);
        let stderr = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");
        assert!(output.status.code() == Some(code) && stderr.contains(words), "{arguments:?}: {stderr}");
    }
    // A requirement that no machine meets is reported at once.
    let path = farm.path("tagged.exr");
    let words = ["render", "goblets.glb", "-o", text(&path), "--size", "32x24", "--farm", "--detach"];
    let submission = farm.run(&[&words[..], &["--require", "mars", "--require", "gpu"]].concat());
    for warning in [String::from_utf8_lossy(&submission.stderr).into_owned(), farm.log_of(1)] {
        let words = "is tagged `mars` and `gpu`: the job waits until one joins by `bottega join --tag mars --tag gpu`";
        assert!(submission.status.success() && warning.contains(words), "{warning}");
    }
    farm.succeed(&["jobs", "cancel", "1"]);
    assert!(farm.log_of(1).contains("cancelled by `bottega jobs` on "), "{}", farm.log_of(1));
    farm.succeed(&["jobs", "remove", "1"]);
    // A job of another version is left to other machines, with a message.
    let job = r#"{"version":"0.0.1","work":9,"scene":"s","output":"o.exr","from":"f","submitted":1,"priority":10,
        "state":"active","log":[]}"#;
    assert!(link(&farm).notices().update("job/9", job.as_bytes(), 0).expect("a notice").is_some());
    let _one = farm.join("one");
    farm.until_says("one", "install bottega 0.0.1 here");
    farm.until("it is in the log", || farm.log_of(9).contains("is left out: the job is for version 0.0.1"));
    // An entry that is not a job has no effect.
    assert!(link(&farm).notices().update("job/10", b"{", 0).expect("a notice").is_some());
    assert_eq!(farm.succeed(&["jobs", "list", "--json"]).lines().count(), 1);
}
