//! Bad input gets a clear error that names the file, the place and the remedy, and an exit code: 2 for a usage error,
//! 1 for a failure. Never a panic.

use std::{fs, process::Output};

use crate::program::support::{self, run, scenes, succeed, text};

fn stderr_of(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Runs the program, which must end with `code` and print all of `words`.
fn fails(arguments: &[&str], code: i32, words: &[&str]) {
    let output = run(arguments);
    let stderr = stderr_of(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
    for word in words {
        assert!(stderr.contains(word), "{arguments:?} does not say {word:?}: {stderr}");
    }
    assert!(!stderr.contains("panicked"), "{stderr}");
}

#[test]
fn wrong_usage_is_reported_before_any_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("picture.png");
    let picture = text(&picture);
    fails(&["render", "cornell-box.glb"], 2, &["--output"]);
    for (option, value) in [
        ("--size", "0x0"),
        ("--size", "99999999999x1"),
        ("--size", "-5x5"),
        ("--spp", "0"),
        ("--agents", "0"),
        ("--threads", "0"),
        ("--optimize", "most"),
        ("--aov", "beauty"),
        ("--crop", "5,5,5,9"),
        ("--exposure", "nan"),
        ("--error", "0"),
        ("--error", "nan"),
        ("--time", "0"),
        ("--time", "soon"),
        ("--env", "1,-1,0"),
        ("--frames", "5..3"),
        ("--frames", "1..9:0"),
        ("--frames", "1..99999999"),
    ] {
        fails(&["render", "cornell-box.glb", "-o", picture, &format!("{option}={value}")], 2, &[option]);
    }
    fails(&["render", "cornell-box.glb", "-o", picture, "--size", "8x8", "--crop", "0,0,9,8"], 2, &["crop", "8x8"]);
    fails(&["render", "cornell-box.glb", "-o", picture, "--size", "65536x65536"], 2, &["65536x65536", "pixels"]);
    fails(&["render", "cornell-box.glb", "-o", picture, "--error", "0.1", "--time", "1m"], 2, &["--error", "--time"]);
    fails(&["render", "cornell-box.glb", "-o", "film.%4d.png", "--frames", "1..2"], 2, &["`%4d`", "%04d"]);
    fails(&["render", "cornell-box.glb", "-o", "film.%d.##.png", "--frames", "1..2"], 2, &["several places"]);
    fails(&["render", "goblets.glb", "-o", picture, "--camera", "nobody"], 2, &["nobody", "camera"]);
    fails(
        &["render", "cornell-box.glb", "-o", picture, "--set", "work.level=4"],
        2,
        &["--set work.level=4", "from 0 to 3"],
    );
    fails(&["render", "cornell-box.glb", "-o", picture, "--zones", "4"], 2, &["--set work.zones=64"]);
    assert!(!folder.path().join("picture.png").exists());
}

#[test]
fn an_output_that_cannot_be_written_is_found_before_rendering() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).to_str().expect("Unicode").to_owned();
    for (output, code, word) in [
        (at("missing/picture.exr"), 1, "does not exist"),
        (at("picture.jpeg"), 2, "jpeg"),
        (at("picture"), 2, "extension"),
        (folder.path().join("").to_str().expect("Unicode").to_owned(), 2, "picture"),
    ] {
        let arguments = ["render", "goblets.glb", "-o", &output, "--spp", "4000000", "--size", "4096x4096"];
        let output = run(&arguments);
        assert_eq!(output.status.code(), Some(code), "{}", stderr_of(&output));
        if word != "picture" {
            assert!(stderr_of(&output).contains(word), "{}", stderr_of(&output));
        }
    }
}

#[test]
fn a_scene_that_is_none_is_refused_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("picture.png");
    let glb = fs::read(scenes().join("cornell-box.glb")).expect("a scene");
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).expect("written");
        path
    };
    let cases = [
        folder.path().join("missing.glb"),
        folder.path().to_owned(),
        write("empty.glb", b""),
        write("magic.glb", b"PK\x03\x04 something else entirely"),
        write("head.glb", &glb[..10]),
        write("json.glb", &glb[..200]),
        write("half.glb", &glb[..glb.len() / 2]),
        write("empty.gltf", b""),
        write("text.gltf", b"{\"asset\": {\"version\": \"2.0\"}"),
        write("list.gltf", b"[1, 2, 3]"),
    ];
    for scene in &cases {
        let name = scene.file_name().expect("a name").to_str().expect("Unicode");
        fails(&["render", text(scene), "-o", text(&picture), "--spp", "1"], 1, &[name]);
        fails(&["info", text(scene)], 1, &[name]);
    }
    let unknown =
        br#"{"asset":{"version":"2.0"},"extensionsRequired":["ACME_teleport"],"extensionsUsed":["ACME_teleport"]}"#;
    fails(&["info", text(&write("unknown.gltf", unknown))], 1, &["ACME_teleport"]);
}

