//! The files that a scene refers to, which other machines need.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    error::EngineFault,
    locate::LocatedEngine,
    manifest::{Refers, SceneFiles},
    session::{Files, ask_files},
};

/// The most files that are scanned.
const FILES_MAX: usize = 4096;
/// The largest text that is scanned, in bytes.
const TEXT_MAX: u64 = 64 << 20;

impl LocatedEngine {
    /// Returns the files that a scene refers to, without the scene file itself; none if scenes of this engine are
    /// single files.
    ///
    /// - `scene`: the path of the scene file.
    /// - `outside`: files and folders that the engine may read in addition to the scene's folder, see
    ///   [`SceneRequest`](super::SceneRequest).
    ///
    /// # Errors
    /// The engine's worker is needed for the list, and does not start or cannot list the files.
    pub fn scene_files(self: &Arc<Self>, scene: &Path, outside: &[PathBuf]) -> Result<Files, EngineFault> {
        match self.manifest().scene.refers {
            Refers::Worker => ask_files(self, scene, outside),
            Refers::Scan => Ok(scan(&self.manifest().scene, scene)),
            Refers::None => Ok(Files::default()),
        }
    }
}

/// Finds paths in the text of a scene, and in the text of the files found.
fn scan(keys: &SceneFiles, scene: &Path) -> Files {
    let folder = scene.parent().unwrap_or(Path::new("."));
    let (mut found, mut missing) = (BTreeSet::new(), BTreeSet::new());
    let mut next = vec![scene.to_owned()];
    while let Some(path) = next.pop() {
        let is_small = fs::metadata(&path).is_ok_and(|file| file.len() <= TEXT_MAX);
        let Ok(bytes) = (if is_small { fs::read(&path) } else { continue }) else { continue };
        let text = String::from_utf8_lossy(&bytes);
        for name in keys.scan.iter().flat_map(|pattern| pattern.find_all(&text)) {
            let beside = path.parent().unwrap_or(folder);
            let candidates = [beside.join(name), folder.join(name)];
            let Some(file) = candidates.into_iter().find(|path: &PathBuf| path.is_file()) else {
                missing.insert(name.to_owned());
                continue;
            };
            let extension = file.extension().map(|it| it.to_string_lossy().to_lowercase()).unwrap_or_default();
            let is_new = file != scene && found.len() < FILES_MAX && found.insert(file.clone());
            if is_new && keys.scan_in.contains(&extension) {
                next.push(file);
            }
        }
    }
    Files { files: found.into_iter().collect(), missing: missing.into_iter().collect() }
}
