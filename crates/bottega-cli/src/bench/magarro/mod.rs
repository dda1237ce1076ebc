//! `bottega bench magarro`: the tables of the MAGarRO paper, on a scene of the same kind.
//!
//! For each partition and optimization the picture is painted once, by one agent on one thread, which gives the time of
//! one agent and what each zone took. More agents than one are replayed in the simulator with those times, each on a
//! machine of its own that is as fast as this one: measured and replayed figures are told apart wherever they are shown.

mod args;
mod paper;
mod plot;
mod tables;

use std::{
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Arc,
    time::Duration,
};

use bottega_engines::{BuiltinEngine, BuiltinOptions, Devices, Tunables};
use bottega_farm::{
    AdaptationRule, AuctionRule, ImportanceFunction, JobSettings, Level, Optimization, StopSwitch,
    simulate::{Crew, Plan, Record, Recorder, Workpiece, simulate},
};
use bottega_image::{AovSet, Canvas, ColorMap, FlipOptions, Layout, Picture, ToneMap, flip, rmse, srgb_from_linear};
use bottega_render::{PathSettings, PrepareOptions, PreparedScene, View};
use bottega_scene::LoadOptions;

pub(crate) use self::args::MagarroArgs;
use self::paper::{AGENTS, OPTIMIZATIONS};
use crate::error::CliError;

/// How long a message takes between machines of one room.
const LATENCY: Duration = Duration::from_micros(500);

pub(crate) fn run(args: &MagarroArgs) -> Result<ExitCode, CliError> {
    let bench = Bench::load(args)?;
    let report = bench.report(args)?;
    if let Some(folder) = &args.output {
        Bench::write(folder, &report)?;
    }
    if args.json {
        println!("{}", tables::as_json(&report));
    } else {
        print!("{}", tables::as_text(&report));
    }
    Ok(ExitCode::SUCCESS)
}

/// Times of one way to paint, in seconds, by number of agents.
#[derive(Clone, Debug)]
struct Row {
    level: Level,
    optimization: Optimization,
    /// As the farm does it, or by the paper's rules of importance, auction and adaptation.
    by_the_paper: bool,
    /// One agent, one thread.
    measured: f64,
    /// Wall time of the look at the scene within it.
    survey: f64,
    /// Replayed, by [`AGENTS`].
    replayed: [f64; 4],
    zones: usize,
    error: Option<Error>,
}

/// How a picture differs from the one without optimization.
#[derive(Clone, Copy, Debug)]
struct Error {
    rmse: f64,
    /// Mean absolute difference of what a display shows, in percent of white.
    percent: f64,
    flip: f64,
}

/// All that is told.
#[derive(Clone, Debug)]
struct Report {
    width: u32,
    height: u32,
    samples: u32,
    light_samples: u32,
    max_depth: u32,
    /// No partition, no optimization.
    whole: Row,
    /// Level 3 without optimization.
    off: Row,
    /// Between two seeds of that.
    noise: Error,
    /// Optimization n, levels 1 to 3.
    levels: Vec<Row>,
    /// Level 3, by [`OPTIMIZATIONS`].
    optimizations: Vec<Row>,
    /// Level 3, optimization n, by the paper's rules.
    paper: Row,
    pictures: Pictures,
}

#[derive(Clone, Debug)]
struct Pictures {
    off: Picture,
    very_big: Picture,
}

struct Bench {
    path: PathBuf,
    width: u32,
    height: u32,
}

impl Bench {
    fn load(args: &MagarroArgs) -> Result<Self, CliError> {
        let in_folder = || args.scenes.as_ref().map(|folder| folder.join("magarro").join("magarro.pbrt"));
        let path = args.scene.clone().or_else(in_folder).ok_or_else(|| {
            CliError::usage("no scene is named", "name one, or the folder of scenes by --scenes or BOTTEGA_SCENES")
        })?;
        let hints = bottega_scene::load(&path, &options())?.hints;
        let [width, height] = hints.resolution.unwrap_or([640, 480]);
        let side = |side: u32| ((f64::from(side) * args.scale).round() as u32).clamp(8, 1 << 14);
        Ok(Self { path, width: side(width), height: side(height) })
    }

    fn report(&self, args: &MagarroArgs) -> Result<Report, CliError> {
        let said = |what: &str| eprintln!("painting {what} …");
        said("without partition and optimization");
        let (whole, _) = self.row(args, Level::Whole, Optimization::Off, false, 0)?;
        said("level 3 without optimization");
        let (off, off_picture) = self.row(args, Level::Balanced, Optimization::Off, false, 0)?;
        said("the same with another seed");
        let (_, other_seed) = self.row(args, Level::Balanced, Optimization::Off, false, 1)?;
        let noise = error(&off_picture, &other_seed)?;
        let judged = |(row, picture): (Row, Picture)| -> Result<(Row, Picture), CliError> {
            Ok((Row { error: Some(error(&off_picture, &picture)?), ..row }, picture))
        };
        let (mut levels, mut optimizations, mut very_big) = (Vec::new(), Vec::new(), None);
        for optimization in OPTIMIZATIONS {
            said(&format!("level 3, optimization {optimization}"));
            let (row, picture) = judged(self.row(args, Level::Balanced, optimization, false, 0)?)?;
            optimizations.push(row);
            very_big = Some(picture);
        }
        for level in [Level::Divided, Level::Joined] {
            said(&format!("level {}, optimization n", level as u8));
            levels.push(judged(self.row(args, level, Optimization::Normal, false, 0)?)?.0);
        }
        levels.extend(optimizations.iter().find(|row| row.optimization == Optimization::Normal).cloned());
        said("level 3, optimization n, by the paper's rules");
        let (paper, _) = judged(self.row(args, Level::Balanced, Optimization::Normal, true, 0)?)?;
        let very_big = very_big.unwrap_or_else(|| off_picture.clone());
        Ok(Report {
            width: self.width,
            height: self.height,
            samples: args.spp,
            light_samples: args.light_samples,
            max_depth: args.max_depth,
            whole,
            off,
            noise,
            levels,
            optimizations,
            paper,
            pictures: Pictures { off: off_picture, very_big },
        })
    }

