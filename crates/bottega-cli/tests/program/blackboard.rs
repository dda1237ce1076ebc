//! `bottega blackboard --page`: the rows of a process that renders without a farm.

use std::{
    collections::BTreeSet,
    io::{BufRead, BufReader},
    process::Stdio,
};

use serde_json::Value;

use crate::program::support::{bottega, run, signal, succeed, text};

#[cfg(unix)]
#[test]
fn rows_of_one_process_are_followed_over_its_page() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.png");
    let arguments = [
        "render",
        "goblets.glb",
        "-o",
        text(&file),
        "--size",
        "96x72",
        "--spp",
        "400000",
        "--agents",
        "2",
        "--set",
        "work.zones=12",
        "--dashboard",
        "127.0.0.1:0",
    ];
    let mut render = bottega(&arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the program");
    let mut said = BufReader::new(render.stderr.take().expect("a pipe"));
    let mut page = String::new();
    while !page.contains("token=") {
        page.clear();
        assert!(said.read_line(&mut page).expect("text") > 0, "it prints the address of its page");
    }
    let page = page.split_whitespace().find(|word| word.contains("token=")).expect("an address").to_owned();
    // A first look has a table; a wrong token is refused
    let table = succeed(&["blackboard", "--page", &page]);
    assert!(table.contains("T_est") || table.contains("has no rows"), "{table}");
    let wrong = run(&["blackboard", "--page", &format!("{page}0")]);
    let why = String::from_utf8_lossy(&wrong.stderr).into_owned();
    assert!(!wrong.status.success() && why.contains("token"), "{why}");
    // Each change is a row, until the picture is written
    let mut watch = bottega(&["blackboard", "--page", &page, "--watch", "--json"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let rows = BufReader::new(watch.stdout.take().expect("a pipe")).lines();
    let (mut zones, mut agents, mut is_stopped) = (BTreeSet::new(), BTreeSet::new(), false);
    for line in rows.map_while(Result::ok) {
        let row: Value = serde_json::from_str(&line).expect("JSON");
        match row["event"].as_str() {
            Some("zone") if row["agent"].is_string() => _ = zones.insert(row["id"].as_u64()),
            Some("agent") => _ = agents.insert(row["agent"].to_string()),
            _ => {}
        }
        if zones.len() > 1 && agents.len() == 2 && !is_stopped {
            is_stopped = true;
            assert!(signal("-INT", render.id()));
        }
    }
    assert!(is_stopped && watch.wait().expect("it ends with the page").success(), "{zones:?} {agents:?}");
    render.wait().expect("it ends");
    assert!(file.is_file(), "what is rendered is kept");
}
