//! The learning of a machine: its predictions of zone times from one run to the next.

use std::{fs, path::Path, process::Output, thread};

use crate::program::support::{bottega, text};
use serde_json::Value;

/// Runs the program with a state of its own.
fn run_in(state: &Path, arguments: &[&str]) -> Output {
    bottega(arguments).env("XDG_STATE_HOME", state).output().expect("the program starts")
}

fn succeed_in(state: &Path, arguments: &[&str]) -> String {
    let output = run_in(state, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// Renders a small picture. Returns all events.
fn paint(state: &Path, picture: &Path) -> Vec<Value> {
    let arguments = [
        "goblets.glb",
        "--size",
        "96x72",
        "--spp",
        "16",
        "--set",
        "work.zones=12",
        "--optimize",
        "n",
        "--threads",
        "2",
    ];
    let mut all = vec!["render", "--json", "-o", text(picture)];
    all.extend(arguments);
    let output = succeed_in(state, &all);
    output.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

fn forecast(events: &[Value]) -> &Value {
    events.iter().find(|event| event["event"] == "forecast").expect("a forecast")
}

#[test]
fn a_second_run_expects_what_the_first_took_and_paints_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let (state, [first, second]) =
        (folder.path().join("state"), ["a.exr", "b.exr"].map(|name| folder.path().join(name)));
    let before = paint(&state, &first);
    assert_eq!(forecast(&before)["jobs_learnt"], 0);
    let kept: Value = serde_json::from_str(&succeed_in(&state, &["machines", "show", "--json"])).expect("JSON");
    assert_eq!(kept["jobs"], 1);
    assert!(kept["benchmark"].as_f64().is_some_and(|power| power > 0.0), "{kept}");
    assert!(kept["load"].as_f64().is_some_and(|load| load >= 1.0), "{kept}");
    let tasks = kept["factors"].as_array().expect("factors").iter().map(|it| it["tasks"].as_str().unwrap_or_default());
    assert!(
        tasks.clone().any(|it| it == "builtin path at n") && tasks.clone().any(|it| it.contains("glass")),
        "{kept}"
    );
    let after = paint(&state, &second);
    assert_eq!(forecast(&after)["jobs_learnt"], 1);
    // The expected times before profiling differ, and no pixel depends on them.
    let expected = |events: &[Value]| -> Vec<f64> {
        let open = events.iter().filter(|it| it["event"] == "zone" && it["state"] == "open");
        open.map(|zone| zone["seconds_estimated"].as_f64().expect("T_est")).collect()
    };
    assert!(!expected(&before).is_empty() && expected(&before) != expected(&after));
    succeed_in(&state, &["diff", text(&first), text(&second), "--fail-above", "0"]);
    let exported: Value = serde_json::from_str(&succeed_in(&state, &["machines", "export"])).expect("JSON");
    assert!(exported["jobs"] == 2 && exported["techniques"]["builtin path at n"].is_object(), "{exported}");
    succeed_in(&state, &["machines", "forget"]);
    let kept: Value = serde_json::from_str(&succeed_in(&state, &["machines", "show", "--json"])).expect("JSON");
    assert!(kept["jobs"] == 0 && kept["benchmark"].is_null(), "{kept}");
}

#[test]
fn an_unusable_file_is_reported_and_left_as_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let (state, picture) = (folder.path().join("state"), folder.path().join("a.exr"));
    let file = state.join("bottega/experience.json");
    fs::create_dir_all(file.parent().expect("a folder")).expect("a folder");
    let long = " ".repeat((1 << 20) + 1);
    let newer = r#"{"format":7,"jobs":3,"paces":{},"powers":{},"more":[]}"#;
    let mad = r#"{"format":3,"jobs":3,"techniques":{},"pictures":[],"powers":{"p":{"log":1e300,"count":3,"job":2}}}"#;
    for (bytes, words) in [
        (b"{\"format\":3,\"jo".as_slice(), "not the experience of a machine"),
        (b"\xff\xfe\x00".as_slice(), "valid UTF-8"),
        (long.as_bytes(), "1048577 bytes"),
        (newer.as_bytes(), "format 7"),
        (mad.as_bytes(), "is not a valid number"),
    ] {
        fs::write(&file, bytes).expect("a file");
        let events = paint(&state, &picture);
        let warnings: Vec<&str> = events.iter().filter_map(|event| event["message"].as_str()).collect();
        let is_reported = warnings.iter().any(|it| it.contains(words) && it.contains("bottega machines forget"));
        assert!(is_reported, "{words}: {warnings:?}");
        assert_eq!(forecast(&events)["jobs_learnt"], 0);
        assert_eq!(fs::read(&file).expect("a file"), bytes, "it is left for the user to look at");
        let output = run_in(&state, &["machines", "show"]);
        assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    }
    succeed_in(&state, &["machines", "forget"]);
    assert!(!file.exists());
}

#[test]
fn processes_that_learn_at_the_same_time_lose_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let state = folder.path().join("state");
    thread::scope(|scope| {
        for number in 0..4 {
            let (state, picture) = (&state, folder.path().join(format!("{number}.exr")));
            scope.spawn(move || paint(state, &picture));
        }
    });
    let kept: Value = serde_json::from_str(&succeed_in(&state, &["machines", "show", "--json"])).expect("JSON");
    assert_eq!(kept["jobs"], 4);
}