    /// Paints the picture with one agent on one thread, and replays it with more.
    fn row(
        &self,
        args: &MagarroArgs,
        level: Level,
        optimization: Optimization,
        by_the_paper: bool,
        seed: u64,
    ) -> Result<(Row, Picture), CliError> {
        let tunables = Tunables { max_depth: args.max_depth, light_samples: args.light_samples };
        let layout = Layout::new(AovSet::NONE);
        let settings = JobSettings {
            level,
            optimization,
            agents: 1,
            processors: 1,
            zones: Some(args.zones),
            importance: if by_the_paper { ImportanceFunction::Paper } else { ImportanceFunction::default() },
            ..JobSettings::new(self.width, self.height, args.spp, tunables, layout)
        };
        let (record, picture) = self.paint(&settings, seed)?;
        let piece = Workpiece::recorded(&record, 1)
            .map_err(|error| CliError::failed(error.to_string(), "this is unexpected; report it"))?;
        let piece = Arc::new(piece);
        let mut replayed = [0.0; 4];
        for (time, agents) in replayed.iter_mut().zip(AGENTS) {
            let mut plan = Plan::calm(Crew::equal(agents), seed);
            plan.faults.latency_min = LATENCY;
            if by_the_paper {
                plan.auction = AuctionRule::Paper;
                plan.adaptation = AdaptationRule::Paper;
            }
            *time = simulate(&piece, &plan).map_err(CliError::Simulation)?.makespan.as_secs_f64();
        }
        let row = Row {
            level,
            optimization,
            by_the_paper,
            measured: record.total.as_secs_f64(),
            survey: record.survey.as_secs_f64(),
            replayed,
            zones: record.zones.len(),
            error: None,
        };
        Ok((row, picture))
    }

    fn paint(&self, settings: &JobSettings, seed: u64) -> Result<(Record, Picture), CliError> {
        // Anew each time: what is learnt of where light comes from belongs to the time of a picture.
        let loaded = bottega_scene::load(&self.path, &options())?;
        let filter = loaded.hints.filter.unwrap_or_default();
        let options = PrepareOptions { threads: 1, ..PrepareOptions::default() };
        let prepared = Arc::new(PreparedScene::new(Arc::new(loaded.scene), &options)?);
        let path_settings = PathSettings {
            seed,
            max_depth: settings.tunables.max_depth,
            light_samples: settings.tunables.light_samples,
            filter,
            planned_samples: settings.samples,
            ..PathSettings::default()
        };
        let view = View { camera: 0, width: self.width, height: self.height };
        let options = BuiltinOptions { view, settings: path_settings, layout: settings.layout.clone(), threads: 1 };
        let engine = Arc::new(BuiltinEngine::new(prepared, options, Devices::default()));
        let recorder = Arc::new(Recorder::new(engine, Arc::new(())));
        let (as_engine, as_observer) = (Arc::clone(&recorder) as _, Arc::clone(&recorder) as _);
        let report = bottega_farm::run(settings, as_engine, as_observer, &StopSwitch::new(), None, None);
        let report = report.map_err(bottega::Error::Job)?;
        let record = recorder.record(&bottega::text::shown(&self.path), settings, &report);
        let record = record.map_err(|source| bottega::Error::Record { path: self.path.clone(), source })?;
        Ok((record, report.film.to_picture()))
    }

    fn write(folder: &Path, report: &Report) -> Result<(), CliError> {
        fs::create_dir_all(folder).map_err(|source| CliError::write(folder.to_owned(), source))?;
        let write = |name: &str, text: String| {
            let path = folder.join(name);
            fs::write(&path, text).map_err(|source| CliError::write(path, source))
        };
        let json = serde_json::to_string_pretty(&tables::as_json(report)).unwrap_or_default();
        write("magarro.json", json)?;
        write("magarro.svg", plot::svg(report))?;
        let Pictures { off, very_big } = &report.pictures;
        let difference = flip(off, very_big, &FlipOptions::default())?;
        Canvas::of_picture(off, 0.0, ToneMap::Agx).write_png(folder.join("off.png"))?;
        Canvas::of_picture(very_big, 0.0, ToneMap::Agx).write_png(folder.join("vb.png"))?;
        Canvas::heat_map(off.width, off.height, &difference.map, 1.0, ColorMap::Inferno)
            .write_png(folder.join("difference.png"))?;
        Ok(())
    }
}

/// The scenes of a folder share their meshes, which lie beside them.
fn options() -> LoadOptions {
    LoadOptions { allow_outside: true, ..LoadOptions::default() }
}

fn error(reference: &Picture, picture: &Picture) -> Result<Error, CliError> {
    Ok(Error {
        rmse: rmse(reference, picture)?,
        percent: percent(reference, picture),
        flip: flip(reference, picture, &FlipOptions::default())?.mean,
    })
}

/// Mean absolute difference of what a display shows, in percent of white. (The paper does not say how it measured.)
fn percent(reference: &Picture, picture: &Picture) -> f64 {
    let shown = |value: f32| f64::from(srgb_from_linear(value.clamp(0.0, 1.0)));
    let pixels = reference.data.iter().flatten().zip(picture.data.iter().flatten());
    let sum: f64 = pixels.map(|(a, b)| (shown(*a) - shown(*b)).abs()).sum();
    100.0 * sum / (3 * reference.data.len().max(1)) as f64
}
