//! Farms that paint with external engines.

use std::{fs, path::Path};

use bottega_image::{ReadLimits, read_channels, read_picture};

use super::{
    fixture::Farm,
    support::{bottega, servers, text},
};

const SCENE: &str = r#"<scene version="3.0.0">
  <integrator type="aov">
    <string name="aovs" value="far:depth,here:uv"/>
    <integrator type="path"><integer name="max_depth" value="4"/></integrator>
  </integrator>
  <sensor type="perspective">
    <float name="fov" value="39"/>
    <transform name="to_world"><lookat origin="0, -4, 1" target="0, 0, 0" up="0, 0, 1"/></transform>
    <film type="hdrfilm"><integer name="width" value="96"/><integer name="height" value="72"/></film>
  </sensor>
  <shape type="ply"><string name="filename" value="meshes/square.ply"/></shape>
  <emitter type="constant"/>
</scene>"#;

const SQUARE: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    element face 2\nproperty list uchar int vertex_indices\nend_header\n-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n3 0 1 2\n3 0 2 3\n";

#[test]
fn a_machine_paints_with_mitsuba_and_one_without_it_says_so() {
    let Some(server) = servers().pop() else { return };
    let check = bottega(&["engines", "check", "mitsuba"]).output().expect("the program starts");
    if !check.status.success() {
        eprintln!("SKIPPED: there is no Mitsuba; `cargo xtask engines` installs it");
        return;
    }
    let farm = Farm::start(&server);
    fs::create_dir(farm.path("meshes")).expect("a folder");
    fs::write(farm.path("scene.xml"), SCENE).expect("written");
    fs::write(farm.path("meshes/square.ply"), SQUARE).expect("written");
    let (scene, output) = (farm.path("scene.xml"), farm.path("a.exr"));
    let words = [
        "render",
        text(&scene),
        "--engine",
        "mitsuba",
        "-o",
        text(&output),
        "--spp=16",
        "--set=work.zones=6",
        "--quiet",
    ];
    let alone = farm.path("alone.exr");
    farm.succeed(&["render", text(&scene), "--engine", "mitsuba", "-o", text(&alone), "--spp=16", "--quiet"]);
    farm.succeed(&[&words, ["--farm", "--detach"].as_slice()].concat());
    let mut poor = farm.command(&["join", "--threads", "1", "--cache", text(&farm.path("cache-poor"))]);
    // A machine without any Python.
    poor.env("PATH", farm.path("nowhere")).env_remove("BOTTEGA_ENGINE_PYTHON").env_remove("BOTTEGA_MITSUBA_PYTHON");
    let log = fs::File::create(farm.path("poor")).expect("a log");
    let _poor =
        super::fixture::Process(poor.stdout(log.try_clone().expect("a log")).stderr(log).spawn().expect("it starts"));
    farm.until("the poor machine refuses", || {
        let shown = farm.succeed(&["jobs", "log", "1"]);
        shown.contains("is left out") && shown.contains("not installed here")
    });
    let _one = farm.join("one");
    farm.until_state(1, "done");
    farm.succeed(&["jobs", "fetch", "1"]);
    let (farmed, alone) = (read_picture(&output).expect("a picture"), read_picture(&alone).expect("a picture"));
    let mean = |picture: &bottega_image::Picture| {
        picture.data.iter().flatten().map(|value| f64::from(*value)).sum::<f64>() / (3 * picture.data.len()) as f64
    };
    assert!((mean(&farmed) / mean(&alone) - 1.0).abs() < 0.02, "{} and {}", mean(&farmed), mean(&alone));
    // Layers arrived, at the place of the colour.
    let names = ["depth.Z", "uv.U"].map(str::to_owned);
    let layers = |path: &Path| read_channels(path, ReadLimits::default(), &names).expect("a picture").1;
    for (name, (farmed, alone)) in names.iter().zip(layers(&output).into_iter().zip(layers(&farm.path("alone.exr")))) {
        let (farmed, alone) = (farmed.expect("the layer"), alone.expect("the layer"));
        let apart = farmed.iter().zip(&alone).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / alone.len() as f64;
        let size = alone.iter().map(|value| f64::from(*value)).sum::<f64>() / alone.len() as f64;
        assert!(size > 0.05 && apart < 0.05 * size, "{name}: {apart} apart, {size} on average");
    }
    // The square is visible: its file was sent, too.
    assert!(farmed.pixel(48, 36) != farmed.pixel(2, 2));
}

