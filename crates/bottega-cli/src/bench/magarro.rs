//! `bottega bench magarro`: the tables of the MAGarRO paper.

use std::{path::PathBuf, process::ExitCode};

use bottega_bench::magarro::{MagarroOptions, SCENE, measure};
use clap::{Args, ValueHint};

use super::result::{no_scene, print};
use crate::{error::CliError, output::LogWriter};

/// The tables of the MAGarRO paper.
#[derive(Debug, Args)]
#[command(after_help = "Every time of one agent is measured, on one thread; times of more agents are replayed in the \
    simulator from what the zones took. For example:\n  bottega bench magarro --scenes ../scenes -o magarro/")]
pub(super) struct MagarroArgs {
    /// The scene. Default: magarro/magarro.pbrt in the folder of scenes.
    #[arg(value_hint = ValueHint::FilePath)]
    scene: Option<PathBuf>,
    /// The folder of scenes. Default: what the environment variable BOTTEGA_SCENES names.
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath, env = "BOTTEGA_SCENES")]
    scenes: Option<PathBuf>,
    /// Sides of the picture, as a share of what the scene file asks for.
    #[arg(long, value_name = "S", default_value_t = 0.5, value_parser = parse_scale)]
    scale: f64,
    /// Samples a pixel: the paper's eight levels of oversampling, along both axes.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    spp: u32,
    /// Light samples at each bounce. The paper has 1024 for a pixel: 16 for each of 64 samples.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1024))]
    light_samples: u32,
    /// Bounces: the paper's eight levels of recursion.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(0..=1024))]
    max_depth: u32,
    /// Zones that the partition aims at, for all numbers of agents.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    zones: u32,
    /// Folder for magarro.json, magarro.svg, and the pictures.
    #[arg(short, long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    output: Option<PathBuf>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &MagarroArgs) -> Result<ExitCode, CliError> {
    let in_folder = || args.scenes.as_ref().map(|folder| folder.join(SCENE));
    let options = MagarroOptions {
        scene: args.scene.clone().or_else(in_folder).ok_or_else(no_scene)?,
        scale: args.scale,
        spp: args.spp,
        light_samples: args.light_samples,
        max_depth: args.max_depth,
        zones: args.zones,
        output: args.output.clone(),
    };
    Ok(print(&measure(&options, &mut LogWriter)?, args.json))
}

fn parse_scale(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(scale) if (0.02..=8.0).contains(&scale) => Ok(scale),
        _ => Err("a number from 0.02 to 8 is needed".to_owned()),
    }
}
