//! A request is a value: every door gives the same bits.

use std::{
    fs,
    io::Write,
    path::Path,
    process::{Output, Stdio},
    sync::Arc,
};

use crate::program::support::{bottega, example, run, scenes, succeed, text};
use bottega::{Request, Session, SessionOptions, StopSwitch, picture::request_of};
use bottega_farm::simulate::{FarmSpec, Plan, Record, Workpiece, simulate};

/// The options of the picture.
const OPTIONS: [&str; 9] = [
    "goblets.glb",
    "--size=40x30",
    "--spp=9",
    "--seed=7",
    "--max-depth=5",
    "--optimize=b",
    "--agents=2",
    "--threads=2",
    "--exact",
];

fn bits(path: &Path) -> Vec<[u32; 3]> {
    let picture = bottega_image::read_picture(path).expect("a picture");
    picture.data.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// Runs the program with a text as its standard input.
fn fed(arguments: &[&str], input: &[u8]) -> Output {
    let mut command = bottega(arguments);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program starts");
    // The program may refuse the text before it has read all of it.
    _ = child.stdin.take().expect("piped").write_all(input);
    child.wait_with_output().expect("the program ends")
}

#[test]
fn every_door_gives_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let render = |more: &[&str]| succeed(&[&["render", "--quiet"], more].concat());
    let by_options = at("options.exr");
    render(&[&OPTIONS[..], &["-o", text(&by_options)]].concat());
    let reference = bits(&by_options);

    // As a file, and as a text that is piped.
    let json = succeed(&[&["render"], &OPTIONS[..], &["-o", text(&at("file.exr")), "--dry-run"]].concat());
    fs::write(at("request.json"), &json).expect("written");
    render(&["--request", text(&at("request.json"))]);
    assert_eq!(bits(&at("file.exr")), reference);
    let output = fed(&["render", "--quiet", "--request", "-", "-o", text(&at("piped.exr"))], json.as_bytes());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(bits(&at("piped.exr")), reference);

    // From a finished picture, and from a PNG of it.
    render(&["--from", text(&by_options), "-o", text(&at("again.exr"))]);
    assert_eq!(bits(&at("again.exr")), reference);
    render(&["--from", text(&by_options), "-o", text(&at("again.png"))]);
    render(&["--from", text(&at("again.png")), "-o", text(&at("third.exr"))]);
    assert_eq!(bits(&at("third.exr")), reference);

    // Without any command line.
    let mut request = Request::from_json(json.as_bytes()).expect("a request");
    request.scene.file = scenes().join("goblets.glb");
    request.output.file = None;
    let picture = Session::open(&request).expect("opened").render(Arc::new(()), &StopSwitch::new()).expect("painted");
    let pixels: Vec<[u32; 3]> = picture.film().to_picture().data.iter().map(|pixel| pixel.map(f32::to_bits)).collect();
    assert_eq!(pixels, reference);

    // With one field set, it is another picture.
    render(&["--from", text(&by_options), "-o", text(&at("other.exr")), "--set", "seed=8"]);
    assert_ne!(bits(&at("other.exr")), reference);
    render(&["--request", text(&at("request.json")), "-o", text(&at("back.exr")), "--set", "seed=8", "--set=seed=7"]);
    assert_eq!(bits(&at("back.exr")), reference);
}

#[test]
fn options_take_the_place_of_what_a_request_says() {
    let json = succeed(&[&["render"], &OPTIONS[..], &["-o", "a.exr", "--dry-run"]].concat());
    let output = fed(&["render", "--request", "-", "--spp", "3", "--size=8x8", "--dry-run"], json.as_bytes());
    let changed = Request::from_json(&output.stdout).expect("a request");
    assert_eq!((changed.goal.samples, changed.film.size, changed.seed), (Some(3), Some([8, 8]), 7));
    let options = fed(&["request", "options", "-"], json.as_bytes());
    let line = String::from_utf8(options.stdout).expect("text");
    assert!(line.starts_with("bottega render goblets.glb --output=a.exr --size=40x30 --spp=9 --seed=7"), "{line}");
    let shown = fed(&["request", "check", "-"], json.as_bytes());
    assert_eq!(String::from_utf8(shown.stdout).expect("text"), json);
    let schema: serde_json::Value = serde_json::from_str(&succeed(&["request", "schema"])).expect("JSON");
    assert_eq!(schema["title"], "Request");
}

