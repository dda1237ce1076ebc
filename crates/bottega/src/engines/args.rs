//! What the command line takes about engines.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueHint};

use crate::{
    cli::{Size, parse_define, parse_size},
    error::CliError,
};

/// Which engine paints, and what it is told beside the usual.
#[derive(Clone, Debug, Args)]
pub(crate) struct EngineArgs {
    /// Who paints: our own engine, or another renderer that is installed here, see `bottega engines list`; or both, as
    /// `builtin,NAME` or `NAME,builtin`: who is free takes the zone that suits it best, simple ones the engine named first,
    /// complex ones the other.
    #[arg(long, value_name = "NAME", default_value = "builtin", value_delimiter = ',', help_heading = "Engine")]
    pub(crate) engine: Vec<String>,
    /// Which of two engines suits a zone, as FCL text; default: engine-choice, which comes with the program.
    #[arg(long = "engine-rules", value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = "Engine")]
    pub(crate) choice: Option<PathBuf>,
    /// More manifests of engines: the files NAME.toml of this folder.
    #[arg(long = "engines", value_name = "FOLDER", value_hint = ValueHint::DirPath, help_heading = "Engine")]
    pub(crate) folders: Vec<PathBuf>,
    /// A parameter of the engine's own; its manifest says which there are.
    #[arg(long = "engine-option", value_name = "NAME=VALUE", value_parser = parse_define, help_heading = "Engine")]
    pub(crate) options: Vec<(String, String)>,
    /// Let scripts run that are in the scene: only for scenes of people you trust.
    #[arg(long, help_heading = "Engine")]
    pub(crate) trust: bool,
    /// Which frame of the animation, for engines that know of frames; default: the one that the scene is at.
    #[arg(long, value_name = "N", conflicts_with = "frames", allow_negative_numbers = true, help_heading = "Engine")]
    pub(crate) frame: Option<i32>,
    /// Where the files of a scene are that was sent here; none: it is the user's own.
    #[arg(skip)]
    pub(crate) sent: Option<PathBuf>,
}

impl EngineArgs {
    /// The engine of other people that paints, and whether ours paints with it.
    pub(crate) fn other(&self) -> Result<(&str, bool), CliError> {
        let others: Vec<&String> = self.engine.iter().filter(|name| *name != super::BUILTIN).collect();
        match (others.as_slice(), self.engine.len()) {
            ([name], 1) => Ok((name.as_str(), false)),
            ([name], 2) => Ok((name.as_str(), true)),
            _ => Err(CliError::usage(
                "these engines cannot paint one picture",
                "give --engine one name, or `builtin` and one other that reads the same scene",
            )),
        }
    }

    /// Whether our own engine paints, and no other.
    pub(crate) fn is_builtin(&self) -> bool {
        self.engine == [super::BUILTIN]
    }
}

#[derive(Debug, Args)]
pub(crate) struct EnginesArgs {
    #[command(subcommand)]
    pub(crate) command: EnginesCommand,
}

#[derive(Debug, Subcommand)]
pub(crate) enum EnginesCommand {
    /// List the engines that there are manifests for, and whether they are installed here.
    List(ListArgs),
    /// Check a manifest, and whether its engine is found and answers.
    Check(CheckArgs),
    /// Have an engine paint a small picture of a scene, whole and in windows, and compare the two.
    Try(TryArgs),
    /// Let an engine paint again that failed so often on this machine that it is not used any more.
    Release(ReleaseArgs),
}

#[derive(Debug, Args)]
pub(crate) struct ListArgs {
    /// More manifests of engines: the files NAME.toml of this folder.
    #[arg(long = "engines", value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub(crate) folders: Vec<PathBuf>,
    /// Print one JSON object an engine instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// The engine, or the file of a manifest.
    pub(crate) name: String,
    /// More manifests of engines: the files NAME.toml of this folder.
    #[arg(long = "engines", value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub(crate) folders: Vec<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct ReleaseArgs {
    /// The engine.
    pub(crate) name: String,
    /// More manifests of engines: the files NAME.toml of this folder.
    #[arg(long = "engines", value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub(crate) folders: Vec<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct TryArgs {
    /// The engine.
    pub(crate) name: String,
    /// The scene.
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) scene: PathBuf,
    /// Keep the two pictures here, as full.exr and windows.exr.
    #[arg(short, long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub(crate) output: Option<PathBuf>,
    /// Size of the picture; default: a quarter of what the scene says.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(crate) size: Option<Size>,
    /// Samples a pixel.
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    pub(crate) spp: u32,
    /// Processors to use; default: all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Let scripts run that are in the scene.
    #[arg(long)]
    pub(crate) trust: bool,
    /// A parameter of the engine's own.
    #[arg(long = "engine-option", value_name = "NAME=VALUE", value_parser = parse_define)]
    pub(crate) options: Vec<(String, String)>,
    /// More manifests of engines: the files NAME.toml of this folder.
    #[arg(long = "engines", value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub(crate) folders: Vec<PathBuf>,
}
