//! `bottega platform`: two processes over one file, one of which is killed; queries; the trace.

use std::{
    fs,
    io::{BufRead, BufReader, Read},
    process::{Child, ChildStdout, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::program::support::{bottega, run, signal, succeed, text};
use serde_json::Value;

/// A process that serves, killed when the test is over.
struct Serving {
    child: Child,
    out: BufReader<ChildStdout>,
    url: String,
}

impl Serving {
    fn start(more: &[&str]) -> Self {
        let arguments = [&["platform", "serve", "--listen", "127.0.0.1:0", "--json"], more].concat();
        let mut child = bottega(&arguments).stdout(Stdio::piped()).spawn().expect("the program starts");
        let mut out = BufReader::new(child.stdout.take().expect("a pipe"));
        let said = json(&mut out);
        let url = said["address"].as_str().expect("an address").to_owned();
        Self { child, out, url }
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        // It may have ended by itself.
        _ = self.child.kill();
        _ = self.child.wait();
    }
}

fn json(out: &mut impl BufRead) -> Value {
    let mut line = String::new();
    out.read_line(&mut line).expect("a line");
    serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line:?}"))
}

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

/// Returns the agents that a platform knows, except for the clients that ask, which come and go.
fn agents(url: &str) -> Vec<String> {
    let agents_json = succeed(&["platform", "agents", "--at", url, "--json"]);
    lines(&agents_json).iter().map(|agent| agent["agent"].as_str().expect("a name").to_owned()).collect()
}

#[cfg(unix)]
fn interrupt(child: &Child) {
    assert!(signal("-INT", child.id()));
}

#[test]
fn a_platform_is_served_by_two_processes_of_which_one_is_killed() {
    let folder = tempfile::tempdir().expect("a folder");
    let state = folder.path().join("state");
    let state = ["--name", "workshop", "--state", text(&state)];
    let mut one = Serving::start(&state);
    let two = Serving::start(&state);
    let expected = ["ams@workshop", "df@workshop", "start@workshop", "acc@workshop"];
    assert_eq!(agents(&one.url), expected);
    // Another platform registers itself with the DF, through the first process.
    let guest = Serving::start(&["--name", "guest", "--federate", &one.url]);
    let services = |url: &str| lines(&succeed(&["platform", "services", "--at", url, "--json"]));
    let begun = Instant::now();
    while services(&two.url).is_empty() {
        assert!(begun.elapsed() < Duration::from_secs(10), "the second process knows of the guest");
        thread::sleep(Duration::from_millis(50));
    }
    one.child.kill().expect("killed");
    one.child.wait().expect("gone");
    assert_eq!(agents(&two.url), expected);
    let found = services(&two.url);
    assert_eq!((found[0]["agent"].as_str(), found[0]["type"].as_str()), (Some("df@guest"), Some("fipa-df")));
    assert_eq!(found[0]["addresses"][0].as_str(), Some(guest.url.as_str()));
    // After a restart it knows what it knew before.
    let one = Serving::start(&state);
    assert_eq!(services(&one.url).len(), 1);
    let said = succeed(&["platform", "services", "--at", &format!("workshop={}", one.url)]);
    assert!(said.contains("df@guest") && said.contains("fipa-df"), "{said}");
    #[cfg(unix)]
    {
        // A guest deregisters when it ends.
        let mut late = Serving::start(&["--name", "late", "--federate", &two.url]);
        let begun = Instant::now();
        while services(&two.url).len() != 2 {
            assert!(begun.elapsed() < Duration::from_secs(10), "the second process knows of the other guest");
        }
        interrupt(&late.child);
        assert!(late.child.wait().expect("an end").success());
        let found = services(&two.url);
        assert_eq!((found.len(), found[0]["agent"].as_str()), (1, Some("df@guest")), "{found:?}");
    }
}

#[test]
fn what_passes_can_be_watched_and_drawn() {
    let platform = Serving::start(&["--name", "watched"]);
    let folder = tempfile::tempdir().expect("a folder");
    let drawing = folder.path().join("trace.svg");
    let arguments = ["platform", "trace", "--at", &platform.url, "--count", "2", "-o", text(&drawing)];
    let mut watch = bottega(&arguments).stdout(Stdio::piped()).spawn().expect("the program starts");
    let mut out = BufReader::new(watch.stdout.take().expect("a pipe"));
    let mut first = String::new();
    out.read_line(&mut first).expect("a line");
    assert!(first.starts_with("watching "), "{first}");
    agents(&platform.url);
    let mut rest = String::new();
    out.read_to_string(&mut rest).expect("text");
    assert!(watch.wait().expect("an end").success());
    let rows: Vec<&str> = rest.lines().collect();
    assert!(rows[0].contains("#1") && rows[0].contains(" request ") && rows[0].contains("ams@watched"), "{rest}");
    assert!(rows[1].contains("#1") && rows[1].contains(" inform "), "{rest}");
    let drawing = fs::read_to_string(drawing).expect("a drawing");
    assert_eq!(drawing.matches("<g><title>").count(), 2);
}

#[test]
fn impossible_commands_are_refused() {
    for (arguments, code, words) in [
        (vec!["platform", "serve", "--listen", "0.0.0.0:0"], 2, "--public"),
        (vec!["platform", "serve", "--name", "a b", "--listen", "127.0.0.1:0"], 1, "cannot be the name"),
        (vec!["platform", "agents", "--at", "ftp://x"], 2, "an address such as"),
        (vec!["platform", "agents", "--at", "http://127.0.0.1:1/acc"], 1, "NAME=URL"),
        (vec!["platform", "agents", "--at", "x=http://127.0.0.1:1/acc", "--wait", "5s"], 1, "no connection"),
        (vec!["platform", "trace", "--at", "http://127.0.0.1:1/acc"], 1, "cannot watch"),
    ] {
        let output = run(&arguments);
        let stderr = String::from_utf8_lossy(&output.stderr).replace(['│', '|', '\n'], " ");
        let stderr = stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
        assert!(stderr.contains(words), "{arguments:?}: {stderr}");
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_it_politely() {
    let folder = tempfile::tempdir().expect("a folder");
    let state = folder.path().join("state");
    let state = ["--name", "p", "--state", text(&state)];
    let (mut one, two) = (Serving::start(&state), Serving::start(&state));
    let addresses = |of: &Serving| {
        let agents_json = succeed(&["platform", "agents", "--at", &of.url, "--json"]);
        lines(&agents_json)[0]["addresses"].as_array().expect("addresses").len()
    };
    let begun = Instant::now();
    while addresses(&two) != 2 {
        assert!(begun.elapsed() < Duration::from_secs(10));
    }
    interrupt(&one.child);
    assert!(one.child.wait().expect("an end").success());
    let mut rest = String::new();
    one.out.read_to_string(&mut rest).expect("text");
    while addresses(&two) != 1 {
        assert!(begun.elapsed() < Duration::from_secs(20), "nobody is sent to who said farewell");
    }
}

#[test]
fn in_one_process_agents_register_and_find_their_master_in_the_directory() {
    let folder = tempfile::tempdir().expect("a folder");
    let (picture, trace) = (folder.path().join("a.png"), folder.path().join("trace.txt"));
    let words = ["render", "goblets.glb", "-o", text(&picture), "--size", "32x24", "--spp", "1", "--agents", "2"];
    succeed(&[&words[..], &["--quiet", "--trace", text(&trace)]].concat());
    let trace = std::fs::read_to_string(&trace).expect("a trace");
    let first = |what: &[&str]| {
        let found = trace.lines().position(|line| what.iter().all(|part| line.contains(part)));
        found.unwrap_or_else(|| panic!("no line with {what:?} in {trace}"))
    };
    for agent in ["render-1@bottega", "render-2@bottega"] {
        let to = |service: &str| format!("{agent} -> {service}@bottega ");
        let from = |service: &str| format!("{service}@bottega -> {agent} ");
        let steps = [
            first(&[&to("start"), "(getServiceRoot)"]),
            first(&[&to("ams"), "(register (ams-agent-description"]),
            first(&[&to("df"), "(register (df-agent-description", "bottega-job-render-agent"]),
            first(&[&to("df"), "(search (df-agent-description", "bottega-job-master"]),
            first(&[&from("df"), "((result (action", "(agent-identifier :name master@bottega)"]),
            first(&[&to("master"), "Subscribe"]),
        ];
        assert!(steps.is_sorted(), "{agent}: {steps:?} in {trace}");
    }
    first(&["df@bottega -> master@bottega", "bottega-job-blackboard", "bottega-job-model-repository"]);
}