#[test]
fn a_picture_of_a_farm_is_denoised_as_a_whole() {
    let Some(server) = servers().pop() else { return };
    if let Err(error) = bottega_denoise::Denoiser::load() {
        eprintln!("SKIPPED: {error}");
        return;
    }
    let farm = Farm::start(&server);
    let (farmed, alone) = (farm.path("farmed.exr"), farm.path("alone.exr"));
    let usual = [
        "render",
        "cornell-box.glb",
        "--size",
        "64x48",
        "--spp",
        "64",
        "--set=work.zones=9",
        "--denoise",
        "--quiet",
        "-o",
    ];
    farm.succeed(&[&usual[..], &[text(&alone)]].concat());
    let _one = farm.join("one");
    farm.succeed(&[&usual[..], &[text(&farmed), "--farm"]].concat());
    let names = ["noisy.R", "albedo.G", "normal.Z"].map(str::to_owned);
    let read = |path: &Path| read_channels(path, ReadLimits::default(), &names).expect("a picture");
    let ((farmed, its_layers), (alone, layers)) = (read(&farmed), read(&alone));
    assert!(farmed.metadata.get("denoised").is_some(), "{:?}", farmed.metadata);
    assert_eq!(its_layers, layers);
    // Denoised zone by zone the picture differs, because the denoiser does not see beyond their edges.
    assert_eq!(farmed.picture, alone.picture);
}

const MOVING: &str = "#version 3.7; global_settings { assumed_gamma 1.0 } #include \"lamp.inc\"
camera { location <0, 1, -4> look_at <0, 0.5, 0> right x*image_width/image_height angle 45 }
background { rgb <0.3, 0.4, 0.6> }
plane { y, 0 pigment { checker rgb 0.7 rgb <0.5, 0.2, 0.1> } }
sphere { <frame_number / 2 - 1, 0.5, 0>, 0.5 pigment { rgb <0.6, 0.5, 0.4> } }
";

#[test]
fn an_animation_is_painted_by_machines_with_povray_and_a_lost_frame_alone() {
    let Some(server) = servers().pop() else { return };
    let check = bottega(&["engines", "check", "povray"]).output().expect("the program starts");
    if !check.status.success() {
        eprintln!("SKIPPED: there is no POV-Ray; `cargo xtask engines` installs it");
        return;
    }
    let farm = Farm::start(&server);
    fs::write(farm.path("film.pov"), MOVING).expect("written");
    fs::write(farm.path("lamp.inc"), "light_source { <3, 5, -4> rgb 1.2 }").expect("written");
    let ini = "Input_File_Name=film.pov\nInitial_Frame=1\nFinal_Frame=3\n";
    fs::write(farm.path("film.ini"), ini).expect("written");
    let scene = farm.path("film.ini");
    let words = |output: &str| {
        let output = farm.path(output);
        let words = ["render", text(&scene), "--engine", "povray", "--frames", "1..3", "-o", text(&output)];
        let quality = ["--size=64x48", "--spp=4", "--set=work.zones=4", "--quiet"];
        words.into_iter().chain(quality).map(str::to_owned).collect::<Vec<_>>()
    };
    let run = |words: &[String]| farm.succeed(&words.iter().map(String::as_str).collect::<Vec<_>>());
    run(&words("alone.####.exr"));
    let _machines = ["one", "two"].map(|name| farm.join(name));
    let farmed = [words("film.####.exr"), vec!["--farm".to_owned()]].concat();
    run(&farmed);
    let frame = |kind: &str, number: u32| super::fixture::bits(&farm.path(&format!("{kind}.000{number}.exr")));
    for number in 1..=3 {
        assert_eq!(frame("film", number), frame("alone", number), "frame {number}");
    }
    assert!(frame("film", 1) != frame("film", 2) && frame("film", 2) != frame("film", 3));
    fs::remove_file(farm.path("film.0002.exr")).expect("removed");
    fs::write(farm.path("film.0003.exr"), "mine").expect("written");
    run(&[farmed, vec!["--resume".to_owned()]].concat());
    assert_eq!(frame("film", 2), frame("alone", 2));
    assert_eq!(fs::read(farm.path("film.0003.exr")).expect("a file"), b"mine");
}
