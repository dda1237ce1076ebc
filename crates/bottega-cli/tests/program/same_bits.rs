//! A picture depends on scene, settings and seed, not on the agents and machines that paint it.

use std::{fs, path::Path};

use crate::program::support::{interrupt, scenes, succeed, text};
use proptest::prelude::*;

const SIZE: &str = "48x36";

/// The pixels of an EXR file, bit by bit, without the metadata, which has the time taken.
fn bits(path: &Path) -> Vec<[u32; 3]> {
    let picture = bottega_image::read_picture(path).expect("a picture");
    picture.data.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

fn painted(folder: &Path, name: &str, more: &[&str]) -> Vec<[u32; 3]> {
    let usual = ["--size", SIZE, "--spp", "24"];
    painted_as(folder, name, &[&usual, more].concat())
}

fn painted_as(folder: &Path, name: &str, settings: &[&str]) -> Vec<[u32; 3]> {
    let output = folder.join(name);
    let mut arguments = vec!["render", "goblets.glb", "-o", text(&output), "--quiet"];
    arguments.extend(settings);
    succeed(&arguments);
    assert!(!folder.join(format!("{name}.bottega-journal")).exists(), "a complete picture needs no journal");
    bits(&output)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_picture_does_not_depend_on_who_paints_it(
        agents in prop::sample::select(vec!["1", "2", "7"]),
        level in prop::sample::select(vec!["work.level=0", "work.level=1", "work.level=2", "work.level=3"]),
        threads in prop::sample::select(vec!["1", "2"]),
        seed in 0u64..1000,
    ) {
        let folder = tempfile::tempdir().expect("a folder");
        let seed = seed.to_string();
        let reference = painted(folder.path(), "a.exr", &["--agents", "1", "--set", "work.level=0", "--threads", "1", "--seed", &seed]);
        let other =
            painted(folder.path(), "b.exr", &["--agents", agents, "--set", level, "--threads", threads, "--seed", &seed]);
        prop_assert_eq!(reference, other);
    }
}

#[test]
fn a_picture_with_an_error_does_not_depend_on_who_paints_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let painted = |name: &str, more: &[&str]| {
        let usual = ["--size", "100x70", "--spp", "200", "--error", "0.25", "--aov", "samples", "--exact"];
        painted_as(folder.path(), name, &[&usual, more].concat())
    };
    let reference = painted("a.exr", &["--agents", "1", "--set", "work.level=0", "--threads", "1"]);
    for (name, more) in [
        ("b.exr", ["--agents", "7", "--set", "work.level=1", "--threads", "2"]),
        ("c.exr", ["--agents", "3", "--set", "work.level=3", "--threads", "2"]),
        ("d.exr", ["--agents", "2", "--set", "work.zones=12", "--threads", "1"]),
    ] {
        assert_eq!(reference, painted(name, &more), "{more:?}");
    }
}

#[test]
fn exactly_the_requested_frames_are_rendered() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = folder.path().join("f.%03d.exr");
    let words = ["render", "goblets.glb", "--size", "8x8", "--spp", "1", "--quiet", "-o", text(&output)];
    succeed(&[&words[..], &["--frames", "-2..2:2,7"]].concat());
    let mut names: Vec<_> =
        fs::read_dir(folder.path()).expect("it is there").flatten().map(|it| it.file_name()).collect();
    names.sort();
    assert_eq!(names, ["f.-002.exr", "f.000.exr", "f.002.exr", "f.007.exr"]);
}

#[test]
fn another_seed_gives_another_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let a = painted(folder.path(), "a.exr", &["--seed", "1"]);
    let b = painted(folder.path(), "b.exr", &["--seed", "2"]);
    assert_ne!(a, b);
}

#[test]
fn a_crop_equals_that_part_of_the_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    painted(folder.path(), "whole.exr", &[]);
    painted(folder.path(), "crop.exr", &["--crop", "11,5,40,29", "--agents", "2"]);
    let whole = bottega_image::read_picture(folder.path().join("whole.exr")).expect("a picture");
    let crop = bottega_image::read_picture(folder.path().join("crop.exr")).expect("a picture");
    assert_eq!(crop.size(), (29, 24));
    for y in 0..24 {
        for x in 0..29 {
            assert_eq!(crop.pixel(x, y).map(f32::to_bits), whole.pixel(x + 11, y + 5).map(f32::to_bits), "{x},{y}");
        }
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_picture_goes_on_to_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = ["--size", "64x48", "--spp", "1500", "--max-depth", "8"];
    let (whole, parts) = (folder.path().join("whole.exr"), folder.path().join("parts.exr"));
    let scene = scenes().join("goblets.glb");
    let command = |output: &'_ Path| -> Vec<String> {
        let start = ["render", text(&scene), "-o", text(output)];
        start.iter().chain(&settings).map(|&argument| argument.to_owned()).collect()
    };
    let as_refs = |owned: &[String]| owned.iter().map(String::as_str).map(str::to_owned).collect::<Vec<_>>();
    let interrupted = as_refs(&command(&parts));
    let arguments: Vec<&str> = interrupted.iter().map(String::as_str).collect();
    let status = interrupt(&arguments);
    assert_eq!(status.code(), Some(130), "it was stopped before its end");
    assert!(parts.exists(), "what is painted is written");
    assert!(folder.path().join("parts.exr.bottega-journal").exists(), "and kept");

    let mut resumed = arguments.clone();
    resumed.extend(["--resume", "--quiet", "--agents", "3"]);
    succeed(&resumed);
    let quiet = command(&whole);
    let mut arguments: Vec<&str> = quiet.iter().map(String::as_str).collect();
    arguments.push("--quiet");
    succeed(&arguments);
    assert_eq!(bits(&whole), bits(&parts));
    assert!(fs::metadata(folder.path().join("parts.exr.bottega-journal")).is_err(), "nothing is left behind");
}
