//! Options of the measurement.

use std::{ffi::OsString, path::PathBuf};

use clap::Args;

use crate::arguments::{SceneFolder, number};

/// The scene that replaces the paper's, relative to the folder of scenes.
pub(super) const SCENE: &str = "magarro/magarro.pbrt";

/// The tables of the MAGarRO paper: time by agents, partition and optimization, and what optimization does to the picture.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "An agent is a process with one thread. Times of one and of two agents are measured, over a NATS server that is \
    started for it; times of four and eight are replayed in the simulator from what the zones took, and so are those of two, which \
    tells how good the replay is. --equal-time measures something else: error for time, against a converged reference, of \
    `--optimize n`, `b` and `vb` beside uniform samples.\n\n\
    For example:\n  bottega-bench magarro --scenes ../scenes -o magarro/\n  bottega-bench magarro room.xml --scale 0.25 --equal-time"
)]
pub(crate) struct MagarroOptions {
    #[command(flatten)]
    pub(super) picture: MagarroPicture,
    /// Folder for magarro.json, magarro.svg, and the pictures.
    #[arg(short, long, value_name = "FOLDER")]
    pub(super) output: Option<PathBuf>,
    /// Error for time instead of the tables, against a reference of so many samples per pixel.
    #[arg(long, value_name = "SPP", num_args = 0..=1, default_missing_value = "8192",
        value_parser = clap::value_parser!(u32).range(1..=1 << 20), conflicts_with_all = ["output", "replay"])]
    pub(super) equal_time: Option<u32>,
    /// Replay two agents, too, instead of painting with two processes.
    #[arg(long)]
    pub(super) replay: bool,
    /// The program of the NATS server to start; default: `nats-server`, where systems put it.
    #[arg(long, value_name = "PROGRAM")]
    pub(super) server: Option<PathBuf>,
}

/// The picture that all agents paint.
#[derive(Clone, Debug, Args)]
pub(super) struct MagarroPicture {
    /// The scene. Default: magarro/magarro.pbrt in the folder of scenes.
    pub(super) scene: Option<PathBuf>,
    #[command(flatten)]
    pub(super) folder: SceneFolder,
    /// Sides of the picture, as a share of what the scene file asks for.
    #[arg(long, value_name = "S", default_value_t = 0.5, value_parser = number(0.02, 8.0))]
    pub(super) scale: f64,
    /// Samples per pixel: the paper's eight levels of oversampling, along both axes.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    pub(super) spp: u32,
    /// Light samples at each bounce. The paper has 1024 for a pixel: 16 for each of 64 samples.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(super) light_samples: u32,
    /// Bounces: the paper's eight levels of recursion.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(0..=1024))]
    pub(super) max_depth: u32,
    /// Zones that the partition aims at, for all numbers of agents.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    pub(super) zones: u32,
}

impl MagarroPicture {
    /// Returns the arguments that pass the same image to another process of this program.
    ///
    /// - `scene`: the path of the scene.
    pub(super) fn words(&self, scene: PathBuf) -> Vec<OsString> {
        let Self { scale, spp, light_samples, max_depth, zones, .. } = self;
        let options = [
            format!("--scale={scale}"),
            format!("--spp={spp}"),
            format!("--light-samples={light_samples}"),
            format!("--max-depth={max_depth}"),
            format!("--zones={zones}"),
        ];
        [scene.into_os_string()].into_iter().chain(options.map(OsString::from)).collect()
    }
}
