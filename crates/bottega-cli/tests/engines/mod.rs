//! External engines, correct and faulty: workers and command lines made for these tests.

mod real;

use crate::support;

use std::{
    fs,
    net::TcpListener,
    path::{Path, PathBuf},
    process::{Command, Output},
    time::{Duration, Instant},
};

use bottega_image::{Picture, ReadLimits, read_channels, read_picture};
use support::text;
use tempfile::TempDir;

/// A folder with the manifest and the worker, and a scene.
struct Stage {
    folder: TempDir,
}

/// The file in which the worker writes its requests.
const TRACE: &str = "traces/trace";

const MANIFEST: &str = r#"
manifest = 1
name = "hostile"
title = "Hostile"
kind = "worker"
files = ["hostile.py", "plain_exr.py"]
determinism = "frame"
seeds = true
[[find]]
programs = ["python3"]
check = ["{program}", "--version"]
version = 'Python (\d+\.\d+)'
command = ["{program}", "{folder}/hostile.py"]
inherit = ["TRACE", "PORT"]
writes = ["TRACES"]
[install]
any = "python3 is needed"
[scene]
extensions = ["toy"]
refers = "worker"
[tunables.samples]
least = 1
most = 64
default = 4
[pixels]
color_space = "linear-rec709"
[animation]
frames = true
[limits]
start_seconds = 20
open_seconds = 20
silence_seconds = 2
log_kib = 256
"#;

impl Stage {
    fn new(scene: &str) -> Self {
        let stage = Self { folder: tempfile::tempdir().expect("a folder") };
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../engines/plain_exr.py");
        fs::copy(shipped, stage.path("plain_exr.py")).expect("copied");
        fs::write(stage.path("hostile.py"), include_str!("hostile.py")).expect("written");
        fs::write(stage.path("hostile.toml"), MANIFEST).expect("written");
        fs::write(stage.path("scene.toy"), scene).expect("written");
        // In the scene's folder it may write only this file.
        fs::create_dir(stage.path("traces")).expect("a folder");
        stage
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = support::bottega(arguments);
        command.args(["--engines", text(self.folder.path())]).env("TRACE", self.path(TRACE));
        command.env("TRACES", self.path("traces"));
        command.env("XDG_CONFIG_HOME", self.path("config")).env("XDG_STATE_HOME", self.path("state"));
        command.env("NO_COLOR", "1");
        command
    }

    fn render(&self, more: &[&str]) -> Output {
        let (scene, output) = (self.path("scene.toy"), self.path("out.exr"));
        let usual = [
            "render",
            text(&scene),
            "--engine",
            "hostile",
            "-o",
            text(&output),
            "--set",
            "work.level=1",
            "--set",
            "work.zones=4",
        ];
        self.command(&[&usual, more].concat()).output().expect("the program starts")
    }

    fn picture(&self) -> Picture {
        read_picture(self.path("out.exr")).expect("a picture")
    }
}

