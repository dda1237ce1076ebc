//! `bottega analyze` on scenes, and its zones in a picture.

use std::{fs, path::Path};

use crate::program::support::{succeed, text};
use bottega_image::{ExrOptions, FlipOptions, Picture, Rect, flip, read_picture, write_picture_exr};
use serde_json::Value;

const SIZE: &str = "192x144";

/// Analyzes a scene for eight agents. Returns its index.
fn analyzed(scene: &str, folder: &Path, more: &[&str]) -> Value {
    let mut arguments = vec!["analyze", scene, "-o", text(folder), "--size", SIZE, "--agents", "8"];
    arguments.extend(more);
    succeed(&arguments);
    let index = fs::read_to_string(folder.join("index.json")).expect("an index");
    serde_json::from_str(&index).expect("JSON")
}

fn zones(index: &Value, level: usize) -> Vec<(Rect, f64)> {
    let zones = index["levels"][level - 1]["zones"].as_array().expect("zones");
    let zone = |zone: &Value| {
        let side = |i: usize| zone["rect"][i].as_u64().expect("a number") as u32;
        (Rect::new(side(0), side(1), side(2), side(3)), zone["complexity"].as_f64().expect("a number"))
    };
    zones.iter().map(zone).collect()
}

fn rendered(folder: &Path, name: &str, more: &[&str]) -> Picture {
    let output = folder.join(name);
    let mut arguments = vec!["render", "goblets.glb", "-o", text(&output), "--size", SIZE, "--agents", "8", "--quiet"];
    arguments.extend(more);
    succeed(&arguments);
    read_picture(&output).expect("a picture")
}

/// The output of `bottega diff --seams`: z and p.
fn seams(folder: &Path, name: &str, reference: Option<&str>) -> (f64, f64) {
    let (picture, index) = (folder.join(name), folder.join("index.json"));
    let reference = reference.map(|name| folder.join(name));
    let mut arguments = vec!["diff", text(&picture)];
    arguments.extend(reference.as_deref().map(text));
    arguments.extend(["--seams", text(&index), "--json"]);
    let report: Value = serde_json::from_str(&succeed(&arguments)).expect("JSON");
    (report["seams"]["z"].as_f64().expect("z"), report["seams"]["p"].as_f64().expect("p"))
}

#[test]
fn level_3_keeps_the_expected_times_of_real_scenes_within_a_tenth() {
    for scene in ["goblets.glb", "cornell-box.glb", "clear-coat-test.glb"] {
        let folder = tempfile::tempdir().expect("a folder");
        let index = analyzed(scene, folder.path(), &[]);
        let zones = zones(&index, 3);
        let mean = zones.iter().map(|(_, complexity)| complexity).sum::<f64>() / zones.len() as f64;
        for (rect, complexity) in &zones {
            let off = complexity / mean - 1.0;
            assert!(off.abs() <= 0.1, "{scene}: {rect} is {off:+.3} off");
        }
        for file in index["files"].as_array().expect("files") {
            let name = file["file"].as_str().expect("a name");
            assert!(read_picture(folder.path().join(name)).is_ok(), "{scene}: {name}");
        }
    }
}

#[test]
fn a_map_without_channels_is_even() {
    let folder = tempfile::tempdir().expect("a folder");
    let index = analyzed("goblets.glb", folder.path(), &["--set", "work.channels=depth"]);
    // Depth has no relation to time, so all zones of the first level are alike.
    let zones = zones(&index, 1);
    assert!(zones.iter().all(|(_, complexity)| (complexity / zones[0].1 - 1.0).abs() < 1e-3), "{zones:?}");
}

