//! Engines that are installed: a picture in zones equals the whole frame that the engine renders itself.

use std::{fs, path::Path, process::Command};

use bottega_image::{Picture, ReadLimits, read_channels, read_picture};

use crate::engines::support::{bottega, scenes, text};

const MITSUBA: &str = r#"<scene version="3.0.0">
  <integrator type="path"><integer name="max_depth" value="6"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="39"/>
    <transform name="to_world"><lookat origin="0.3, -4, 1.4" target="0, 0, 0.6" up="0, 0, 1"/></transform>
    <sampler type="independent"><integer name="sample_count" value="16"/></sampler>
    <film type="hdrfilm"><integer name="width" value="96"/><integer name="height" value="72"/></film>
  </sensor>
  <bsdf type="twosided" id="gray"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></bsdf>
  <shape type="sphere"><point name="center" x="0" y="0" z="0.7"/><float name="radius" value="0.7"/><ref id="gray"/></shape>
  <shape type="rectangle"><transform name="to_world"><scale value="5"/></transform><ref id="gray"/></shape>
  <emitter type="constant"><rgb name="radiance" value="0.7, 0.8, 1"/></emitter>
</scene>"#;

const POVRAY: &str = "#version 3.7; global_settings { assumed_gamma 1.0 }
camera { location <0.3, 1.4, -4> look_at <0, 0.6, 0> right x*image_width/image_height angle 45 }
light_source { <3, 5, -4> rgb 1.2 }
background { rgb <0.3, 0.4, 0.6> }
plane { y, 0 pigment { checker rgb 0.7 rgb <0.5, 0.2, 0.1> } }
sphere { <0, 0.7, 0>, 0.7 pigment { rgb <0.6, 0.5, 0.4> } finish { reflection 0.2 } }
";

/// Returns true if the engine is installed; prints that the test is skipped if not.
fn is_here(name: &str) -> bool {
    let check = bottega(&["engines", "check", name]).output().expect("the program starts");
    if !check.status.success() {
        let stderr = String::from_utf8_lossy(&check.stderr);
        eprintln!("SKIPPED: {name} is not usable here; `cargo xtask engines --all` installs it: {stderr}");
    }
    check.status.success()
}

/// The Python in which Mitsuba's worker runs.
fn python() -> std::path::PathBuf {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(std::path::PathBuf::from);
    let of_all =
        || set("BOTTEGA_ENGINE_PYTHON").map(|named| if named.is_dir() { named.join("bin/python3") } else { named });
    set("BOTTEGA_MITSUBA_PYTHON").or_else(of_all).unwrap_or_else(|| "python3".into())
}

fn mean(picture: &Picture) -> f64 {
    picture.data.iter().flatten().map(|value| f64::from(*value)).sum::<f64>() / (3 * picture.data.len()) as f64
}

/// The engine's windows agree with its whole frame, and a picture in zones with one in a single window.
fn check(name: &str, scene: &Path, spp: &str) {
    let tried = bottega(&["engines", "try", name, text(scene), "--size", "96x72", "--spp", spp]).output();
    let tried = tried.expect("the program starts");
    let text_of = |output: &[u8]| String::from_utf8_lossy(output).into_owned();
    assert!(tried.status.success(), "{name}: {}{}", text_of(&tried.stdout), text_of(&tried.stderr));
    let folder = tempfile::tempdir().expect("a folder");
    let paint = |file: &str, more: &[&str]| {
        let output = folder.path().join(file);
        let usual = ["render", text(scene), "--engine", name, "--size", "96x72", "--spp", spp, "--quiet", "-o"];
        let done = bottega(&[usual.as_slice(), &[text(&output)], more].concat()).output().expect("the program starts");
        assert!(done.status.success(), "{name}: {}", text_of(&done.stderr));
        read_picture(output).expect("a picture")
    };
    let whole = paint("whole.exr", &["--set", "work.level=0"]);
    let zones = paint("zones.exr", &["--set", "work.level=3", "--set", "work.zones=6"]);
    assert_eq!(whole.size(), (96, 72));
    assert!((mean(&zones) / mean(&whole) - 1.0).abs() < 0.02, "{name}: {} and {}", mean(&zones), mean(&whole));
    if name == "cycles" {
        assert_eq!(whole, zones, "Cycles has the same bits in zones");
    }
}

