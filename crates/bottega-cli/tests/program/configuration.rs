//! The configuration file and variables of the environment: their options count as if they were typed.

use std::{fs, process::Command};

use crate::program::support::bottega;
use bottega::Request;

const FILE: &str = r#"
[render]
size = "64x48"
max-depth = 3
rules = ["paper"]
time = "10s"

[profile.draft.render]
spp = 2
size = "32x24"

[profile.exact.render]
error = 0.2
"#;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn render(config: &str, options: &[&str]) -> Command {
    let mut command = bottega(&["render", "goblets.glb", "--dry-run"]);
    command.args(options).env("BOTTEGA_CONFIG", config);
    command
}

fn request_of(command: &mut Command) -> Request {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    Request::from_json(&output.stdout).unwrap()
}

#[test]
fn the_command_line_goes_before_the_environment_the_profile_and_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("config.toml");
    fs::write(&file, FILE).unwrap();
    let file = file.to_str().unwrap();
    let plain = request_of(&mut render(file, &[]));
    assert_eq!((plain.film.size, plain.integrator.max_depth, plain.goal.samples), (Some([64, 48]), Some(3), None));
    assert_eq!((plain.goal.time, plain.work.rules.len()), (Some(10.0), 1));
    let draft = request_of(&mut render(file, &["--profile", "draft"]));
    assert_eq!((draft.film.size, draft.integrator.max_depth, draft.goal.samples), (Some([32, 24]), Some(3), Some(2)));
    let exact = request_of(&mut render(file, &["--profile", "exact"]));
    assert_eq!((exact.goal.error, exact.goal.time), (Some(0.2), None));
    let draft = request_of(render(file, &[]).env("BOTTEGA_PROFILE", "draft").env("BOTTEGA_RENDER_SPP", "5"));
    assert_eq!((draft.film.size, draft.goal.samples), (Some([32, 24]), Some(5)));
    let typed = request_of(render(file, &["--size=8x6", "--error=0.1"]).env("BOTTEGA_RENDER_SIZE", "9x9"));
    assert_eq!((typed.film.size, typed.goal.error, typed.goal.time), (Some([8, 6]), Some(0.1), None));
    let none = folder.path().join("nothing");
    let none = request_of(
        bottega(&["render", "goblets.glb", "--dry-run"]).env_remove("BOTTEGA_CONFIG").env("XDG_CONFIG_HOME", none),
    );
    assert_eq!(none.film.size, None);
}

#[test]
fn a_whole_request_takes_nothing_from_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let (file, request) = (folder.path().join("config.toml"), folder.path().join("request.json"));
    fs::write(&file, FILE).unwrap();
    fs::write(&request, Request::new("goblets.glb").to_json().unwrap()).unwrap();
    let mut command = bottega(&["render", "--dry-run", "--request"]);
    command.arg(&request).env("BOTTEGA_CONFIG", &file);
    assert_eq!(request_of(&mut command), Request::new("goblets.glb"));
    assert_eq!(request_of(command.env("BOTTEGA_PROFILE", "draft")), Request::new("goblets.glb"));
    let output = command.args(["--profile", "draft"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("a request is complete"), "{}", text(&output.stderr));
}

#[test]
fn errors_name_their_place_and_nothing_is_painted() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("config.toml");
    let refused = |contents: &[u8], options: &[&str]| {
        fs::write(&file, contents).unwrap();
        let output = render(file.to_str().unwrap(), options).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", text(&output.stdout));
        text(&output.stderr).split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ")
    };
    for (contents, expected) in [
        ("[render]\nssp = 3", "line 2, column 1: `render` has no option `ssp`; did you mean `spp`?"),
        ("[render]\nspp = \"many\"", "invalid value 'many' for '--spp <N>'"),
        ("[render\n", "line 1"),
        ("[farm]\naddress = \"http://x\"", "farm.address"),
        ("[farm]\nadress = \"nats://x\"", "line 2, column 1"),
    ] {
        let error = refused(contents.as_bytes(), &[]);
        assert!(error.contains(expected), "{contents}: {error}");
    }
    let error = refused(FILE.as_bytes(), &["--profile", "final"]);
    assert!(error.contains("there is no profile `final`") && error.contains("`draft`"), "{error}");
    fs::write(&file, [0xff, 0xfe]).unwrap();
    let output = render(file.to_str().unwrap(), &[]).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    // The path of the file is printed even if the file is wrong.
    let output = bottega(&["config", "path"]).env("BOTTEGA_CONFIG", &file).output().unwrap();
    assert_eq!(text(&output.stdout).trim(), file.to_str().unwrap());
}

#[test]
fn the_farm_of_the_file_is_meant_where_none_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("config.toml");
    fs::write(&file, "[farm]\naddress = \"nats://127.0.0.1:9\"").unwrap();
    let output = bottega(&["jobs", "list"]).env("BOTTEGA_CONFIG", &file).env_remove("BOTTEGA_FARM").output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("127.0.0.1:9"), "{}", text(&output.stderr));
}
