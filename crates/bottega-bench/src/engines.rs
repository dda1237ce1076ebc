//! The overhead of painting in zones with another engine, beside the same picture that the engine paints as one window. Start
//! and end of all processes count on both sides.

mod trial;

use std::{
    collections::BTreeMap,
    env,
    io::{self, Write},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::Arc,
    time::Instant,
};

use bottega::engines::{absolute, located, parameters};
use bottega_engines::external::{EngineFault, LocatedEngine, SceneRequest, Session};
use bottega_image::Rect;
use bottega_platform::processor_time;
use serde_json::{Value, json};

pub use self::trial::EngineTrial;
use crate::{Error, Report, say};

/// The engine and the picture of the measurement.
#[derive(Clone, Debug)]
pub struct EnginesOptions {
    /// The engine.
    pub engine: String,
    /// Folders with more manifests of engines.
    pub folders: Vec<PathBuf>,
    /// The scene.
    pub scene: PathBuf,
    /// Size of the picture; `None`: what the scene says.
    pub size: Option<(u32, u32)>,
    /// Samples a pixel.
    pub spp: u32,
    /// Threads of both.
    pub threads: usize,
    /// How often both are measured, in turn, at least once.
    pub pairs: u16,
    /// Parameters of the engine's own.
    pub parameters: BTreeMap<String, String>,
}

/// Makes the command that paints a request in zones, `bottega render`, with events as JSON lines: into the file of this path.
pub type RenderCommand<'a> = &'a dyn Fn(&SceneRequest, &Path) -> io::Result<Command>;

/// The times of all pairs.
#[derive(Clone, Debug)]
pub struct EnginesReport {
    engine: String,
    scene: PathBuf,
    spp: u32,
    pairs: Vec<TimedPair>,
    /// Medians of what painting in zones adds, as shares of the engine alone.
    wall: f64,
    processors: Option<f64>,
}

/// The time of a picture, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct PictureTime {
    wall: f64,
    /// Of all processes; `None` where the system does not tell.
    processors: Option<f64>,
}

/// The same picture by the engine alone and by bottega.
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

/// Paints the picture both ways, in turn.
///
/// - `render`: has it painted in zones.
/// - `log`: is told the times of each pair.
///
/// # Errors
/// The engine or `render` fails.
pub fn measure(
    options: &EnginesOptions,
    render: RenderCommand<'_>,
    log: &mut dyn Write,
) -> Result<EnginesReport, Error> {
    let engine = located(&options.folders, &options.engine)?;
    let mut request = SceneRequest {
        scene: absolute(&options.scene)?,
        size: options.size,
        frame: None,
        threads: options.threads,
        trust: false,
        view: None,
        parameters: parameters(&engine, &options.parameters)?,
        outside: Vec::new(),
    };
    if request.size.is_none() {
        let session = Session::open(&engine, &request).map_err(|source| options.failed(source))?;
        request.size = Some((session.opened().width, session.opened().height));
    }
    let folder = tempfile::tempdir().map_err(|source| bottega::Error::Write { path: env::temp_dir(), source })?;
    let output = folder.path().join("picture.exr");
    let mut pairs = Vec::new();
    for number in 0..options.pairs.max(1) {
        let alone_first = number % 2 == 0;
        let before = if alone_first { Some(alone(options, &engine, &request)?) } else { None };
        let (zones, zone_count) = in_zones(render, &request, &output)?;
        let alone = before.map_or_else(|| alone(options, &engine, &request), Ok)?;
        let pair = TimedPair { alone, zones, zone_count };
        say(log, format_args!("{}", pair.line()));
        pairs.push(pair);
    }
    let wall = median(pairs.iter().map(TimedPair::wall).collect());
    let processors = pairs.iter().map(TimedPair::processors).collect::<Option<Vec<_>>>().map(median);
    let EnginesOptions { engine, scene, spp, .. } = options.clone();
    Ok(EnginesReport { engine, scene, spp, pairs, wall, processors })
}

impl EnginesOptions {
    fn failed(&self, source: EngineFault) -> Error {
        bottega::Error::External { engine: self.engine.clone(), source }.into()
    }
}

fn timed<T>(work: impl FnOnce() -> Result<T, Error>) -> Result<(PictureTime, T), Error> {
    let (before, begun) = (processor_time::children_seconds(), Instant::now());
    let made = work()?;
    let wall = begun.elapsed().as_secs_f64();
    let processors = before.zip(processor_time::children_seconds()).map(|(before, after)| after - before);
    Ok((PictureTime { wall, processors }, made))
}

/// The whole frame as one window, by the same worker.
fn alone(options: &EnginesOptions, engine: &Arc<LocatedEngine>, request: &SceneRequest) -> Result<PictureTime, Error> {
    let (width, height) = request.size.unwrap_or_default();
    let (time, ()) = timed(|| {
        let trial = EngineTrial::begin(engine, request, 1).map_err(|source| options.failed(source))?;
        trial.paint(&[Rect::of_size(width, height)], options.spp).map(drop)
    })?;
    Ok(time)
}

/// `bottega render`, as a user runs it. Returns the time and the number of zones.
fn in_zones(render: RenderCommand<'_>, request: &SceneRequest, output: &Path) -> Result<(PictureTime, usize), Error> {
    let mut command = render(request, output).map_err(Error::StartRender)?;
    command.stdin(Stdio::null()).stderr(Stdio::piped());
    let (time, done) = timed(|| command.output().map_err(Error::StartRender))?;
    if !done.status.success() {
        return Err(Error::Render { said: String::from_utf8_lossy(&done.stderr).trim().to_owned() });
    }
    let said = String::from_utf8_lossy(&done.stdout).into_owned();
    let mut events = said.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let analyzed = events.find(|event| event["event"] == "analyzed").unwrap_or_default();
    Ok((time, analyzed["zones"].as_array().map_or(0, Vec::len)))
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
        format!("medians: {:+.1} % of the time, processors {processors}\n", 100.0 * wall)
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
