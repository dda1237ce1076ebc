//! A run is recorded and run again in virtual time.

use std::fs;

use crate::program::support::{run, succeed, text};
use serde_json::Value;

fn simulate(arguments: &[&str]) -> Value {
    let json = succeed(&[&["simulate", "--json"], arguments].concat());
    serde_json::from_str(&json).expect("one JSON object")
}

fn number(value: &Value, field: &str) -> f64 {
    value[field].as_f64().unwrap_or_else(|| panic!("no number `{field}` in {value}"))
}

#[test]
fn a_recorded_run_is_replayed_with_other_agents() {
    let folder = tempfile::tempdir().expect("a folder");
    let [picture, record, gantt, trace] =
        ["a.png", "run.json", "gantt.svg", "trace.txt"].map(|name| folder.path().join(name));
    let painted =
        ["render", "goblets.glb", "-o", text(&picture), "--size", "96x72", "--spp", "40", "--set", "work.zones=12"];
    let recorded = ["--quiet", "--agents", "2", "--threads", "2", "--record", text(&record)];
    succeed(&[&painted[..], &recorded[..]].concat());

    let one = simulate(&[text(&record), "--agents", "1"]);
    let zones = number(&one, "zones");
    assert!((8.0..=16.0).contains(&zones), "{zones}");
    let four = simulate(&[text(&record), "--agents", "4", "-o", text(&gantt), "--trace", text(&trace)]);
    assert_eq!(number(&one, "work_seconds"), number(&four, "work_seconds"));
    assert!(number(&four, "makespan_seconds") < number(&one, "makespan_seconds"));
    assert!(number(&four, "makespan_seconds") >= number(&four, "least_seconds"));
    assert!(fs::read_to_string(&gantt).expect("a drawing").contains("agent-3"));
    assert!(fs::read_to_string(&trace).expect("a trace").contains("agent-3 -> master  subscribe"));
    let finer = simulate(&[text(&record), "--agents", "4", "--zones-scale", "3"]);
    assert_eq!(number(&finer, "zones"), 3.0 * zones);

    // A failing agent is left out, unless it is the only one.
    let lame = simulate(&[text(&record), "--agents", "3,agent-1@fail=100ms"]);
    assert_eq!(number(&lame, "zones_failed"), 0.0);
    let alone = run(&["simulate", text(&record), "--agents", "1,agent-0@fail=10ms"]);
    assert_eq!(alone.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&alone.stderr).contains("no agent is left"));
}

/// Agents choose by the rules of the recorded agents; otherwise they paint with other settings.
#[test]
fn a_work_with_rules_of_its_own_is_replayed_by_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let [picture, record] = ["a.png", "run.json"].map(|name| folder.path().join(name));
    let painted =
        ["render", "goblets.glb", "-o", text(&picture), "--size", "96x72", "--spp", "64", "--set", "work.zones=12"];
    let ruled = ["--quiet", "--optimize", "b", "--rules", "paper", "--record", text(&record)];
    succeed(&[&painted[..], &ruled[..]].concat());
    let busy = |more: &[&str]| {
        let outcome = simulate(&[&[text(&record), "--agents", "1"], more].concat());
        number(&outcome["agents"][0], "busy_seconds")
    };
    let (others, own) = (busy(&["--rules", "../rules/path-tracing.fcl"]), busy(&[]));
    assert!(others < 0.9 * own, "{own} {others}");
    assert_eq!(own, busy(&["--rules", "paper"]), "the record has the rules by which it was painted");
}

#[test]
fn the_same_seed_gives_the_same_synthetic_run() {
    let arguments = ["--synthetic", "200", "--agents", "10x1.0,10x0.5", "--fail", "10%", "--loss", "2%", "--seed", "4"];
    let [first, second] = [simulate(&arguments), simulate(&arguments)];
    for field in ["makespan_seconds", "messages", "efficiency"] {
        assert_eq!(number(&first, field), number(&second, field), "{field}");
    }
}

#[test]
fn what_cannot_be_simulated_is_refused_with_a_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let torn = folder.path().join("torn.json");
    fs::write(&torn, "{\n  \"format\": \"bottega record\",\n  \"version\": 2,\n").expect("written");
    for (arguments, code, reason) in [
        (vec!["simulate"], 2, "<RECORD>"),
        (vec!["simulate", "nowhere.json"], 1, "nowhere.json"),
        (vec!["simulate", text(&torn)], 1, "line 4"),
        (vec!["simulate", "cornell-box.glb"], 1, "cornell-box.glb"),
        (vec!["simulate", "--synthetic", "0", "--agents", "1"], 2, "0 zones"),
        (vec!["simulate", "--synthetic", "5", "--agents", "many"], 2, "`many`"),
        (vec!["simulate", "--synthetic", "5", "--agents", "2,agent-7@fail=1s"], 2, "no agent-7"),
        (vec!["simulate", "--synthetic", "5", "--loss", "2"], 2, "--loss"),
    ] {
        let output = run(&arguments);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
        assert!(stderr.contains(reason), "{arguments:?}: {stderr}");
    }
}
