//! Servers that run out of space: nothing is lost, nothing is left behind, and jobs continue when there is space again.

use std::{
    fmt::Write,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::Duration,
};

use super::{
    fixture::{Farm, Process, bits, link},
    others::Other,
    support::{self, servers, text},
};

/// Space of a small picture.
const SMALL: [&str; 8] = ["render", "goblets.glb", "--size", "64x64", "--spp", "4", "--quiet", "-o"];

/// Makes a scene of a triangle, with this many megabytes of comments.
fn large_scene(path: &Path, megabytes: usize) {
    let mut words = String::new();
    let mut number = 0_u64;
    while words.len() < megabytes << 20 {
        number += 1;
        // All its pieces differ.
        _ = writeln!(words, "# {number:060}");
    }
    words += "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    fs::write(path, words).expect("written");
}

/// Returns the bytes that the server stores. The count of an old server is larger: it includes deleted data.
fn used(farm: &Farm) -> u64 {
    let link = link(farm);
    let blobs: u64 = link.blobs().list().iter().map(|blob| blob.bytes).sum();
    blobs + link.payloads().bytes_by_folder().values().sum::<u64>()
}

#[test]
fn a_scene_for_which_there_is_no_room_is_refused_and_leaves_nothing() {
    for server in servers() {
        let farm = Farm::start_with(&server, &["--store-size", "0.02"]);
        assert!(farm.said("up.log").contains("It stores at most 20 MB"), "{}", farm.logs());
        let (scene, output) = (farm.path("large.obj"), farm.path("large.exr"));
        large_scene(&scene, 30);
        let render = farm.run(&["render", text(&scene), "-o", text(&output), "--quiet", "--farm"]);
        let stderr = String::from_utf8_lossy(&render.stderr).replace("\n  │ ", " ");
        assert!(render.status.code() == Some(1) && stderr.contains("no room for the scene: 31 MB"), "{stderr}");
        assert!(used(&farm) < 1 << 20, "{} bytes are left", used(&farm));
        let [small, plain] = ["small.exr", "plain.exr"].map(|name| farm.path(name));
        farm.succeed(&[&SMALL[..], &[text(&plain)]].concat());
        farm.succeed(&[&SMALL[..], &[text(&small), "--farm"]].concat());
        assert!(bits(&small) == bits(&plain), "{}", farm.logs());
        // Removing a finished job removes its scene.
        let (scene, output) = (farm.path("fits.obj"), farm.path("fits.exr"));
        large_scene(&scene, 12);
        let render = ["render", text(&scene), "-o", text(&output), "--size", "8x8", "--spp", "1", "--quiet", "--farm"];
        farm.succeed(&[&render[..], &["--detach"]].concat());
        let list = farm.succeed(&["jobs", "list"]);
        assert!(list.lines().any(|line| line.contains("fits.obj") && line.contains("13 MB")), "{list}");
        // Including the notices of the previous job.
        let keeps = ["13", "14"].map(|size| format!("the farm's server keeps {size} MB of at most 20 MB"));
        assert!(keeps.iter().any(|words| list.contains(words)), "{list}");
        farm.succeed(&["jobs", "cancel", "2"]);
        farm.succeed(&["jobs", "remove", "2"]);
        assert!(used(&farm) < 2 << 20, "{} bytes are left", used(&farm));
    }
}

#[test]
fn a_server_of_others_that_has_no_room_is_left_as_it_was() {
    // An old one counts what was taken back until it is started again.
    if let Some(server) = servers().pop() {
        let other = Other::new(&server);
        let _server = other.start("jetstream { store_dir: \"STORE\", max_file_store: 20M }\n");
        let address = format!("--farm=nats://127.0.0.1:{}", other.port);
        let (scene, output) = (other.path("large.obj"), other.path("large.exr"));
        large_scene(&scene, 30);
        let render = other.command(&["render", text(&scene), "-o", text(&output), "--quiet", &address]).output();
        let stderr =
            String::from_utf8(render.expect("the program starts").stderr).expect("text").replace("\n  │ ", " ");
        assert!(stderr.contains("no room for the scene: 31 MB"), "{stderr}");
        let [small, plain] = ["small.exr", "plain.exr"].map(|name| other.path(name));
        support::succeed(&[&SMALL[..], &[text(&plain)]].concat());
        let render = other.command(&[&SMALL[..], &[text(&small), &address]].concat()).output();
        let render = render.expect("the program starts");
        assert!(render.status.success(), "{}", String::from_utf8_lossy(&render.stderr));
        assert!(bits(&small) == bits(&plain));
    }
}

