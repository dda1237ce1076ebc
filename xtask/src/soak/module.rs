//! The Python module of a build, assembled in a folder from its sources and the library built by cargo.

use std::{
    env, fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};

use crate::bars::root;

/// Puts the module `bottega` into a folder, and returns that folder, for `PYTHONPATH`. Without a library beside the program the
/// module cannot be imported.
pub(super) fn assemble(program: &Path, folder: &Path) -> Result<PathBuf> {
    let package = folder.join("bottega");
    fs::create_dir_all(&package)?;
    let sources = root().join("crates/bottega-python/python/bottega");
    for entry in fs::read_dir(&sources).with_context(|| sources.display().to_string())?.flatten() {
        if entry.path().is_file() {
            fs::copy(entry.path(), package.join(entry.file_name()))?;
        }
    }
    if let Some(library) = library_beside(program) {
        fs::copy(library, package.join("_native.abi3.so"))?;
    }
    Ok(folder.to_owned())
}

/// Returns the newest library of the module in the folder of a program, or in its `deps`.
fn library_beside(program: &Path) -> Option<PathBuf> {
    let name = format!("{}bottega_python{}", env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX);
    let folder = program.parent()?;
    let made = |path: &PathBuf| fs::metadata(path).and_then(|file| file.modified()).ok();
    [folder.join(&name), folder.join("deps").join(&name)].into_iter().filter(|it| it.is_file()).max_by_key(made)
}
