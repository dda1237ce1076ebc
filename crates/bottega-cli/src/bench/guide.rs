//! `bottega bench guide`: what the guide of paths is worth.

use std::{path::PathBuf, process::ExitCode};

use bottega::devices::processors;
use bottega_bench::guide::{GuideOptions, SCENES, measure};
use clap::{Args, ValueHint};

use super::result::{no_scene, print};
use crate::{error::CliError, output::LogWriter};

/// What the guide of paths is worth: error × time of --guide ala over --guide none, learning included.
#[derive(Debug, Args)]
#[command(
    after_help = "A ratio below 1 says that the guide pays. Errors are to a picture of many samples without a guide. \
    For example:\n  bottega bench guide --scenes ../scenes --spp 8,32 -o guide/"
)]
pub(super) struct GuideBenchArgs {
    /// Scenes. Default: five in the folder of scenes.
    #[arg(value_hint = ValueHint::FilePath)]
    files: Vec<PathBuf>,
    /// The folder of scenes. Default: what the environment variable BOTTEGA_SCENES names.
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath, env = "BOTTEGA_SCENES")]
    scenes: Option<PathBuf>,
    /// Width of the pictures.
    #[arg(long, value_name = "PIXELS", default_value_t = 160, value_parser = clap::value_parser!(u32).range(8..=1 << 14))]
    width: u32,
    /// Height of the pictures.
    #[arg(long, value_name = "PIXELS", default_value_t = 120, value_parser = clap::value_parser!(u32).range(8..=1 << 14))]
    height: u32,
    /// Samples a pixel, one row each.
    #[arg(long, value_name = "N", value_delimiter = ',', default_values_t = [4, 8, 32, 128],
        value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    spp: Vec<u32>,
    /// Pictures of each kind; figures are of their means.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    seeds: u32,
    /// The first of their seeds.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u32,
    /// Samples a pixel of the reference.
    #[arg(long, value_name = "N", default_value_t = 4096, value_parser = clap::value_parser!(u32).range(2..=1 << 20))]
    reference_spp: u32,
    /// Threads that paint what is measured. References take all processors.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Folder for the references, which are taken from there the next time, and for the pictures of the first seed.
    #[arg(short, long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    output: Option<PathBuf>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &GuideBenchArgs) -> Result<ExitCode, CliError> {
    let scenes = match (&args.scenes, args.files.is_empty()) {
        (_, false) => args.files.clone(),
        (Some(folder), true) => SCENES.iter().map(|scene| folder.join(scene)).collect(),
        (None, true) => return Err(no_scene()),
    };
    let options = GuideOptions {
        scenes,
        size: [args.width, args.height],
        samples: args.spp.clone(),
        seeds: args.seeds,
        first_seed: args.seed.into(),
        reference_samples: args.reference_spp,
        threads: args.threads.into(),
        reference_threads: processors(),
        output: args.output.clone(),
    };
    Ok(print(&measure(&options, &mut LogWriter)?, args.json))
}
