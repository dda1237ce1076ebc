use std::path::Path;

use super::*;

const SOUND: &str = r#"
manifest = 1
name = "toy"
title = "Toy"
kind = "command"
determinism = "window"
seeds = true

[[find]]
programs = ["toy"]
check = ["{program}", "--version"]
version = '(\d+\.\d+)'

[install]
any = "get it"

[scene]
extensions = ["toy"]

[tunables.samples]
least = 1
most = 64

[pixels]
color_space = "linear-rec709"

[command]
run = ["{program}", "+SC{x0+1}", ["-d", "{max_depth}"], "{scene}", "{output}", "{{x}}"]
output = "out.exr"
"#;

fn parse(text: &str) -> Result<Manifest, ManifestError> {
    Manifest::parse(Path::new("toy.toml"), text)
}

#[test]
fn a_sound_manifest_is_read() {
    let manifest = parse(SOUND).expect("sound");
    assert!(manifest.takes(Path::new("a/b.TOY")) && !manifest.takes(Path::new("toy")));
    assert!(manifest.tunables.max_depth.is_none() && manifest.adds_up());
}

#[test]
fn what_has_no_value_is_left_out() {
    let run = parse(SOUND).expect("sound").command.expect("a command").run;
    let mut values: Values = [("program", "/p"), ("x0", "7"), ("scene", "a b;c"), ("output", "/o")]
        .map(|(name, value)| (name, value.to_owned()))
        .into();
    assert_eq!(Argument::fill_all(&run, &values), ["/p", "+SC8", "a b;c", "/o", "{x}"]);
    values.insert("max_depth", "3".to_owned());
    assert_eq!(Argument::fill_all(&run, &values), ["/p", "+SC8", "-d", "3", "a b;c", "/o", "{x}"]);
}

#[test]
fn a_list_is_no_table() {
    let table = "[tunables.samples]\nleast = 1\nmost = 64\n";
    let text = SOUND.replace(table, "[tunables]\nsamples = [1, 64]\n");
    assert_ne!(text, SOUND);
    let error = parse(&text).unwrap_err();
    assert!(
        error.problem.contains("sequence") && text.lines().nth(error.line - 1).unwrap().starts_with("samples"),
        "{error:?}"
    );
}

#[test]
fn errors_have_their_place() {
    for (from, to, line, says) in [
        ("title = \"Toy\"", "titel = \"Toy\"", 4, "unknown field `titel`"),
        ("kind = \"command\"", "kind = \"demon\"", 5, "unknown variant `demon`"),
        ("name = \"toy\"", "name = \"Toy\"", 3, "a-z"),
        ("name = \"toy\"", "name = \"builtin\"", 3, "taken"),
        ("manifest = 1", "manifest = 2", 2, "newer"),
        ("manifest = 1", "manifest = ", 2, ""),
        ("'(\\d+\\.\\d+)'", "'(('", 12, "not a regular expression"),
        ("'(\\d+\\.\\d+)'", "'x'", 12, "group"),
        ("any = \"get it\"", "", 14, "any"),
        ("most = 64", "most = 0", 20, "the range is empty"),
        ("{x0+1}", "{x9}", 28, "no placeholder"),
        ("{x0+1}", "{x0", 28, "stands alone"),
        ("\"{output}\", ", "", 28, "{output} is missing"),
        ("output = \"out.exr\"", "output = \"../out.exr\"", 29, "plain file name"),
        ("[command]", "[commando]", 27, "unknown field"),
        ("seeds = true", "seeds = 3", 7, "boolean"),
        ("extensions = [\"toy\"]", "extensions = [\"toy\"]\nrefers = \"worker\"", 19, "no worker"),
    ] {
        let text = SOUND.replace(from, to);
        assert_ne!(text, SOUND, "{from}");
        let error = parse(&text).expect_err(to);
        assert!(error.problem.contains(says), "{to}: {error}");
        assert_eq!(error.line, line, "{to}: {error}");
        assert!(error.column >= 1 && error.span.end <= text.len());
    }
}

#[test]
fn no_text_is_too_odd() {
    for text in ["", "\u{0}", "[[[", "a = 1", "manifest = 99999999999999999999", "é = \"ü", "[find]\nx=1"] {
        assert!(parse(text).is_err(), "{text}");
    }
    for end in 0..SOUND.len() {
        // A truncated text is an error or a manifest, but never panics.
        let _ = parse(&SOUND[..end]);
    }
}

#[test]
fn versions_are_compared_by_number() {
    let version = |text: &str| Version::parse(text).expect("a version");
    assert!(
        version("3.10") > version("3.9.1") && version("4") == version("4.0.0") && version("4.2-beta") > version("4.1")
    );
    assert!(Version::parse("v3").is_none() && Version::parse("").is_none() && Version::parse("3..1").is_none());
    let versions = Versions { least: Some(version("3.5")), below: Some(version("4")) };
    assert!(
        versions.include(&version("3.9.1"))
            && !versions.include(&version("4.0"))
            && !versions.include(&version("3.4.9"))
    );
}

#[test]
fn ranges_fit_what_is_wanted() {
    let range = Range { least: 4, most: 64, default: None, powers_of_two: true, squares: false };
    assert_eq!([0, 4, 5, 33, 1000, u32::MAX].map(|wanted| range.fit(wanted)), [4, 4, 8, 64, 64, 64]);
}
