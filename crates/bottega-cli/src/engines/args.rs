//! Options of `bottega engines`.

use std::{path::PathBuf, time::Duration};

use clap::{Args, Subcommand, ValueHint};

use crate::{
    cli::{Size, parse_define, parse_size},
    option_value::parse_duration,
};

#[derive(Debug, Args)]
pub(crate) struct EnginesArgs {
    #[command(subcommand)]
    pub(crate) command: EnginesCommand,
}

#[derive(Debug, Subcommand)]
pub(crate) enum EnginesCommand {
    /// List the engines that have a manifest, and whether they are installed here.
    List(ListArgs),
    /// Check a manifest, and whether its engine is found and answers.
    Check(EngineCheckArgs),
    /// Render a small picture of a scene with an engine, whole and in windows, and compare the two.
    Try(TryArgs),
    /// Use an engine again that was excluded on this machine because it failed too often.
    Release(ReleaseArgs),
}

#[derive(Debug, Args)]
pub(crate) struct ListArgs {
    /// More manifests of engines: the files NAME.toml of this folder.
    #[arg(long = "engines", value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub(crate) folders: Vec<PathBuf>,
    /// Time that engines have to answer. One that takes longer is listed as starting.
    #[arg(long, value_name = "TIME", default_value = "2s", value_parser = parse_duration)]
    pub(crate) wait: Duration,
    /// Print one JSON object per engine instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct EngineCheckArgs {
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
    /// Size of the picture; default: a quarter of the scene's.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(crate) size: Option<Size>,
    /// Samples per pixel.
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