#[test]
fn a_request_that_is_none_is_refused_with_its_place_and_the_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    for (json, words) in [
        (r#"{"scene": {"file": "goblets.glb"}, "film": {"sice": 1}}"#, "`film.sice`: there is no field `sice` here"),
        (r#"{"scene": {"file": "goblets.glb"}, "goal": {"samples": 0}}"#, "`goal.samples` is 0"),
        (r#"{"version": 9, "scene": 5}"#, "version 9"),
        (r#"{"scene": {"file": "goblets.glb"}"#, "the text ends in the middle of"),
        ("\u{feff}{}", "line 1, column 1"),
    ] {
        let output = fed(&["render", "--request", "-", "-o", text(&folder.path().join("a.exr"))], json.as_bytes());
        let stderr = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");
        assert_eq!(output.status.code(), Some(2), "{json}: {stderr}");
        assert!(
            stderr.contains("standard input") && stderr.contains(words) && stderr.contains("request schema"),
            "{json}: {stderr}"
        );
    }
    let none = run(&["render", "--request", "nowhere.json"]);
    assert!(!none.status.success() && String::from_utf8_lossy(&none.stderr).contains("nowhere.json"));
    let nowhere = fed(&["render", "--request", "-"], br#"{"scene": {"file": "goblets.glb"}}"#);
    assert!(String::from_utf8_lossy(&nowhere.stderr).contains("no output file is given"));
    assert!(!folder.path().join("a.exr.bottega-journal").exists());
}

#[test]
fn a_picture_without_a_sound_request_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    succeed(&["render", "cornell-box.glb", "--size=8x8", "--spp=1", "--quiet", "-o", text(&at("a.png"))]);
    assert_eq!(request_of(&at("a.png")).expect("its request").film.size, Some([8, 8]));
    let shown = succeed(&["request", "show", text(&at("a.png"))]);
    assert_eq!(Request::from_json(shown.as_bytes()).expect("a request"), request_of(&at("a.png")).expect("the same"));

    let from = |name: &str| {
        let output = run(&["render", "--from", text(&at(name)), "-o", text(&at("b.exr"))]);
        assert!(!output.status.success(), "{name}");
        String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ")
    };
    // Another program's picture, a damaged one, and a file that is not a picture.
    bottega_image::write_png_rgb8(at("foreign.png"), 2, 2, &[9; 12]).expect("written");
    assert!(from("foreign.png").contains("does not contain its request"));
    let film = bottega_image::Film::new(
        bottega_image::Rect::of_size(2, 2),
        bottega_image::Layout::new(bottega_image::AovSet::NONE),
    );
    let mut metadata = bottega_image::Metadata::new();
    metadata.set("request", r#"{"scene": {"file": "a.glb"}, "film": {"size": [0, 0]}}"#);
    bottega_image::write_exr(at("damaged.exr"), &film, &metadata, bottega_image::ExrOptions::default())
        .expect("written");
    let stderr = from("damaged.exr");
    assert!(stderr.contains("damaged.exr") && stderr.contains("`film.size` is 0x0"), "{stderr}");
    fs::write(at("text.png"), "no picture").expect("written");
    assert!(from("text.png").contains("text.png"));
}

#[test]
fn a_request_of_no_command_line_is_recorded_and_simulated() {
    let folder = tempfile::tempdir().expect("a folder");
    let record = folder.path().join("record.json");
    let mut request = Request::new(scenes().join("cornell-box.glb"));
    request.film.size = Some([64, 48]);
    request.goal.samples = Some(8);
    request.work.zones = Some(12);
    let options = SessionOptions { record: Some(record.clone()), ..SessionOptions::default() };
    let session = Session::open_with(&request, options).expect("opened");
    let picture = session.render(Arc::new(()), &StopSwitch::new()).expect("painted");
    let zones = picture.report().rows.len();
    let record = Record::from_json(&fs::read_to_string(record).expect("written")).expect("a record");
    let piece = Arc::new(Workpiece::recorded(&record, 1).expect("zones"));
    let outcome = simulate(&piece, &Plan::calm(FarmSpec::equal(8), 1)).expect("a simulated farm");
    assert_eq!((outcome.zones, outcome.failed, outcome.wrong), (zones, 0, 0));
    assert!(zones >= 6 && outcome.agents.len() == 8);
}

#[test]
fn the_examples_of_the_library_paint_pictures() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    for (name, arguments) in [("ten_lines", vec!["cornell-box.glb"]), ("in_memory", Vec::new())] {
        let picture = at(&format!("{name}.png"));
        let output = example(name).args(arguments).arg(&picture).output().expect("the example starts");
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        let picture = bottega_image::read_picture(&picture).expect("a picture");
        let mean = picture.data.iter().map(|pixel| pixel[1]).sum::<f32>() / picture.data.len() as f32;
        assert!(picture.width == 320 && (0.05..0.9).contains(&mean), "{name}: {mean}");
    }
}

#[test]
fn what_is_wrong_with_a_request_is_found_before_it_is_painted_or_sent() {
    let folder = tempfile::tempdir().expect("a folder");
    let record = folder.path().join("record.json");
    let json = br#"{"scene": {"file": "cornell-box.glb"}, "goal": {"error": 0.1}}"#;
    let picture = folder.path().join("a.exr");
    let output = fed(&["render", "--request", "-", "--record", text(&record), "-o", text(&picture)], json);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("--record needs a whole picture") && !picture.exists(), "{stderr}");

    let mut request = Request::new(scenes().join("cornell-box.glb"));
    assert!(Session::examine(&request).is_ok());
    request.film.size = Some([8, 8]);
    request.film.crop = Some([0, 0, 9, 8]);
    assert!(Session::examine(&request).map(drop).expect_err("a crop beyond the picture").to_string().contains("crop"));
    request.film.crop = None;
    let rules = bottega::request::RulesText { name: "mine.fcl".into(), text: "FUNCTION_BLOCK".to_owned() };
    request.work.rules = vec![bottega::request::RulesSource::Text(rules)];
    assert!(Session::examine(&request).map(drop).expect_err("rules that are cut off").to_string().contains("mine.fcl"));
}
