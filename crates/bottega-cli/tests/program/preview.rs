//! Previews while a picture is rendered: their files, and how these are written.

use std::{
    fs,
    io::{BufRead, BufReader},
    path::Path,
    process::Stdio,
};

use crate::program::support::{bottega, run, scenes, signal, succeed, text};
use bottega_image::{Picture, read_picture, rmse};

const SIZE: (u32, u32) = (96, 72);

fn arguments<'a>(scene: &'a str, output: &'a Path, more: &[&'a str]) -> Vec<&'a str> {
    [&["render", scene, "-o", text(output), "--size", "96x72", "--spp", "48"], more].concat()
}

fn picture(path: &Path) -> Picture {
    read_picture(path).expect("a picture")
}

#[test]
fn the_preview_is_complete_at_once_and_in_the_end_the_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let [output, seen, alone] = ["a.png", "seen.png", "b.png"].map(|name| folder.path().join(name));
    let options = ["--json", "--preview", text(&seen)];
    let mut child =
        bottega(&arguments("goblets.glb", &output, &options)).stdout(Stdio::piped()).spawn().expect("it starts");
    let (mut first, mut kinds) = (None, Vec::new());
    for line in BufReader::new(child.stdout.take().expect("piped")).lines() {
        let event: serde_json::Value = serde_json::from_str(&line.expect("text")).expect("JSON");
        if event["event"] == "preview" && first.is_none() {
            assert_eq!(event["number"], 1);
            assert!(event["seconds"].as_f64().is_some_and(|seconds| seconds >= 0.0), "{event}");
            first = Some(picture(&seen));
        }
        kinds.push(event["event"].to_string());
    }
    assert!(child.wait().expect("it ends").success());
    let of_kind = |kind: &str| kinds.iter().position(|known| known.contains(kind)).expect("the event");
    assert!(of_kind("started") < of_kind("preview") && of_kind("preview") < of_kind("finished"), "{kinds:?}");

    let (first, last, painted) = (first.expect("a first preview"), picture(&seen), picture(&output));
    assert_eq!(first.size(), SIZE);
    // It shows the scene, if coarsely: it is nearer to the picture than the picture's mean color is to it.
    let mean = std::array::from_fn(|channel| {
        painted.data.iter().map(|pixel| pixel[channel]).sum::<f32>() / painted.data.len() as f32
    });
    let flat = Picture::from_fn(SIZE.0, SIZE.1, |_, _| mean);
    let error = |seen| rmse(seen, &painted).expect("pictures of one size");
    assert!(error(&first) < 0.75 * error(&flat), "{} and {}", error(&first), error(&flat));
    // The last one is the picture but for rounding: that is dithered.
    assert!(error(&last) < 0.01, "{}", error(&last));

    succeed(&arguments("goblets.glb", &alone, &["--quiet"]));
    assert!(painted == picture(&alone), "who looks changes nothing");
    let left: Vec<_> =
        fs::read_dir(folder.path()).expect("a folder").map(|entry| entry.expect("a file").file_name()).collect();
    assert_eq!(left.len(), 3, "{left:?}");
}

#[cfg(unix)]
#[test]
fn who_resumes_sees_what_was_kept_and_ends_with_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let [whole, parts, seen] = ["whole.exr", "parts.exr", "seen.png"].map(|name| folder.path().join(name));
    let scene = scenes().join("goblets.glb");
    let more = ["--spp", "600", "--json", "--preview", text(&seen)];
    let command =
        |output| -> Vec<&str> { [&["render", text(&scene), "-o", output, "--size", "96x72"][..], &more].concat() };
    let mut child = bottega(&command(text(&parts))).stdout(Stdio::piped()).spawn().expect("it starts");
    let mut lines = BufReader::new(child.stdout.take().expect("piped")).lines().map_while(Result::ok);
    assert!(lines.any(|line| line.contains(r#""state":"done""#)), "a zone is done");
    assert!(signal("-INT", child.id()));
    lines.for_each(drop);
    assert_eq!(child.wait().expect("it ends").code(), Some(130), "it was stopped before its end");
    assert_eq!(picture(&seen).size(), SIZE);

    fs::remove_file(&seen).expect("removed");
    let output = succeed(&[&command(text(&parts))[..], &["--resume"]].concat());
    assert!(output.contains(r#""event":"preview","number":1"#), "{output}");
    assert_eq!(picture(&seen).size(), SIZE);
    succeed(&[&command(text(&whole))[..8], &["--quiet"]].concat());
    assert!(picture(&whole) == picture(&parts));
}

#[test]
fn a_preview_is_a_png_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = folder.path().join("a.exr");
    let refused = run(&arguments("goblets.glb", &output, &["--preview", "seen.exr"]));
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains(".png"));
    assert!(!output.exists());
}

/// The kind of color of a PNG file, as its header tells: 2 is RGB, 6 RGBA.
fn png_kind(path: &Path) -> u8 {
    fs::read(path).expect("a picture")[25]
}

#[test]
fn a_png_has_alpha_where_the_film_or_the_user_asks_for_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = folder.path().join("a.png");
    for (film, option, kind) in [("rgba", None, 6), ("rgb", None, 2), ("rgb", Some("--alpha"), 6)] {
        let scene = folder.path().join("scene.xml");
        let content = format!(
            "<scene version='3.0.0'><sensor type='perspective'><film type='hdrfilm'>
                <string name='pixel_format' value='{film}'/></film></sensor>
             <shape type='sphere'><point name='center' x='0' y='0' z='4'/></shape><emitter type='constant'/></scene>"
        );
        fs::write(&scene, content).expect("a scene");
        let mut arguments = vec!["render", text(&scene), "-o", text(&output), "--size", "8x8", "--spp", "1", "--quiet"];
        arguments.extend(option);
        succeed(&arguments);
        assert_eq!(png_kind(&output), kind, "{film} {option:?}");
    }
}

#[cfg(unix)]
#[test]
fn a_picture_is_written_where_a_link_leads() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::create_dir(folder.path().join("disk")).expect("a folder");
    let link = folder.path().join("link.png");
    std::os::unix::fs::symlink("disk/real.png", &link).expect("a link");
    succeed(&["render", "goblets.glb", "-o", text(&link), "--size", "8x8", "--spp", "1", "--quiet"]);
    assert!(fs::symlink_metadata(&link).expect("a link").is_symlink());
    assert_eq!(png_kind(&folder.path().join("disk/real.png")), 2);
}

