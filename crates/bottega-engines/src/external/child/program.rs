//! A program to start, and what of the user's surroundings it is given.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use crate::external::manifest::Limits;

/// Variables that a child is given as the user has them.
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

/// Where packages of Python are installed for a user, below the home.
pub(super) const USER_BASE: &str = ".local";

/// What is to be started.
#[derive(Clone, Debug)]
pub(in crate::external) struct Program<'a> {
    /// Program and arguments; never empty.
    pub(in crate::external) line: &'a [String],
    /// Working folder, home and place of temporary files.
    pub(in crate::external) scratch: &'a Path,
    /// Set beside the usual ones.
    pub(in crate::external) environment: &'a BTreeMap<String, String>,
    /// Passed on where set.
    pub(in crate::external) inherit: &'a [String],
    /// Variables that name what it may write beside its scratch folder.
    pub(in crate::external) writes: &'a [String],
    /// Files and folders that it may read beside the system's and where it is installed.
    pub(in crate::external) reads: &'a [PathBuf],
    pub(in crate::external) limits: Limits,
}
