use std::{collections::BTreeMap, path::PathBuf};

use super::*;

fn spawn(script: &str, limits: Limits) -> (tempfile::TempDir, GuardedChild) {
    spawn_with(script, &[], limits)
}

fn spawn_with(script: &str, reads: &[PathBuf], limits: Limits) -> (tempfile::TempDir, GuardedChild) {
    let scratch = tempfile::tempdir().expect("a folder");
    let line = ["/bin/sh", "-c", script].map(str::to_owned);
    let (environment, inherit) = (BTreeMap::new(), []);
    let program = Program {
        line: &line,
        scratch: scratch.path(),
        environment: &environment,
        inherit: &inherit,
        writes: &[],
        reads,
        limits,
    };
    let child = GuardedChild::spawn(&program).expect("a shell");
    (scratch, child)
}

fn listen_to_end(child: &mut GuardedChild) -> Result<Vec<String>, EngineFault> {
    let until = Instant::now() + Duration::from_secs(20);
    let mut lines = Vec::new();
    while Instant::now() < until {
        match child.listen()? {
            ChildOutput::Line(line) => lines.push(line),
            ChildOutput::End => return Ok(lines),
            ChildOutput::Silence => {}
        }
    }
    panic!("it neither speaks nor ends: {lines:?}");
}

#[test]
fn a_child_has_a_home_of_its_own_and_little_else() {
    let (scratch, mut child) = spawn("echo $HOME; echo $TMPDIR; pwd; echo \"[$EDITOR$USER]\"", Limits::default());
    let home = scratch.path().display().to_string();
    assert_eq!(listen_to_end(&mut child).expect("lines"), [&home, &home, &home, "[]"]);
}

#[test]
fn a_flood_is_stemmed() {
    let limits = Limits { log_kib: 64, ..Limits::default() };
    let (_scratch, mut child) = spawn("while :; do echo aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa >&2; done", limits);
    assert!(matches!(listen_to_end(&mut child), Err(EngineFault::Flood { .. })));
    let (_scratch, mut child) = spawn("while :; do echo aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa; done", limits);
    assert!(matches!(listen_to_end(&mut child), Err(EngineFault::Flood { .. })));
    let (_scratch, mut child) = spawn("while :; do printf aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa; done", limits);
    assert!(matches!(listen_to_end(&mut child), Err(EngineFault::Flood { .. })));
}

#[test]
fn a_glutton_is_noticed() {
    let limits = Limits { memory_mib: 64, ..Limits::default() };
    let (_scratch, mut child) =
        spawn("exec python3 -c 'x = bytearray(300 << 20); import time; time.sleep(60)'", limits);
    assert!(matches!(listen_to_end(&mut child), Err(EngineFault::Memory { mib: 64 })));
}

/// Returns the number of processes with this home folder.
fn at_home_in(folder: &Path) -> usize {
    let home = format!("HOME={}", folder.display());
    let entries = std::fs::read_dir("/proc").expect("processes").flatten();
    let all = entries.map(|entry| std::fs::read(entry.path().join("environ")).unwrap_or_default());
    all.filter(|all| all.split(|byte| *byte == 0).any(|entry| entry == home.as_bytes())).count()
}

#[test]
fn nothing_of_a_child_is_left() {
    let script = "trap '' TERM INT HUP; (setsid sh -c 'trap \"\" TERM; echo there; sleep 600') & sleep 600 & wait";
    let (scratch, child) = spawn(script, Limits::default());
    assert!(matches!(child.lines.recv_timeout(Duration::from_secs(20)), Ok(Some(line)) if line == "there"));
    assert!(at_home_in(scratch.path()) > 1, "the children are there");
    drop(child);
    let until = Instant::now() + Duration::from_secs(5);
    while at_home_in(scratch.path()) > 0 && Instant::now() < until {
        thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(at_home_in(scratch.path()), 0);
}

#[test]
fn signals_are_reported_by_name() {
    let (_scratch, mut child) = spawn("kill -ABRT $$", Limits::default());
    assert!(listen_to_end(&mut child).expect("nothing").is_empty());
    assert_eq!(child.ended().expect("an end"), "signal 6 (aborted)");
}

#[test]
fn a_child_opens_what_is_its_own_and_its_scenes_and_nothing_else() {
    if !is_fenced_in() {
        eprintln!("SKIPPED: this kernel has no Landlock, and engines see all files");
        return;
    }
    let elsewhere = tempfile::tempdir().expect("a folder");
    let (scene, secret) = (elsewhere.path().join("scene"), elsewhere.path().join("secret.txt"));
    std::fs::create_dir(&scene).expect("a folder");
    std::fs::write(scene.join("mesh.txt"), "mesh\n").expect("a file");
    std::fs::write(&secret, "secret\n").expect("a file");
    std::os::unix::fs::symlink(&secret, scene.join("link.txt")).expect("a link");
    let (scene_word, secret_word) = (scene.display(), secret.display());
    let script = format!(
        "cat {scene_word}/mesh.txt; cat {secret_word} || echo no; cat {scene_word}/link.txt || echo no; ls {outside} || \
         echo no; echo x > {scene_word}/new || echo no; echo x >> {scene_word}/mesh.txt || echo no; rm -f \
         {scene_word}/mesh.txt || echo no; echo x > {outside}/new || echo no; echo mine > $HOME/own && cat $TMPDIR/own; \
         echo gone > /dev/null && echo done; cat /etc/hosts > $HOME/hosts; python3 -c 'print(\"python\")'",
        outside = elsewhere.path().display()
    );
    let (_scratch, mut child) = spawn_with(&script, std::slice::from_ref(&scene), Limits::default());
    let lines = listen_to_end(&mut child).expect("lines");
    assert_eq!(lines, ["mesh", "no", "no", "no", "no", "no", "no", "no", "mine", "done", "python"]);
    assert_eq!(std::fs::read_to_string(scene.join("mesh.txt")).expect("still there"), "mesh\n");
    assert!(!scene.join("new").exists() && !elsewhere.path().join("new").exists());
}
