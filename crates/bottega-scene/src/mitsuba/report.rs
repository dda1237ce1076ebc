//! Errors and warnings of a scene file, with file, line and column.

use std::collections::BTreeMap;
use std::path::Path;

use crate::error::Warnings;
use crate::import::text_place::{TextFiles, TextPlace};

/// The files of a scene, and warnings about them. Equal messages are merged, with the first location.
#[derive(Debug)]
pub(super) struct ImportReport {
    /// The scene file and those that it includes.
    pub(super) files: TextFiles,
    entries: Vec<ReportEntry>,
    index_of: BTreeMap<String, usize>,
}

/// A message, with the number of its locations.
#[derive(Debug)]
struct ReportEntry {
    at: TextPlace,
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
        Self { files: TextFiles::new(path), entries: Vec::new(), index_of: BTreeMap::new() }
    }

    /// Warns that something was left out or replaced.
    pub(super) fn warn(&mut self, at: TextPlace, message: impl Into<String>) {
        self.add(at, message.into(), true);
    }

    /// Notes something unexpected that does not change the picture.
    pub(super) fn note(&mut self, at: TextPlace, message: impl Into<String>) {
        self.add(at, message.into(), false);
    }

    fn add(&mut self, at: TextPlace, message: String, is_lack: bool) {
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
            let (place, message) = (self.files.show(*at), format!("{message}{more}"));
            if *is_lack { warnings.unsupported(place, message) } else { warnings.add(place, message) }
        }
    }
}
