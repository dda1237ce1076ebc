//! The ports on which a farm listens: ports that are taken, and how other processes find the farm.

use std::{fs, net::TcpListener, path::Path};

use serde_json::Value;

use super::{
    fixture::Farm,
    support::{bottega, servers, signal, text},
};

#[test]
fn a_port_in_use_is_reported_before_anything_is_started_and_nothing_is_left() {
    let Some(server) = servers().pop() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let state = folder.path().join("state");
    let free = || TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("an address").to_string();
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
    let taken = taken.local_addr().expect("an address").to_string();
    for (option, what) in [("--listen", "the NATS server"), ("--fipa", "the FIPA platform"), ("--web", "the page")] {
        let listen = if option == "--listen" { taken.clone() } else { free() };
        let mut words = vec!["up", "--listen", &listen, "--hidden", "--server", text(&server)];
        if option != "--listen" {
            words.extend([option, &taken]);
        }
        let output = bottega(&words).env("XDG_STATE_HOME", &state).output().expect("the program starts");
        let stderr = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ").replace("\n        ", " ");
        assert_eq!((output.status.code(), &*output.stdout), (Some(1), &b""[..]), "{option}: {stderr}");
        assert!(stderr.contains(&format!("{what} cannot listen on {taken}")), "{stderr}");
        assert!(stderr.contains(&format!("with {option} ADDRESS:PORT")), "{stderr}");
        assert!(!state.join("bottega/farm").exists(), "{option}");
        assert!(!runs(&state.join("bottega/server/server.pid")), "{option}: a server was left behind");
    }
}

/// Returns true if the process whose number is in the file runs.
fn runs(file: &Path) -> bool {
    let number = fs::read_to_string(file).ok().and_then(|text| text.trim().parse().ok());
    number.is_some_and(|number| signal("-0", number))
}

#[test]
fn the_page_is_printed_first_and_the_platform_is_found_at_any_port() {
    let Some(server) = servers().pop() else { return };
    let mut farm = Farm::start_with(&server, &["--web", "127.0.0.1:0", "--fipa", "127.0.0.1:0"]);
    let said = farm.said("up.log");
    assert!(said.starts_with("See and steer the farm in a browser:\n\n  http://127.0.0.1:"), "{said}");
    let agents = farm.succeed(&["platform", "agents", "--json"]);
    let agents = agents.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    assert!(agents.into_iter().any(|agent| agent["agent"] == "jobs@bottega"), "{said}");
    assert!(farm.succeed(&["platform", "services"]).contains("bottega-jobs"));
    // A second `up` for the same farm prints its address.
    let again = farm.up_words(&["--web", "127.0.0.1:0"]);
    let again = farm.succeed(&again.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(again.starts_with("The farm already runs") && again.contains("bottega join"), "{again}");
    assert!(farm.up.as_mut().is_some_and(super::fixture::Process::end), "{}", farm.logs());
    assert!(!farm.path("state/bottega/farm").exists(), "what has ended is not found");
}

#[test]
fn a_machine_has_the_given_name_and_warns_that_its_word_was_not_checked() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let [line, _] = farm.lines();
    let named = |name: &str, log: &str| {
        let machine = farm.spawn(&["join", "--threads", "1", "--name", name, &line], log);
        farm.until_says(log, "waiting for work");
        machine
    };
    let (_a, _b) = (named("studio-a", "a"), named("studio-b", "b"));
    assert!(
        farm.name_of("a").starts_with("studio-a-") && farm.name_of("b").starts_with("studio-b-"),
        "{}",
        farm.logs()
    );
    let machines = farm.succeed(&["machines", "list"]);
    assert!(machines.contains("studio-a-") && machines.contains("studio-b-"), "{machines}");
    // It keeps its port after a restart.
    let member = |log: &str| farm.name_of(log).split('.').next().map(str::to_owned);
    let before = member("a");
    let _again = named("studio-a", "a-again");
    assert_eq!(member("a-again"), before);
    let refused = farm.run(&["join", "--name", "a b", &line]);
    let stderr = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(2) && stderr.contains("letters, digits and hyphens"), "{stderr}");

    // With another word in the line the key counts.
    let at = "bottega://t".len();
    let other = if line[at..].starts_with('0') { "1" } else { "0" };
    let altered = format!("{}{other}{}", &line[..at], &line[at + 1..]);
    let listed = farm.run(&["jobs", "list", "--farm", &altered]);
    let stderr = String::from_utf8_lossy(&listed.stderr).into_owned();
    assert!(listed.status.success() && stderr.contains("was not checked") && stderr.contains("studio-a-"), "{stderr}");
    let listed = farm.run(&["jobs", "list", "--farm", &line]);
    assert!(listed.status.success() && listed.stderr.is_empty(), "{}", String::from_utf8_lossy(&listed.stderr));
}
