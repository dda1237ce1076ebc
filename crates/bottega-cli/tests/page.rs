//! The page of a real farm in a real browser: runs the tests of `bottega-web/tests/browser`, which Node.js runs.
//!
//! They need a NATS server, Node.js, Chromium, and Playwright below `target/node`: `cargo xtask test` installs these. Without
//! one the tests say that they are skipped. Screenshots are in `target/pictures`.

use std::{
    env,
    path::{Path, PathBuf},
    process::Command,
    sync::{PoisonError, RwLock},
};

/// A test that times answers runs alone; the others, which mostly wait, run at the same time.
static PROCESSORS: RwLock<()> = RwLock::new(());

#[test]
fn an_artist_submits_a_job_watches_it_and_steers_the_farm() {
    let _shared = PROCESSORS.read().unwrap_or_else(PoisonError::into_inner);
    browse("page.test.js");
}

#[test]
fn ten_thousand_zones_and_a_thousand_machines_are_answered_at_once() {
    let _alone = PROCESSORS.write().unwrap_or_else(PoisonError::into_inner);
    browse("crowd.test.js");
}

#[test]
fn a_scene_is_looked_around_in_and_its_pictures_are_looked_at_closely() {
    let _shared = PROCESSORS.read().unwrap_or_else(PoisonError::into_inner);
    browse("look.test.js");
}

#[test]
fn every_view_fits_usual_screens_and_a_job_of_the_command_line_is_painted_again() {
    let _shared = PROCESSORS.read().unwrap_or_else(PoisonError::into_inner);
    browse("views.test.js");
}

/// Runs tests in a browser, against the newest NATS server.
fn browse(file: &str) {
    let Some(server) = crate::support::servers().pop() else { return };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let lacking = |what: &str| eprintln!("SKIPPED: there is no {what}; `cargo xtask test` installs it");
    let Some(node) = program(&["node"]) else { return lacking("Node.js") };
    let named = env::var_os("BOTTEGA_CHROMIUM").map(PathBuf::from);
    let Some(chromium) = named.or_else(|| program(&["chromium", "chromium-browser", "google-chrome"])) else {
        return lacking("Chromium");
    };
    if !["playwright-core", "axe-core"].iter().all(|it| root.join("target/node/node_modules").join(it).is_dir()) {
        return lacking("Playwright and axe-core below target/node");
    }
    let mut node = Command::new(node);
    node.args(["--test", "--test-reporter=spec"]).arg(root.join("crates/bottega-web/tests/browser").join(file));
    node.env("BOTTEGA", env!("CARGO_BIN_EXE_bottega")).env("BOTTEGA_NATS_SERVER", server);
    let run = node.env("BOTTEGA_CHROMIUM", chromium).output().expect("Node.js starts");
    let said = String::from_utf8_lossy(&run.stdout);
    assert!(run.status.success(), "{said}\n{}", String::from_utf8_lossy(&run.stderr));
}

/// Returns the first of these programs that is installed.
fn program(names: &[&str]) -> Option<PathBuf> {
    let places = env::var_os("PATH").unwrap_or_default();
    let places: Vec<PathBuf> = env::split_paths(&places).collect();
    names.iter().flat_map(|name| places.iter().map(move |folder| folder.join(name))).find(|path| path.is_file())
}
