//! The tables of the MAGarRO paper, on a scene of the same kind.
//!
//! For each partition and optimization the picture is painted by one agent on one thread, which gives the time of one
//! agent and what each zone took, and by two agents in two processes. More agents are replayed in the simulator, each on a
//! machine of its own that is as fast as this one, and so are one and two: a replay that is far off the measured pair is no
//! measurement. Measured and replayed figures are told apart wherever they are shown.

mod equal_time;
mod paper;
mod plot;
mod report;
mod second_agent;
mod tables;

use std::{
    io::Write,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use bottega_engines::{BuiltinEngine, BuiltinOptions, Devices, Tunables};
use bottega_farm::{
    AdaptationRule, AuctionRule, Balance, Expert, ImportanceFunction, JobSettings, Level, Optimization, PAPER_RULES,
    StopSwitch, ZoneLimits,
    simulate::{CrewSpec, Plan, Record, Recorder, Workpiece, simulate},
};
use bottega_image::{AovSet, Canvas, ColorMap, FlipOptions, Layout, Picture, ToneMap, flip, rmse, srgb_from_linear};
use bottega_render::{PathSettings, PrepareOptions, PreparedScene, View};

pub use self::{
    equal_time::{EqualTimeReport, measure_equal_time},
    report::MagarroReport,
    second_agent::{SecondAgentCommand, SharedRow, run_second_agent},
};
use self::{
    paper::{AGENTS, OPTIMIZATIONS},
    report::{MagarroRow, PictureError, Pictures, Ways},
    second_agent::AgentPair,
};
use crate::{Error, Report, create_folder, say, shared_meshes, write_file};

/// The scene that stands for the paper's, in the folder of scenes.
pub const SCENE: &str = "magarro/magarro.pbrt";

/// How long a message takes between machines of one room.
const LATENCY: Duration = Duration::from_micros(500);

/// The picture of the measurement.
#[derive(Clone, Debug)]
pub struct MagarroOptions {
    /// The scene.
    pub scene: PathBuf,
    /// Sides of the picture, as a share of what the scene file asks for.
    pub scale: f64,
    /// Samples a pixel.
    pub spp: u32,
    /// Light samples at each bounce.
    pub light_samples: u32,
    /// Bounces.
    pub max_depth: u32,
    /// Zones that the partition aims at, for all numbers of agents.
    pub zones: u32,
    /// Folder for `magarro.json`, `magarro.svg`, and the pictures.
    pub output: Option<PathBuf>,
    /// The program of the NATS server over which two agents meet; `None`: `nats-server`, where systems put it.
    pub server: Option<PathBuf>,
}

/// Paints the scene in every way of the paper, and writes what `output` asks for.
///
/// - `second`: starts the process of the second agent; `None`: two agents are replayed like more.
/// - `log`: is told which picture is being painted.
///
/// # Errors
/// The scene cannot be painted, there is no server for two agents, or a file cannot be written.
pub fn measure(
    options: &MagarroOptions,
    second: Option<SecondAgentCommand<'_>>,
    log: &mut dyn Write,
) -> Result<MagarroReport, Error> {
    let pair = second.map(|command| AgentPair::start(options.server.as_deref(), command)).transpose()?;
    let report = MagarroScene::load(options)?.report(pair.as_ref(), log)?;
    if let Some(folder) = &options.output {
        write(folder, &report)?;
    }
    Ok(report)
}

struct MagarroScene<'a> {
    options: &'a MagarroOptions,
    width: u32,
    height: u32,
}

impl<'a> MagarroScene<'a> {
    fn load(options: &'a MagarroOptions) -> Result<Self, Error> {
        let hints = bottega_scene::load(&options.scene, &shared_meshes())?.hints;
        let [width, height] = hints.resolution.unwrap_or([640, 480]);
        let side = |side: u32| ((f64::from(side) * options.scale).round() as u32).clamp(8, 1 << 14);
        Ok(Self { options, width: side(width), height: side(height) })
    }