/// A glass ball over a table, lit by a lamp without extent, for pbrt.
fn ball_on_table(integrator: &str, more: &str) -> String {
    format!(
        "LookAt 0 3 5  0 0.4 0  0 1 0
        Camera \"perspective\" \"float fov\" 40
        Film \"rgb\" \"integer xresolution\" 32 \"integer yresolution\" 24
        PixelFilter \"box\"
        Sampler \"independent\" \"integer pixelsamples\" 16
        Integrator \"{integrator}\" {more}
        WorldBegin
        LightSource \"point\" \"point3 from\" [ 0 4 0 ] \"rgb I\" [ 20 20 20 ]
        AttributeBegin
        Material \"diffuse\" \"rgb reflectance\" [ 0.6 0.6 0.6 ]
        Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ] \"point3 P\" [ -5 0 -5  -5 0 5  5 0 5  5 0 -5 ]
        AttributeEnd
        AttributeBegin
        Translate 0 0.8 0
        Material \"dielectric\" \"float eta\" 1.5
        Shape \"sphere\" \"float radius\" 0.6
        AttributeEnd
        "
    )
}

#[test]
fn the_integrator_of_the_file_chooses_ours() {
    let folder = tempfile::tempdir().expect("a folder");
    let (scene, output) = (folder.path().join("scene.pbrt"), folder.path().join("picture.exr"));
    // The choice, whether it is reported, and the mean of the picture.
    let painted = |integrator: &str, more: &str, options: &[&str]| {
        fs::write(&scene, ball_on_table(integrator, more)).expect("a scene");
        let arguments = [&["render", text(&scene), "-o", text(&output), "--json", "--exact"], options].concat();
        let (mut chosen, mut warning) = (String::new(), String::new());
        for line in succeed(&arguments).lines() {
            let event: serde_json::Value = serde_json::from_str(line).expect("JSON");
            match event["event"].as_str() {
                Some("started") => chosen = format!("{}/{}", event["integrator"], event["progressive"]),
                Some("warning") => warning += event["message"].as_str().expect("a message"),
                _ => {}
            }
        }
        let picture = picture(&output);
        let mean = picture.data.iter().map(|pixel| pixel[1]).sum::<f32>() / picture.data.len() as f32;
        (chosen, warning, mean)
    };
    let photons = "\"photon\"/true";
    let (chosen, warning, with_caustic) =
        painted("sppm", "\"float radius\" 0.1 \"integer photonsperiteration\" 40000", &[]);
    assert_eq!(chosen, photons);
    assert!(warning.contains("scene.pbrt:6:9: the integrator `sppm` is replaced by progressive photons"), "{warning}");
    let (chosen, warning, by_paths) = painted("volpath", "", &[]);
    assert_eq!((chosen.as_str(), warning.as_str()), ("\"path\"/false", ""));
    assert!(with_caustic > 1.05 * by_paths, "{with_caustic} and {by_paths}");
    // An integrator that finds the same light from both ends.
    let (chosen, warning, from_both_ends) =
        painted("bdpt", "", &["--set", "photons.count=40000", "--set", "photons.radius=0.05"]);
    assert_eq!(chosen, photons);
    assert!(warning.contains("`bdpt` is replaced"), "{warning}");
    assert!((from_both_ends / with_caustic - 1.0).abs() < 0.05, "{from_both_ends} and {with_caustic}");
    // The user's option wins.
    let (chosen, warning, by_option) = painted("sppm", "", &["--integrator", "path"]);
    assert_eq!(chosen, "\"path\"/false");
    assert!(warning.contains(", as requested"), "{warning}");
    assert!((by_option / by_paths - 1.0).abs() < 0.02, "{by_option} and {by_paths}");
    let (chosen, ..) = painted("sppm", "", &["--set", "photons.final_rays=2", "--set", "photons.count=20000"]);
    assert_eq!(chosen, "\"photon\"/false");
}
