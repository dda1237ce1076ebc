//! The Analyst: from a fast look at the scene to the rows of the Blackboard.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use bottega_agents::{AgentId, Performative, Revision, StateMachine, StoreReply, Ticket, Time};
use bottega_engines::Survey;
use bottega_image::Rect;

use crate::{
    FarmAction, FarmCompletion, FarmContent, FarmEffect, FarmEvent, FarmValue, Foreknowledge, Goal, ImportanceError,
    ImportanceFunction, ImportanceMap, InputRanges, Partition, PartitionSettings, RegistrationConfig, TaskOutlook,
    WorkId, WorkKeys, WorkRow, WorkSettings, ZoneRow, compare_and_set, contents::message, directory::ANALYST_SERVICES,
    importance::Outlook, protocol, registrant::Registrant,
};

/// Cells of the survey at most: a look, not a picture.
const SURVEY_CELLS_MAX: u64 = 1 << 14;
/// Side of a cell in pixels at least: finer than zones can follow is wasted.
const SURVEY_CELL_SIDE_MIN: u32 = 4;
/// How long the Analyst waits for an answer before it asks the store again.
const RETRY_AFTER: Duration = Duration::from_secs(3);

/// The configuration of an Analyst.
#[derive(Clone, Debug)]
pub struct AnalystConfig {
    /// Its own name.
    pub id: AgentId,
    /// Whom it tells when it has finished.
    pub master: AgentId,
    /// Which picture.
    pub work: WorkId,
    /// What the user wants of it.
    pub settings: WorkSettings,
    /// What a place is worth.
    pub importance: ImportanceFunction,
    /// Which zones to aim at.
    pub partition: PartitionSettings,
    /// Where it registers, if it does.
    pub registration: Option<RegistrationConfig>,
    /// What this machine has learnt of how long zones take.
    pub knowledge: Foreknowledge,
}

/// The size of the survey of a picture: its shape, a cell to 4 × 4 pixels, but at most 2¹⁴ cells.
pub fn survey_size(picture: &Rect) -> (u32, u32) {
    let fit = (picture.area() as f64 / SURVEY_CELLS_MAX as f64).sqrt();
    let cell = fit.max(f64::from(SURVEY_CELL_SIDE_MIN));
    let cells = |side: u32| ((f64::from(side) / cell) as u32).clamp(1, side.max(1));
    let (width, height) = (cells(picture.width()), cells(picture.height()));
    // A picture of one row has as many cells as one of many.
    let bounded = |a: u32, b: u32| a.min((SURVEY_CELLS_MAX / u64::from(b)).max(1) as u32);
    (bounded(width, height), bounded(height, width))
}

/// The Analyst's work without any agent: the map, the zones and their rows.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// The importance map.
    pub map: Arc<ImportanceMap>,
    /// The zones.
    pub partition: Arc<Partition>,
    /// The row of the work.
    pub work: WorkRow,
    /// The rows of all zones, by id.
    pub rows: Vec<ZoneRow>,
    /// What the survey says of each of them.
    pub outlooks: Arc<[TaskOutlook]>,
}

