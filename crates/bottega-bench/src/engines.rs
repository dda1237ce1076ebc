//! The overhead of rendering in zones with an external engine, relative to the same image rendered by the engine as one window.
//! Start and end of all processes count on both sides.

use std::{
    env,
    io::Write,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::Arc,
    time::Instant,
};

use bottega::engines::{absolute, located, parameters};
use bottega_engines::external::{EngineFault, EngineTrial, LocatedEngine, SceneRequest, Session};
use bottega_image::Rect;
use bottega_platform::processor_time;
use clap::Args;
use serde_json::{Value, json};

use crate::{
    arguments::{self, parse_define, parse_size},
    error::Error,
    files::temporary_folder,
    report::{Measurement, Report, say},
};

/// The cost of rendering in zones with an external engine, beside the same picture as one window.
#[derive(Clone, Debug, Args)]
pub(crate) struct EnginesOptions {
    /// The engine.
    engine: String,
    /// The scene: with so many samples that the engine takes about a minute.
    scene: PathBuf,
    /// Size of the picture; default: what the scene says.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<(u32, u32)>,
    /// Samples per pixel.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    spp: u32,
    /// Threads of both; default: all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Number of measurements of each, in turn.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=100))]
    pairs: u16,
    /// More words for `bottega render`, with spaces between, such as "--set work.zones=4".
    #[arg(long, value_name = "WORDS", value_delimiter = ' ', allow_hyphen_values = true)]
    render: Vec<String>,
    /// A parameter of the engine's own.
    #[arg(long = "engine-option", value_name = "NAME=VALUE", value_parser = parse_define)]
    parameters: Vec<(String, String)>,
    /// More manifests of engines: the files NAME.toml of this folder.
    #[arg(long = "engines", value_name = "FOLDER")]
    folders: Vec<PathBuf>,
    /// The program `bottega`, which renders in zones; default: the one beside this program, or else the first on the search path.
    #[arg(long, value_name = "PATH")]
    program: Option<PathBuf>,
}

/// The times of all pairs.
#[derive(Clone, Debug)]
struct EnginesReport {
    engine: String,
    scene: PathBuf,
    spp: u32,
    pairs: Vec<TimedPair>,
    /// Medians of the overhead of rendering in zones, relative to the engine alone.
    wall: f64,
    processors: Option<f64>,
}

/// The time of an image, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct PictureTime {
    wall: f64,
    /// Processor time of all processes; `None`: the system does not report it.
    processors: Option<f64>,
}

/// The times of the same image by the engine alone and by bottega.
#[derive(Clone, Copy, Debug)]
struct TimedPair {
    alone: PictureTime,
    zones: PictureTime,
    zone_count: usize,
}

impl TimedPair {
    fn wall(&self) -> f64 {
        self.zones.wall / self.alone.wall - 1.0
    }

    fn processors(&self) -> Option<f64> {
        Some(self.zones.processors? / self.alone.processors? - 1.0)
    }

    fn line(&self) -> String {
        let of = |time: &PictureTime| {
            let processors = time.processors.map_or_else(String::new, |seconds| format!(", processors {seconds:.2} s"));
            format!("{:.2} s{processors}", time.wall)
        };
        let more =
            self.processors().map_or_else(String::new, |more| format!(", {:+.1} % of the processors'", 100.0 * more));
        format!(
            "one window {}; {} zones {}: {:+.1} % of the time{more}",
            of(&self.alone),
            self.zone_count,
            of(&self.zones),
            100.0 * self.wall()
        )
    }
}

impl Measurement for EnginesOptions {
    /// Renders the image both ways, alternately.
    fn measure(&self, log: &mut dyn Write) -> Result<Box<dyn Report>, Error> {
        let program = self.program()?;
        let engine = located(&self.folders, &self.engine)?;
        let mut request = SceneRequest {
            scene: absolute(&self.scene)?,
            size: self.size,
            frame: None,
            threads: arguments::threads(self.threads),
            trust: false,
            view: None,
            parameters: parameters(&engine, &self.parameters.iter().cloned().collect())?,
            outside: Vec::new(),
        };
        if request.size.is_none() {
            let session = Session::open(&engine, &request).map_err(|source| self.failed(source))?;
            request.size = Some((session.opened().width, session.opened().height));
        }
        let folder = temporary_folder()?;
        let output = folder.path().join("picture.exr");
        let mut pairs = Vec::new();
        for number in 0..self.pairs {
            let alone_first = number % 2 == 0;
            let before = if alone_first { Some(self.alone(&engine, &request)?) } else { None };
            let (zones, zone_count) = self.in_zones(&program, &request, &output)?;
            let alone = before.map_or_else(|| self.alone(&engine, &request), Ok)?;
            let pair = TimedPair { alone, zones, zone_count };
            say(log, format_args!("{}", pair.line()));
            pairs.push(pair);
        }
        let wall = median(pairs.iter().map(TimedPair::wall).collect());
        let processors = pairs.iter().map(TimedPair::processors).collect::<Option<Vec<_>>>().map(median);
        let Self { engine, scene, spp, .. } = self.clone();
        Ok(Box::new(EnginesReport { engine, scene, spp, pairs, wall, processors }))
    }
}

