//! The recorder of runs: watches the orders of the engine and the events of the farm.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use bottega_agents::{AgentId, Time};
use bottega_engines::{
    EngineDescription, EngineError, LoneHand, Painted, RenderEngine, SharedTime, Sharing, Survey, ZoneCallback,
    ZoneTask,
};
use bottega_image::Rect;

use super::record::{CostGrid, Record, RecordError, RecordedRules, RecordedZone};
use crate::{
    AgentRow, Choice, FarmContent, FarmMessage, Goal, ImportanceMap, JobReport, JobSettings, Observer, Partition,
    Progress, ZoneRow,
};

/// An engine and an observer that forward everything and record it.
pub struct Recorder {
    engine: Arc<dyn RenderEngine>,
    observer: Arc<dyn Observer>,
    log: Arc<Mutex<RecorderLog>>,
}

#[derive(Debug, Default)]
struct RecorderLog {
    /// The Analyst's zones.
    zones: BTreeMap<crate::ZoneId, ZoneRow>,
    power: Option<f64>,
    /// Times of the preparation that machines of a farm share.
    shared: SharedTime,
    tasks: Vec<Task>,
}

/// A task that the engine painted.
#[derive(Debug)]
struct Task {
    rect: Rect,
    first_sample: u32,
    samples: u32,
    busy: Duration,
    /// The time by parts, as far as the engine reports it.
    parts: Vec<(Rect, Duration)>,
}

impl Recorder {
    /// Makes a recorder between a job and its engine and observer, to which it forwards everything.
    pub fn new(engine: Arc<dyn RenderEngine>, observer: Arc<dyn Observer>) -> Self {
        Self { engine, observer, log: Arc::default() }
    }

    fn log(&self) -> MutexGuard<'_, RecorderLog> {
        self.log.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the record of a job that has ended successfully.
    ///
    /// - `scene`: the scene file, for display.
    /// - `settings`, `report`: those of the job.
    ///
    /// # Errors
    /// The job cannot be recorded: it was stopped, has failed zones or another goal than samples, or was resumed and
    /// not observed from its beginning.
    pub fn record(&self, scene: &str, settings: &JobSettings, report: &JobReport) -> Result<Record, RecordError> {
        if report.stopped || !report.failed.is_empty() {
            let problem = "was stopped, or zones of it failed: only a whole one can be recorded".to_owned();
            return Err(RecordError::Value { field: "run".to_owned(), problem });
        }
        if settings.goal != Goal::Samples {
            let problem = "had another goal than samples: how it goes on depends on what is painted".to_owned();
            return Err(RecordError::Value { field: "run".to_owned(), problem });
        }
        let log = self.log();
        let work = crate::WorkSettings {
            picture: Rect::of_size(settings.width, settings.height),
            frame: settings.crop,
            samples: settings.samples,
            goal: settings.goal,
            tunables: settings.tunables,
            optimization: settings.optimization,
        };
        let mut choices: BTreeMap<_, Choice> =
            report.rows.iter().filter_map(|row| Some((row.zone, row.choice?))).collect();
        let zones: Vec<RecordedZone> = log
            .zones
            .values()
            .map(|row| {
                let choice = choices.remove(&row.zone).unwrap_or(Choice::unchanged(&work));
                log.zone(row, choice, &work.frame)
            })
            .collect();
        let parts = log.tasks.iter().flat_map(|task| {
            let whole = [(task.rect, task.busy)];
            let parts = if task.parts.is_empty() { whole.to_vec() } else { task.parts.clone() };
            parts.into_iter().map(|(rect, busy)| (rect, task.samples, busy.as_secs_f64()))
        });
        let engine = self.engine.describe();
        let record = Record {
            scene: scene.to_owned(),
            rules: RecordedRules::new(&settings.experts, settings.bands, &engine),
            engine: engine.name,
            costs: CostGrid::of_parts(&work.frame, parts),
            work,
            level: settings.level,
            agents: settings.agents,
            processors: settings.processors,
            relative_power: log.power.unwrap_or(1.0),
            zones,
            total: report.times.total,
            survey: report.times.survey,
            preparation: report.times.preparation,
            shared_preparation: log.shared.time.min(report.times.preparation),
            shared_stages: log.shared.stages,
            composition: report.times.composition,
        };
        record.check()?;
        Ok(record)
    }
}

