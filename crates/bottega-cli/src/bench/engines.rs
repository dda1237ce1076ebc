//! `bottega bench engines`: the overhead of painting in zones with another engine.

use std::{
    env,
    io::{self, Write},
    path::{Path, PathBuf},
    process::{Command, ExitCode},
};

use bottega::devices::processors;
use bottega_bench::engines::{EnginesOptions, measure};
use bottega_engines::external::SceneRequest;
use clap::{Args, ValueHint};

use super::result::print;
use crate::{
    cli::{Size, parse_define, parse_size},
    error::CliError,
    output::ResultWriter,
};

/// Which engine, with which picture.
#[derive(Debug, Args)]
pub(super) struct EnginesBenchArgs {
    /// The engine.
    name: String,
    /// The scene: with so many samples that the engine takes about a minute.
    #[arg(value_hint = ValueHint::FilePath)]
    scene: PathBuf,
    /// Size of the picture; default: what the scene says.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<Size>,
    /// Samples a pixel.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    spp: u32,
    /// Threads of both; default: all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// How often both are measured, in turn.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=100))]
    pairs: u16,
    /// More words for `bottega render`, with spaces between, such as "--zones 4".
    #[arg(long, value_name = "WORDS", value_delimiter = ' ', allow_hyphen_values = true)]
    render: Vec<String>,
    /// A parameter of the engine's own.
    #[arg(long = "engine-option", value_name = "NAME=VALUE", value_parser = parse_define)]
    options: Vec<(String, String)>,
    /// More manifests of engines: the files NAME.toml of this folder.
    #[arg(long = "engines", value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    folders: Vec<PathBuf>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &EnginesBenchArgs) -> Result<ExitCode, CliError> {
    let options = EnginesOptions {
        engine: args.name.clone(),
        folders: args.folders.clone(),
        scene: args.scene.clone(),
        size: args.size.map(|size| (size.width, size.height)),
        spp: args.spp,
        threads: args.threads.map_or_else(processors, usize::from),
        pairs: args.pairs,
        parameters: args.options.iter().cloned().collect(),
    };
    let render = |request: &SceneRequest, output: &Path| render_command(args, request, output);
    // For people, each pair is a part of the result.
    let (mut shown, mut hidden) = (ResultWriter, io::sink());
    let log: &mut dyn Write = if args.json { &mut hidden } else { &mut shown };
    Ok(print(&measure(&options, &render, log)?, args.json))
}

/// `bottega render`, as a user runs it.
fn render_command(args: &EnginesBenchArgs, request: &SceneRequest, output: &Path) -> io::Result<Command> {
    let (width, height) = request.size.unwrap_or_default();
    let mut command = Command::new(env::current_exe()?);
    command.arg("render").arg(&request.scene).arg("-o").arg(output).args(["--engine", &args.name, "--json"]);
    command.args(["--size", &format!("{width}x{height}"), "--spp", &args.spp.to_string(), "--seed", "1"]);
    command.args(["--threads", &request.threads.to_string()]).args(&args.render);
    for (name, value) in &args.options {
        command.args(["--engine-option", &format!("{name}={value}")]);
    }
    for more in &args.folders {
        command.arg("--engines").arg(more);
    }
    Ok(command)
}
