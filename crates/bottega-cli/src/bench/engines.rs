//! `bottega bench engines`: what it costs that bottega has an engine of other people paint a picture in zones, beside the same
//! picture that the engine paints as one window. Start and end of all processes count on both sides.

use std::{
    env,
    path::{Path, PathBuf},
    process::{Command, ExitCode, Stdio},
    sync::Arc,
    time::Instant,
};

use bottega_engines::external::{Located, SceneRequest, Session};
use bottega_image::Rect;
use clap::{Args, ValueHint};
use serde_json::{Value, json};

use bottega::{
    devices::processors,
    engines::{absolute, located, parameters},
};

use crate::{
    cli::{Size, parse_define, parse_size},
    clock::children_seconds,
    engines::Trial,
    error::CliError,
};

/// Which engine, with which picture.
#[derive(Debug, Args)]
pub(crate) struct EnginesBenchArgs {
    /// The engine.
    pub(crate) name: String,
    /// The scene: with so many samples that the engine takes about a minute.
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) scene: PathBuf,
    /// Size of the picture; default: what the scene says.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(crate) size: Option<Size>,
    /// Samples a pixel.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    pub(crate) spp: u32,
    /// Threads of both; default: all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// How often both are measured, in turn.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=100))]
    pub(crate) pairs: u16,
    /// More words for `bottega render`, with spaces between, such as "--zones 4".
    #[arg(long, value_name = "WORDS", value_delimiter = ' ', allow_hyphen_values = true)]
    pub(crate) render: Vec<String>,
    /// A parameter of the engine's own.
    #[arg(long = "engine-option", value_name = "NAME=VALUE", value_parser = parse_define)]
    pub(crate) options: Vec<(String, String)>,
    /// More manifests of engines: the files NAME.toml of this folder.
    #[arg(long = "engines", value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub(crate) folders: Vec<PathBuf>,
    /// Print one JSON object instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}

/// What a picture took, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Took {
    wall: f64,
    /// Of all processes; `None` where the system does not tell.
    processors: Option<f64>,
}

/// The same picture by the engine alone and by bottega.
#[derive(Clone, Copy, Debug)]
struct Pair {
    alone: Took,
    zones: Took,
    zone_count: usize,
}

impl Pair {
    fn wall(&self) -> f64 {
        self.zones.wall / self.alone.wall - 1.0
    }

    fn processors(&self) -> Option<f64> {
        Some(self.zones.processors? / self.alone.processors? - 1.0)
    }
}

pub(super) fn run(args: &EnginesBenchArgs) -> Result<ExitCode, CliError> {
    let engine = located(&args.folders, &args.name)?;
    let failed = |source| bottega::Error::External { engine: args.name.clone(), source };
    let mut request = SceneRequest {
        scene: absolute(&args.scene)?,
        size: args.size.map(|size| (size.width, size.height)),
        frame: None,
        threads: args.threads.map_or_else(processors, usize::from),
        trust: false,
        view: None,
        parameters: parameters(&engine, &args.options.iter().cloned().collect())?,
        outside: Vec::new(),
    };
    if request.size.is_none() {
        let session = Session::open(&engine, &request).map_err(failed)?;
        request.size = Some((session.opened().width, session.opened().height));
    }
    let folder = tempfile::tempdir().map_err(|source| CliError::write(env::temp_dir(), source))?;
    let mut pairs = Vec::new();
    for number in 0..args.pairs {
        let alone_first = number % 2 == 0;
        let before = if alone_first { Some(alone(args, &engine, &request)?) } else { None };
        let (zones, zone_count) = in_zones(args, &request, folder.path())?;
        let alone = before.map_or_else(|| alone(args, &engine, &request), Ok)?;
        pairs.push(Pair { alone, zones, zone_count });
        if !args.json {
            tell(&pairs[pairs.len() - 1]);
        }
    }
    let wall = median(pairs.iter().map(Pair::wall).collect());
    let processors = pairs.iter().map(Pair::processors).collect::<Option<Vec<_>>>().map(median);
    if args.json {
        println!("{}", as_json(args, &pairs, wall, processors));
    } else {
        let processors = processors.map_or_else(|| "not known".to_owned(), |more| format!("{:+.1} %", 100.0 * more));
        println!("medians: {:+.1} % of the time, processors {processors}", 100.0 * wall);
    }
    Ok(ExitCode::SUCCESS)
}

