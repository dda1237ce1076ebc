//! The scene of the measurement, and rendering by one agent.

use std::{path::PathBuf, sync::Arc};

use bottega_engines::{BuiltinEngine, BuiltinOptions, Devices, Tunables};
use bottega_farm::{
    AdaptationRule, AuctionRule, Balance, Expert, ImportanceFunction, JobSettings, Level, Optimization, PAPER_RULES,
    StopSwitch, ZoneLimits,
    simulate::{Record, Recorder},
};
use bottega_image::{AovSet, Layout, Picture};
use bottega_render::{PathSettings, PrepareOptions, PreparedScene, View};

use super::{
    options::{MagarroPicture, SCENE},
    report::Ways,
};
use crate::{error::Error, files::shared_meshes};

/// The scene at a size.
pub(super) struct MagarroScene<'a> {
    pub(super) options: &'a MagarroPicture,
    pub(super) path: PathBuf,
    pub(super) width: u32,
    pub(super) height: u32,
}

impl<'a> MagarroScene<'a> {
    pub(super) fn load(options: &'a MagarroPicture) -> Result<Self, Error> {
        let path = options.folder.scene(options.scene.as_ref(), SCENE)?;
        let hints = bottega_scene::load(&path, &shared_meshes())?.hints;
        let [width, height] = hints.resolution.unwrap_or([640, 480]);
        let side = |side: u32| ((f64::from(side) * options.scale).round() as u32).clamp(8, 1 << 14);
        Ok(Self { options, path, width: side(width), height: side(height) })
    }

    /// Returns the settings of a job of one agent on one processor.
    pub(super) fn settings(&self, level: Level, optimization: Optimization, ways: Ways) -> JobSettings {
        let options = self.options;
        let tunables = Tunables { max_depth: options.max_depth, light_samples: options.light_samples };
        let by_the_paper = ways == Ways::Papers;
        let papers_rules = || Expert::parse(PAPER_RULES).expect("the built-in rules are valid");
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
            prefetch: if by_the_paper { 1 } else { 2 },
            shares_tail: !by_the_paper,
            experts: vec![if ways == Ways::Ours { Expert::path_tracing() } else { papers_rules() }],
            ..JobSettings::new(self.width, self.height, options.spp, tunables, Layout::new(AovSet::NONE))
        }
    }

    /// Creates an agent's engine with one thread. A new one each time, because learning the light distribution is part of an
    /// image's time.
    pub(super) fn engine(&self, settings: &JobSettings, seed: u64) -> Result<Arc<BuiltinEngine>, Error> {
        let loaded = bottega_scene::load(&self.path, &shared_meshes())?;
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
            view: View::of_scene(prepared.scene(), 0, self.width, self.height)?,
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
        let record = recorder.record(&bottega::text::shown(&self.path), settings, &report);
        let record = record.map_err(|source| bottega::Error::Record { path: self.path.clone(), source })?;
        Ok((record, report.film.to_picture()))
    }

    /// Renders an image with uniform samples, on all processors.
    pub(super) fn reference(&self, samples: u32, seed: u64) -> Result<Picture, Error> {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let off = self.settings(Level::Balanced, Optimization::Off, Ways::Ours);
        let settings = JobSettings { samples, processors, ..off };
        let engine = self.engine(&settings, seed)?;
        let report = bottega_farm::run(&settings, engine, Arc::new(()), &StopSwitch::new(), None, None);
        Ok(report.map_err(bottega::Error::Job)?.film.to_picture())
    }
}
