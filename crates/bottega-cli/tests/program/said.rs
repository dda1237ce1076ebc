//! The lines that the program prints while it renders, and its end by a signal.

use std::{fs, process::Output};
#[cfg(unix)]
use std::{
    io::{BufRead, BufReader},
    process::Stdio,
};

use crate::program::support::{bottega, run, text};

fn stderr_of(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_picture_is_reported_in_two_lines_and_its_division_with_verbose() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("a.png");
    let small =
        ["render", "cornell-box.glb", "-o", text(&picture), "--size", "32x32", "--spp", "2", "--devices", "cpu"];
    let plain = stderr_of(&run(&small));
    let lines: Vec<&str> = plain.lines().collect();
    let is_right = lines.len() == 2 && lines[0].contains("2 samples each") && lines[1].starts_with(text(&picture));
    assert!(is_right, "{plain}");
    let verbose = stderr_of(&run(&[&small[..], &["-v", "--agents", "2"]].concat()));
    for words in ["auction:", "work bin", "samples/s", "times of zones", "Render Agent"] {
        assert!(verbose.contains(words) && !plain.contains(words), "{words}: {plain}{verbose}");
    }
}

#[test]
fn a_goal_is_said_in_place_of_the_most_samples() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("a.png");
    for (goal, words) in [(["--error", "0.5"], "an estimated error of 0.5"), (["--time", "20s"], "the best in 20 s")] {
        // A pixel gets at most one sample, so no part takes longer.
        let small = ["render", "cornell-box.glb", "-o", text(&picture), "--size", "32x32", "--spp", "1"];
        let output = run(&[&small[..], &goal].concat());
        let stderr = stderr_of(&output);
        assert!(output.status.success() && stderr.contains(words) && !stderr.contains("samples each"), "{stderr}");
    }
}

#[test]
fn what_drivers_print_is_no_part_of_the_list_of_devices() {
    let output = bottega(&["devices"]).env_remove("XDG_RUNTIME_DIR").output().expect("the program starts");
    assert!(output.status.success() && stderr_of(&output).is_empty(), "{}", stderr_of(&output));
}

#[test]
fn a_scene_of_another_program_is_painted_by_its_engine_or_is_to_be_exported() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("a.png");
    for (name, words) in [("a.stl", "STL"), ("a.fbx", "FBX"), ("a.abc", "Alembic")] {
        let scene = folder.path().join(name);
        fs::write(&scene, "#usda 1.0").expect("written");
        for command in [&["render", text(&scene), "-o", text(&picture)][..], &["info", text(&scene)]] {
            let stderr = stderr_of(&run(command)).replace('\n', " ");
            assert!(stderr.contains(words) && stderr.contains("glTF"), "{stderr}");
        }
    }
    let scene = folder.path().join("a.blend");
    fs::write(&scene, "BLENDER").expect("written");
    let output = run(&["render", text(&scene), "-o", text(&picture)]);
    assert!(!output.status.success() && stderr_of(&output).contains("`cycles`"), "{}", stderr_of(&output));
}

#[test]
fn a_picture_that_is_whole_is_not_painted_again_by_resume() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("a.exr");
    let small = ["render", "cornell-box.glb", "-o", text(&picture), "--size", "16x16", "--spp", "1"];
    assert!(run(&small).status.success());
    let written = fs::metadata(&picture).and_then(|file| file.modified()).expect("a picture");
    let again = run(&[&small[..], &["--resume"]].concat());
    assert!(again.status.success() && stderr_of(&again).contains("nothing is left to paint"), "{}", stderr_of(&again));
    assert_eq!(fs::metadata(&picture).and_then(|file| file.modified()).expect("a picture"), written);
    let other = run(&["render", "cornell-box.glb", "-o", text(&picture), "--size", "16x16", "--spp", "2", "--resume"]);
    assert!(!other.status.success() && stderr_of(&other).contains("nothing to resume"), "{}", stderr_of(&other));
}

/// A device that pretends to be a GPU compiles its kernels when it has none in its cache, for a minute on a slow machine.
#[cfg(unix)]
#[test]
fn a_signal_ends_the_program_while_a_device_compiles() {
    use crate::program::support::signal;

    if !String::from_utf8_lossy(&run(&["devices"]).stdout).contains("llvmpipe") {
        eprintln!("SKIPPED: no llvmpipe; to test a device that compiles: apt install mesa-vulkan-drivers");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("a.png");
    let mut child = bottega(&["render", "cornell-box.glb", "-o", text(&picture), "--size", "16x16", "--spp", "1"])
        .args(["--devices", "llvmpipe", "--json"])
        .env("XDG_CACHE_HOME", folder.path())
        .env("MESA_SHADER_CACHE_DIR", folder.path())
        .env("XDG_STATE_HOME", folder.path())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let lines = BufReader::new(child.stdout.take().expect("piped")).lines().map_while(Result::ok);
    let compiles = lines.into_iter().any(|line| line.contains(r#""event":"compiling""#));
    assert!(compiles && signal("-TERM", child.id()));
    assert_eq!(child.wait().expect("the program ends").code(), Some(130));
    assert!(!picture.exists());
}