fn stderr_of(output: &Output) -> String {
    // Lines are wrapped at the width of a terminal.
    let text = String::from_utf8_lossy(&output.stderr).replace('│', " ");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn a_picture_in_zones_has_each_pixel_in_its_place() {
    let stage = Stage::new("sound");
    let output = stage.render(&[]);
    assert!(output.status.success(), "{}", stderr_of(&output));
    let expected = Picture::from_fn(96, 64, |x, y| [x as f32 / 8.0, y as f32 / 8.0, 1.0]);
    assert_eq!(stage.picture(), expected);
}

#[test]
fn a_crash_costs_a_zone_and_no_picture() {
    let stage = Stage::new("once");
    let output = stage.render(&[]);
    assert!(output.status.success(), "{}", stderr_of(&output));
    assert!(stderr_of(&output).contains("signal 6 (aborted)"), "{}", stderr_of(&output));
    assert!(stderr_of(&output).contains("about to fall"), "{}", stderr_of(&output));
    assert_eq!(stage.picture().pixel(95, 63), [95.0 / 8.0, 63.0 / 8.0, 1.0]);
}

#[test]
fn an_engine_that_can_end_early_gets_the_remaining_time_and_is_believed() {
    let stage = Stage::new("early");
    let timed = MANIFEST.replace("\"frame\"", "\"statistics\"").replace("most = 64", "most = 4096");
    let timed = format!("{timed}[tunables.time]\nleast = 1\nmost = 100\n");
    fs::write(stage.path("hostile.toml"), timed).expect("written");
    let orders = || -> Vec<serde_json::Value> {
        let trace = fs::read_to_string(stage.path(TRACE)).expect("a trace");
        trace.lines().map(|line| serde_json::from_str(line).expect("an order")).collect()
    };
    let output = stage.render(&["--time", "3s", "--quiet"]);
    assert!(output.status.success(), "{}", stderr_of(&output));
    let zones: Vec<_> = orders().into_iter().filter(|order| !order["time"].is_null()).collect();
    let times: Vec<u64> = zones.iter().filter_map(|order| order["time"].as_u64()).collect();
    assert!(times.first() == Some(&3) && times.is_sorted_by(|a, b| a >= b) && times.len() >= 8, "{times:?}");
    assert!(times.iter().all(|time| (1..=3).contains(time)) && times.last() < times.first(), "{times:?}");
    // Many samples were ordered after the first ones, and one was taken each time: it has the weight of one sample.
    let of = |is_first: bool| zones.iter().filter(move |order| (order["first_sample"] == 0) == is_first);
    let ordered = |is_first: bool| of(is_first).filter_map(|order| order["samples"].as_u64()).sum::<u64>() as f64 / 4.0;
    let (first, later) = (ordered(true), ordered(false));
    let fair = |bright: f64| (first + 3.0 * bright) / (first + bright);
    let picture = stage.picture();
    let mean = picture.data.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / picture.data.len() as f64;
    let (expected, if_believed) = (fair(of(false).count() as f64 / 4.0), fair(later));
    // The difference depends on the number of orders that the machine had time for; it is 0 for few orders.
    let apart = (if_believed - expected).abs();
    assert!((mean - expected).abs() <= 0.25 * apart + 1e-6, "{mean}, {expected}, {if_believed}");
    // A picture without a time limit gives the engine none.
    fs::remove_file(stage.path(TRACE)).expect("removed");
    assert!(stage.render(&["--quiet"]).status.success());
    assert!(orders().iter().all(|order| order["time"].is_null()));
}

#[test]
fn windows_that_are_dear_are_not_tried_out() {
    // One process for the survey, one for the only zone: each further one costs five seconds.
    for (seconds, windows) in [("5", 2..3), ("-1", 4..1000)] {
        let stage = Stage::new(&format!("dear windows {seconds}"));
        let (scene, output) = (stage.path("scene.toy"), stage.path("out.exr"));
        let words = ["render", text(&scene), "--engine", "hostile", "-o", text(&output), "--quiet"];
        let done = stage.command(&words).output().expect("the program starts");
        assert!(done.status.success(), "{}", stderr_of(&done));
        let painted = fs::read_to_string(stage.path(TRACE)).expect("a trace").split_whitespace().count();
        assert!(windows.contains(&painted), "{seconds} s: {painted} windows");
    }
}

#[test]
fn faults_of_engines_are_reported() {
    for (scene, says) in [
        ("crash", "signal 6 (aborted)"),
        ("early crash", "signal 6 (aborted)"),
        ("early hang", "without a word"),
        ("early refuses", "not to my taste"),
        ("hang", "without a word"),
        ("flood", "more than 256 KiB to its log"),
        ("nothing", "wrote no picture"),
        ("half", "cannot be read"),
        ("size", "pixels where"),
        ("nan", "not finite numbers"),
        ("black", "all black"),
        ("nonsense", "protocol"),
        ("elsewhere", "not in its folder"),
        ("refuses", "texture `wood.png` is not to my taste"),
        ("unreadable", "I do not know the word `unreadable`"),
        ("wide filter", "the scene's pixel filter is Tent"),
    ] {
        let stage = Stage::new(scene);
        let begun = Instant::now();
        let output = stage.render(&[]);
        assert_eq!(output.status.code(), Some(1), "{scene}: {}", stderr_of(&output));
        assert!(stderr_of(&output).contains(says), "{scene}: {}", stderr_of(&output));
        assert!(!stderr_of(&output).contains("panicked"), "{scene}: {}", stderr_of(&output));
        assert!(begun.elapsed() < Duration::from_secs(60), "{scene}: it takes too long");
    }
}

#[test]
fn an_engine_that_fails_repeatedly_is_quarantined_until_it_is_released() {
    let stage = Stage::new("crash");
    let run = |arguments: &[&str]| stage.command(arguments).output().expect("the program starts");
    let says = |output: &Output| String::from_utf8_lossy(&output.stdout).into_owned() + &stderr_of(output);
    assert_eq!(stage.render(&[]).status.code(), Some(1));
    // For any command of the next process.
    fs::write(stage.path("scene.toy"), "sound").expect("written");
    let refused = stage.render(&[]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(stderr_of(&refused).contains("engines release hostile"), "{}", stderr_of(&refused));
    assert!(says(&run(&["engines", "list", "--wait", "90s"])).contains("not used here: it failed 3 times in a row"));
    let check = run(&["engines", "check", "hostile"]);
    assert!(!check.status.success() && stderr_of(&check).contains("signal 6 (aborted)"), "{}", stderr_of(&check));
    assert!(says(&run(&["engines", "release", "hostile"])).contains("is used again"));
    assert!(says(&run(&["engines", "release", "hostile"])).contains("is not in quarantine"));
    let painted = stage.render(&[]);
    assert!(painted.status.success(), "{}", stderr_of(&painted));
}

#[test]
fn another_version_of_an_engine_is_used_again() {
    let stage = Stage::new("crash");
    assert_eq!(stage.render(&[]).status.code(), Some(1));
    fs::write(stage.path("scene.toy"), "sound").expect("written");
    assert_eq!(stage.render(&[]).status.code(), Some(1));
    let worker = format!("{}# repaired\n", include_str!("hostile.py"));
    fs::write(stage.path("hostile.py"), worker).expect("written");
    let painted = stage.render(&[]);
    assert!(painted.status.success(), "{}", stderr_of(&painted));
}

#[test]
fn a_file_that_shuts_an_engine_out_and_is_not_ours_is_left_aside() {
    let stage = Stage::new("sound");
    fs::create_dir_all(stage.path("state/bottega/engines")).expect("a folder");
    fs::write(stage.path("state/bottega/engines/hostile.json"), "{\"identity\": [[[").expect("written");
    let painted = stage.render(&[]);
    assert!(painted.status.success() && stderr_of(&painted).contains("is ignored"), "{}", stderr_of(&painted));
}

#[test]
fn nothing_that_an_engine_started_is_left() {
    let stage = Stage::new("forks");
    let output = stage.render(&[]);
    assert!(output.status.success(), "{}", stderr_of(&output));
    let mark = text(&stage.path(TRACE)).to_owned();
    let lives = || {
        let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
        let environments = entries.filter_map(|entry| fs::read(entry.path().join("environ")).ok());
        environments.filter(|bytes| String::from_utf8_lossy(bytes).contains(&mark)).count()
    };
    let until = Instant::now() + Duration::from_secs(5);
    while lives() > 0 && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(50));
    }
    assert_eq!(lives(), 0);
}