/// Analyzes a picture.
///
/// - `survey`: covers the whole picture.
/// - `knowledge`: of how long zones take. Zones and their complexities do not depend on it, only T_est does.
pub fn analyze(
    work: WorkId,
    settings: &WorkSettings,
    survey: &Survey,
    importance: ImportanceFunction,
    partition: &PartitionSettings,
    knowledge: &Foreknowledge,
) -> Result<Analysis, ImportanceError> {
    let map = ImportanceMap::new(survey, settings.picture, settings.frame, importance)?;
    // Few dear zones, but none of the agents is without one.
    let most = survey.zones_max.map_or(u32::MAX, |most| most.max(partition.zones_least));
    let partition = Partition::new(&map, settings.frame, &partition.at_most(most));
    let partition = partition.along_grid(settings.goal.grid());
    let differences = partition.neighbor_differences(&map);
    let outlook = Outlook::new(survey, settings.picture);
    let features = outlook.of(&settings.frame).features;
    let outlooks: Arc<[TaskOutlook]> = partition.iter().map(|(_, rect)| outlook.of(&rect)).collect();
    // How many samples an error or a time will take is not known.
    let is_countable = settings.goal == Goal::Samples;
    let time = |zone| is_countable.then(|| knowledge.time(&features, zone, settings.samples));
    let rows: Vec<ZoneRow> = partition
        .iter()
        .zip(differences)
        .zip(&*outlooks)
        .map(|(((zone, rect), difference), outlook)| {
            let row = ZoneRow::open(work, zone, rect, map.complexity(&rect), difference);
            ZoneRow { time_estimated: time(outlook), ..row }
        })
        .collect();
    let zone_count = rows.len() as u32;
    let work = WorkRow { work, settings: *settings, zone_count, ranges: InputRanges::of(&rows), features };
    Ok(Analysis { map: Arc::new(map), partition: Arc::new(partition), work, rows, outlooks })
}

/// The state machine of the Analyst. Its work is done when its rows are on the Blackboard. One that is registered stays, as long as
/// its process has a part in the work.
#[derive(Clone, Debug)]
pub struct Analyst {
    config: AnalystConfig,
    /// Rows that the store has not confirmed, by ticket. The work's own row is written last, when all others are there.
    unwritten: BTreeMap<Ticket, FarmValue>,
    work: Option<WorkRow>,
    retry: Option<Time>,
    registrant: Option<Box<Registrant>>,
}

impl Analyst {
    /// An Analyst that has just been born.
    pub fn new(config: AnalystConfig) -> Self {
        let registrant = config.registration.clone();
        let registrant = registrant.map(|place| Box::new(Registrant::new(config.id.clone(), place, &ANALYST_SERVICES)));
        Self { config, unwritten: BTreeMap::new(), work: None, retry: None, registrant }
    }

    fn surveyed(&mut self, survey: Result<Arc<Survey>, String>, actions: &mut Vec<FarmAction>) {
        let AnalystConfig { work, settings, importance, partition, knowledge, .. } = &self.config;
        let analysis = survey.and_then(|survey| {
            analyze(*work, settings, &survey, *importance, partition, knowledge).map_err(|error| error.to_string())
        });
        match analysis {
            Err(reason) => {
                actions.push(FarmAction::Effect(FarmEffect::Abandon { reason }));
                actions.push(FarmAction::Stop);
            }
            Ok(Analysis { map, partition, work, rows, outlooks }) => {
                actions.push(FarmAction::Effect(FarmEffect::Analyzed { map, partition, outlooks }));
                self.work = Some(work);
                let rows = rows.into_iter().map(|row| FarmValue::Zone(Arc::new(row)));
                self.unwritten = rows.enumerate().map(|(i, row)| (Ticket(i as u64 + 1), row)).collect();
                self.write(actions);
            }
        }
    }

    /// Asks the store for all that it has not confirmed. Rows that are there already were written by an earlier life,
    /// and may have been worked on since.
    fn write(&self, actions: &mut Vec<FarmAction>) {
        let keys = WorkKeys::new(self.config.work);
        for (&ticket, value) in &self.unwritten {
            let request = compare_and_set(&keys, Revision::ABSENT, value.clone());
            actions.push(FarmAction::Store { ticket, request });
        }
    }

    fn written(&mut self, ticket: Ticket, actions: &mut Vec<FarmAction>) {
        if self.unwritten.remove(&ticket).is_none() || !self.unwritten.is_empty() {
            return;
        }
        if let Some(work) = self.work.take() {
            self.unwritten.insert(Ticket(0), FarmValue::Work(Arc::new(work)));
            return self.write(actions);
        }
        // Workflow, step 3: the Master is notified. It watches the blackboard too, so this may be lost.
        let AnalystConfig { id, master, work, .. } = &self.config;
        let content = FarmContent::Analyzed(*work);
        let inform = message(Performative::Inform, protocol::REQUEST, id, vec![master.clone()], content);
        actions.push(FarmAction::Send(inform));
        self.retry = None;
        if self.registrant.is_none() {
            actions.push(FarmAction::Stop);
        }
    }
}