#[test]
fn a_job_waits_while_the_store_is_full_and_goes_on_when_something_is_let_go() {
    for server in servers() {
        let farm = Farm::start_with(&server, &["--store-size", "0.02"]);
        let plain = farm.plain();
        assert!(farm.render("a.exr", &["--detach"]).wait(), "{}", farm.logs());
        let link = link(&farm);
        // A megabyte at a time, and then the rest.
        let mut filled = Vec::new();
        for bytes in [1 << 20, 64 << 10, 4 << 10] {
            loop {
                let name = format!("filler-{}", filled.len());
                match link.blobs().put(&name, &vec![7; bytes]) {
                    Ok(()) => filled.push(name),
                    Err(error) => {
                        assert!(error.is_full, "{server:?}: {error}");
                        break;
                    }
                }
            }
        }
        let _one = farm.join("one");
        farm.until_says("up.log", "the store is full");
        std::thread::sleep(Duration::from_secs(3));
        assert_ne!(farm.job(1)["state"], "done", "there is no room for its pixels");
        filled.iter().for_each(|name| link.blobs().forget(name));
        farm.until_says("up.log", "the store has room again");
        farm.until_state(1, "done");
        farm.succeed(&["jobs", "fetch", "1"]);
        assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
    }
}

/// A farm whose folder lies on a disk that only its own processes see.
struct SmallDisk {
    _up: Process,
    /// The path at which other processes see the folder.
    seen: PathBuf,
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let number = fs::read_to_string(self.seen.join("server.pid")).unwrap_or_default();
        // The server does not end with a process that is killed; it may have ended by itself.
        _ = Command::new("kill").args(["-KILL", number.trim()]).stderr(Stdio::null()).status();
    }
}

/// Makes a disk of this many megabytes for a farm; `None`: the system does not allow it.
fn farm_on_small_disk(farm: &mut Farm, megabytes: u32) -> Option<SmallDisk> {
    let state = farm.path("disk");
    fs::create_dir(&state).expect("a folder");
    let mount = format!("mount -t tmpfs -o size={megabytes}m none {0} && exec \"$@\"", text(&state));
    let may = Command::new("unshare").args(["-rm", "sh", "-c", &mount, "sh", "true"]).stderr(Stdio::null()).status();
    if !may.is_ok_and(|status| status.success()) {
        eprintln!("SKIPPED: this system lets nobody mount a disk");
        return None;
    }
    assert!(farm.up.take().expect("a server").end());
    let up = farm.up_words(&["--state", text(&state)]);
    let log = fs::File::create(farm.path("up.log")).expect("a log");
    let mut command = Command::new("unshare");
    command.args(["-rm", "sh", "-c", &mount, "sh", env!("CARGO_BIN_EXE_bottega")]).args(up);
    command.env("XDG_STATE_HOME", farm.path("state")).env_remove("BOTTEGA_FARM");
    command.stdout(log.try_clone().expect("a log")).stderr(log).stdin(Stdio::null());
    let up = Process(command.spawn().expect("the program starts"));
    let seen = PathBuf::from(format!("/proc/{}/root{}", up.0.id(), text(&state)));
    let disk = SmallDisk { _up: up, seen };
    farm.until_says("up.log", "bottega join");
    Some(disk)
}

#[test]
fn a_job_goes_on_by_itself_when_a_full_disk_has_room_again() {
    for server in servers() {
        let mut farm = Farm::start(&server);
        let plain = farm.plain();
        let Some(disk) = farm_on_small_disk(&mut farm, 64) else { return };
        assert!(farm.render("a.exr", &["--detach"]).wait(), "{}", farm.logs());
        let filler = disk.seen.join("filler");
        let full = Command::new("dd").args(["if=/dev/zero", "bs=64k", &format!("of={}", text(&filler))]).output();
        assert!(!full.expect("dd runs").status.success(), "the disk is full");
        let _one = farm.join("one");
        farm.until_says("up.log", "may have stopped storing");
        std::thread::sleep(Duration::from_secs(5));
        fs::remove_file(&filler).expect("removed");
        farm.until("the job is done", || {
            let shown = farm.run(&["jobs", "show", "1", "--json"]);
            String::from_utf8_lossy(&shown.stdout).contains(r#""state":"done""#)
        });
        farm.succeed(&["jobs", "fetch", "1"]);
        assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
    }
}
