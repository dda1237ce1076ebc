//! `bottega blackboard --page`: the rows of a process that renders without a farm.

use std::{
    collections::BTreeSet,
    io::{BufRead, BufReader},
    process::Stdio,
};

use serde_json::Value;

use crate::program::support::{bottega, run, succeed, text};

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
        "4096",
        "--agents",
        "2",
        "--set",
        "work.zones=12",
        "--dashboard",
        "127.0.0.1:0",
    ];
    let mut render = bottega(&arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program");
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
    let rows = bottega(&["blackboard", "--page", &page, "--watch", "--json"]).stdout(Stdio::piped()).spawn();
    let rows = rows.expect("the program starts");
    // Its output is read, so that it does not wait.
    let mut output = String::new();
    std::io::Read::read_to_string(&mut BufReader::new(render.stdout.take().expect("a pipe")), &mut output)
        .expect("events");
    assert!(render.wait().expect("it ends").success(), "{output}");
    let rows = rows.wait_with_output().expect("it ends with the page");
    assert!(rows.status.success());
    let rows = String::from_utf8(rows.stdout).expect("text");
    let rows: Vec<Value> = rows.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let zones: BTreeSet<u64> =
        rows.iter().filter(|row| row["event"] == "zone").flat_map(|row| row["id"].as_u64()).collect();
    let agents = rows.iter().filter(|row| row["event"] == "agent").count();
    assert!(zones.len() > 4 && agents > 0, "{rows:?}");
    assert!(rows.iter().any(|row| row["state"] == "done" && row["seconds_measured"].is_f64()), "{rows:?}");
}
