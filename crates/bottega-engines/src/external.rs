//! Engines that other people wrote: found, started and told what to do by their manifests.
//!
//! An engine runs in a child process with limits (`child`), keeps a scene in a [`Session`], and is a
//! [`RenderEngine`](crate::RenderEngine) as [`ExternalEngine`]. The decision that shaped it: nothing that an engine does
//! is believed. What it says has a deadline, what it writes is looked at before it counts.

mod child;
mod engine;
mod error;
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
    locate::{LocatedEngine, install_hint},
    quarantine::{Quarantine, keep_quarantines_in, quarantine, release},
    session::{CameraView, CombineWord, Files, Opened, OpenedLayer, Probe, SceneRequest, Session},
    shelf::{Shelf, ShelfEntry},
    shipped::rules as shipped_rules,
    trial::EngineTrial,
};

/// Of a log so many lines are told.
const LINES_TOLD: usize = 8;

/// What of an engine's log tells why it failed: the lines that its manifest names, else the last ones.
fn log_tail(engine: &LocatedEngine, log: &child::Log) -> String {
    let text = log.text();
    let lines: Vec<&str> = text.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
    let patterns = &engine.manifest().errors.patterns;
    let meant: Vec<&str> =
        lines.iter().filter_map(|line| patterns.iter().find_map(|pattern| pattern.find(line))).collect();
    let chosen = if meant.is_empty() { &lines } else { &meant };
    let tail = &chosen[chosen.len().saturating_sub(LINES_TOLD)..];
    tail.iter().map(|line| line.chars().take(300).collect::<String>()).collect::<Vec<_>>().join("\n")
}
