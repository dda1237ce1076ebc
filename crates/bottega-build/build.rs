//! Tells the crate which compiler compiles it: it compiles the program, too.

use std::{env, process::Command};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let compiler = env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let version = Command::new(compiler).arg("--version").output().map(|output| output.stdout).unwrap_or_default();
    println!("cargo::rustc-env=BOTTEGA_COMPILER={}", String::from_utf8_lossy(&version).trim());
}