    fn report(&self, pair: Option<&AgentPair<'_>>, log: &mut dyn Write) -> Result<MagarroReport, Error> {
        let mut said = |what: &str| say(log, format_args!("painting {what} …"));
        said("without partition and optimization");
        let (whole, _) = self.row(pair, Level::Whole, Optimization::Off, Ways::Ours, 0)?;
        said("level 3 without optimization");
        let (off, off_picture) = self.row(pair, Level::Balanced, Optimization::Off, Ways::Ours, 0)?;
        said("the same with another seed");
        let (_, other_seed) = self.row(pair, Level::Balanced, Optimization::Off, Ways::Ours, 1)?;
        let noise = error(&off_picture, &other_seed)?;
        let judged = |(row, picture): (MagarroRow, Picture)| -> Result<(MagarroRow, Picture), Error> {
            Ok((MagarroRow { error: Some(error(&off_picture, &picture)?), ..row }, picture))
        };
        let (mut levels, mut optimizations, mut very_big) = (Vec::new(), Vec::new(), None);
        for optimization in OPTIMIZATIONS {
            said(&format!("level 3, optimization {optimization}"));
            let (row, picture) = judged(self.row(pair, Level::Balanced, optimization, Ways::Ours, 0)?)?;
            optimizations.push(row);
            very_big = Some(picture);
        }
        for level in [Level::Divided, Level::Joined] {
            said(&format!("level {}, optimization n", level as u8));
            levels.push(judged(self.row(pair, level, Optimization::Normal, Ways::Ours, 0)?)?.0);
        }
        levels.extend(optimizations.iter().find(|row| row.optimization == Optimization::Normal).cloned());
        let mut papers_rules = Vec::new();
        for optimization in OPTIMIZATIONS {
            said(&format!("level 3, optimization {optimization}, with the paper's set of rules"));
            papers_rules.push(judged(self.row(pair, Level::Balanced, optimization, Ways::PapersRules, 0)?)?.0);
        }
        said("level 3, optimization n, all as in the paper");
        let (paper, _) = judged(self.row(pair, Level::Balanced, Optimization::Normal, Ways::Papers, 0)?)?;
        let very_big = very_big.unwrap_or_else(|| off_picture.clone());
        let MagarroOptions { spp, light_samples, max_depth, .. } = *self.options;
        Ok(MagarroReport {
            width: self.width,
            height: self.height,
            samples: spp,
            light_samples,
            max_depth,
            whole,
            off,
            noise,
            levels,
            optimizations,
            papers_rules,
            paper,
            pictures: Pictures { off: off_picture, very_big },
        })
    }

    /// Paints the picture with one agent on one thread, then with a pair of them, and replays it with more.
    fn row(
        &self,
        pair: Option<&AgentPair<'_>>,
        level: Level,
        optimization: Optimization,
        ways: Ways,
        seed: u64,
    ) -> Result<(MagarroRow, Picture), Error> {
        let settings = self.settings(level, optimization, ways);
        let (record, picture) = self.paint(&settings, seed)?;
        let piece = Arc::new(Workpiece::recorded(&record, 1)?);
        let mut replayed = [0.0; 4];
        for (time, agents) in replayed.iter_mut().zip(AGENTS) {
            let mut plan = Plan::calm(CrewSpec::equal(agents), seed);
            plan.faults.latency_min = LATENCY;
            if ways == Ways::Papers {
                plan.auction = AuctionRule::Paper;
                plan.adaptation = AdaptationRule::Paper;
            }
            *time = simulate(&piece, &plan)?.makespan.as_secs_f64();
        }
        let pair = pair.map(|pair| pair.seconds(self, level, optimization, ways)).transpose()?;
        let row = MagarroRow {
            level,
            optimization,
            ways,
            measured: record.total.as_secs_f64(),
            survey: record.survey.as_secs_f64(),
            pair,
            replayed,
            zones: record.zones.len(),
            error: None,
        };
        Ok((row, picture))
    }

