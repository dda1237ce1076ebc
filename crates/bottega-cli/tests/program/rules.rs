//! `bottega rules check | eval | plot`, and rules given to `render`.

use std::{fs, path::Path, process::Output};

use crate::program::support::{run, succeed, text};
use serde_json::Value;

const FAN: &str = "FUNCTION_BLOCK fan
VAR_INPUT heat : REAL; noise : REAL; END_VAR
VAR_OUTPUT speed : REAL; END_VAR
FUZZIFY heat TERM cold := (10, 1) (30, 0); TERM hot := (10, 0) (30, 1); RANGE := (10 .. 30); END_FUZZIFY
FUZZIFY noise TERM low := (0, 1) (1, 0); TERM high := (0, 0) (1, 1); END_FUZZIFY
DEFUZZIFY speed TERM slow := (0, 1) (50, 0); TERM fast := (50, 0) (100, 1); METHOD : COG; DEFAULT := 0; END_DEFUZZIFY
RULEBLOCK all
    RULE 1 : IF heat IS cold OR noise IS high THEN speed IS slow;
    RULE 2 : IF heat IS hot AND noise IS low THEN speed IS fast;
END_RULEBLOCK
END_FUNCTION_BLOCK
";

fn stderr_of(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn file(folder: &Path, name: &str, content: impl AsRef<[u8]>) -> String {
    let path = folder.join(name);
    fs::write(&path, content).expect("written");
    text(&path).to_owned()
}

/// Runs the program, which must end with `code` and print all of `words`.
fn fails(arguments: &[&str], code: i32, words: &[&str]) {
    let output = run(arguments);
    // Long lines are broken, with a border.
    let stderr = stderr_of(&output).replace(['│', '|', '\n'], " ").split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
    for word in words {
        assert!(stderr.contains(word), "{arguments:?} does not say {word:?}: {stderr}");
    }
    assert!(!stderr.contains("panicked"), "{stderr}");
}

#[test]
fn the_rules_that_come_with_the_program_are_sound() {
    let said = succeed(&["rules", "check", "--strict", "path-tracing", "photon-mapping"]);
    assert!(said.contains("`path_tracing`, 28 rules from 4 inputs to 3 outputs"), "{said}");
    assert!(said.contains("for photon mapping: photons, gather_count"), "{said}");
    assert!(said.contains("unknown to path tracing: photons"), "{said}");
    assert!(!said.contains("warning"), "{said}");
}

#[test]
fn mistakes_are_shown_in_the_text_and_warnings_fail_only_if_requested() {
    let folder = tempfile::tempdir().expect("a folder");
    let good = file(folder.path(), "good.fcl", FAN);
    let wrong = file(folder.path(), "wrong.fcl", FAN.replace("speed IS fast", "speed IS fsat"));
    let doubtful = file(folder.path(), "doubtful.fcl", FAN.replace("IS fast;", "IS fast WITH 0;"));
    let misspelt = file(folder.path(), "misspelt.fcl", FAN.replace("DEFUZZIFY speed", "DEFUZZIFI speed"));
    let (line, column) = ("line 9, column 60", "did you mean `fast`?");
    fails(&["rules", "check", &wrong], 1, &["wrong.fcl", line, column, "RULE 2 : IF heat IS hot"]);
    fails(&["rules", "check", &misspelt], 1, &["line 6, column 1", "did you mean `DEFUZZIFY`?"]);
    assert!(succeed(&["rules", "check", &good]).contains("2 rules"));
    let said = succeed(&["rules", "check", &doubtful]);
    assert!(said.contains("doubtful.fcl:9:5: warning: rule 2 says nothing: its weight is 0 [dead-rule]"), "{said}");
    assert_eq!(run(&["rules", "check", "--strict", &doubtful]).status.code(), Some(1));
    // A file that cannot be read does not hide the others.
    let output = run(&["rules", "check", "--json", &wrong, &doubtful, "missing.fcl"]);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8(output.stdout).expect("text");
    let lines: Vec<Value> = said.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(lines[0]["errors"][0]["line"], 9);
    assert_eq!(lines[0]["errors"][0]["column"], 60);
    assert_eq!(lines[1]["warnings"][0]["code"], "dead-rule");
    assert_eq!(lines[1]["blocks"][0]["rules"], 2);
    assert!(lines[2]["errors"][0]["message"].as_str().expect("text").contains("missing.fcl"));
}

#[test]
fn files_that_are_not_rules_are_reported_by_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("picture.png");
    let folder_itself = text(folder.path());
    let binary = file(folder.path(), "binary.fcl", [0xff, 0xfe, 0x00]);
    let long = file(folder.path(), "long.fcl", vec![b' '; (1 << 20) + 1]);
    let wrong = file(
        folder.path(),
        "wrong.fcl",
        "FUNCTION_BLOCK x\nVAR_INPUT\n  complexity REAL;\nEND_VAR\nEND_FUNCTION_BLOCK\n",
    );
    let empty = file(folder.path(), "empty.fcl", "// nothing\n");
    let stranger = file(folder.path(), "stranger.fcl", FAN);
    let outputs = FAN.replace("heat", "complexity").replace("noise", "size");
    let no_output = file(folder.path(), "nothing.fcl", outputs);
    let name = folder_itself.rsplit('/').next().expect("a name");
    let render = |rules: &str, words: &[&str]| {
        let arguments =
            ["render", "cornell-box.glb", "-o", text(&picture), "--rules", "path-tracing", "--rules", rules];
        fails(&arguments, 1, words);
    };
    for (rules, words) in [
        ("missing.fcl", &["missing.fcl", "No such file"][..]),
        (folder_itself, &[name, "it is a folder"]),
        (&binary, &["binary.fcl", "it is not UTF-8 text"]),
        (&long, &["long.fcl", "longer than 1048576 bytes"]),
        (&wrong, &["wrong.fcl", "line 3, column 14", "expected `:`, found `REAL`", "complexity REAL;"]),
    ] {
        fails(&["rules", "check", rules], 1, words);
        fails(&["rules", "eval", rules], 1, words);
        render(rules, words);
    }
    render(&empty, &["empty.fcl", "expected one function block, found 0"]);
    render(&stranger, &["stranger.fcl", "line 2, column 11", "an input `heat`", "complexity, neighbor_difference"]);
    render(&no_output, &["nothing.fcl", "they have speed", "recursion_level"]);
    assert!(!picture.exists());
}

