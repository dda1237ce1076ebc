//! Different builds with one version number: neither paints jobs of the other.

use std::{
    fs,
    path::PathBuf,
    process::{Command, Stdio},
};

use super::{
    fixture::{FEW, Farm, PICTURE, Process, bits},
    support::{bottega, scenes, servers, text},
};

/// The identity of the program, and that of its sources.
fn identity() -> [String; 2] {
    let said = bottega(&["--version"]).output().expect("the program starts").stdout;
    let said = String::from_utf8(said).expect("text");
    let identity = said.split_whitespace().nth(1).expect("an identity").to_owned();
    let sources = identity.split(['+', '.']).nth(3).expect("a digest").to_owned();
    [identity, sources]
}

/// Makes a copy of the program with another digest of its sources.
fn other_build(farm: &Farm) -> (PathBuf, String) {
    let [identity, sources] = identity();
    let other: String = sources.chars().rev().collect();
    assert_ne!(sources, other);
    let mut bytes = fs::read(env!("CARGO_BIN_EXE_bottega")).expect("the program");
    let places: Vec<usize> =
        (0..bytes.len() - sources.len()).filter(|&at| bytes[at..].starts_with(sources.as_bytes())).collect();
    assert!(!places.is_empty(), "the program knows its sources");
    for at in places {
        bytes[at..at + other.len()].copy_from_slice(other.as_bytes());
    }
    let path = farm.path("other-bottega");
    fs::write(&path, bytes).expect("written");
    let from = fs::metadata(env!("CARGO_BIN_EXE_bottega")).expect("the program").permissions();
    fs::set_permissions(&path, from).expect("a program");
    (path, identity.replace(&sources, &other))
}

#[test]
fn a_machine_of_another_build_is_left_out_and_both_sides_report_it() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    let ([ours, _], (program, theirs)) = (identity(), other_build(&farm));
    let lines = farm.lines();
    let _others: Vec<Process> = (["trusted", "guest"].iter().zip(&lines))
        .map(|(name, line)| {
            let log = fs::File::create(farm.path(name)).expect("a log");
            let cache = farm.path(&format!("cache-{name}"));
            let mut command = Command::new(&program);
            command.args(["join", line, "--threads", "1", "--cache", text(&cache)]).current_dir(scenes());
            command.env("XDG_STATE_HOME", farm.path(&format!("state-{name}"))).env_remove("BOTTEGA_FARM");
            command.stdout(log.try_clone().expect("a log")).stderr(log).stdin(Stdio::null());
            let machine = Process(command.spawn().expect("the program starts"));
            farm.until_says(name, "waiting for work");
            machine
        })
        .collect();
    assert!(farm.succeed(&["machines", "list"]).contains(&theirs));
    let path = farm.path("a.exr");
    let words = ["render", "goblets.glb", "-o", text(&path), "--threads", "1", "--farm", FEW, "--json"];
    let is_loud = |word: &&&str| **word != "--quiet";
    let words: Vec<&str> = words.iter().chain(PICTURE.iter().filter(is_loud)).copied().collect();
    let mut asker = farm.spawn(&words, "asker");
    assert!(asker.wait(), "{}", farm.logs());
    assert!(bits(&path) == plain, "{}", farm.logs());
    let joined_words = |text: String| text.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    let (asker, log) = (joined_words(farm.said("asker")), joined_words(farm.log_of(1)));
    for name in ["trusted", "guest"] {
        let machine = joined_words(farm.said(name));
        let process = machine.split_once(" as ").and_then(|(_, rest)| rest.split([';', ':']).next()).expect("a name");
        for words in [&*format!("install bottega {ours}"), &theirs, "built from different sources"] {
            assert!(machine.contains(words), "{words}: {machine}");
        }
        assert!(!machine.contains("M samples here"), "{machine}");
        for side in [&asker, &log] {
            assert!(
                side.contains(&format!("{process} is left out: the job is for version {ours}")),
                "{process}: {side}"
            );
            assert!(
                side.contains(&format!("or {ours}")) || side.contains(&format!("install bottega {ours}")),
                "{side}"
            );
        }
    }
}
