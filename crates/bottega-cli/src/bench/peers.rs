//! `bottega bench peers`: error and time beside other renderers.

use std::{path::PathBuf, process::ExitCode, time::Duration};

use bottega::{devices::processors, request::GuideChoice};
use bottega_bench::peers::{PeersOptions, measure};
use clap::{Args, ValueHint};

use super::result::print;
use crate::{cli::choice, error::CliError, output::LogWriter};

#[derive(Debug, Args)]
pub(super) struct PeersArgs {
    /// Folder with the scenes: SCENE.json (ours, and Cycles'), SCENE.xml (Mitsuba's), SCENE.scn (LuxCore's), the PLY meshes
    /// that they name, and reference/ref_SCENE.exr.
    #[arg(value_hint = ValueHint::DirPath)]
    folder: PathBuf,
    /// A scene by name; may be given more than once. Default: all.
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// Samples a pixel.
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    spp: u32,
    /// Repetitions, interleaved; medians of the times and means of the errors are printed.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=100))]
    repeat: u16,
    /// Only those others whose names begin so (`mitsuba`, `mitsuba llvm`, `cycles`, `luxcore`); may be given more than
    /// once.
    #[arg(long, value_name = "NAME")]
    peer: Vec<String>,
    /// What our paths learn beforehand; the time for it counts.
    #[arg(long, value_name = "GUIDE", value_parser = choice::<GuideChoice>(), default_value = "ala")]
    guide: GuideChoice,
    /// Numbers of threads to paint with. Default: one, and as many as there are processors.
    #[arg(long, value_delimiter = ',', value_parser = parse_threads)]
    threads: Vec<usize>,
    /// The Python that has the modules of the others (mitsuba, bpy, pyluxcore); who is missing is left out.
    #[arg(long, value_name = "PROGRAM", default_value = "python3")]
    python: String,
    /// Compare the time of the processors, not of the clock: for a machine that has other work as well.
    #[arg(long)]
    processor_time: bool,
    /// How long one picture of another renderer may take, in seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 3600)]
    timeout: u64,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &PeersArgs) -> Result<ExitCode, CliError> {
    let options = PeersOptions {
        folder: args.folder.clone(),
        scenes: args.scene.clone(),
        spp: args.spp,
        repeat: args.repeat,
        peers: args.peer.clone(),
        guide: args.guide,
        threads: if args.threads.is_empty() { vec![1, processors()] } else { args.threads.clone() },
        python: args.python.clone(),
        processor_time: args.processor_time,
        timeout: Duration::from_secs(args.timeout),
    };
    Ok(print(&measure(&options, &mut LogWriter)?, args.json))
}

fn parse_threads(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(threads @ 1..=1024) => Ok(threads),
        _ => Err("a number from 1 to 1024 is needed".to_owned()),
    }
}