fn check_text(name: &str, extension: &str, scene: &str, spp: &str) {
    if is_here(name) {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join(format!("scene.{extension}"));
        fs::write(&file, scene).expect("written");
        check(name, &file, spp);
    }
}

#[test]
fn mitsuba_paints_in_zones() {
    check_text("mitsuba", "xml", MITSUBA, "32");
}

/// NumPy makes the worker faster, and changes no pixel.
#[test]
fn mitsuba_paints_the_same_without_numpy() {
    if !is_here("mitsuba") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    fs::write(at("scene.xml"), aov_scene()).expect("written");
    fs::create_dir(at("hidden")).expect("a folder");
    fs::write(at("hidden").join("numpy.py"), "raise ModuleNotFoundError('hidden')").expect("written");
    let scene = at("scene.xml");
    let paint = |name: &str, path: Option<&Path>| {
        let output = at(name);
        let words = ["render", text(&scene), "--engine", "mitsuba", "--size", "40x30", "--spp", "4", "--seed", "3"];
        // Several threads add the blocks of a picture up in any order.
        let mut command = bottega(&[&words[..], &["--threads", "1", "--quiet", "-o", text(&output)]].concat());
        if let Some(path) = path {
            command.env("PYTHONPATH", path);
        }
        let done = command.output().expect("the program starts");
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let names = ["depth.Z", "normal.X", "which.I"].map(str::to_owned);
        let (file, planes) = read_channels(&output, ReadLimits::default(), &names).expect("a picture");
        assert!(planes.iter().all(Option::is_some), "{names:?}");
        (file.picture.data, planes)
    };
    assert!(paint("with.exr", None) == paint("without.exr", Some(&at("hidden"))));
}

#[test]
fn povray_paints_in_zones() {
    if Command::new("povray").arg("--version").output().is_ok() {
        check_text("povray", "pov", POVRAY, "9");
    } else {
        eprintln!("SKIPPED: there is no povray; `cargo xtask engines` installs it");
    }
}

#[test]
fn cycles_paints_in_zones() {
    let scene = scenes().join("goblets.glb");
    if is_here("cycles") && scene.is_file() {
        check("cycles", &scene, "16");
    }
}

/// Renders the whole frame by Mitsuba itself, without a worker: two pictures of different seeds, all channels.
const WHOLE_FRAMES: &str = "
import sys, numpy, mitsuba
mitsuba.set_variant('scalar_rgb')
scene = mitsuba.load_file(sys.argv[1])
names = scene.integrator().aov_names()
for seed in (1, 2):
    picture = numpy.array(mitsuba.render(scene, spp=32, seed=seed), numpy.float32)
    picture = numpy.concatenate([picture[..., :4], picture[..., picture.shape[2] - len(names):]], 2)
    picture.transpose(2, 0, 1).tofile(sys.argv[1 + seed])
print(' '.join(names))
";

