//! Light groups and forms of EXR files, as a user asks for them.

use std::{fs, path::Path};

use bottega_image::{ReadLimits, read_channels, read_image};

use crate::program::support::{interrupt, run, succeed, text};

const LIGHTS: [&str; 2] = ["light_lamp", "light_sky"];

/// The options of a picture that is lit by the lamp of the box and by a sky.
fn words(output: &Path) -> Vec<&str> {
    let usual = ["cornell-box.glb", "-o", text(output), "--size", "40x30", "--spp", "1200", "--set=work.zones=12"];
    let lights = ["--env", "0.3,0.4,0.5", "--light-group", "lamp=*mitter*", "--light-group", "sky=environment"];
    [&["render"][..], &usual, &lights].concat()
}

/// Color and groups of a file: red of each pixel.
fn reds(path: &Path) -> [Vec<u32>; 3] {
    let names = [LIGHTS.map(|layer| format!("{layer}.R")).to_vec(), vec!["R".to_owned()]].concat();
    let (_, planes) = read_channels(path, ReadLimits::default(), &names).expect("a picture");
    let planes: Vec<Vec<u32>> =
        planes.into_iter().map(|plane| plane.expect("a layer").iter().map(|value| value.to_bits()).collect()).collect();
    planes.try_into().expect("three channels")
}

#[test]
fn light_groups_add_up_and_depend_on_nobody_who_paints() {
    let folder = tempfile::tempdir().expect("a folder");
    let [one, other, stopped] = ["one.exr", "other.exr", "stopped.exr"].map(|name| folder.path().join(name));
    succeed(&[&words(&one)[..], &["--quiet", "--threads", "1", "--agents", "1"]].concat());
    succeed(&[&words(&other)[..], &["--quiet", "--threads", "2", "--agents", "3", "--set", "work.zones=7"]].concat());
    let of_one = reds(&one);
    assert_eq!(of_one, reds(&other));
    let [lamp, sky, whole] = of_one.each_ref().map(|bits| bits.iter().map(|bits| f32::from_bits(*bits)));
    let mut sums = [0.0; 2];
    for ((lamp, sky), whole) in lamp.zip(sky).zip(whole) {
        assert!((lamp + sky - whole).abs() <= 1e-5 * whole.max(1.0), "{lamp} + {sky} is not {whole}");
        sums = [sums[0] + lamp, sums[1] + sky];
    }
    assert!(sums.iter().all(|sum| *sum > 1.0), "{sums:?}");
    // An interrupted picture goes on to the same bits
    let long = words(&stopped);
    assert_eq!(interrupt(&long).code(), Some(130), "it was stopped before its end");
    succeed(&[&long[..], &["--quiet", "--resume"]].concat());
    assert_eq!(reds(&stopped), of_one);
}

#[test]
fn a_light_group_without_lights_names_the_lights_there_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("a.exr");
    let small = ["render", "cornell-box.glb", "-o", text(&picture), "--size", "8x6", "--spp", "1"];
    let output = run(&[&small[..], &["--light-group", "key=Lamp*"]].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && said.contains("no light belongs to `key`"), "{said}");
    let listed = said.split("the lights are ").nth(1).expect("a list").trim().trim_end_matches('.').to_owned();
    let first = listed.split([',', '\n']).next().expect("a light").trim().to_owned();
    let output = run(&[&small[..], &["--light-group", &format!("key={first}")]].concat());
    assert!(!String::from_utf8_lossy(&output.stderr).contains("no light"), "{first}");
    for (wrong, expected) in [
        (vec!["--light-group", "a.b=*"], "none of them a dot"),
        (vec!["--light-group", "key=*", "--integrator", "photon"], "--integrator path"),
        (vec!["--light-group", "key=*", "--engine", "mitsuba"], "exclude each other"),
    ] {
        let output = run(&[&small[..], &wrong].concat());
        let said = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ").replace("\n      ", " ");
        assert!(output.status.code() == Some(2) && said.contains(expected), "{wrong:?}: {said}");
    }
}

#[test]
fn light_on_shadow_catchers_depends_on_nobody_who_paints() {
    let folder = tempfile::tempdir().expect("a folder");
    let [one, other, stopped] = ["one.exr", "other.exr", "stopped.exr"].map(|name| folder.path().join(name));
    let words = |output: &'_ Path| -> Vec<String> {
        let usual = ["render", "cornell-box.glb", "-o", text(output), "--size", "24x18", "--spp", "300"];
        let more = ["--set=work.zones=12", "--shadow-catcher", "cbox*"];
        usual.into_iter().chain(more).map(str::to_owned).collect()
    };
    let with = |words: &[String], more: &[&str]| {
        let words: Vec<&str> = words.iter().map(String::as_str).chain(more.iter().copied()).collect();
        succeed(&words);
    };
    let bits = |path: &Path| -> Vec<u32> {
        let layers = ["shadow_catcher.R", "shadow_catcher.A", "catcher_light.G", "A", "R"].map(str::to_owned);
        let planes = read_channels(path, ReadLimits::default(), &layers).expect("a picture").1;
        planes.into_iter().flat_map(|plane| plane.expect("a layer")).map(f32::to_bits).collect()
    };
    with(&words(&one), &["--quiet", "--threads", "1", "--agents", "1"]);
    with(&words(&other), &["--quiet", "--threads", "2", "--agents", "3", "--set", "work.zones=7"]);
    let of_one = bits(&one);
    assert_eq!(of_one, bits(&other));
    let mean = |plane: &[u32]| plane.iter().map(|&bits| f32::from_bits(bits)).sum::<f32>() / plane.len() as f32;
    let means: Vec<f32> = of_one.chunks(24 * 18).map(mean).collect();
    assert!(means[0] < 0.99 && means[1] > 0.2 && means[2] > 0.0 && means[3] < 1.0, "{means:?}");
    // An interrupted picture goes on to the same bits
    let long = words(&stopped);
    let words: Vec<&str> = long.iter().map(String::as_str).collect();
    assert_eq!(interrupt(&words).code(), Some(130), "it was stopped before its end");
    with(&long, &["--quiet", "--resume"]);
    assert_eq!(bits(&stopped), of_one);
}