#[test]
fn engines_have_no_network_where_the_system_can_shut_them_in() {
    let allowed = Command::new("unshare").args(["--net", "true"]).status().is_ok_and(|status| status.success());
    if !allowed {
        eprintln!("SKIPPED: the system allows no network namespaces");
        return;
    }
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = listener.local_addr().expect("an address").port();
    let stage = Stage::new("network");
    let (scene, output) = (stage.path("scene.toy"), stage.path("out.exr"));
    let arguments = ["render", text(&scene), "--engine", "hostile", "-o", text(&output)];
    let output = stage.command(&arguments).env("PORT", port.to_string()).output().expect("the program starts");
    assert!(output.status.success(), "{}", stderr_of(&output));
    assert_eq!(stage.picture().pixel(3, 3), [0.0, 1.0, 0.0]);
}

/// Channels of the picture, by their full names.
fn channels<const N: usize>(stage: &Stage, names: [&str; N]) -> [Option<Vec<f32>>; N] {
    let names = names.map(str::to_owned);
    let (_, planes) = read_channels(stage.path("out.exr"), ReadLimits::default(), &names).expect("a picture");
    planes.try_into().expect("a plane each")
}

#[test]
fn layers_and_alpha_come_out_in_their_places() {
    let stage = Stage::new("layers");
    let is_right = |plane: &Option<Vec<f32>>, value: fn(f32, f32) -> f32| {
        let expected: Vec<f32> = (0..96 * 64).map(|i| value((i % 96) as f32, (i / 96) as f32)).collect();
        plane.as_ref().is_some_and(|plane| *plane == expected)
    };
    for more in [&[][..], &["--spp", "7"], &["--aov", "all"]] {
        let output = stage.render(more);
        assert!(output.status.success(), "{}", stderr_of(&output));
        let [alpha, id, normal, two, samples] = channels(&stage, ["A", "id.Y", "normal.X", "two.b", "samples"]);
        assert!(is_right(&alpha, |x, _| x / 128.0) && is_right(&two, |x, y| x - y), "{more:?}");
        assert!(is_right(&normal, |x, _| x) && samples.is_none());
        assert!(is_right(&id, |x, y| x * 1000.0 + y), "an identity is never a mean of two neighbours");
    }
    let output = stage.render(&["--aov", "two,samples"]);
    assert!(output.status.success(), "{}", stderr_of(&output));
    let [id, normal, two, samples] = channels(&stage, ["id.Y", "normal.X", "two.a", "samples"]);
    assert!(id.is_none() && normal.is_none() && two.is_some() && is_right(&samples, |_, _| 4.0));
    assert!(stage.render(&["--aov", "none"]).status.success());
    assert!(channels(&stage, ["id.Y", "normal.X", "two.a", "samples"]).iter().all(Option::is_none));
    let refused = stage.render(&["--aov", "two,uv"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr_of(&refused).contains("available: id, normal, two, samples"), "{}", stderr_of(&refused));
}

#[test]
fn layers_that_no_picture_can_have_are_refused() {
    for (scene, says) in [
        ("no such layer", "lacks the channel `depth.Z`"),
        ("many layers", "there are 1000 layers, and at most 128 are taken"),
        ("nameless layer", "is not a valid channel name"),
    ] {
        let stage = Stage::new(scene);
        let output = stage.render(&[]);
        assert_eq!(output.status.code(), Some(1), "{scene}: {}", stderr_of(&output));
        assert!(stderr_of(&output).contains(says), "{scene}: {}", stderr_of(&output));
    }
}

#[test]
fn frames_are_numbered_and_passed_to_the_engine() {
    let stage = Stage::new("frames");
    let scene = stage.path("scene.toy");
    let output = stage.path("out.exr");
    let arguments = ["render", text(&scene), "--engine", "hostile", "-o", text(&output), "--frames", "7..9"];
    let done = stage.command(&arguments).output().expect("the program starts");
    assert!(done.status.success(), "{}", stderr_of(&done));
    for frame in 7..=9_u8 {
        let picture = read_picture(stage.path(&format!("out.000{frame}.exr"))).expect("a picture");
        assert_eq!(picture.pixel(5, 5)[0], f32::from(frame));
    }
    // One process of the engine has rendered all frames, because loading a scene may take longer than a frame.
    let trace = fs::read_to_string(stage.path(TRACE)).expect("the trace");
    let mut processes: Vec<&str> = trace.lines().collect();
    assert!(processes.len() >= 3, "it opens the scene for each frame: {processes:?}");
    processes.dedup();
    assert_eq!(processes.len(), 1, "{processes:?}");
    // A frame that is lost is painted again, and no other.
    fs::remove_file(stage.path("out.0008.exr")).expect("removed");
    fs::write(stage.path("out.0007.exr"), "mine").expect("written");
    let done = stage.command(&[&arguments, ["--resume"].as_slice()].concat()).output().expect("the program starts");
    assert!(done.status.success(), "{}", stderr_of(&done));
    assert_eq!(read_picture(stage.path("out.0008.exr")).expect("a picture").pixel(5, 5)[0], 8.0);
    assert_eq!(fs::read(stage.path("out.0007.exr")).expect("a file"), b"mine");
}

#[test]
fn what_an_engine_lacks_is_reported_before_anything_is_painted() {
    let stage = Stage::new("sound");
    let refuse = |arguments: &[&str], says: &str| {
        let output = stage.render(arguments);
        assert!(!output.status.success() && stderr_of(&output).contains(says), "{arguments:?}: {}", stderr_of(&output));
    };
    refuse(&["--camera", "x"], "only the built-in engine supports --camera");
    refuse(&["--aov", "albedo"], "Hostile makes no layer `albedo` of this scene");
    refuse(&["--engine-option", "speed=11"], "Hostile has no option `speed`");
    refuse(&["--set", "engine.rules.file=x.fcl"], "it needs two engines");
    refuse(&["-D", "a=b"], "Hostile does not support --define");
    refuse(&["--crop", "0,0,97,64"], "not within the picture");
    fs::rename(stage.path("scene.toy"), stage.path("scene.glb")).expect("renamed");
    let (scene, output) = (stage.path("scene.glb"), stage.path("out.exr"));
    let other = |name: &str, says: &str| {
        let arguments = ["render", text(&scene), "--engine", name, "-o", text(&output)];
        let output = stage.command(&arguments).output().expect("the program starts");
        assert!(!output.status.success() && stderr_of(&output).contains(says), "{name}: {}", stderr_of(&output));
    };
    other("hostile", "does not read");
    other("nobody", "there is no engine `nobody`");
    let manifest = |from: &str, to: &str| {
        fs::write(stage.path("hostile.toml"), MANIFEST.replace(from, to)).expect("written");
    };
    manifest("\"python3\"", "\"pithon3\"");
    other("hostile", "not installed here (no pithon3 in PATH); to install it: python3 is needed");
    manifest("[install]", "[versions]\nleast = \"99\"\n[install]");
    other("hostile", "99 or newer is needed");
    manifest("seeds = true", "sees = true");
    other("hostile", "line 8, column 1: unknown field `sees`");
}

#[test]
fn a_command_line_is_an_engine_too() {
    let stage = Stage::new("sound");
    fs::write(
        stage.path("paint.py"),
        "import sys, plain_exr, array\n\
         print('50 %', file=sys.stderr)\n\
         w, h, path = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]\n\
         if sys.argv[4] == 'broken': sys.exit('Fatal: the lamp is missing')\n\
         c = {'R': [x for y in range(h) for x in range(w)], 'G': [y for y in range(h) for x in range(w)]}\n\
         c['B'] = [{'': 1.0, '-t 7': 2.0}[' '.join(sys.argv[5:])]] * (w * h)\n\
         plain_exr.write(path, w, h, {k: array.array('f', map(float, v)) for k, v in c.items()})\n",
    )
    .expect("written");
    fs::write(
        stage.path("line.toml"),
        r#"
manifest = 1
name = "line"
title = "A line"
kind = "command"
files = ["paint.py", "plain_exr.py"]
determinism = "frame"
seeds = false
[[find]]
programs = ["python3"]
check = ["{program}", "--version"]
version = 'Python (\d+\.\d+)'
[install]
any = "python3 is needed"
[scene]
extensions = ["toy"]
[tunables.samples]
least = 1
most = 64
[tunables.time]
least = 7
most = 60
[pixels]
color_space = "linear-rec709"
window = "frame"
[progress]
pattern = '(\d+) %'
[errors]
patterns = ['Fatal: (.*)']
[command]
run = ["{program}", "{folder}/paint.py", "{width}", "{height}", "{output}", "sound", ["-d", "{max_depth}"], ["-t", "{time}"]]
output = "out.exr"
"#,
    )
    .expect("written");
    let (scene, output) = (stage.path("scene.toy"), stage.path("out.exr"));
    let arguments =
        ["render", text(&scene), "--engine", "line", "-o", text(&output), "--size", "40x30", "--set", "work.zones=4"];
    let done = stage.command(&arguments).output().expect("the program starts");
    assert!(done.status.success(), "{}", stderr_of(&done));
    assert_eq!(stage.picture(), Picture::from_fn(40, 30, |x, y| [x as f32, y as f32, 1.0]));
    let timed = stage.command(&[&arguments[..], &["--time", "1s"]].concat()).output().expect("the program starts");
    assert!(timed.status.success(), "{}", stderr_of(&timed));
    assert_eq!(stage.picture(), Picture::from_fn(40, 30, |x, y| [x as f32, y as f32, 2.0]));
    let manifest = fs::read_to_string(stage.path("line.toml")).expect("text").replace("\"sound\"", "\"broken\"");
    fs::write(stage.path("line.toml"), manifest).expect("written");
    let failed = stage.command(&arguments).output().expect("the program starts");
    assert!(!failed.status.success() && stderr_of(&failed).contains("the lamp is missing"), "{}", stderr_of(&failed));
}

#[test]
fn an_engine_opens_no_files_but_its_own_and_its_scenes() {
    let elsewhere = tempfile::tempdir().expect("a folder");
    let secret = elsewhere.path().join("secret");
    fs::write(&secret, "the combination of the safe").expect("written");
    let stage = Stage::new(&format!("secret {}", text(&secret)));
    let list = stage.command(&["engines", "list", "--wait", "90s"]).output().expect("the program starts");
    if String::from_utf8_lossy(&list.stdout).contains("Engines can read all files") {
        eprintln!("SKIPPED: this kernel has no Landlock, and engines see all files");
        return;
    }
    // Red, green and blue say whether it could read the secret, write beside it, or change its scene.
    let output = stage.render(&["--spp", "1"]);
    assert!(output.status.success(), "{}", stderr_of(&output));
    assert_eq!(stage.picture(), Picture::from_fn(96, 64, |_, _| [0.25; 3]));
    // With `--allow-outside` it reads everything, but still writes nothing.
    let output = stage.render(&["--spp", "1", "--allow-outside"]);
    assert!(output.status.success(), "{}", stderr_of(&output));
    assert_eq!(stage.picture(), Picture::from_fn(96, 64, |_, _| [1.0, 0.25, 0.25]));
    assert_eq!(fs::read_dir(elsewhere.path()).expect("a folder").count(), 1);
}

#[test]
fn an_engine_is_usable_when_its_worker_has_answered() {
    let stage = Stage::new("sound");
    let lacking = r#"import json; print(json.dumps({"failed": {"id": None, "reason": "No module named 'lamps'", "fatal": True}}), flush=True)"#;
    fs::write(stage.path("lacking.py"), lacking).expect("written");
    let manifest = MANIFEST.replace("hostile", "lacking").replace(", \"plain_exr.py\"", "");
    fs::write(stage.path("lacking.toml"), manifest).expect("written");
    let list = stage.command(&["engines", "list", "--wait", "90s"]).output().expect("the program starts");
    let listed = String::from_utf8_lossy(&list.stdout).into_owned();
    let line = listed.lines().find(|line| line.starts_with("lacking")).unwrap_or_else(|| panic!("{listed}"));
    assert!(line.contains("not usable") && line.ends_with("python3 -m pip install lamps"), "{line}");
}

#[test]
fn an_engine_that_does_not_answer_is_listed_as_starting_and_is_said_to_be_waited_for() {
    let stage = Stage::new("sound");
    fs::write(stage.path("slow.py"), "import time; time.sleep(600)").expect("written");
    let manifest = MANIFEST.replace("hostile", "slow").replace(", \"plain_exr.py\"", "");
    fs::write(stage.path("slow.toml"), manifest).expect("written");
    let list = stage.command(&["engines", "list", "--wait", "1s"]).output().expect("the program starts");
    let listed = String::from_utf8_lossy(&list.stdout).into_owned();
    let line = listed.lines().find(|line| line.starts_with("slow")).unwrap_or_else(|| panic!("{listed}"));
    assert!(
        list.status.success() && line.contains("starting") && line.contains("bottega engines check slow"),
        "{line}"
    );
    let said = stderr_of(&list);
    assert!(said.lines().any(|line| line.starts_with("waiting for") && line.contains("slow")), "{said}");
}

#[test]
fn engines_are_listed_and_checked() {
    let stage = Stage::new("sound");
    let list = stage.command(&["engines", "list", "--wait", "90s"]).output().expect("the program starts");
    let listed = String::from_utf8_lossy(&list.stdout).into_owned();
    assert!(list.status.success() && listed.contains("hostile   3."), "{listed}");
    for shipped in ["builtin", "cycles", "luxcore", "mitsuba", "povray"] {
        assert!(listed.lines().any(|line| line.starts_with(shipped)), "{shipped}: {listed}");
    }
    let check = stage.command(&["engines", "check", "hostile"]).output().expect("the program starts");
    let checked = String::from_utf8_lossy(&check.stdout).into_owned();
    assert!(check.status.success() && checked.contains("ready after"), "{checked}{}", stderr_of(&check));
    let scene = stage.path("scene.toy");
    let tried = stage.command(&["engines", "try", "hostile", text(&scene)]).output().expect("the program starts");
    let said = String::from_utf8_lossy(&tried.stdout).into_owned();
    assert!(tried.status.success() && said.contains("have the same bits"), "{said}{}", stderr_of(&tried));
}
