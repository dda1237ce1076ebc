//! The manifests and workers that come with the program.

/// Files of the folder `engines/`, by name.
macro_rules! shipped {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../../engines/", $name)))),*]
    };
}

/// File name and text of each manifest.
pub(super) const MANIFESTS: &[(&str, &str)] = shipped!["cycles.toml", "luxcore.toml", "mitsuba.toml", "povray.toml"];

/// Name and text of each script.
const FILES: &[(&str, &str)] = shipped![
    "cycles_worker.py",
    "line_protocol.py",
    "luxcore_worker.py",
    "mitsuba_lanes.py",
    "mitsuba_scene.py",
    "mitsuba_worker.py",
    "plain_exr.py",
    "povray_files.py",
    "povray_worker.py",
];

/// The text of a script.
pub(super) fn file(name: &str) -> Option<&'static str> {
    FILES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::external::manifest::Manifest;

    #[test]
    fn all_that_comes_with_the_program_is_sound_and_complete() {
        for (name, text) in MANIFESTS {
            let manifest = Manifest::parse(Path::new(name), text).unwrap_or_else(|error| panic!("{error}"));
            for needed in &manifest.files {
                assert!(file(needed).is_some(), "{name} needs {needed}");
            }
        }
    }
}