impl StateMachine for Analyst {
    type Content = FarmContent;
    type Value = FarmValue;
    type Effect = FarmEffect;
    type Completion = FarmCompletion;

    fn handle(&mut self, now: Time, event: FarmEvent, actions: &mut Vec<FarmAction>) {
        match event {
            FarmEvent::Start => {
                let picture = self.config.settings.picture;
                let (width, height) = survey_size(&picture);
                actions.push(FarmAction::Effect(FarmEffect::Survey { picture, width, height }));
            }
            FarmEvent::Completed(FarmCompletion::Surveyed(survey)) => {
                self.surveyed(survey, actions);
                self.retry = Some(now + RETRY_AFTER);
            }
            FarmEvent::Store { ticket, reply: StoreReply::Written { .. } | StoreReply::Conflict { .. } } => {
                self.written(ticket, actions);
            }
            FarmEvent::Message(received) if let FarmContent::Management(_) = received.content => {
                self.registrant.as_mut().and_then(|registrant| registrant.hear(now, &received));
            }
            FarmEvent::Message(received) => {
                tracing::debug!(from = %received.sender, "the Analyst takes no messages");
            }
            FarmEvent::Completed(_) | FarmEvent::Store { .. } | FarmEvent::Presence { .. } | FarmEvent::Deadline => {}
        }
        if self.retry.is_some_and(|at| at <= now) {
            self.write(actions);
            self.retry = Some(now + RETRY_AFTER);
        }
        if let Some(registrant) = &mut self.registrant {
            registrant.tick(now, actions);
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        let directories = self.registrant.as_ref().and_then(|registrant| registrant.next_deadline());
        [self.retry, directories].into_iter().flatten().min()
    }
}

#[cfg(test)]
mod tests {
    use bottega_engines::{SurveyPixel, Tunables};

    use super::*;
    use crate::{Goal, Level, Optimization};

    #[test]
    fn dear_zones_are_few_but_one_for_each_agent() {
        let frame = Rect::of_size(512, 256);
        let settings = WorkSettings {
            picture: frame,
            frame,
            samples: 16,
            goal: Goal::Samples,
            tunables: Tunables { max_depth: 3, light_samples: 1 },
            optimization: Optimization::Off,
        };
        let pixels = vec![SurveyPixel { recursion_levels: 1.0, ..SurveyPixel::default() }; 64 * 32];
        let zones_of = |agents, zones_max| {
            let survey = Survey { width: 64, height: 32, pixels: pixels.clone(), zones_max };
            let partition = PartitionSettings::for_agents(Level::Balanced, agents, frame);
            let knowledge = Foreknowledge::default();
            analyze(WorkId(1), &settings, &survey, ImportanceFunction::default(), &partition, &knowledge)
                .unwrap()
                .rows
                .len()
        };
        assert_eq!(zones_of(1, None), 16);
        assert_eq!(zones_of(1, Some(0)), 1);
        assert_eq!(zones_of(1, Some(3)), 3);
        assert_eq!(zones_of(8, Some(3)), 8);
        assert_eq!(zones_of(8, None), 64);
    }

    #[test]
    fn the_survey_is_small_and_keeps_the_shape() {
        assert_eq!(survey_size(&Rect::of_size(1, 1)), (1, 1));
        assert_eq!(survey_size(&Rect::of_size(64, 32)), (16, 8));
        let (width, height) = survey_size(&Rect::of_size(3840, 2160));
        assert!(u64::from(width) * u64::from(height) <= SURVEY_CELLS_MAX);
        assert!((f64::from(width) / f64::from(height) - 16.0 / 9.0).abs() < 0.03);
        let (width, height) = survey_size(&Rect::of_size(4_000_000_000, 1));
        assert!(u64::from(width) * u64::from(height) <= SURVEY_CELLS_MAX && height == 1);
    }
}
