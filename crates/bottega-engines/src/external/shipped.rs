//! The manifests and workers that come with the program.

/// Files of the folder `engines/`, by name.
macro_rules! shipped {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../../../engines/", $name)))),*]
    };
}

/// File name and text of each manifest.
pub(super) const MANIFESTS: &[(&str, &str)] = shipped!["mitsuba.toml"];

/// Name and text of each script.
const FILES: &[(&str, &str)] = shipped![
    "line_protocol.py",
    "mitsuba_lanes.py",
    "mitsuba_scene.py",
    "mitsuba_worker.py",
    "plain_exr.py",
];

/// The text of a script.
pub(super) fn file(name: &str) -> Option<&'static str> {
    FILES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}
