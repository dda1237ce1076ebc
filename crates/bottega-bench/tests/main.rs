//! The program as a user runs it.

mod farm;
mod program;
#[path = "../../bottega-cli/tests/support/servers.rs"]
mod servers;

use std::process::{Command, Output};

fn bench(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bottega-bench")).args(arguments).output().expect("the program starts")
}
