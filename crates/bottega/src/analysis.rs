//! The Analyst's view of a scene: survey, importance map and zones, without rendering.

use std::sync::Arc;

use bottega_engines::{BuiltinEngine, BuiltinOptions, Devices, RenderEngine, Survey, Tunables};
use bottega_farm::{
    Analysis, Foreknowledge, Goal, ImportanceFunction, Level, Optimization, PartitionSettings, WorkId, WorkSettings,
    ZoneRow, analyze, survey_size,
};
use bottega_image::{AovSet, Layout, Rect};
use bottega_render::PathSettings;
use bottega_scene::Loaded;
use serde::Serialize;

use crate::{
    devices::threads,
    error::Error,
    events::corners,
    loaded_scene::LoadedScene,
    request::Request,
    settings::{agents, zone_limits},
};

/// Maximum number of bounces if the scene gives none.
const DEFAULT_DEPTH: u32 = 16;

/// Samples per pixel for which costs are predicted, if the request gives none.
const DEFAULT_SAMPLES: u32 = 64;

/// The levels that divide a picture into zones, level 1 first.
pub const LEVELS: [Level; 3] = [Level::Divided, Level::Joined, Level::Balanced];

/// A zone with the measures of the Analyst.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ZoneAnalysis {
    /// Number of the zone, from 0.
    pub id: u32,
    /// Corners of the zone in pixels: x0, y0, x1, y1.
    pub rect: [u32; 4],
    /// Size of the zone: number of pixels.
    pub size: u64,
    /// Predicted cost of all the zone's pixels; unit: one average pixel of the picture.
    pub complexity: f64,
    /// `complexity` as a share of the sum over all zones, 0 to 1.
    pub share_of_cost: f64,
    /// Absolute difference of the cost per pixel from the zones that share an edge, averaged by the length of the edges.
    pub neighbor_difference: f64,
    /// The same average per side: left, top, right, bottom.
    pub edge_differences: [f64; 4],
    /// Mean visual importance of the zone's pixels, 0 to 1.
    pub visual_importance: f64,
}

/// Returns the zones of an analysis, in the order of their numbers.
pub fn zones(analysis: &Analysis) -> Vec<ZoneAnalysis> {
    let total: f64 = analysis.rows.iter().map(|row| row.complexity).sum();
    let zone = |row: &ZoneRow| ZoneAnalysis {
        id: row.zone.0,
        rect: corners(&row.rect),
        size: row.size(),
        complexity: row.complexity,
        share_of_cost: row.complexity / total,
        neighbor_difference: row.neighbor_difference.mean,
        edge_differences: row.neighbor_difference.sides.into_array(),
        visual_importance: analysis.map.importance_of(&row.rect),
    };
    analysis.rows.iter().map(zone).collect()
}

/// Returns the settings of path tracing for a scene, without those of a request.
///
/// - `samples`: planned number of samples per pixel.
pub(crate) fn path_settings(subject: &LoadedScene, samples: u32) -> PathSettings {
    PathSettings {
        max_depth: subject.hints.max_depth.unwrap_or(DEFAULT_DEPTH),
        filter: subject.hints.filter.unwrap_or_default(),
        sample_max: subject.hints.sample_max.unwrap_or(f32::INFINITY),
        planned_samples: samples,
        ..PathSettings::default()
    }
}

/// A scene with its survey.
pub struct AnalyzedScene {
    /// The request that names the scene.
    pub request: Request,
    /// The loaded scene, with camera and picture size.
    pub subject: LoadedScene,
    /// The engine that made the survey.
    pub engine: BuiltinEngine,
    /// The survey: cost and color of each cell of the picture.
    pub survey: Survey,
    /// The settings of the work that is divided into zones.
    pub settings: WorkSettings,
    /// Number of Render Agents for which the picture is divided.
    pub agents: usize,
}

impl AnalyzedScene {
    /// Reads the scene of a request and surveys it. Returns the scene with its survey.
    ///
    /// # Errors
    /// The request or its scene cannot be used, or the survey fails.
    pub fn open(request: Request) -> Result<Self, Error> {
        request.validate()?;
        let subject = LoadedScene::load(&request)?;
        let painters = threads(&request);
        Self::of(request, subject, painters)
    }

    /// Surveys a scene made in memory. Returns the scene with its survey.
    ///
    /// # Errors
    /// Those of [`Self::open`].
    pub fn of_scene(request: Request, scene: impl Into<Loaded>) -> Result<Self, Error> {
        request.validate()?;
        let subject = LoadedScene::of_scene(scene, &request)?;
        let painters = threads(&request);
        Self::of(request, subject, painters)
    }

    /// Surveys a loaded scene. Returns it with its survey.
    ///
    /// - `request`: the request for which the scene was loaded.
    /// - `painters`: number of CPU threads of the survey.
    ///
    /// # Errors
    /// The survey fails.
    pub fn of(request: Request, subject: LoadedScene, painters: usize) -> Result<Self, Error> {
        let samples = request.goal.samples.unwrap_or(DEFAULT_SAMPLES);
        let settings = path_settings(&subject, samples);
        let max_depth = settings.max_depth;
        let options = BuiltinOptions {
            view: subject.view.clone(),
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
            samples,
            goal: Goal::Samples,
            tunables: Tunables { max_depth, light_samples: 1 },
            optimization: Optimization::Off,
        };
        let agents = agents(request.work.agents, threads(&request));
        Ok(Self { request, subject, engine, survey, settings, agents })
    }

    /// Returns the rectangle of all pixels of the picture.
    pub fn frame(&self) -> Rect {
        self.settings.frame
    }

    /// Returns the importance map by a measure, and the zones of a level.
    ///
    /// # Errors
    /// The picture cannot be divided into zones.
    pub fn analyze(&self, function: ImportanceFunction, level: Level) -> Result<Analysis, Error> {
        let partition = PartitionSettings::for_agents(level, self.agents, self.frame());
        let partition = partition.within(None, zone_limits(&self.request.work));
        analyze(WorkId(1), &self.settings, &self.survey, function, &partition, &Foreknowledge::default(), false)
            .map_err(|error| Error::failed(error.to_string(), "this is unexpected; report it with the scene"))
    }
}
