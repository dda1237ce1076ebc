//! Machines that come at the same moment, and a second `bottega up`.

use std::process::{Child, Stdio};

use serde_json::Value;

use super::{
    fixture::{Farm, MANY, Process, bits},
    support::{servers, text},
};

/// Machines that join at the same moment, and processes of one machine that connect at the same moment.
const MACHINES: usize = 6;
const LOOKS: usize = 6;

#[test]
fn machines_that_join_at_the_same_moment_are_all_let_in() {
    for server in servers() {
        let farm = Farm::start(&server);
        let [line, guest_line] = farm.lines();
        // Each is a machine of its own: it has a state of its own.
        let join = |number: usize| {
            let (log, line) = (format!("m{number}"), if number.is_multiple_of(2) { &line } else { &guest_line });
            let cache = farm.path(&format!("cache-{number}"));
            let arguments = ["join", "--threads", "1", "--cache", text(&cache), line];
            farm.spawn_in(&format!("state-{number}"), &arguments, &log)
        };
        let mut machines: Vec<Process> = (0..MACHINES).map(join).collect();
        // These are one machine, which the farm does not know yet.
        let look = |_| {
            let mut command = farm.command(&["machines", "list", "--json", "--farm", &line]);
            command.env("XDG_STATE_HOME", farm.path("state-new")).stdout(Stdio::piped()).stderr(Stdio::piped());
            command.spawn().expect("the program starts")
        };
        let looks: Vec<Child> = (0..LOOKS).map(look).collect();
        for look in looks {
            let output = look.wait_with_output().expect("a child");
            let stderr = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{server:?}: {stderr}{}", farm.logs());
        }
        (0..MACHINES).for_each(|number| farm.until_says(&format!("m{number}"), "waiting for work"));
        let members = std::fs::read(farm.path("state/bottega/server/members.json")).expect("members");
        let members: Value = serde_json::from_slice(&members).expect("JSON");
        assert_eq!(members["members"].as_array().map(Vec::len), Some(MACHINES + 1), "a machine is one member");
        assert!(machines.iter_mut().all(Process::end), "{}", farm.logs());
    }
}

#[test]
fn a_second_up_says_the_lines_and_leaves_the_farm_alone() {
    let Some(server) = servers().pop() else { return };
    let mut farm = Farm::start(&server);
    let listen = format!("127.0.0.1:{}", farm.port);
    for arguments in [&["up", "--server", text(&server)][..], &["up", "--server", text(&server), "--listen", &listen]] {
        let said = farm.succeed(arguments);
        assert!(said.contains("already runs") && said.contains(&farm.lines()[0]), "{said}");
    }
    let other = farm.run(&["up", "--server", text(&server), "--listen", "127.0.0.1:1"]);
    let stderr = String::from_utf8_lossy(&other.stderr).replace("\n  │ ", " ");
    assert!(other.status.code() == Some(1) && stderr.contains("end it first"), "{stderr}");
    assert!(farm.succeed(&["machines", "list", "--json"]).is_empty(), "the server is there");
    assert!(farm.up.take().expect("a server").end());
    // No process holds it any more.
    farm.up();
}

#[test]
fn a_server_that_hangs_is_started_again() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    let _one = farm.join("one");
    assert!(farm.render("a.exr", &["--detach"]).wait(), "{}", farm.logs());
    farm.until_painted(1, 0.1);
    farm.signal_server("-STOP");
    farm.until_says("up.log", "does not answer; it is started again");
    farm.until("it answers", || farm.run(&["jobs", "show", "1", "--json"]).status.success());
    farm.until_state(1, "done");
    farm.succeed(&["jobs", "fetch", "1"]);
    assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
    assert!(!farm.said("up.log").contains('\u{1b}'), "a file is not a terminal");
}

#[test]
fn a_submitter_that_is_stopped_at_once_says_how_to_continue() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let mut asker = farm.render_by("a.exr", MANY, &[]);
    farm.until_painted(1, 0.01);
    // It cannot cancel the job.
    farm.signal_server("-STOP");
    asker.signal("-INT");
    std::thread::sleep(std::time::Duration::from_millis(300));
    asker.signal("-INT");
    assert!(!asker.wait());
    farm.signal_server("-CONT");
    let said = farm.said("a.exr.log");
    assert!(said.contains("bottega jobs fetch 1") && said.contains("bottega jobs cancel 1"), "{said}");
}

#[test]
fn a_picture_that_cannot_be_written_here_can_be_fetched() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain();
    let folder = farm.path("away");
    std::fs::create_dir(&folder).expect("a folder");
    let mut asker = farm.render("away/a.exr", &[]);
    farm.until_painted(1, 0.1);
    std::fs::remove_dir_all(&folder).expect("removed");
    std::fs::write(&folder, "no folder").expect("a file");
    assert!(!asker.wait());
    let said = farm.said("away-a.exr.log").replace("\n  │ ", " ").replace("\n        ", " ");
    assert!(said.contains("bottega jobs fetch 1"), "{said}");
    // The farm keeps it.
    let _one = farm.join("one");
    farm.until_state(1, "done");
    let path = farm.path("b.exr");
    farm.succeed(&["jobs", "fetch", "1", "-o", text(&path)]);
    assert!(bits(&path) == plain, "{}", farm.logs());
}
