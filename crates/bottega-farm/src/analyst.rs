//! The Analyst: turns a survey of the scene into the rows of the Blackboard.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use bottega_agents::{AgentId, Performative, Revision, StateMachine, StoreReply, Ticket, Time};
use bottega_engines::Survey;
use bottega_image::Rect;

use crate::{
    FarmAction, FarmCompletion, FarmContent, FarmEffect, FarmEvent, FarmValue, Foreknowledge, Goal, ImportanceError,
    ImportanceFunction, ImportanceMap, InputRanges, Partition, PartitionSettings, PictureOutlook, RegistrationConfig,
    WorkId, WorkKeys, WorkRow, WorkSettings, ZoneRow, compare_and_set, contents::message, directory::ANALYST_SERVICES,
    importance::Outlook, protocol, registrant::Registrant,
};

/// Maximum number of cells of the survey.
const SURVEY_CELLS_MAX: u64 = 1 << 14;
/// Minimum side of a survey cell, in pixels: zones cannot follow finer detail.
const SURVEY_CELL_SIDE_MIN: u32 = 4;
/// Time without a reply after which the Analyst repeats its requests to the store.
const RETRY_AFTER: Duration = Duration::from_secs(3);

/// The configuration of an Analyst: the work, and how to cut its picture.
#[derive(Clone, Debug)]
pub struct AnalystConfig {
    /// The Analyst's own id.
    pub id: AgentId,
    /// The Master to notify at the end.
    pub master: AgentId,
    /// The id of the work.
    pub work: WorkId,
    /// The user's settings of the work.
    pub settings: WorkSettings,
    /// The function that gives each cell of the survey its cost.
    pub importance: ImportanceFunction,
    /// The target of the partition: its level, and the number and limits of zones.
    pub partition: PartitionSettings,
    /// The platform at which the Analyst registers; `None`: it does not.
    pub registration: Option<RegistrationConfig>,
    /// Knowledge from earlier works about the times of zones.
    pub knowledge: Foreknowledge,
    /// True if zones whose time is known well from earlier works are not profiled.
    pub trusts_forecasts: bool,
}

/// Returns the size of the survey of a picture, in cells: the picture's shape, one cell per 4 × 4 pixels, at most 2¹⁴
/// cells.
pub fn survey_size(picture: &Rect) -> (u32, u32) {
    let fit = (picture.area() as f64 / SURVEY_CELLS_MAX as f64).sqrt();
    let cell = fit.max(f64::from(SURVEY_CELL_SIDE_MIN));
    let cells = |side: u32| ((f64::from(side) / cell) as u32).clamp(1, side.max(1));
    let (width, height) = (cells(picture.width()), cells(picture.height()));
    // Bound the cell count of pictures with few rows or columns
    let bounded = |a: u32, b: u32| a.min((SURVEY_CELLS_MAX / u64::from(b)).max(1) as u32);
    (bounded(width, height), bounded(height, width))
}

/// The result of the Analyst: the map, the zones and their rows.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// The importance map.
    pub map: Arc<ImportanceMap>,
    /// The zones of the picture.
    pub partition: Arc<Partition>,
    /// The row of the work.
    pub work: WorkRow,
    /// The rows of all zones, in the order of their ids.
    pub rows: Vec<ZoneRow>,
    /// The survey's predictions for the picture and its zones.
    pub outlook: Arc<PictureOutlook>,
}

