//! The scene of the measurement, and how one agent paints it.

use std::{path::PathBuf, sync::Arc};

use bottega_engines::{BuiltinEngine, BuiltinOptions, Devices, Tunables};
use bottega_farm::{
    AdaptationRule, AuctionRule, Balance, Expert, ImportanceFunction, JobSettings, Level, Optimization, PAPER_RULES,
    StopSwitch, ZoneLimits,
    simulate::{Record, Recorder},
};
use bottega_image::{AovSet, Layout, Picture};
use bottega_render::{PathSettings, PrepareOptions, PreparedScene, View};

use super::report::Ways;
use crate::{Error, shared_meshes};

/// The scene that stands for the paper's, in the folder of scenes.
pub const SCENE: &str = "magarro/magarro.pbrt";

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

/// The scene in a size.
pub(super) struct MagarroScene<'a> {
    pub(super) options: &'a MagarroOptions,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl<'a> MagarroScene<'a> {
    pub(super) fn load(options: &'a MagarroOptions) -> Result<Self, Error> {
        let hints = bottega_scene::load(&options.scene, &shared_meshes())?.hints;
        let [width, height] = hints.resolution.unwrap_or([640, 480]);
        let side = |side: u32| ((f64::from(side) * options.scale).round() as u32).clamp(8, 1 << 14);
        Ok(Self { options, width: side(width), height: side(height) })
    }

    /// The settings of a job of one agent on one processor.
    pub(super) fn settings(&self, level: Level, optimization: Optimization, ways: Ways) -> JobSettings {
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
    pub(super) fn engine(&self, settings: &JobSettings, seed: u64) -> Result<Arc<BuiltinEngine>, Error> {
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

    pub(super) fn paint(&self, settings: &JobSettings, seed: u64) -> Result<(Record, Picture), Error> {
        let recorder = Arc::new(Recorder::new(self.engine(settings, seed)?, Arc::new(())));
        let (as_engine, as_observer) = (Arc::clone(&recorder) as _, Arc::clone(&recorder) as _);
        let report = bottega_farm::run(settings, as_engine, as_observer, &StopSwitch::new(), None, None);
        let report = report.map_err(bottega::Error::Job)?;
        let record = recorder.record(&bottega::text::shown(&self.options.scene), settings, &report);
        let record = record.map_err(|source| bottega::Error::Record { path: self.options.scene.clone(), source })?;
        Ok((record, report.film.to_picture()))
    }

    /// A picture of so many uniform samples, painted by all processors.
    pub(super) fn reference(&self, samples: u32, seed: u64) -> Result<Picture, Error> {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let off = self.settings(Level::Balanced, Optimization::Off, Ways::Ours);
        let settings = JobSettings { samples, processors, ..off };
        let engine = self.engine(&settings, seed)?;
        let report = bottega_farm::run(&settings, engine, Arc::new(()), &StopSwitch::new(), None, None);
        Ok(report.map_err(bottega::Error::Job)?.film.to_picture())
    }
}
