//! Files: those that are written beside the figures, and scenes that are read.

use std::{
    env, fs, io,
    path::{Path, PathBuf},
};

use bottega_scene::LoadOptions;
use tempfile::TempDir;

use crate::error::Error;

/// Makes a folder for what is written beside the figures.
pub(crate) fn create_folder(folder: &Path) -> Result<(), Error> {
    fs::create_dir_all(folder).map_err(|source| write_error(folder, source))
}

pub(crate) fn write_file(path: &Path, text: &str) -> Result<(), Error> {
    fs::write(path, text).map_err(|source| write_error(path, source))
}

fn write_error(path: &Path, source: io::Error) -> Error {
    bottega::Error::Write { path: PathBuf::from(path), source }.into()
}

/// Makes a folder that goes with the value.
pub(crate) fn temporary_folder() -> Result<TempDir, Error> {
    tempfile::tempdir().map_err(|source| write_error(&env::temp_dir(), source))
}

/// Options for the scenes of a folder, which share meshes that lie beside them.
pub(crate) fn shared_meshes() -> LoadOptions {
    LoadOptions { allow_outside: true, ..LoadOptions::default() }
}
