//! `bottega bench learning`: what a machine knows of the time of zones before anybody has seen them.

use std::{path::PathBuf, process::ExitCode};

use bottega_bench::learning::{LearningOptions, PAIRS, measure};
use clap::{Args, ValueHint};

use super::result::{no_scene, print};
use crate::{error::CliError, output::LogWriter};

/// How well the time of a zone is known before anybody has seen it: in a first job, and in a second of its kind.
#[derive(Debug, Args)]
#[command(after_help = "What this machine has learnt before is neither used nor changed. For example:\n  \
    bottega bench learning goblets.glb goblets.glb magarro.pbrt goblets.glb")]
pub(super) struct LearningArgs {
    /// Pairs of scenes: of the first is learnt, then the second is painted. Default: some in the folder of scenes.
    #[arg(value_hint = ValueHint::FilePath)]
    pairs: Vec<PathBuf>,
    /// The folder of scenes. Default: what the environment variable BOTTEGA_SCENES names.
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath, env = "BOTTEGA_SCENES")]
    scenes: Option<PathBuf>,
    /// Samples a pixel of the first pictures, of 240 × 180 pixels. Those of the second ones are half as many, of 400 × 300 pixels.
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(4..=1 << 16))]
    spp: u32,
    /// How far the partition goes. At level 3 zones are made to take as long as each other, and ranks tell little.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=3))]
    level: u8,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &LearningArgs) -> Result<ExitCode, CliError> {
    if !args.pairs.len().is_multiple_of(2) {
        return Err(CliError::usage("the last scene has no second one", "name two scenes for each pair"));
    }
    let named = || args.pairs.chunks_exact(2).map(|pair| (pair[0].clone(), pair[1].clone())).collect();
    let in_folder = |folder: &PathBuf| PAIRS.iter().map(|(a, b)| (folder.join(a), folder.join(b))).collect();
    let pairs = match (&args.scenes, args.pairs.is_empty()) {
        (_, false) => named(),
        (Some(folder), true) => in_folder(folder),
        (None, true) => return Err(no_scene()),
    };
    let options =
        LearningOptions { pairs, first: ([240, 180], args.spp), second: ([400, 300], args.spp / 2), level: args.level };
    Ok(print(&measure(&options, &mut LogWriter)?, args.json))
}
