//! The program as a user runs it. The farm is a small one: its figures make sense, whatever they are on this machine.
//!
//! The servers are those that `BOTTEGA_NATS_SERVERS` names, or the system's. Without one its test says that it is skipped.

#[path = "../../bottega-cli/tests/support/servers.rs"]
mod servers;

use std::process::{Command, Output};

use serde_json::Value;

fn bench(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bottega-bench")).args(arguments).output().expect("the program starts")
}

fn number(value: &Value, field: &str) -> f64 {
    value[field].as_f64().unwrap_or_else(|| panic!("no number `{field}` in {value}"))
}

#[test]
fn agents_in_several_processes_are_awarded_each_zone_and_paint_it_once() {
    for server in servers::servers() {
        let server = server.to_str().expect("a path in Unicode");
        let arguments = ["--agents", "20", "--zones", "200", "--zone-time", "30ms", "--processes", "2", "--json"];
        let output = bench(&[&["farm", "--server", server], &arguments[..]].concat());
        // It fails where a pixel is not painted, or not once.
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let told: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
        let command = told["head"]["command"].as_str().unwrap_or_default();
        assert!(command.ends_with(&format!("bottega-bench farm --server {server} {}", arguments.join(" "))), "{told}");
        assert_eq!((number(&told, "agents"), number(&told, "processes")), (20.0, 3.0));
        let zones = number(&told, "zones");
        assert!((100.0..=400.0).contains(&zones), "{told}");
        // One that was taken back or taken over is awarded again.
        assert!((zones..2.0 * zones).contains(&number(&told, "awards")), "{told}");
        let wanted = number(&told, "wanted_per_second");
        assert!((wanted - 20.0 / 0.03).abs() < 1e-6, "{told}");
        // Nobody paints faster than time goes by: 1.5 for the zones that happen to be cheap.
        assert!((1.0..1.5 * wanted).contains(&number(&told, "awards_per_second")), "{told}");
        let wait = &told["award_wait_ms"];
        for times in [wait, &told["award_ms"]] {
            let [median, p99, longest] = ["p50", "p99", "max"].map(|it| number(times, it));
            assert!(0.0 < median && median <= p99 && p99 <= longest, "{told}");
            assert!(longest < 1e3 * number(&told, "seconds"), "{told}");
        }
        assert!(number(wait, "count") <= number(&told, "awards"), "{told}");
        assert!(number(&told, "messages_per_zone") > 20.0, "{told}");
        assert!(number(&told, "bytes_per_zone") > 1000.0, "{told}");
    }
}

#[test]
fn what_cannot_be_measured_is_refused_with_a_reason() {
    for (arguments, code, reason) in [
        (&["farm", "--agents", "0"][..], 2, "--agents"),
        (&["farm", "--zone-time", "soon"], 2, "--zone-time"),
        (&["farm", "--server", "/nowhere/nats-server"], 1, "/nowhere/nats-server"),
        (&["farm", "--farm", "nowhere"], 2, "--farm"),
        (&["farm-part", "--share", "1:2:3"], 2, "no farm is named"),
        (&["engines", "povray", "room.pov", "--program", "/nowhere/bottega"], 2, "cargo build --release"),
        (&["learning", "scene.glb"], 2, "two scenes for each pair"),
        (&["peers", "/nowhere"], 1, "/nowhere"),
    ] {
        let output = bench(arguments);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {told}");
        assert!(told.contains(reason), "{arguments:?}: {told}");
    }
}

#[test]
fn the_head_stands_above_the_figures_of_people() {
    let output = bench(&["rays", "--only", "noisy", "--side", "16", "--repeat", "1"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("text");
    let (head, figures) = text.split_once("\n\n").expect("a head");
    let names: Vec<&str> = head.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(names, ["commit", "build", "command", "processors", "system", "date"], "{text}");
    assert!(head.contains("bottega-bench rays --only noisy --side 16 --repeat 1"), "{text}");
    assert!(figures.contains("noisy sphere (69168 triangles)") && !figures.contains("hall"), "{text}");
}
