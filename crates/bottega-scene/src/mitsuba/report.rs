//! What is told of a scene file: errors and warnings that name file, line and column.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::xml::Place;
use crate::SceneError;
use crate::error::Warnings;

/// The files of a scene, and what is worth telling of them. Equal messages become one, with the first of their places.
#[derive(Debug)]
pub(super) struct Report {
    /// Name and path; 0 is the scene.
    files: Vec<(String, PathBuf)>,
    entries: Vec<(Place, String, usize)>,
    index_of: BTreeMap<String, usize>,
}

/// Different messages that are kept.
const ENTRIES_MAX: usize = 1000;

impl Report {
    pub(super) fn new(path: &Path) -> Self {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Self { files: vec![(name, path.to_path_buf())], entries: Vec::new(), index_of: BTreeMap::new() }
    }

    /// Another file; returns its index.
    pub(super) fn add_file(&mut self, name: String, path: PathBuf) -> u32 {
        self.files.push((name, path));
        self.files.len() as u32 - 1
    }

    /// Where a file is.
    pub(super) fn path(&self, file: u32) -> &Path {
        &self.files[file as usize].1
    }

    /// The name of a file, relative to the folder of the scene.
    pub(super) fn name(&self, file: u32) -> &str {
        &self.files[file as usize].0
    }

    /// A place as `file:line:column`.
    pub(super) fn show(&self, at: Place) -> String {
        let name = &self.files[at.file as usize].0;
        if at.line == 0 { String::new() } else { format!("{name}:{}:{}", at.line, at.column) }
    }

    /// An error at a place.
    pub(super) fn invalid(&self, at: Place, problem: impl Into<String>) -> SceneError {
        let (line, column) = (at.line as usize, at.column as usize);
        SceneError::Text { path: self.path(at.file).into(), line, column, problem: problem.into() }
    }

    /// Something that was left out or replaced.
    pub(super) fn warn(&mut self, at: Place, message: impl Into<String>) {
        let message = message.into();
        if let Some(&index) = self.index_of.get(&message) {
            self.entries[index].2 += 1;
        } else if self.entries.len() < ENTRIES_MAX {
            self.index_of.insert(message.clone(), self.entries.len());
            self.entries.push((at, message, 1));
        }
    }

    /// Hands the warnings on.
    pub(super) fn finish(self, warnings: &mut Warnings) {
        for (at, message, count) in &self.entries {
            let more = match count - 1 {
                0 => String::new(),
                1 => " (and at another place)".into(),
                more => format!(" (and at {more} other places)"),
            };
            warnings.unsupported(self.show(*at), format!("{message}{more}"));
        }
    }
}
