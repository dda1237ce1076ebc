//! Measurements of this program on this machine: the tables of the papers beside the papers' own figures, rays and paths a
//! second, other renderers on the same triangles, a farm of many agents.
//!
//! Every measurement takes plain options and returns a [`Report`]. What is told on the way, such as which picture is being
//! painted, goes to a writer; a line that cannot be written there changes no figure.
//!
//! # Where is what
//!
//! | what | where |
//! |---|---|
//! | rays and paths a second | [`rays`]: `src/rays/` |
//! | what work costs on each processor and GPU | [`devices`] |
//! | the three papers | [`hra`]: `src/hra/`; [`magarro`]: `src/magarro/`; [`ala`]: `src/ala/` |
//! | error and time beside other renderers, and the scenes that all of them read | [`peers`]: `src/peers/`; `src/neutral_scene.rs` |
//! | the overhead of painting in zones with another engine | [`engines`] |
//! | what the guide of paths is worth | [`guide`]: `src/guide/` |
//! | how well times are known in a second job | [`learning`] |
//! | awards a second, on a real NATS server | [`farm`]: `src/farm/` |
//! | painting that several measurements share | `src/painting.rs` |
//! | processes that a measurement starts | `src/part_process.rs` |

pub mod ala;
pub mod devices;
pub mod engines;
mod error;
pub mod farm;
pub mod guide;
pub mod hra;
pub mod learning;
pub mod magarro;
mod neutral_scene;
mod painting;
mod part_process;
pub mod peers;
pub mod rays;

use std::{
    fmt::Arguments,
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use bottega_scene::LoadOptions;
use serde_json::Value;

pub use self::error::Error;

/// The figures of a measurement.
pub trait Report {
    /// Tables for people, in whole lines.
    fn as_text(&self) -> String;
    /// The same for programs.
    fn as_json(&self) -> Value;
}

/// Writes a line to a log.
fn say(log: &mut dyn Write, line: Arguments<'_>) {
    // A log that cannot be written changes no figure.
    _ = log.write_all(format!("{line}\n").as_bytes());
}

/// Makes a folder for what is written beside the figures.
fn create_folder(folder: &Path) -> Result<(), Error> {
    fs::create_dir_all(folder).map_err(|source| write_error(folder, source))
}

fn write_file(path: &Path, text: &str) -> Result<(), Error> {
    fs::write(path, text).map_err(|source| write_error(path, source))
}

fn write_error(path: &Path, source: std::io::Error) -> Error {
    bottega::Error::Write { path: PathBuf::from(path), source }.into()
}

/// Options for the scenes of a folder, which share meshes that lie beside them.
fn shared_meshes() -> LoadOptions {
    LoadOptions { allow_outside: true, ..LoadOptions::default() }
}