#[test]
fn shadow_catchers_that_cannot_be_are_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("a.exr");
    let small = ["render", "cornell-box.glb", "-o", text(&picture), "--size", "8x6", "--spp", "1"];
    let output = run(&[&small[..], &["--shadow-catcher", "sofa"]].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && said.contains("named `sofa`") && said.contains("the objects are "), "{said}");
    for (wrong, expected) in [
        (["--shadow-catcher=cbox*", "--integrator", "photon"], "--integrator path"),
        (["--shadow-catcher=cbox*", "--engine", "mitsuba"], "exclude each other"),
        (["--quiet", "--aov", "shadow-catcher"], "it comes with --shadow-catcher"),
    ] {
        let output = run(&[&small[..], &wrong].concat());
        let said = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ").replace("\n      ", " ");
        assert!(output.status.code() == Some(2) && said.contains(expected), "{wrong:?}: {said}");
    }
}

#[test]
fn files_have_the_color_space_compression_and_parts_that_are_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let paint = |name: &str, more: &[&str]| {
        let path = folder.path().join(name);
        let usual =
            ["--size", "64x48", "--spp", "4", "--seed", "3", "--aov", "depth,normal,position,crypto-object", "--quiet"];
        succeed(&[&["render", "cornell-box.glb", "-o", text(&path)], &usual[..], more].concat());
        path
    };
    let plain = paint("plain.exr", &[]);
    let aces = paint("aces.exr", &["--colorspace", "acescg"]);
    let lossy = paint("lossy.exr", &["--set=output.compression=dwaa", "--set=output.parts=true", "--half"]);
    let color = |path: &Path| read_image(path, ReadLimits::default()).expect("a picture").picture.data;
    let most = |path: &Path| {
        let pairs = color(path).into_iter().zip(color(&plain)).collect::<Vec<_>>();
        pairs
            .iter()
            .flat_map(|(a, b)| a.iter().zip(b))
            .map(|(a, b)| (a - b).abs() / b.abs().max(1.0))
            .fold(0.0, f32::max)
    };
    // The colors are the same; the numbers in the file are not
    assert!(most(&aces) < 1e-3, "{}", most(&aces));
    assert!(most(&lossy) < 0.05, "{}", most(&lossy));
    assert_ne!(fs::read(&aces).expect("a file")[200..], fs::read(&plain).expect("a file")[200..]);
    let depth = |path: &Path| {
        let names = ["depth.Z", "P.X", "P.Y", "P.Z", "CryptoObject00.R"].map(str::to_owned);
        read_channels(path, ReadLimits::default(), &names).expect("a picture").1
    };
    let bits = |planes: Vec<Option<Vec<f32>>>| -> Vec<u32> {
        planes.into_iter().flat_map(|plane| plane.expect("a layer")).map(f32::to_bits).collect()
    };
    assert_eq!(bits(depth(&plain)), bits(depth(&lossy)));
    assert_eq!(bits(depth(&plain)), bits(depth(&aces)));
    // Without half precision normals are kept, too
    let whole = paint("whole.exr", &["--set=output.compression=dwab"]);
    let normal = |path: &Path| {
        let names = ["normal.X", "normal.Y", "normal.Z"].map(str::to_owned);
        read_channels(path, ReadLimits::default(), &names).expect("a picture").1
    };
    assert_eq!(bits(normal(&plain)), bits(normal(&whole)));
}

#[test]
fn support_tells_what_is_read_from_what_is_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("a.pbrt");
    let felt = "Material \"felt\"\nShape \"sphere\"\n";
    let begin = "Camera \"perspective\"\nWorldBegin\nLightSource \"point\"\nShape \"sphere\"\n";
    fs::write(&scene, format!("{begin}{felt}{felt}")).expect("a file");
    let said = succeed(&["info", text(&scene), "--support"]);
    let (read, rest) = said.split_once("replaced or left out").expect("two parts");
    assert!(read.contains("3 spheres") && read.contains("1 point") && read.contains("1 perspective"), "{said}");
    assert!(rest.contains("2 × the material \"felt\" is unknown") && rest.contains("first: a.pbrt:5:1"), "{said}");
    let json: serde_json::Value = serde_json::from_str(&succeed(&["info", text(&scene), "--json"])).expect("JSON");
    let unsupported = json["unsupported"].as_array().expect("a list");
    assert!(
        !unsupported.is_empty() && unsupported.len() <= json["warnings"].as_array().expect("a list").len(),
        "{json}"
    );
    // Nothing is missing where all is read
    assert!(succeed(&["info", "cornell-box.glb", "--support"]).contains("replaced or left out: nothing"));
}