#[test]
fn rules_that_are_doubtful_or_say_too_much_are_used_with_a_note() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = folder.path().join("picture.png");
    let rules = own_rules("path-tracing.fcl");
    let dead =
        file(folder.path(), "dead.fcl", rules.replacen("recursion_level IS VB;", "recursion_level IS VB WITH 0;", 1));
    let arguments = |rules| {
        [
            "render",
            "cornell-box.glb",
            "-o",
            text(&picture),
            "--size",
            "16x16",
            "--spp",
            "2",
            "--optimize",
            "vb",
            "--rules",
            rules,
        ]
    };
    let output = run(&arguments("photon-mapping"));
    assert!(output.status.success(), "{}", stderr_of(&output));
    assert!(
        stderr_of(&output).contains("ignored, because path tracing does not use them: photons"),
        "{}",
        stderr_of(&output)
    );
    let output = run(&arguments(&dead));
    assert!(output.status.success(), "{}", stderr_of(&output));
    assert!(stderr_of(&output).contains("rule 1 says nothing: its weight is 0"), "{}", stderr_of(&output));
}

fn own_rules(name: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../rules").join(name)).expect("rules")
}

#[test]
fn rules_are_evaluated_and_explained() {
    let folder = tempfile::tempdir().expect("a folder");
    let fan = file(folder.path(), "fan.fcl", FAN);
    // `slow` alone is a triangle from 0 to 50 with its right angle at 0: its center of gravity is at a third.
    let said = succeed(&["rules", "eval", &fan, "heat=10", "noise=1"]);
    let speed: f64 = said.trim().strip_prefix("speed = ").expect("one output").parse().expect("a number");
    assert!((speed - 50.0 / 3.0).abs() < 1e-9, "{said}");
    let json = |arguments: &[&str]| -> Value { serde_json::from_str(&succeed(arguments)).expect("JSON") };
    let why = json(&["rules", "eval", &fan, "heat=25", "noise=0.5", "--explain", "--json"]);
    assert_eq!(why["inputs"]["heat"]["hot"], 0.75);
    assert_eq!(why["rules"][0]["degree"], 0.5);
    assert_eq!(why["aggregates"]["speed"]["points"][0], serde_json::json!([0.0, 0.5]));
    // Laid out over 100 .. 300, 250 takes the place of 25.
    let laid_out = json(&["rules", "eval", &fan, "heat=250", "noise=0.5", "--range", "heat=100..300", "--json"]);
    assert_eq!(laid_out["outputs"], why["outputs"]);
    let said = succeed(&["rules", "eval", &fan, "heat=25", "noise=0.5", "--explain"]);
    assert!(said.contains("rule 1 fires at 0.500: speed IS slow"), "{said}");
    fails(&["rules", "eval", &fan, "heat=25"], 2, &["the input `noise` has no value", "heat, noise"]);
    fails(&["rules", "eval", &fan, "heat=25", "wind=1"], 2, &["no input `wind`"]);
    fails(&["rules", "eval", &fan, "heat=hot"], 2, &["not a number"]);
    fails(&["rules", "eval", &fan, "heat=1", "noise=0", "--range", "heat=3..1"], 2, &["[3, 1] is not an interval"]);
    let both = file(folder.path(), "both.fcl", format!("{FAN}{}", FAN.replace("BLOCK fan", "BLOCK draught")));
    fails(&["rules", "eval", &both, "heat=1", "noise=0"], 2, &["2 function blocks", "--block: fan, draught"]);
    fails(&["rules", "eval", &both, "heat=1", "noise=0", "--block", "x"], 2, &["no function block `x`"]);
    succeed(&["rules", "eval", &both, "heat=1", "noise=0", "--block", "Draught"]);
}