impl EnginesOptions {
    fn failed(&self, source: EngineFault) -> Error {
        bottega::Error::External { engine: self.engine.clone(), source }.into()
    }

    /// Returns the path of the program `bottega`.
    fn program(&self) -> Result<PathBuf, Error> {
        if let Some(program) = &self.program {
            return program.canonicalize().map_err(|_| Error::NoProgram { path: program.clone() });
        }
        let name = format!("bottega{}", env::consts::EXE_SUFFIX);
        let beside = env::current_exe().map_err(Error::Process)?.with_file_name(&name);
        let places = env::var_os("PATH").unwrap_or_default();
        let on_path = env::split_paths(&places).map(|folder| folder.join(&name));
        let found = [beside.clone()].into_iter().chain(on_path).find(|path| path.is_file());
        found.ok_or(Error::NoProgram { path: beside })
    }

    /// Renders the whole frame as one window with the same worker.
    fn alone(&self, engine: &Arc<LocatedEngine>, request: &SceneRequest) -> Result<PictureTime, Error> {
        let (width, height) = request.size.unwrap_or_default();
        let (time, ()) = timed(|| {
            let trial = EngineTrial::begin(engine, request, 1).map_err(|source| self.failed(source))?;
            trial.paint(&[Rect::of_size(width, height)], self.spp)?;
            Ok(())
        })?;
        Ok(time)
    }

    /// Runs `bottega render` like a user. Returns the time and the number of zones.
    fn in_zones(&self, program: &Path, request: &SceneRequest, output: &Path) -> Result<(PictureTime, usize), Error> {
        let (width, height) = request.size.unwrap_or_default();
        let mut command = Command::new(program);
        command.arg("render").arg(&request.scene).arg("-o").arg(output).args(["--engine", &self.engine, "--json"]);
        command.args(["--size", &format!("{width}x{height}"), "--spp", &self.spp.to_string(), "--seed", "1"]);
        command.args(["--threads", &request.threads.to_string()]).args(&self.render);
        for (name, value) in &self.parameters {
            command.args(["--engine-option", &format!("{name}={value}")]);
        }
        for folder in &self.folders {
            command.arg("--engines").arg(folder);
        }
        command.stdin(Stdio::null()).stderr(Stdio::piped());
        let failed = |source| Error::StartRender { path: program.to_owned(), source };
        let (time, done) = timed(|| command.output().map_err(failed))?;
        if !done.status.success() {
            return Err(Error::Render { said: String::from_utf8_lossy(&done.stderr).trim().to_owned() });
        }
        let said = String::from_utf8_lossy(&done.stdout).into_owned();
        let mut events = said.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        let analyzed = events.find(|event| event["event"] == "analyzed").unwrap_or_default();
        Ok((time, analyzed["zones"].as_array().map_or(0, Vec::len)))
    }
}

fn timed<T>(work: impl FnOnce() -> Result<T, Error>) -> Result<(PictureTime, T), Error> {
    let (before, begun) = (processor_time::children_seconds(), Instant::now());
    let made = work()?;
    let wall = begun.elapsed().as_secs_f64();
    let processors = before.zip(processor_time::children_seconds()).map(|(before, after)| after - before);
    Ok((PictureTime { wall, processors }, made))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}

impl Report for EnginesReport {
    fn as_text(&self) -> String {
        let Self { wall, processors, .. } = self;
        let processors = processors.map_or_else(|| "not known".to_owned(), |more| format!("{:+.1} %", 100.0 * more));
        let pairs: String = self.pairs.iter().map(|pair| pair.line() + "\n").collect();
        format!("{pairs}medians: {:+.1} % of the time, processors {processors}\n", 100.0 * wall)
    }

    fn as_json(&self) -> Value {
        let time = |time: &PictureTime| json!({"seconds": time.wall, "processor_seconds": time.processors});
        let each = |pair: &TimedPair| json!({"alone": time(&pair.alone), "zones": time(&pair.zones), "zone_count": pair.zone_count});
        json!({
            "engine": self.engine,
            "scene": self.scene,
            "spp": self.spp,
            "pairs": self.pairs.iter().map(each).collect::<Vec<_>>(),
            "overhead": self.wall,
            "processor_overhead": self.processors,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overheads_are_relative_to_the_engine_alone() {
        let took = |wall, processors| PictureTime { wall, processors };
        let pair = TimedPair { alone: took(10.0, Some(20.0)), zones: took(10.5, Some(20.2)), zone_count: 4 };
        assert!((pair.wall() - 0.05).abs() < 1e-12 && (pair.processors().unwrap() - 0.01).abs() < 1e-12);
        assert_eq!(TimedPair { zones: took(1.0, None), ..pair }.processors(), None);
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
    }

    #[test]
    fn what_children_spend_is_seen_where_the_system_tells() {
        let Some(before) = processor_time::children_seconds() else { return };
        let done = Command::new("sh").args(["-c", "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done"]).status();
        assert!(done.is_ok_and(|status| status.success()));
        assert!(processor_time::children_seconds().is_some_and(|after| after > before));
    }
}
