//! A program to start, and the part of the user's environment that it gets.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use crate::external::manifest::Limits;

/// Environment variables that a child inherits.
pub(super) const PASSED_ON: &[&str] = &[
    "PATH",
    "LD_LIBRARY_PATH",
    "PYTHONPATH",
    "VIRTUAL_ENV",
    "PYENV_ROOT",
    "PYENV_VERSION",
    "SYSTEMROOT",
    "LOCALAPPDATA",
    "CUDA_VISIBLE_DEVICES",
    "XDG_DATA_DIRS",
];

/// The folder of Python packages installed for a user, in the home folder.
pub(super) const USER_BASE: &str = ".local";

/// A program to start, with its environment and limits.
#[derive(Clone, Debug)]
pub(in crate::external) struct Program<'a> {
    /// Program and arguments; never empty.
    pub(in crate::external) line: &'a [String],
    /// The working folder, also used as home and for temporary files.
    pub(in crate::external) scratch: &'a Path,
    /// Further environment variables to set.
    pub(in crate::external) environment: &'a BTreeMap<String, String>,
    /// Names of further environment variables to inherit, where set.
    pub(in crate::external) inherit: &'a [String],
    /// Names of environment variables that list what it may write in addition to its scratch folder.
    pub(in crate::external) writes: &'a [String],
    /// Files and folders that the program may read in addition to the system's and its installation.
    pub(in crate::external) reads: &'a [PathBuf],
    pub(in crate::external) limits: Limits,
}