#[test]
fn pictures_of_different_sizes_are_not_compared() {
    let folder = tempfile::tempdir().expect("a folder");
    let (a, b) = (folder.path().join("a.png"), folder.path().join("b.png"));
    succeed(&["render", "cornell-box.glb", "-o", text(&a), "--size", "8x8", "--spp", "1", "--quiet"]);
    succeed(&["render", "cornell-box.glb", "-o", text(&b), "--size", "9x8", "--spp", "1", "--quiet"]);
    fails(&["diff", text(&a), text(&b)], 2, &["8x8", "9x8"]);
    fails(&["diff", text(&a), "missing.exr"], 1, &["missing.exr"]);
}

#[test]
fn resume_without_anything_to_resume_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("picture.exr");
    fails(&["render", "cornell-box.glb", "-o", text(&picture), "--resume"], 1, &["nothing to resume", "--resume"]);
}

/// Commands whose result is their output.
#[cfg(target_os = "linux")]
const PRINTING: [&[&str]; 9] = [
    &["info", "cornell-box.glb"],
    &["info", "cornell-box.glb", "--json"],
    &["rules", "check", "path-tracing"],
    &["engines", "list", "--wait", "0.1s"],
    &["completions", "bash"],
    &["--help"],
    &["render", "--help"],
    &["--version"],
    &["render", "cornell-box.glb", "--dry-run"],
];

#[cfg(target_os = "linux")]
#[test]
fn when_nobody_reads_a_result_it_ends_quietly() {
    for arguments in PRINTING {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let output = support::bottega(arguments).stdout(writer).output().expect("an end");
        assert_eq!((output.status.code(), stderr_of(&output)), (Some(141), String::new()), "{arguments:?}");
    }
}

/// A disk that is full.
#[cfg(target_os = "linux")]
fn full() -> fs::File {
    fs::File::options().write(true).open("/dev/full").expect("Linux has it")
}

#[cfg(target_os = "linux")]
#[test]
fn a_result_that_cannot_be_written_is_a_failure_and_is_said() {
    for arguments in PRINTING {
        let output = support::bottega(arguments).stdout(full()).output().expect("an end");
        let stderr = stderr_of(&output);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {stderr}");
        assert!(stderr.contains("cannot write standard output"), "{arguments:?}: {stderr}");
        assert!(!stderr.contains("panicked"), "{arguments:?}: {stderr}");
    }
    // Output that cannot be written changes no exit code.
    for (arguments, code) in [(&["info", "missing.glb"][..], 1), (&["render"], 2), (&["info", "cornell-box.glb"], 0)] {
        let output = support::bottega(arguments).stderr(full()).output().expect("an end");
        assert_eq!(output.status.code(), Some(code), "{arguments:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_record_or_trace_that_cannot_be_written_costs_no_picture_and_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("picture.exr");
    let small = ["render", "cornell-box.glb", "-o", text(&picture), "--size", "8x8", "--spp", "2"];
    for (option, words) in
        [("--record", "the record /dev/full is lost"), ("--trace", "trace of messages is incomplete")]
    {
        let output = support::bottega(&[&small[..], &[option, "/dev/full"]].concat()).output().expect("an end");
        let stderr = stderr_of(&output);
        assert!(output.status.success() && stderr.contains(words) && picture.exists(), "{option}: {stderr}");
        fs::remove_file(&picture).expect("a picture");
    }
    // Without the folder nothing is rendered.
    let missing = folder.path().join("missing/record.json");
    let output = support::bottega(&[&small[..], &["--record", text(&missing)]].concat()).output().expect("an end");
    assert!(!output.status.success() && !picture.exists(), "{}", stderr_of(&output));
}

#[cfg(target_os = "linux")]
#[test]
fn a_log_that_cannot_be_written_costs_no_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, more, output_is_full, error_is_full, word) in [
        ("json.exr", &["--json"][..], true, false, "cannot write standard output"),
        ("bar.exr", &[], false, true, "cannot write standard error"),
        ("neither.exr", &["--json"], true, true, ""),
        ("quiet.exr", &["--quiet"], true, true, ""),
    ] {
        let picture = folder.path().join(name);
        let mut command =
            support::bottega(&["render", "cornell-box.glb", "-o", text(&picture), "--size", "8x8", "--spp", "2"]);
        command.args(more).env("BOTTEGA_LOG", "trace").stdout(std::process::Stdio::piped());
        if output_is_full {
            command.stdout(full());
        }
        if error_is_full {
            command.stderr(full());
        }
        let output = command.output().expect("an end");
        let said = [output.stdout.as_slice(), &output.stderr].concat();
        let said = String::from_utf8_lossy(&said);
        assert_eq!(output.status.code(), Some(0), "{name}: {said}");
        assert_eq!(said.matches("cannot write standard").count(), usize::from(!word.is_empty()), "{name}: {said}");
        assert!(said.contains(word), "{name}: {said}");
        assert!(picture.exists() && !folder.path().join(format!("{name}.bottega-journal")).exists(), "{name}");
    }
}

