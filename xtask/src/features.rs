//! A test of the library's features: no network, GPU or board code is compiled unless requested.

use std::process::Command;

use crate::cargo;

/// The crates of networks, GPUs and boards.
const HEAVY: [&str; 9] =
    ["async-nats", "hyper", "mdns-sd", "rustls", "tokio", "wgpu", "naga", "bottega-gpu", "bottega-board"];

/// Returns the names of the crates that a package is compiled with.
///
/// - `features`: the features of the package, separated by commas.
fn tree(package: &str, features: &str) -> Vec<String> {
    let mut command: Command = cargo::command();
    command.args(["tree", "--offline", "--edges", "normal", "--prefix", "none", "--format", "{p}"]);
    command.args(["--package", package, "--features", features]);
    let output = command.output().expect("cargo tree runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).expect("text");
    lines.lines().filter_map(|line| line.split(' ').next()).map(str::to_owned).collect()
}

fn heavy_of(package: &str, features: &str) -> Vec<&'static str> {
    let tree = tree(package, features);
    assert!(tree.len() > 50, "{package} has {} crates", tree.len());
    HEAVY.into_iter().filter(|heavy| tree.iter().any(|name| name == heavy)).collect()
}

#[test]
fn the_library_has_no_network_gpu_or_board_where_nobody_asks_for_them() {
    assert!(heavy_of("bottega", "").is_empty(), "{:?}", heavy_of("bottega", ""));
    assert_eq!(heavy_of("bottega", "gpu"), ["wgpu", "naga", "bottega-gpu"]);
    assert_eq!(heavy_of("bottega", "board"), ["bottega-board"]);
}

#[test]
fn the_program_has_all_of_them() {
    assert_eq!(heavy_of("bottega-cli", ""), HEAVY);
}
