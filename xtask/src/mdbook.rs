//! mdBook, which makes the manual a book: a program beside cargo's, not a dependency.

use std::{env, path::PathBuf};

use crate::{bars::root, cargo, python::works};

/// The release that is compiled where none is installed.
pub(crate) const RELEASE: &str = "mdbook@0.5.4";

/// The one at hand, or that of `target/mdbook`.
pub(crate) fn program() -> Option<PathBuf> {
    let own = folder().join("bin").join(format!("mdbook{}", env::consts::EXE_SUFFIX));
    [PathBuf::from("mdbook"), own].into_iter().find(|program| works(program))
}

/// Compiles it into `target/mdbook`, without its server, and as fast as that goes. Whether it could.
pub(crate) fn install() -> bool {
    let mut install = cargo::command();
    install.args(["install", "--quiet", "--locked", "--debug", "--no-default-features", RELEASE, "--root"]);
    // Outside of the workspace, whose settings are not those of programs that are installed.
    install.arg(folder()).current_dir(env::temp_dir()).env_remove("CARGO_TARGET_DIR");
    install.status().is_ok_and(|status| status.success())
}

fn folder() -> PathBuf {
    root().join("target/mdbook")
}
