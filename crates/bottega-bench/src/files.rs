//! Output files of measurements, and loading of scenes.

use std::{
    env, fs, io,
    path::{Path, PathBuf},
};

use bottega_scene::LoadOptions;
use tempfile::TempDir;

use crate::error::Error;

/// Creates a folder for output files.
pub(crate) fn create_folder(folder: &Path) -> Result<(), Error> {
    fs::create_dir_all(folder).map_err(|source| write_error(folder, source))
}

pub(crate) fn write_file(path: &Path, text: &str) -> Result<(), Error> {
    fs::write(path, text).map_err(|source| write_error(path, source))
}

fn write_error(path: &Path, source: io::Error) -> Error {
    bottega::Error::Write { path: PathBuf::from(path), source }.into()
}

/// Creates a folder that is deleted when the value is dropped.
pub(crate) fn temporary_folder() -> Result<TempDir, Error> {
    tempfile::tempdir().map_err(|source| write_error(&env::temp_dir(), source))
}

/// Returns load options for scenes that share meshes outside of their folders.
pub(crate) fn shared_meshes() -> LoadOptions {
    LoadOptions { allow_outside: true, ..LoadOptions::default() }
}
