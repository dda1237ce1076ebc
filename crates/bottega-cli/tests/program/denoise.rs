//! `render --denoise`, with the real library if it is installed.

use std::{fs, process::Command};

use crate::program::support::{self, bottega, text};
use bottega_denoise::{DenoiseError, Denoiser};
use bottega_image::{ReadLimits, read_channels, read_image};

/// Returns true if the library is installed; prints that the test is skipped if not.
fn is_here() -> bool {
    match Denoiser::load() {
        Ok(_) => true,
        Err(DenoiseError::NotFound { tried }) => {
            eprintln!("SKIPPED: there is not Open Image Denoise ({tried}); BOTTEGA_OIDN may name one");
            false
        }
        Err(error) => panic!("{error}"),
    }
}

fn run_for_text(command: &mut Command) -> (Option<i32>, String) {
    let output = command.env("NO_COLOR", "1").output().expect("the program starts");
    let text = String::from_utf8_lossy(&output.stderr).replace('│', " ");
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ") + &String::from_utf8_lossy(&output.stdout);
    (output.status.code(), text)
}

#[test]
fn a_picture_is_denoised_when_it_is_finished_and_keeps_its_noisy_color() {
    if !is_here() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let (noisy, clean, shown) = (at("noisy.exr"), at("clean.exr"), at("clean.png"));
    let usual = ["render", "cornell-box.glb", "--size", "64x48", "--spp", "4", "-o"];
    let paint = |more: &[&str]| {
        let (code, said) = run_for_text(&mut bottega(&[&usual[..], more].concat()));
        assert_eq!(code, Some(0), "{more:?}: {said}");
        said
    };
    paint(&[text(&noisy), "--aov", "albedo,normal"]);
    let json = paint(&[text(&clean), "--denoise", "--json"]);
    assert!(json.contains(r#""event":"denoised","by":"Open Image Denoise"#), "{json}");
    assert!(paint(&[text(&shown), "--denoise", "--verbose"]).contains("of color, albedo, normal"));
    let names = ["noisy.R", "noisy.G", "noisy.B", "albedo.R", "normal.Z"].map(str::to_owned);
    let (before, _) = read_channels(&noisy, ReadLimits::default(), &names).expect("a picture");
    let (after, layers) = read_channels(&clean, ReadLimits::default(), &names).expect("a picture");
    assert_ne!(before.picture, after.picture);
    assert!(layers.iter().all(Option::is_some));
    for (channel, layer) in layers.iter().take(3).enumerate() {
        let expected: Vec<f32> = before.picture.data.iter().map(|pixel| pixel[channel]).collect();
        assert_eq!(layer.as_ref(), Some(&expected), "nothing is lost");
    }
    for file in [&clean, &shown] {
        let metadata = read_image(file, ReadLimits::default()).expect("a picture").metadata;
        assert!(metadata.get("denoised").is_some_and(|by| by.contains("albedo")), "{metadata:?}");
    }
}

#[test]
fn frames_are_denoised_each_and_color_alone_where_no_layers_are_wanted() {
    if !is_here() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let output = folder.path().join("##.exr");
    let words = ["render", "cornell-box.glb", "--size", "32x32", "--spp", "2", "--frames", "1..2", "--denoise"];
    let (code, said) = run_for_text(&mut bottega(&[&words[..], &["--aov", "none", "-o", text(&output)]].concat()));
    assert_eq!(code, Some(0), "{said}");
    for name in ["01.exr", "02.exr"] {
        let names = ["noisy.R", "albedo.R"].map(str::to_owned);
        let (file, layers) = read_channels(folder.path().join(name), ReadLimits::default(), &names).expect("a frame");
        assert!(layers[0].is_some() && layers[1].is_none());
        assert!(file.metadata.get("denoised").is_some_and(|by| by.ends_with("of color")));
    }
}

#[test]
fn a_missing_library_is_reported_before_anything_is_painted() {
    let folder = tempfile::tempdir().expect("a folder");
    let broken = folder.path().join("broken.so");
    fs::write(&broken, "no library").expect("written");
    let output = folder.path().join("a.exr");
    for (place, says) in [
        (folder.path().join("nowhere"), "not installed here"),
        (folder.path().to_owned(), "not installed here"),
        (broken, "is not Open Image Denoise"),
    ] {
        let words = ["render", "cornell-box.glb", "--spp", "100000", "-o", text(&output), "--denoise"];
        let (code, said) = run_for_text(bottega(&words).env("BOTTEGA_OIDN", &place));
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains(says) && said.contains("BOTTEGA_OIDN"), "{said}");
    }
    let left: Vec<_> =
        fs::read_dir(folder.path()).expect("a folder").flatten().map(|entry| entry.file_name()).collect();
    assert_eq!(left, ["broken.so"], "no journal is left behind");
}

#[cfg(unix)]
#[test]
fn what_is_stopped_keeps_its_noise_and_is_denoised_when_it_is_finished() {
    if !is_here() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let (parts, plain) = (folder.path().join("parts.exr"), folder.path().join("plain.exr"));
    let usual = ["render", "goblets.glb", "--size", "64x48", "--spp", "1000"];
    let arguments = [&usual[..], &["--denoise", "-o", text(&parts)]].concat();
    assert_eq!(support::interrupt(&arguments).code(), Some(130), "it was stopped before its end");
    let stopped = read_image(&parts, ReadLimits::default()).expect("what is painted is written");
    assert_eq!(stopped.metadata.get("denoised"), None);
    support::succeed(&[&arguments[..], &["--resume", "--quiet"]].concat());
    support::succeed(&[&usual[..], &["--quiet", "-o", text(&plain)]].concat());
    let names = ["noisy.R", "noisy.G", "noisy.B"].map(str::to_owned);
    let (done, noisy) = read_channels(&parts, ReadLimits::default(), &names).expect("a picture");
    assert!(done.metadata.get("denoised").is_some());
    let plain = read_image(&plain, ReadLimits::default()).expect("a picture").picture;
    assert_ne!(done.picture, plain);
    for (channel, layer) in noisy.iter().enumerate() {
        let expected: Vec<f32> = plain.data.iter().map(|pixel| pixel[channel]).collect();
        assert_eq!(layer.as_ref(), Some(&expected), "the noise is that of a picture that nobody stopped");
    }
}