fn aov_scene() -> String {
    let inner = r#"<integrator type="path"><integer name="max_depth" value="6"/></integrator>"#;
    let aovs = "far:depth,up:sh_normal,paint:albedo,which:shape_index,here:uv";
    let outer = format!(r#"<integrator type="aov"><string name="aovs" value="{aovs}"/>{inner}</integrator>"#);
    let film = r#"<film type="hdrfilm">"#;
    let with_alpha = format!(r#"{film}<string name="pixel_format" value="rgba"/>"#);
    MITSUBA.replace(inner, &outer).replace(film, &with_alpha)
}

#[test]
fn layers_of_a_picture_in_zones_are_those_of_the_whole_frame() {
    if !is_here("mitsuba") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    fs::write(at("scene.xml"), aov_scene()).expect("written");
    let whole = Command::new(python()).args(["-c", WHOLE_FRAMES]).args([at("scene.xml"), at("1"), at("2")]).output();
    let whole = whole.expect("Python starts");
    assert!(whole.status.success(), "{}", String::from_utf8_lossy(&whole.stderr));
    let own_names = String::from_utf8_lossy(&whole.stdout).into_owned();
    let own_names: Vec<&str> = ["R", "G", "B", "A"].into_iter().chain(own_names.split_whitespace()).collect();
    let planes = |name: &str| -> Vec<f32> {
        let bytes = fs::read(at(name)).expect("a picture");
        bytes.as_chunks().0.iter().map(|bytes| f32::from_ne_bytes(*bytes)).collect()
    };
    let (one, other) = (planes("1"), planes("2"));
    let output = at("zones.exr");
    // Two passes of each zone, of different numbers of samples, and bands where zones overlap.
    let scene = at("scene.xml");
    let words = ["render", text(&scene), "--engine", "mitsuba", "--spp", "32", "--set", "work.zones=7"];
    let done = bottega(&[&words[..], &["--quiet", "-o", text(&output)]].concat()).output().expect("the program starts");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let pairs = [
        ("R", "R"),
        ("A", "A"),
        ("depth.Z", "far.T"),
        ("normal.X", "up.X"),
        ("normal.Z", "up.Z"),
        ("albedo.G", "paint.G"),
        ("uv.U", "here.U"),
        ("uv.V", "here.V"),
    ];
    let names: Vec<String> = pairs.iter().map(|(name, _)| (*name).to_owned()).collect();
    let (file, found) = read_channels(&output, ReadLimits::default(), &names).expect("a picture");
    let red: Vec<f32> = file.picture.data.iter().map(|pixel| pixel[0]).collect();
    for ((name, own), found) in pairs.iter().zip(found) {
        let found: Vec<f32> = if *name == "R" { red.clone() } else { found.unwrap_or_else(|| panic!("no {name}")) };
        let place = own_names.iter().position(|known| known == own);
        let place = place.unwrap_or_else(|| panic!("Mitsuba has {own_names:?}, not {own}")) * found.len();
        let (one, other) = (&one[place..place + found.len()], &other[place..place + found.len()]);
        let rms = |a: &[f32], b: &[f32]| {
            (a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
        };
        let (apart, noise) = (rms(&found, one), rms(other, one));
        let mean = |values: &[f32]| values.iter().map(|value| f64::from(*value)).sum::<f64>() / values.len() as f64;
        let z = (mean(&found) - mean(one)) / (noise / (found.len() as f64).sqrt()).max(1e-6);
        assert!(apart < 1.2 * noise + 1e-5, "{name}: {apart} apart where two seeds are {noise}");
        assert!(z.abs() < 4.5, "{name}: the means differ by {z} standard errors");
    }
}

#[test]
fn two_engines_paint_one_picture() {
    if !is_here("mitsuba") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("scene.xml");
    fs::write(&scene, aov_scene()).expect("written");
    let paint = |engine: &str, more: &[&str]| {
        let output = folder.path().join(format!("{engine}.exr"));
        let words = [
            "render",
            text(&scene),
            "--engine",
            engine,
            "--spp",
            "64",
            "--set",
            "work.zones=8",
            "--verbose",
            "-o",
            text(&output),
        ];
        let done = bottega(&[&words, more].concat()).output().expect("the program starts");
        let stderr = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.success(), "{engine}: {stderr}");
        assert!(!stderr.contains("can be seen"), "{engine}: {stderr}");
        (output, stderr)
    };
    let (own, _) = paint("builtin", &["--aov", "depth,normal"]);
    let (other, _) = paint("mitsuba", &[]);
    let (both, stderr) = paint("builtin,mitsuba", &[]);
    assert!(stderr.contains("by builtin") && stderr.contains("by mitsuba"), "{stderr}");
    let names = ["depth.Z", "normal.X", "normal.Y", "normal.Z", "albedo.R", "uv.U"].map(str::to_owned);
    let read = |path: &Path| {
        let (file, planes) = read_channels(path, ReadLimits::default(), &names).expect("a picture");
        let colors = file.picture.data.iter().flatten().copied().collect();
        std::iter::once(Some(colors)).chain(planes).collect::<Vec<Option<Vec<f32>>>>()
    };
    let (own, other, both) = (read(&own), read(&other), read(&both));
    // Only layers that mean the same in both engines.
    assert!(both[5..].iter().all(Option::is_none) && other[5..].iter().all(Option::is_some));
    for (channel, ((own, other), both)) in own.iter().zip(&other).zip(&both).take(5).enumerate() {
        let [own, other, both] = [own, other, both].map(|plane| plane.as_deref().expect("a plane"));
        let mean = |values: &[f32]| values.iter().map(|value| f64::from(*value)).sum::<f64>() / values.len() as f64;
        let size = mean(&other.iter().map(|value| value.abs()).collect::<Vec<_>>());
        for (who, plane) in [("builtin", own), ("both", both)] {
            let apart = mean(plane) - mean(other);
            assert!(apart.abs() < 0.02 * size, "{channel}: {who} is {apart} apart from Mitsuba, of {size}");
        }
    }
}

/// Requests for two engines in one picture that are refused.
#[test]
fn two_engines_that_would_not_agree_are_refused() {
    if !is_here("mitsuba") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("scene.xml");
    let refuse = |text_of_scene: &str, more: &[&str], says: &str| {
        fs::write(&scene, text_of_scene).expect("written");
        let output = folder.path().join("a.exr");
        let words = ["render", text(&scene), "--engine", "builtin,mitsuba", "-o", text(&output)];
        let done = bottega(&[&words, more].concat()).env("NO_COLOR", "1").output().expect("the program starts");
        let stderr = String::from_utf8_lossy(&done.stderr).replace('│', " ");
        let stderr = stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(!done.status.success() && stderr.contains(says), "{stderr}");
    };
    let film = r#"<film type="hdrfilm">"#;
    let lanczos = MITSUBA.replace(film, &format!(r#"{film}<rfilter type="lanczos"/>"#));
    refuse(&lanczos, &[], "a pixel filter that the built-in engine does not have");
    refuse(&aov_scene(), &["--aov", "depth,albedo"], "do not make the same layer `albedo`");
    refuse(MITSUBA, &["--filter", "box"], "only the built-in engine supports --filter");
}

#[test]
fn a_gltf_without_a_camera_is_seen_alike_by_cycles_and_by_our_own_engine() {
    let scene = scenes().join("cornell-box.glb");
    if !is_here("cycles") || !scene.is_file() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let paint = |engine: &str| {
        let output = folder.path().join(format!("{engine}.exr"));
        let size = ["--size", "64x64", "--spp", "64", "--max-depth", "8", "--set", "work.zones=4"];
        let words = ["render", text(&scene), "--engine", engine, "-o", text(&output)];
        let done = bottega(&[&words[..], &size].concat()).output().expect("the program starts");
        let stderr = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.success() && !stderr.contains("can be seen"), "{engine}: {stderr}");
        read_picture(output).expect("a picture")
    };
    let (own, other, both) = (paint("builtin"), paint("cycles"), paint("builtin,cycles"));
    // Blocks of pixels, so that noise counts less than a shift of the view by a pixel.
    let blocks = |picture: &Picture| -> Vec<f64> {
        let mut sums = vec![0.0; 256];
        for (index, pixel) in picture.data.iter().enumerate() {
            let (x, y) = (index % 64, index / 64);
            sums[y / 4 * 16 + x / 4] += pixel.iter().map(|value| f64::from(value.min(1.0))).sum::<f64>() / 48.0;
        }
        sums
    };
    let size = blocks(&own).iter().sum::<f64>() / 256.0;
    // Glossy walls are 2 to 4 % brighter by Blender 3.4, whose materials are older than those of glTF.
    let list = bottega(&["engines", "list", "--wait", "90s"]).output().expect("the program starts").stdout;
    let is_old = String::from_utf8_lossy(&list).lines().any(|line| line.starts_with("cycles") && line.contains(" 3."));
    let most = if is_old { 0.12 } else { 0.05 };
    for (who, picture) in [("cycles", &other), ("both", &both)] {
        let apart = blocks(picture).iter().zip(blocks(&own)).map(|(a, b)| (a - b).abs()).sum::<f64>() / 256.0;
        assert!(apart < most * size, "{who}: {apart} apart on average, of {size}");
    }
}