#[test]
fn an_invalid_log_filter_is_reported() {
    for (filter, is_reported) in [("bottega=loud", true), ("warn,bottega=debug", false), ("", false)] {
        let output =
            support::bottega(&["info", "cornell-box.glb"]).env("BOTTEGA_LOG", filter).output().expect("an end");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{filter}: {said}");
        assert_eq!(said.contains("BOTTEGA_LOG is not a filter"), is_reported, "{filter}: {said}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_reader_of_events_may_leave_before_the_picture_is_done() {
    use std::io::{BufRead, BufReader};
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("picture.exr");
    let mut command =
        support::bottega(&["render", "goblets.glb", "-o", text(&picture), "--size", "48x36", "--spp", "64", "--json"]);
    let mut child =
        command.stdout(std::process::Stdio::piped()).stderr(std::process::Stdio::piped()).spawn().expect("a start");
    let mut lines = BufReader::new(child.stdout.take().expect("piped")).lines();
    assert!(lines.next().expect("a line").expect("text").contains("started"));
    drop(lines);
    let output = child.wait_with_output().expect("an end");
    assert_eq!((output.status.code(), stderr_of(&output)), (Some(0), String::new()));
    assert!(picture.exists() && !folder.path().join("picture.exr.bottega-journal").exists());
}

#[test]
fn sizes_count_what_is_painted() {
    let folder = tempfile::tempdir().expect("a folder");
    let (scene, picture) = (folder.path().join("a.xml"), folder.path().join("a.exr"));
    let film = |size: u32, crop: &str| {
        let content = format!(
            "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'>
            <integer name='width' value='{size}'/><integer name='height' value='{size}'/>{crop}<rfilter type='box'/></film></sensor>
            <shape type='sphere'/><emitter type='constant'/></scene>"
        );
        fs::write(&scene, content).expect("a scene");
    };
    let crop = "<integer name='crop_offset_x' value='8'/><integer name='crop_offset_y' value='2'/>
        <integer name='crop_width' value='16'/><integer name='crop_height' value='4'/>";
    let render =
        |more: &[&'static str]| [&["render", text(&scene), "-o", text(&picture), "--spp", "1"][..], more].concat();
    film(17_000, crop);
    succeed(&render(&[]));
    let image = bottega_image::read_image(&picture, bottega_image::ReadLimits::default()).expect("a picture");
    assert_eq!((image.full_size, image.offset, image.picture.size()), ((17_000, 17_000), (8, 2), (16, 4)));
    film(17_000, "");
    fails(&render(&[]), 2, &["17000x17000", "--crop"]);
    succeed(&render(&["--crop", "16990,16990,17000,17000"]));
    film(65_537, crop);
    fails(&render(&[]), 2, &["65537x65537", "65536"]);
    film(64, "");
    succeed(&render(&["--size", "60000x60000", "--crop", "59990,0,60000,9"]));
    fails(&render(&["--size", "60000x60000", "--crop", "0,0,60000,9000"]), 2, &["60000x60000"]);
}
