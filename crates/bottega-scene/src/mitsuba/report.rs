//! Errors and warnings of a scene file, with file, line and column.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::xml::XmlPlace;
use crate::SceneError;
use crate::error::Warnings;

/// The files of a scene, and warnings about them. Equal messages are merged, with the first location.
#[derive(Debug)]
pub(super) struct ImportReport {
    /// Name and path of each file; 0 is the scene.
    files: Vec<(String, PathBuf)>,
    entries: Vec<ReportEntry>,
    index_of: BTreeMap<String, usize>,
}

/// A message, with the number of its locations.
#[derive(Debug)]
struct ReportEntry {
    at: XmlPlace,
    message: String,
    count: usize,
    /// `true`: something visible was left out or replaced.
    is_lack: bool,
}

/// Maximal number of different messages.
const ENTRIES_MAX: usize = 1000;

impl ImportReport {
    /// Makes the report of a scene file.
    pub(super) fn new(path: &Path) -> Self {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Self { files: vec![(name, path.to_path_buf())], entries: Vec::new(), index_of: BTreeMap::new() }
    }

    /// Registers a file. Returns its index.
    pub(super) fn add_file(&mut self, name: String, path: PathBuf) -> u32 {
        self.files.push((name, path));
        self.files.len() as u32 - 1
    }

    /// Returns the path of a file.
    pub(super) fn path(&self, file: u32) -> &Path {
        &self.files[file as usize].1
    }

    /// Returns the name of a file, relative to the folder of the scene.
    pub(super) fn name(&self, file: u32) -> &str {
        &self.files[file as usize].0
    }

    /// Formats a location as `file:line:column`.
    pub(super) fn show(&self, at: XmlPlace) -> String {
        let name = &self.files[at.file as usize].0;
        if at.line == 0 { String::new() } else { format!("{name}:{}:{}", at.line, at.column) }
    }

    /// Makes an error at a location.
    pub(super) fn invalid(&self, at: XmlPlace, problem: impl Into<String>) -> SceneError {
        let (line, column) = (at.line as usize, at.column as usize);
        SceneError::Text { path: self.path(at.file).into(), line, column, problem: problem.into() }
    }

    /// Warns that something was left out or replaced.
    pub(super) fn warn(&mut self, at: XmlPlace, message: impl Into<String>) {
        self.tell(at, message.into(), true);
    }

    /// Notes something unexpected that does not change the picture.
    pub(super) fn note(&mut self, at: XmlPlace, message: impl Into<String>) {
        self.tell(at, message.into(), false);
    }

    fn tell(&mut self, at: XmlPlace, message: String, is_lack: bool) {
        if let Some(&index) = self.index_of.get(&message) {
            self.entries[index].count += 1;
        } else if self.entries.len() < ENTRIES_MAX {
            self.index_of.insert(message.clone(), self.entries.len());
            self.entries.push(ReportEntry { at, message, count: 1, is_lack });
        }
    }

    /// Passes the warnings on.
    pub(super) fn finish(self, warnings: &mut Warnings) {
        for ReportEntry { at, message, count, is_lack } in &self.entries {
            let more = match count - 1 {
                0 => String::new(),
                1 => " (and at another place)".into(),
                more => format!(" (and at {more} other places)"),
            };
            let (place, message) = (self.show(*at), format!("{message}{more}"));
            if *is_lack { warnings.unsupported(place, message) } else { warnings.add(place, message) }
        }
    }
}