#[test]
fn zones_of_equal_quality_have_no_seams_and_those_that_are_put_in_are_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let zones = zones(&analyzed("goblets.glb", folder.path(), &[]), 3);
    let mut picture = rendered(folder.path(), "off.exr", &["--spp", "32"]);
    let (z, p) = seams(folder.path(), "off.exr", None);
    // Once in a thousand pictures without seams.
    assert!(p > 0.001, "z = {z}, p = {p}");

    for (rect, _) in zones.iter().step_by(2) {
        for (x, y) in rect.pixels() {
            picture.data[(y * picture.width + x) as usize].iter_mut().for_each(|value| *value *= 1.1);
        }
    }
    let path = folder.path().join("seams.exr");
    write_picture_exr(&path, &picture, &Default::default(), ExrOptions::default()).expect("it is written");
    // A tenth is less than the noise of a pixel; beside a picture of the same samples it is plain.
    let (z, p) = seams(folder.path(), "seams.exr", Some("off.exr"));
    assert!(p < 1e-3, "z = {z}, p = {p}");
}

#[test]
fn bands_between_zones_of_different_quality_are_not_seen() {
    /// Largest distance of a pixel that counts as near an edge of a zone, in pixels.
    const NEAR: u32 = 4;
    let folder = tempfile::tempdir().expect("a folder");
    let zones = zones(&analyzed("goblets.glb", folder.path(), &[]), 3);
    let off = rendered(folder.path(), "off.exr", &["--spp", "32"]);
    let other = rendered(folder.path(), "other.exr", &["--spp", "32", "--seed", "1"]);
    let optimized = rendered(folder.path(), "n.exr", &["--spp", "32", "--optimize", "n"]);
    // Mean FLIP of the pixels near edges, and of all others.
    let errors = |picture: &Picture| {
        let error = flip(&off, picture, &FlipOptions::default()).expect("equal sizes");
        let mut sums = [(0.0, 0.0); 2];
        for (rect, _) in &zones {
            let depth = |x: u32, y: u32| (x - rect.x0).min(rect.x1 - 1 - x).min(y - rect.y0).min(rect.y1 - 1 - y);
            for (x, y) in rect.pixels() {
                let (sum, count) = &mut sums[usize::from(depth(x, y) >= NEAR)];
                *sum += f64::from(error.map[(y * off.width + x) as usize]);
                *count += 1.0;
            }
        }
        sums.map(|(sum, count)| sum / count)
    };
    // A difference below that of another seed is noise. The difference is not at the edges of zones, of which
    // there are more where the scene is complex: there another seed differs more too.
    let ([near, inside], [noise_near, noise_inside]) = (errors(&optimized), errors(&other));
    assert!(near < noise_near, "FLIP near edges {near:.4}, of another seed {noise_near:.4}");
    let (at_edges, noise_at_edges) = (near / inside, noise_near / noise_inside);
    assert!(at_edges < 1.15 * noise_at_edges, "near over inside {at_edges:.3}, of another seed {noise_at_edges:.3}");
    // Beside a picture of the same samples a step of a tenth between zones has z above 8.
    let (z, p) = seams(folder.path(), "n.exr", Some("off.exr"));
    assert!(p > 1e-3, "z = {z}, p = {p}");
}

#[test]
fn noise_is_measured_by_pixel_and_by_kind_of_path() {
    let folder = tempfile::tempdir().expect("a folder");
    let index = analyzed("goblets.glb", folder.path(), &["--noise=4", "--noise-spp", "4"]);
    let noise = &index["noise"];
    let kinds = noise["kinds"].as_array().expect("kinds");
    for share in ["light", "relative_error", "shown_error"] {
        let sum: f64 = kinds.iter().map(|kind| kind[share].as_f64().expect("a share")).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{share}: {sum}");
    }
    assert!(noise["rel_mse"].as_f64().is_some_and(|error| error > 1e-4), "{noise}");
    // The lamp is seen through glass: no light sample finds that.
    let through_glass = kinds.iter().filter(|kind| kind["found_by"] == "over mirror or glass" && kind["bounces"] != 0);
    assert!(through_glass.map(|kind| kind["light"].as_f64().unwrap_or_default()).sum::<f64>() > 0.01, "{noise}");
    for name in ["noise", "noise-light-samples", "noise-scattered-rays", "noise-mirrors-and-glass"] {
        let picture = read_picture(folder.path().join(format!("{name}.png"))).expect("a picture");
        assert_eq!((picture.width, picture.height), (192, 144), "{name}");
    }
}
