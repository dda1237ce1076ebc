//! Lookup of files whose names differ only in letter case.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Maximal number of entries of a folder that are read.
const ENTRIES_MAX: usize = 1 << 16;

/// Maximal number of folders that are cached.
const FOLDERS_MAX: usize = 256;

/// The names in a folder by their lower case; of several that differ only in case, the first in byte order.
type Names = BTreeMap<String, String>;

/// A cache of folder listings.
#[derive(Debug, Default)]
pub(super) struct Spellings {
    folders: Mutex<BTreeMap<PathBuf, Arc<Names>>>,
}

impl Spellings {
    /// Returns a path with the case of the file system; `None` if there is no such file.
    ///
    /// - `name`: below or beside `folder`, normalized, separated by slashes.
    pub(super) fn find(&self, folder: &Path, name: &str) -> Option<String> {
        let mut folder = folder.to_path_buf();
        let mut found: Vec<String> = Vec::new();
        for part in name.split('/') {
            let is_there = part == ".." || folder.join(part).exists();
            let part = if is_there { part.to_owned() } else { self.names(&folder).get(&part.to_lowercase())?.clone() };
            folder.push(&part);
            found.push(part);
        }
        Some(found.join("/"))
    }

    fn names(&self, folder: &Path) -> Arc<Names> {
        let mut folders = self.folders.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(names) = folders.get(folder) {
            return names.clone();
        }
        let mut names = Names::new();
        for entry in std::fs::read_dir(folder).into_iter().flatten().take(ENTRIES_MAX).flatten() {
            let Ok(name) = entry.file_name().into_string() else { continue };
            let first = names.entry(name.to_lowercase()).or_insert_with(|| name.clone());
            if name < *first {
                *first = name;
            }
        }
        let names = Arc::new(names);
        if folders.len() < FOLDERS_MAX {
            folders.insert(folder.to_path_buf(), names.clone());
        }
        names
    }
}