impl RecorderLog {
    /// Returns the measurements of a zone: of all tasks whose center lies in it. A zone may be painted in several.
    fn zone(&self, row: &ZoneRow, choice: Choice, frame: &Rect) -> RecordedZone {
        let painted = row.rect.grown_by(choice.bands, frame);
        let middle_within = |rect: &Rect| row.rect.contains(rect.x0.midpoint(rect.x1), rect.y0.midpoint(rect.y1));
        let of_zone = |task: &&Task| task.rect == painted || painted.encloses(&task.rect) && middle_within(&task.rect);
        let (mut profiling, mut painting) = (Duration::ZERO, Duration::ZERO);
        for task in self.tasks.iter().filter(of_zone) {
            let of_profiling = task.first_sample == 0 && task.samples <= choice.profile_samples(&Goal::Samples);
            *(if of_profiling { &mut profiling } else { &mut painting }) += task.busy;
        }
        let ZoneRow { rect, complexity, neighbor_difference, .. } = *row;
        RecordedZone { rect, complexity, neighbor_difference, choice, profiling, painting }
    }
}

impl RenderEngine for Recorder {
    fn describe(&self) -> EngineDescription {
        self.engine.describe()
    }

    fn prepare(&self) -> Result<(), EngineError> {
        let alone = LoneHand::default();
        self.engine.prepare_with(&alone)?;
        self.log().shared = alone.so_far();
        self.engine.prepare()
    }

    fn prepare_with(&self, others: &dyn Sharing) -> Result<(), EngineError> {
        self.engine.prepare_with(others)
    }

    fn learnt(&self) -> Option<Vec<u8>> {
        self.engine.learnt()
    }

    fn learn_from(&self, bytes: &[u8]) -> Result<(), EngineError> {
        self.engine.learn_from(bytes)
    }

    fn survey(&self, width: u32, height: u32) -> Result<Survey, EngineError> {
        self.engine.survey(width, height)
    }

    fn start(&self, task: ZoneTask, done: ZoneCallback) {
        let log = Arc::clone(&self.log);
        let (rect, first_sample) = (task.rect, task.samples.start);
        let samples = task.samples.end.saturating_sub(first_sample);
        let see = move |painted: Result<Painted, EngineError>| {
            if let Ok(painted) = &painted {
                let (busy, parts) = (painted.busy, painted.parts.clone());
                let task = Task { rect, first_sample, samples, busy, parts };
                log.lock().unwrap_or_else(PoisonError::into_inner).tasks.push(task);
            }
            done(painted);
        };
        self.engine.start(task, Box::new(see));
    }
}

impl Observer for Recorder {
    fn surveyed(&self, survey: &Arc<Survey>) {
        self.observer.surveyed(survey);
    }

    fn analyzed(&self, map: &Arc<ImportanceMap>, partition: &Arc<Partition>) {
        self.observer.analyzed(map, partition);
    }

    fn zone_changed(&self, row: &ZoneRow) {
        self.log().zones.entry(row.zone).or_insert_with(|| row.clone());
        self.observer.zone_changed(row);
    }

    fn agent_changed(&self, row: &AgentRow) {
        self.observer.agent_changed(row);
    }

    fn progress(&self, progress: &Progress) {
        self.observer.progress(progress);
    }

    fn message(&self, now: Time, message: &FarmMessage) {
        if let FarmContent::Subscription { power, .. } = message.content {
            self.log().power.get_or_insert(power.get());
        }
        self.observer.message(now, message);
    }

    fn left_out(&self, agent: &AgentId, reason: &str) {
        self.observer.left_out(agent, reason);
    }

    fn too_few(&self, present: usize, needed: usize) {
        self.observer.too_few(present, needed);
    }

    fn store_failed(&self, error: &std::io::Error) {
        self.observer.store_failed(error);
    }
}