#[test]
fn terms_and_surfaces_are_drawn_as_svg_and_png() {
    let folder = tempfile::tempdir().expect("a folder");
    let fan = file(folder.path(), "fan.fcl", FAN);
    let at = |name: &str| text(&folder.path().join(name)).to_owned();
    let (svg, png) = (at("terms.svg"), at("terms.png"));
    for picture in [&svg, &png] {
        succeed(&["rules", "plot", &fan, "-o", picture, "--range", "heat=0..800"]);
    }
    let drawn = fs::read_to_string(&svg).expect("an SVG");
    for word in ["heat (input)", "noise (input)", "speed (output)", "cold", "fast", "800", "polyline"] {
        assert!(drawn.contains(word), "{word}");
    }
    let painted = bottega_image::read_picture(&png).expect("a PNG");
    let dark = painted.data.iter().filter(|pixel| pixel.iter().all(|value| *value < 0.3)).count();
    assert!(dark > 500, "no text is in the picture: {dark} dark pixels");

    let surface = |out: &str, more: &[&str]| {
        let mut arguments = vec!["rules", "plot", &fan, "-o", out, "--surface", "speed", "--over", "heat,noise"];
        arguments.extend(more);
        run(&arguments)
    };
    let (svg, png) = (at("surface.svg"), at("surface.png"));
    for picture in [&svg, &png] {
        let output = surface(picture, &[]);
        assert!(output.status.success(), "{}", stderr_of(&output));
    }
    let drawn = fs::read_to_string(&svg).expect("an SVG");
    for word in ["speed", "heat", "noise", "rect"] {
        assert!(drawn.contains(word), "{word}");
    }
    // Cold is slow and dark, hot and silent is fast and bright.
    let painted = bottega_image::read_picture(&png).expect("a PNG");
    let pixel = |x: u32, y: u32| painted.data[(y * painted.width + x) as usize];
    let (cold, hot) = (pixel(110, 300), pixel(715, 540));
    assert!(hot[1] > 2.0 * cold[1], "{cold:?} {hot:?}");

    fails(&["rules", "plot", &fan, "-o", &at("x.jpeg")], 2, &["x.jpeg", ".svg or .png"]);
    fails(&["rules", "plot", &fan, "-o", &at("missing/x.svg")], 1, &["x.svg"]);
    fails(&["rules", "plot", &fan, "-o", &at("x.svg"), "heat=3"], 2, &["--surface"]);
    fails(&["rules", "plot", &fan, "-o", &at("x.svg"), "--surface", "speed"], 2, &["--over"]);
    fails(
        &["rules", "plot", &fan, "-o", &at("x.svg"), "--surface", "x", "--over", "heat,noise"],
        2,
        &["no output `x`"],
    );
    fails(&["rules", "plot", &fan, "-o", &at("x.svg"), "--surface", "speed", "--over", "heat,x"], 2, &["no input `x`"]);
    fails(
        &["rules", "plot", "path-tracing", "-o", &at("x.svg"), "--surface", "samples", "--over", "complexity,size"],
        2,
        &["has no value"],
    );
    assert!(stderr_of(&surface(&at("x.svg"), &["heat=3"])).contains("cannot be both"));
}