fn timed<T>(work: impl FnOnce() -> Result<T, CliError>) -> Result<(Took, T), CliError> {
    let (before, begun) = (children_seconds(), Instant::now());
    let made = work()?;
    let wall = begun.elapsed().as_secs_f64();
    let processors = before.zip(children_seconds()).map(|(before, after)| after - before);
    Ok((Took { wall, processors }, made))
}

/// The whole frame as one window, by the same worker.
fn alone(args: &EnginesBenchArgs, engine: &Arc<Located>, request: &SceneRequest) -> Result<Took, CliError> {
    let (width, height) = request.size.unwrap_or_default();
    let (took, ()) = timed(|| {
        let failed = |source| bottega::Error::External { engine: args.name.clone(), source };
        let trial = Trial::begin(engine, request, 1).map_err(failed)?;
        trial.paint(&[Rect::of_size(width, height)], args.spp).map(drop)
    })?;
    Ok(took)
}

/// `bottega render`, as a user runs it.
fn in_zones(args: &EnginesBenchArgs, request: &SceneRequest, folder: &Path) -> Result<(Took, usize), CliError> {
    let (width, height) = request.size.unwrap_or_default();
    let broken = |error: std::io::Error| {
        CliError::failed(format!("bottega cannot start itself: {error}"), "this is unexpected; report it")
    };
    let program = env::current_exe().map_err(broken)?;
    let output = folder.join("picture.exr");
    let mut command = Command::new(program);
    command.arg("render").arg(&request.scene).arg("-o").arg(&output).args(["--engine", &args.name, "--json"]);
    command.args(["--size", &format!("{width}x{height}"), "--spp", &args.spp.to_string(), "--seed", "1"]);
    command.args(["--threads", &request.threads.to_string()]).args(&args.render).stdin(Stdio::null());
    for (name, value) in &args.options {
        command.args(["--engine-option", &format!("{name}={value}")]);
    }
    for more in &args.folders {
        command.arg("--engines").arg(more);
    }
    let (took, done) = timed(|| command.stderr(Stdio::piped()).output().map_err(broken))?;
    if !done.status.success() {
        let said = String::from_utf8_lossy(&done.stderr).trim().to_owned();
        return Err(CliError::failed(format!("bottega render fails: {said}"), "see what it says"));
    }
    let said = String::from_utf8_lossy(&done.stdout).into_owned();
    let events = said.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let analyzed = events.into_iter().find(|event| event["event"] == "analyzed").unwrap_or_default();
    Ok((took, analyzed["zones"].as_array().map_or(0, Vec::len)))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}

fn tell(pair: &Pair) {
    let of = |took: &Took| {
        let processors = took.processors.map_or_else(String::new, |seconds| format!(", processors {seconds:.2} s"));
        format!("{:.2} s{processors}", took.wall)
    };
    let more =
        pair.processors().map_or_else(String::new, |more| format!(", {:+.1} % of the processors'", 100.0 * more));
    println!(
        "one window {}; {} zones {}: {:+.1} % of the time{more}",
        of(&pair.alone),
        pair.zone_count,
        of(&pair.zones),
        100.0 * pair.wall()
    );
}

fn as_json(args: &EnginesBenchArgs, pairs: &[Pair], wall: f64, processors: Option<f64>) -> Value {
    let took = |took: &Took| json!({"seconds": took.wall, "processor_seconds": took.processors});
    let each =
        |pair: &Pair| json!({"alone": took(&pair.alone), "zones": took(&pair.zones), "zone_count": pair.zone_count});
    json!({
        "engine": args.name,
        "scene": args.scene,
        "spp": args.spp,
        "pairs": pairs.iter().map(each).collect::<Vec<_>>(),
        "overhead": wall,
        "processor_overhead": processors,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overheads_are_relative_to_the_engine_alone() {
        let took = |wall, processors| Took { wall, processors };
        let pair = Pair { alone: took(10.0, Some(20.0)), zones: took(10.5, Some(20.2)), zone_count: 4 };
        assert!((pair.wall() - 0.05).abs() < 1e-12 && (pair.processors().unwrap() - 0.01).abs() < 1e-12);
        assert_eq!(Pair { zones: took(1.0, None), ..pair }.processors(), None);
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
    }

    #[test]
    fn what_children_spend_is_seen_where_the_system_tells() {
        let Some(before) = children_seconds() else { return };
        let done = Command::new("sh").args(["-c", "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done"]).status();
        assert!(done.is_ok_and(|status| status.success()));
        assert!(children_seconds().is_some_and(|after| after > before));
    }
}
