//! Real scenes, from the folder that `BOTTEGA_SCENES` names.

use std::path::{Path, PathBuf};

use bottega_scene::LoadOptions;

use crate::mitsuba::support::warnings;

fn scenes() -> Option<PathBuf> {
    let folder = std::env::var_os("BOTTEGA_SCENES").filter(|folder| !folder.is_empty()).map(PathBuf::from);
    if folder.is_none() {
        eprintln!("SKIPPED: BOTTEGA_SCENES does not name the folder of the scenes");
    }
    folder
}

fn xml_files(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        if path.is_dir() {
            xml_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "xml") {
            found.push(path);
        }
    }
    found.sort();
}

#[test]
fn they_load_without_a_word() {
    let Some(folder) = scenes() else { return };
    let mut files = Vec::new();
    xml_files(&folder, &mut files);
    assert!(files.len() >= 10, "{files:?}");
    // Some scenes share their mesh files, which lie outside of their folders.
    let options = LoadOptions { allow_outside: true, ..LoadOptions::default() };
    for file in files {
        let loaded = bottega_scene::load(&file, &options).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(warnings(&loaded), Vec::<String>::new(), "{}", file.display());
        assert_eq!(loaded.scene.cameras.len(), 1);
        assert!(loaded.scene.has_light());
        assert!(loaded.hints.resolution.is_some() && loaded.hints.max_depth.is_some());
        assert!(loaded.scene.triangle_count() > 10, "{}", file.display());
    }
}