/// Analyzes a picture: makes the importance map, cuts the zones and predicts their times. Returns all of these, with
/// the rows for the Blackboard.
///
/// - `survey`: covers the whole picture.
/// - `knowledge`: from earlier works; changes T_est, and with `trusts_forecasts` which zones are profiled. Zones and
///   complexities do not depend on it.
/// - `trusts_forecasts`: `true`: zones whose T_est `knowledge` predicts well are not profiled.
///
/// # Errors
/// The survey has no cells, too many, or another number of pixels than cells; or the frame is empty or not within the
/// picture.
pub fn analyze(
    work: WorkId,
    settings: &WorkSettings,
    survey: &Survey,
    importance: ImportanceFunction,
    partition: &PartitionSettings,
    knowledge: &Foreknowledge,
    trusts_forecasts: bool,
) -> Result<Analysis, ImportanceError> {
    // Make the importance map
    let map = ImportanceMap::new(survey, settings.picture, settings.frame, importance)?;
    // Cut the zones: not more than the survey allows, but at least one per agent
    let most = survey.zones_max.map_or(u32::MAX, |most| most.max(partition.zones_least));
    let partition = Partition::new(&map, settings.frame, &partition.at_most(most));
    let partition = partition.along_grid(settings.goal.grid());
    // Predict the time of each zone
    let differences = partition.neighbor_differences(&map);
    let outlook = Outlook::new(survey, settings.picture);
    let features = outlook.of(&settings.frame).features;
    let outlook = Arc::new(outlook.of_picture(&settings.frame, partition.iter().map(|(_, rect)| rect)));
    // A goal of error or time does not fix the number of samples, so T_est stays unknown.
    let is_countable = settings.goal == Goal::Samples;
    let forecast = |zone| is_countable.then(|| knowledge.forecast(&features, &outlook, zone, settings.samples));
    let rows: Vec<ZoneRow> = partition
        .iter()
        .zip(differences)
        .zip(&outlook.zones)
        .map(|(((zone, rect), difference), zone_outlook)| {
            let row = ZoneRow::open(work, zone, rect, map.complexity(&rect), difference);
            match forecast(zone_outlook) {
                Some(forecast) if trusts_forecasts => row.with_forecast(settings, &forecast),
                Some(forecast) => ZoneRow { time_estimated: Some(forecast.time), ..row },
                None => row,
            }
        })
        .collect();
    let zone_count = rows.len() as u32;
    let work = WorkRow { work, settings: *settings, zone_count, ranges: InputRanges::of(&rows), features };
    Ok(Analysis { map: Arc::new(map), partition: Arc::new(partition), work, rows, outlook })
}

/// The state machine of the Analyst. It stops when its rows are on the Blackboard, or when the picture cannot be
/// surveyed or analyzed; a registered Analyst whose rows are there stays as long as its process takes part in the work.
#[derive(Clone, Debug)]
pub struct Analyst {
    config: AnalystConfig,
    /// Rows that the store has not confirmed, by ticket. The row of the work is written last, after all others.
    unwritten: BTreeMap<Ticket, FarmValue>,
    /// The row of the work while it waits for the zones' rows.
    work: Option<WorkRow>,
    retry: Option<Time>,
    registrant: Option<Box<Registrant>>,
}

impl Analyst {
    /// Makes an Analyst that has not started.
    pub fn new(config: AnalystConfig) -> Self {
        let registrant = config.registration.clone();
        let registrant = registrant.map(|place| Box::new(Registrant::new(config.id.clone(), place, &ANALYST_SERVICES)));
        Self { config, unwritten: BTreeMap::new(), work: None, retry: None, registrant }
    }

    fn surveyed(&mut self, survey: Result<Arc<Survey>, String>, actions: &mut Vec<FarmAction>) {
        let AnalystConfig { work, settings, importance, partition, knowledge, trusts_forecasts, .. } = &self.config;
        let analysis = survey.and_then(|survey| {
            analyze(*work, settings, &survey, *importance, partition, knowledge, *trusts_forecasts)
                .map_err(|error| error.to_string())
        });
        match analysis {
            Err(reason) => {
                actions.push(FarmAction::Effect(FarmEffect::Abandon { reason }));
                actions.push(FarmAction::Stop);
            }
            Ok(Analysis { map, partition, work, rows, outlook }) => {
                actions.push(FarmAction::Effect(FarmEffect::Analyzed { map, partition, outlook }));
                self.work = Some(work);
                let rows = rows.into_iter().map(|row| FarmValue::Zone(Arc::new(row)));
                self.unwritten = rows.enumerate().map(|(i, row)| (Ticket(i as u64 + 1), row)).collect();
                self.write(actions);
            }
        }
    }

    /// Asks the store for every row that it has not confirmed. A row that exists already was written by an Analyst
    /// before a restart, and stays as it is.
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
        // Workflow, step 3: notify the Master. It watches the Blackboard too, so this message may be lost.
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
            analyze(WorkId(1), &settings, &survey, ImportanceFunction::default(), &partition, &knowledge, true)
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
