//! Machines whose owners go first.

use std::{
    fs,
    os::unix::fs::PermissionsExt,
    thread,
    time::{Duration, Instant},
};

use super::{
    fixture::{Farm, MANY, Process, bits},
    support::{servers, text},
};

/// Time within which the owner has the machine back.
const BACK_IN: Duration = Duration::from_secs(2);

/// Makes a program that prints the first line of a file.
fn speaker(farm: &Farm, name: &str, says: &str) {
    let folder = farm.path("programs");
    fs::create_dir_all(&folder).expect("a folder");
    let program = folder.join(name);
    fs::write(&program, format!("#!/bin/sh\n{says}\n")).expect("a program");
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("a program");
}

/// Starts a machine whose screen was touched the number of milliseconds ago that is in `farm.path("touched")`.
fn desk(farm: &Farm) -> Process {
    speaker(farm, "xprintidle", &format!("read ms < {}; echo $ms", text(&farm.path("touched"))));
    // The user of the test machine does not count.
    speaker(farm, "busctl", "echo 'b true'; echo 't 1'");
    let log = fs::File::create(farm.path("desk")).expect("a log");
    let cache = farm.path("cache-desk");
    let mut join =
        farm.command(&["join", "--threads", "1", "--cache", text(&cache), "--when-idle", "1s", "--nice", "5"]);
    join.env("PATH", farm.path("programs")).env("DISPLAY", ":0");
    join.stdout(log.try_clone().expect("a log")).stderr(log);
    Process(join.spawn().expect("the program starts"))
}

#[test]
fn the_owner_has_the_machine_back_at_once_and_no_pixel_is_lost() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start_alone(&server);
    let plain = farm.plain_by(MANY);
    fs::write(farm.path("touched"), "900000\n").expect("a file");
    let _desk = desk(&farm);
    farm.until_says("desk", "waiting for work");
    let mut render = farm.render_by("a.exr", MANY, &[]);
    farm.until_says("desk", "job 1: painting");
    fs::write(farm.path("touched"), "0\n").expect("a file");
    let begun = Instant::now();
    farm.until_says("desk", "suspended by its owner: somebody is at it");
    eprintln!("the owner has the machine back after {:?}", begun.elapsed());
    // Others have the processors of the test, too: more than what is promised.
    assert!(begun.elapsed() < 3 * BACK_IN, "{:?}: {}", begun.elapsed(), farm.logs());
    assert!(farm.said("desk").contains("job 1: left"), "{}", farm.logs());
    thread::sleep(BACK_IN);
    assert_eq!(farm.said("desk").matches("painting").count(), 1, "it paints for the farm: {}", farm.logs());
    fs::write(farm.path("touched"), "900000\n").expect("a file");
    farm.until_says("desk", "resumed; waiting for work");
    assert!(render.wait(), "{}", farm.logs());
    assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
}

#[test]
fn out_of_its_hours_a_machine_rests_and_says_so() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let now = std::process::Command::new("date").arg("+%H").output().expect("the time");
    let hour: u32 = String::from_utf8_lossy(&now.stdout).trim().parse().expect("an hour");
    // It begins in eleven to twelve hours.
    let hours = format!("{}:00-{}:00", (hour + 12) % 24, (hour + 13) % 24);
    let _desk = farm.spawn(&["join", "--threads", "1", "--hours", &hours], "desk");
    farm.until_says("desk", "suspended by its owner: it is not its time");
    let listed = || farm.succeed(&["machines", "list"]);
    farm.until("it is listed", || listed().contains("suspended"));
    let wrong = farm.run(&["join", "--hours", "8-20"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("hours such as 20:00-08:00 are needed"));
}

#[test]
fn a_job_that_asks_for_a_tag_is_painted_by_machines_that_have_it_and_one_that_is_too_large_is_left() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    let _plain_one = farm.join("one");
    let words =
        |name: &str| ["join".to_owned(), "--threads=1".to_owned(), format!("--cache={}", text(&farm.path(name)))];
    let joined = |name: &str, more: &[&str]| {
        let words = words(&format!("cache-{name}"));
        let words: Vec<&str> = words.iter().map(String::as_str).chain(more.iter().copied()).collect();
        let machine = farm.spawn(&words, name);
        farm.until_says(name, "waiting for work");
        machine
    };
    let mut tagged = joined("tagged", &["--tag", "gpu", "--tag", "studio-a"]);
    assert!(farm.succeed(&["machines", "list"]).contains("gpu studio-a"));
    let ask = |output: &str, tag: &str| {
        assert!(farm.render(output, &["--detach", "--require", tag]).wait(), "{}", farm.logs());
    };
    ask("a.exr", "studio-a");
    farm.until_state(1, "done");
    assert!(farm.said("tagged").contains("job 1: painting"), "{}", farm.logs());
    assert!(!farm.said("one").contains("job 1"), "{}", farm.logs());
    let path = farm.path("b.exr");
    farm.succeed(&["jobs", "fetch", "1", "-o", text(&path)]);
    assert!(bits(&path) == plain, "{}", farm.logs());
    ask("c.exr", "mars");
    assert!(farm.succeed(&["jobs", "show", "2"]).contains("for machines tagged mars: 0 of 2 present"));
    assert!(!farm.log_of(1).contains("is tagged") && farm.log_of(2).contains("is tagged `mars`"), "{}", farm.log_of(2));
    let refused = farm.run(&["render", "goblets.glb", "-o", "d.exr", "--farm", "--require", "not a tag"]);
    assert!(
        !refused.status.success() && String::from_utf8_lossy(&refused.stderr).contains("a tag consists of letters")
    );
    // No machine paints with so little memory.
    assert!(tagged.end(), "{}", farm.logs());
    let _small = joined("small", &["--tag", "small", "--max-memory", "16"]);
    assert!(farm.render_by("e.exr", MANY, &["--detach", "--require", "small"]).wait(), "{}", farm.logs());
    farm.until_says("small", "the job needs more memory here than");
    assert!(farm.succeed(&["jobs", "show", "3"]).contains("is left out: the job needs more memory here"));
}
