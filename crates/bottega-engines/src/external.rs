//! External engines: found, started and controlled by their manifests.
//!
//! An engine runs in a child process with limits (`child`), keeps a scene open in a [`Session`], and implements
//! [`RenderEngine`](crate::RenderEngine) as [`ExternalEngine`]. The decision that shaped it: engines are not trusted. Each
//! answer has a deadline, and each output is validated before it counts.

mod child;
mod engine;
mod error;
mod idle;
mod locate;
pub mod manifest;
mod picture;
mod protocol;
mod quarantine;
mod refers;
mod scratch;
mod session;
mod shelf;
mod shipped;
mod tiny;
mod trial;

pub use self::{
    child::{is_fenced_in, is_shut_in},
    engine::{ExternalEngine, ExternalOptions, Surveyor},
    error::EngineFault,
    idle::KeptEngines,
    locate::{LocatedEngine, install_hint},
    quarantine::{Quarantine, keep_quarantines_in, quarantine, release},
    session::{CameraView, CombineWord, Files, Opened, OpenedLayer, Probe, SceneRequest, Session},
    shelf::{Shelf, ShelfEntry},
    shipped::rules as shipped_rules,
    trial::EngineTrial,
};

/// The most lines of a log that are shown.
const LINES_SHOWN: usize = 8;

/// Returns the part of an engine's log that explains a failure: the lines that match the patterns of its manifest, or else
/// the last ones.
fn log_tail(engine: &LocatedEngine, log: &child::Log) -> String {
    let text = log.text();
    let lines: Vec<&str> = text.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
    let patterns = &engine.manifest().errors.patterns;
    let meant: Vec<&str> =
        lines.iter().filter_map(|line| patterns.iter().find_map(|pattern| pattern.find(line))).collect();
    let chosen = if meant.is_empty() { &lines } else { &meant };
    let tail = &chosen[chosen.len().saturating_sub(LINES_SHOWN)..];
    tail.iter().map(|line| line.chars().take(300).collect::<String>()).collect::<Vec<_>>().join("\n")
}