    /// The settings of a job of one agent on one processor.
    fn settings(&self, level: Level, optimization: Optimization, ways: Ways) -> JobSettings {
        let options = self.options;
        let tunables = Tunables { max_depth: options.max_depth, light_samples: options.light_samples };
        let by_the_paper = ways == Ways::Papers;
        let papers_rules = || Expert::parse(PAPER_RULES).expect("the rules in the repository can be read");
        JobSettings {
            level,
            optimization,
            agents: 1,
            processors: 1,
            zones: Some(options.zones),
            importance: if by_the_paper { ImportanceFunction::Paper } else { ImportanceFunction::default() },
            auction: if by_the_paper { AuctionRule::Paper } else { AuctionRule::default() },
            adaptation: if by_the_paper { AdaptationRule::Paper } else { AdaptationRule::default() },
            zone_limits: ZoneLimits {
                balance: if by_the_paper { Balance::Ratio } else { Balance::Time },
                ..ZoneLimits::default()
            },
            experts: vec![if ways == Ways::Ours { Expert::path_tracing() } else { papers_rules() }],
            ..JobSettings::new(self.width, self.height, options.spp, tunables, Layout::new(AovSet::NONE))
        }
    }

    /// The engine of an agent, on one thread. Made anew each time: what is learnt of where light comes from belongs to the time of a
    /// picture.
    fn engine(&self, settings: &JobSettings, seed: u64) -> Result<Arc<BuiltinEngine>, Error> {
        let loaded = bottega_scene::load(&self.options.scene, &shared_meshes())?;
        let filter = loaded.hints.filter.unwrap_or_default();
        let options = PrepareOptions { threads: settings.processors, ..PrepareOptions::default() };
        let prepared = Arc::new(PreparedScene::new(Arc::new(loaded.scene), &options)?);
        let path_settings = PathSettings {
            seed,
            max_depth: settings.tunables.max_depth,
            light_samples: settings.tunables.light_samples,
            filter,
            planned_samples: settings.samples,
            ..PathSettings::default()
        };
        let options = BuiltinOptions {
            view: View { camera: 0, width: self.width, height: self.height },
            settings: path_settings,
            layout: settings.layout.clone(),
            threads: settings.processors,
            wavefront: false,
        };
        Ok(Arc::new(BuiltinEngine::new(prepared, options, Devices::default())))
    }

    fn paint(&self, settings: &JobSettings, seed: u64) -> Result<(Record, Picture), Error> {
        let recorder = Arc::new(Recorder::new(self.engine(settings, seed)?, Arc::new(())));
        let (as_engine, as_observer) = (Arc::clone(&recorder) as _, Arc::clone(&recorder) as _);
        let report = bottega_farm::run(settings, as_engine, as_observer, &StopSwitch::new(), None, None);
        let report = report.map_err(bottega::Error::Job)?;
        let record = recorder.record(&bottega::text::shown(&self.options.scene), settings, &report);
        let record = record.map_err(|source| bottega::Error::Record { path: self.options.scene.clone(), source })?;
        Ok((record, report.film.to_picture()))
    }

    /// A picture of so many uniform samples, painted by all processors.
    fn reference(&self, samples: u32, seed: u64) -> Result<Picture, Error> {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let off = self.settings(Level::Balanced, Optimization::Off, Ways::Ours);
        let settings = JobSettings { samples, processors, ..off };
        let engine = self.engine(&settings, seed)?;
        let report = bottega_farm::run(&settings, engine, Arc::new(()), &StopSwitch::new(), None, None);
        Ok(report.map_err(bottega::Error::Job)?.film.to_picture())
    }
}

/// Writes figures and pictures into a folder.
fn write(folder: &Path, report: &MagarroReport) -> Result<(), Error> {
    create_folder(folder)?;
    let json = serde_json::to_string_pretty(&report.as_json()).unwrap_or_default();
    write_file(&folder.join("magarro.json"), &json)?;
    write_file(&folder.join("magarro.svg"), &plot::svg(report))?;
    let Pictures { off, very_big } = &report.pictures;
    let difference = flip(off, very_big, &FlipOptions::default())?;
    Canvas::of_picture(off, 0.0, ToneMap::Agx).write_png(folder.join("off.png"))?;
    Canvas::of_picture(very_big, 0.0, ToneMap::Agx).write_png(folder.join("vb.png"))?;
    Canvas::heat_map(off.width, off.height, &difference.map, 1.0, ColorMap::Inferno)
        .write_png(folder.join("difference.png"))?;
    Ok(())
}

fn error(reference: &Picture, picture: &Picture) -> Result<PictureError, Error> {
    Ok(PictureError {
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
