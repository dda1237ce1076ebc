//! The manifests, workers and rules that are built into the program.

use std::path::Path;

/// Returns the names and texts of files in the folder `engines/`.
macro_rules! shipped {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../../engines/", $name)))),*]
    };
}

/// The file name and text of each manifest.
pub(super) const MANIFESTS: &[(&str, &str)] = shipped!["cycles.toml", "luxcore.toml", "mitsuba.toml", "povray.toml"];

/// The file name and text of each script.
const FILES: &[(&str, &str)] = shipped![
    "cycles_worker.py",
    "line_protocol.py",
    "luxcore_worker.py",
    "mitsuba_lanes.py",
    "mitsuba_scene.py",
    "mitsuba_worker.py",
    "plain_exr.py",
    "planes.py",
    "povray_files.py",
    "povray_gathered.py",
    "povray_worker.py",
];

/// The file name and text of the rules of each engine.
const RULES: &[(&str, &str)] = &[
    ("cycles.fcl", include_str!("../../../../rules/cycles.fcl")),
    ("luxcore.fcl", include_str!("../../../../rules/luxcore.fcl")),
    ("mitsuba.fcl", include_str!("../../../../rules/mitsuba.fcl")),
    ("povray.fcl", include_str!("../../../../rules/povray.fcl")),
];

/// Returns the text of an engine's built-in rules, by file name with or without the extension; `None`: there are none
/// of this name.
pub fn rules(name: &Path) -> Option<&'static str> {
    let is_it = |known: &str| Path::new(known) == name || known.strip_suffix(".fcl").map(Path::new) == Some(name);
    RULES.iter().find(|(known, _)| is_it(known)).map(|(_, text)| *text)
}

/// Returns the text of a script.
pub(super) fn file(name: &str) -> Option<&'static str> {
    FILES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::external::manifest::Manifest;

    #[test]
    fn all_that_comes_with_the_program_is_sound_and_complete() {
        for (name, text) in MANIFESTS {
            let manifest = Manifest::parse(Path::new(name), text).unwrap_or_else(|error| panic!("{error}"));
            for needed in &manifest.files {
                assert!(file(needed).is_some(), "{name} needs {needed}");
            }
            assert!(manifest.rules.is_none_or(|needed| rules(Path::new(&needed)).is_some()), "{name} needs its rules");
        }
    }
}
