//! A scene that was surveyed, and what the Analyst makes of it.

use std::sync::Arc;

use bottega::{
    Request,
    devices::threads,
    loaded_scene::LoadedScene,
    settings::{agents, zone_limits},
};
use bottega_engines::{BuiltinEngine, BuiltinOptions, Devices, RenderEngine, Survey, Tunables};
use bottega_farm::{
    Analysis, Goal, ImportanceFunction, Level, Optimization, PartitionSettings, WorkId, WorkSettings, analyze,
    survey_size,
};
use bottega_image::{AovSet, Layout, Rect};
use bottega_render::PathSettings;

use crate::{cli::AnalyzeArgs, error::CliError};

/// Bounces where the scene does not say.
const DEFAULT_DEPTH: u32 = 16;

/// The levels of which zones are shown.
pub(super) const LEVELS: [Level; 3] = [Level::Divided, Level::Joined, Level::Balanced];

/// A scene that was surveyed.
pub(super) struct AnalyzedScene {
    pub(super) request: Request,
    pub(super) subject: LoadedScene,
    pub(super) engine: BuiltinEngine,
    pub(super) survey: Survey,
    pub(super) settings: WorkSettings,
    pub(super) agents: usize,
}

impl AnalyzedScene {
    pub(super) fn new(args: &AnalyzeArgs, request: Request) -> Result<Self, CliError> {
        let subject = LoadedScene::load(&request)?;
        let is_single = !args.verify.is_empty() && request.devices.threads.is_none();
        let painters = if is_single { 1 } else { threads(&request) };
        let max_depth = subject.hints.max_depth.unwrap_or(DEFAULT_DEPTH);
        let settings = PathSettings {
            max_depth,
            filter: subject.hints.filter.unwrap_or_default(),
            planned_samples: args.spp,
            ..PathSettings::default()
        };
        let options = BuiltinOptions {
            view: subject.view,
            settings,
            layout: Layout::new(AovSet::NONE),
            threads: painters,
            wavefront: false,
        };
        let (scene, prepass) = (Arc::clone(&subject.prepared), Arc::clone(&subject.prepass));
        let engine = BuiltinEngine::with_prepass(scene, prepass, options, Devices::default());
        let frame = subject.frame();
        let (columns, rows) = survey_size(&frame);
        let survey = engine.survey(columns, rows)?;
        let settings = WorkSettings {
            picture: frame,
            frame,
            samples: args.spp,
            goal: Goal::Samples,
            tunables: Tunables { max_depth, light_samples: 1 },
            optimization: Optimization::Off,
        };
        let agents = agents(args.agents, threads(&request));
        Ok(Self { request, subject, engine, survey, settings, agents })
    }

    pub(super) fn frame(&self) -> Rect {
        self.settings.frame
    }

    pub(super) fn analyze(&self, function: ImportanceFunction, level: Level) -> Result<Analysis, CliError> {
        let partition = PartitionSettings::for_agents(level, self.agents, self.frame());
        let partition = partition.within(None, zone_limits(&self.request.work));
        analyze(WorkId(1), &self.settings, &self.survey, function, &partition)
            .map_err(|error| CliError::failed(error.to_string(), "this is unexpected; report it with the scene"))
    }
}
