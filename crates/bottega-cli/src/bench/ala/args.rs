//! What `bottega bench ala` takes.

use std::path::PathBuf;

use clap::{Args, ValueHint};

/// The tables and figures of the paper on Autonomous Lighting Agents.
#[derive(Debug, Args)]
#[command(after_help = "Photon mapping, the agents of the paper and our own paint the same scene, with more and more \
    samples; errors are to a path-traced picture. For example:\n  bottega bench ala --scenes ../scenes -o ala/")]
pub(crate) struct AlaArgs {
    /// The scene. Default: ala/ala.xml in the folder of scenes.
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) scene: Option<PathBuf>,
    /// The folder of scenes. Default: what the environment variable BOTTEGA_SCENES names.
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath, env = "BOTTEGA_SCENES")]
    pub(crate) scenes: Option<PathBuf>,
    /// A converged picture of the scene, of which the pictures take their size. Default: ala/reference/Mitsuba3.exr in the folder of
    /// scenes for its scene; else one is painted first.
    #[arg(long, value_name = "FILE.exr", value_hint = ValueHint::FilePath)]
    pub(crate) reference: Option<PathBuf>,
    /// Sides of the picture, as a share of the paper's 1600 × 1200; a reference of that size is painted first.
    #[arg(long, value_name = "S", value_parser = parse_scale, conflicts_with = "reference")]
    pub(crate) scale: Option<f64>,
    /// Samples a pixel of a reference that is painted.
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    pub(crate) reference_spp: u32,
    /// Most samples a pixel; errors are measured at 1, 2, 4 and so on.
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=1 << 12))]
    pub(crate) spp: u32,
    /// Photons of the paper's comparison.
    #[arg(long, value_name = "N", default_value_t = 1_000_000, value_parser = clap::value_parser!(u32).range(100..=10_000_000))]
    pub(crate) photons: u32,
    /// Lighting agents of the paper's comparison.
    #[arg(long, value_name = "N", default_value_t = 50_000, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    pub(crate) lighting_agents: u32,
    /// Threads. Default: as many as there are processors.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Folder for ala.json, ala.svg, and the pictures.
    #[arg(short, long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub(crate) output: Option<PathBuf>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}

fn parse_scale(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(scale) if (0.02..=2.0).contains(&scale) => Ok(scale),
        _ => Err("a number from 0.02 to 2 is needed".to_owned()),
    }
}
