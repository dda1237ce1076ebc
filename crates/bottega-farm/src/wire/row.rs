//! The records of the Blackboard's rows.

use std::{sync::Arc, time::Duration};

use bottega_agents::{BlobId, Revision};
use bottega_engines::Tunables;
use serde::{Deserialize, Serialize};

use super::{
    error::WireError,
    layout,
    values::{RectRecord, agent, finite, list, name, nanoseconds, reason, rect, rect_record, short_reason, sides},
};
use crate::{
    AgentRow, Choice, Credit, Cut, FarmValue, Goal, InputRanges, Interval, NeighborDifference, Optimization, Painting,
    RelativePower, ResultRef, Rival, TaskFeatures, Vote, WorkId, WorkRow, WorkSettings, ZoneId, ZoneRow, ZoneState,
};

/// Appends the row of a work.
pub(crate) fn put_work(row: &WorkRow, bytes: &mut Vec<u8>) {
    layout::put(&WorkRecord::from(row), bytes);
}

/// Reads the row of a work.
pub(crate) fn read_work(bytes: &[u8]) -> Result<WorkRow, WireError> {
    layout::read::<WorkRecord>("the row of a work", bytes)?.try_into()
}

/// Appends the row of a zone.
pub(crate) fn put_zone(row: &ZoneRow, bytes: &mut Vec<u8>) {
    layout::put(&ZoneRecord::from(row), bytes);
}

/// Reads the row of a zone from the front of `bytes`. Returns it and the remaining bytes.
pub(crate) fn take_zone(bytes: &[u8]) -> Result<(ZoneRow, &[u8]), WireError> {
    let (record, rest) = layout::take::<ZoneRecord<'_>>("the row of a zone", bytes)?;
    Ok((record.try_into()?, rest))
}

/// The record of any row.
#[derive(Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "there is one at a time, on the stack")]
pub(super) enum ValueRecord<'a> {
    #[serde(borrow)]
    Zone(ZoneRecord<'a>),
    Work(WorkRecord),
    #[serde(borrow)]
    Agent(AgentRecord<'a>),
    Page(&'a str),
}

impl<'a> From<&'a FarmValue> for ValueRecord<'a> {
    fn from(value: &'a FarmValue) -> Self {
        match value {
            FarmValue::Zone(row) => Self::Zone((&**row).into()),
            FarmValue::Work(row) => Self::Work((&**row).into()),
            FarmValue::Agent(row) => Self::Agent((&**row).into()),
            FarmValue::Page(text) => Self::Page(text),
        }
    }
}

impl TryFrom<ValueRecord<'_>> for FarmValue {
    type Error = WireError;

    fn try_from(record: ValueRecord<'_>) -> Result<Self, WireError> {
        Ok(match record {
            ValueRecord::Zone(row) => Self::Zone(Arc::new(row.try_into()?)),
            ValueRecord::Work(row) => Self::Work(Arc::new(row.try_into()?)),
            ValueRecord::Agent(row) => Self::Agent(Arc::new(row.try_into()?)),
            ValueRecord::Page(text) => Self::Page(text.into()),
        })
    }
}

#[derive(Serialize, Deserialize)]
pub(super) struct ZoneRecord<'a> {
    work: u64,
    zone: u32,
    rect: RectRecord,
    complexity: f64,
    /// Neighbor difference: the mean, and the values by side.
    difference: (f64, [f64; 4]),
    time_estimated: Option<u64>,
    time_measured: Option<u64>,
    #[serde(borrow)]
    agent: Option<&'a str>,
    #[serde(with = "ZoneStateRecord")]
    state: ZoneState,
    attempt: u32,
    choice: Option<ChoiceRecord>,
    reasons: Option<&'a str>,
    result: Option<ResultRecord>,
    goal: Option<u32>,
    error: Option<f64>,
    piece: Option<RectRecord>,
    root: Option<u32>,
    cut: Option<(u32, RectRecord)>,
    rival: Option<(&'a str, u64)>,
    votes: Vec<(&'a str, PaintingRecord)>,
    word_of: Option<&'a str>,
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "ZoneState")]
enum ZoneStateRecord {
    Open,
    Profiling,
    Profiled,
    Awarded,
    Done,
    Failed,
}

impl<'a> From<&'a ZoneRow> for ZoneRecord<'a> {
    fn from(row: &'a ZoneRow) -> Self {
        let difference = &row.neighbor_difference;
        Self {
            work: row.work.0,
            zone: row.zone.0,
            rect: rect_record(&row.rect),
            complexity: row.complexity,
            difference: (difference.mean, difference.sides.into_array()),
            time_estimated: row.time_estimated.map(nanoseconds),
            time_measured: row.time_measured.map(nanoseconds),
            agent: row.agent.as_ref().map(name),
            state: row.state,
            attempt: row.attempt,
            choice: row.choice.as_ref().map(Into::into),
            reasons: row.reasons.as_deref().map(short_reason),
            result: row.result.as_ref().map(Into::into),
            goal: row.goal,
            error: row.error,
            piece: row.piece.as_ref().map(rect_record),
            root: row.root.map(|root| root.0),
            cut: row.cut.map(|cut| (cut.zone.0, rect_record(&cut.piece))),
            rival: row.rival.as_ref().map(|rival| (name(&rival.agent), rival.fence.0)),
            votes: row.votes.iter().map(|vote| (name(&vote.agent), (&vote.painting).into())).collect(),
            word_of: row.word_of.as_ref().map(name),
        }
    }
}

impl TryFrom<ZoneRecord<'_>> for ZoneRow {
    type Error = WireError;

    fn try_from(record: ZoneRecord<'_>) -> Result<Self, WireError> {
        let (mean, by_side) = record.difference;
        for value in [mean].iter().chain(&by_side) {
            finite("a neighbor difference", *value)?;
        }
        let cut = |(zone, piece)| Ok::<_, WireError>(Cut { zone: ZoneId(zone), piece: rect(piece)? });
        let rival = |(name, fence)| Ok::<_, WireError>(Rival { agent: agent(name)?, fence: Revision(fence) });
        Ok(Self {
            work: WorkId(record.work),
            zone: ZoneId(record.zone),
            rect: rect(record.rect)?,
            complexity: finite("the complexity of a zone", record.complexity)?,
            neighbor_difference: NeighborDifference { mean, sides: sides(by_side) },
            time_estimated: record.time_estimated.map(Duration::from_nanos),
            time_measured: record.time_measured.map(Duration::from_nanos),
            agent: record.agent.map(agent).transpose()?,
            state: record.state,
            attempt: record.attempt,
            choice: record.choice.map(Into::into),
            reasons: record.reasons.map(reason).transpose()?.map(Into::into),
            result: record.result.map(Into::into),
            goal: record.goal,
            error: record.error.map(|error| finite("the error of a zone", error)).transpose()?,
            piece: record.piece.map(rect).transpose()?,
            root: record.root.map(ZoneId),
            cut: record.cut.map(cut).transpose()?,
            rival: record.rival.map(rival).transpose()?,
            votes: list("the list of votes", record.votes, |(name, painting)| {
                Ok(Vote { agent: agent(name)?, painting: painting.try_into()? })
            })?,
            word_of: record.word_of.map(agent).transpose()?,
        })
    }
}

#[derive(Serialize, Deserialize)]
struct ChoiceRecord {
    max_depth: u32,
    light_samples: u32,
    samples: u32,
    bands: [u32; 4],
}

impl From<&Choice> for ChoiceRecord {
    fn from(choice: &Choice) -> Self {
        let Choice { tunables: Tunables { max_depth, light_samples }, samples, bands } = *choice;
        Self { max_depth, light_samples, samples, bands: bands.into_array() }
    }
}

impl From<ChoiceRecord> for Choice {
    fn from(record: ChoiceRecord) -> Self {
        let ChoiceRecord { max_depth, light_samples, samples, bands } = record;
        Self { tunables: Tunables { max_depth, light_samples }, samples, bands: sides(bands) }
    }
}

#[derive(Serialize, Deserialize)]
struct ResultRecord {
    fence: u64,
    samples: u32,
    digest: [u8; 32],
}

impl From<&ResultRef> for ResultRecord {
    fn from(result: &ResultRef) -> Self {
        Self { fence: result.fence.0, samples: result.samples, digest: result.digest.0 }
    }
}

impl From<ResultRecord> for ResultRef {
    fn from(record: ResultRecord) -> Self {
        Self { fence: Revision(record.fence), samples: record.samples, digest: BlobId(record.digest) }
    }
}

/// The record of a [`Painting`].
#[derive(Serialize, Deserialize)]
pub(super) struct PaintingRecord {
    choice: ChoiceRecord,
    result: ResultRecord,
    time_measured: u64,
    goal: u32,
    time_left: u64,
    /// In the painter's own time, in nanoseconds.
    busy: u64,
    is_measured: bool,
    was_ready: bool,
    error: Option<f64>,
}

impl From<&Painting> for PaintingRecord {
    fn from(painting: &Painting) -> Self {
        Self {
            choice: (&painting.choice).into(),
            result: (&painting.result).into(),
            time_measured: nanoseconds(painting.time_measured),
            goal: painting.goal,
            time_left: nanoseconds(painting.time_left),
            busy: nanoseconds(painting.busy),
            is_measured: painting.is_measured,
            was_ready: painting.was_ready,
            error: painting.error,
        }
    }
}

impl TryFrom<PaintingRecord> for Painting {
    type Error = WireError;

    fn try_from(record: PaintingRecord) -> Result<Self, WireError> {
        Ok(Self {
            choice: record.choice.into(),
            result: record.result.into(),
            time_measured: Duration::from_nanos(record.time_measured),
            goal: record.goal,
            time_left: Duration::from_nanos(record.time_left),
            busy: Duration::from_nanos(record.busy),
            is_measured: record.is_measured,
            was_ready: record.was_ready,
            error: record.error.map(|error| finite("the error of a painting", error)).transpose()?,
        })
    }
}

#[derive(Serialize, Deserialize)]
pub(super) struct WorkRecord {
    work: u64,
    picture: RectRecord,
    frame: RectRecord,
    samples: u32,
    max_depth: u32,
    light_samples: u32,
    #[serde(with = "OptimizationRecord")]
    optimization: Optimization,
    goal: GoalRecord,
    zone_count: u32,
    /// Minimum and maximum of complexity, neighbor difference and size.
    ranges: [(f64, f64); 3],
    /// The fields of [`TaskFeatures`], in their order.
    features: [f64; 6],
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "Optimization")]
enum OptimizationRecord {
    Off,
    VerySmall,
    Small,
    Normal,
    Big,
    VeryBig,
}

#[derive(Serialize, Deserialize)]
enum GoalRecord {
    Samples,
    Error(f64),
    /// The time, in nanoseconds.
    Time(u64),
}

impl From<&WorkRow> for WorkRecord {
    fn from(row: &WorkRow) -> Self {
        let WorkSettings { picture, frame, samples, goal, tunables, optimization } = &row.settings;
        let InputRanges { complexity_density, neighbor_difference, size } = row.ranges;
        Self {
            work: row.work.0,
            picture: rect_record(picture),
            frame: rect_record(frame),
            samples: *samples,
            max_depth: tunables.max_depth,
            light_samples: tunables.light_samples,
            optimization: *optimization,
            goal: match *goal {
                Goal::Samples => GoalRecord::Samples,
                Goal::Error(error) => GoalRecord::Error(error),
                Goal::Time(time) => GoalRecord::Time(nanoseconds(time)),
            },
            zone_count: row.zone_count,
            ranges: [complexity_density, neighbor_difference, size].map(|range| (range.min, range.max)),
            features: {
                let TaskFeatures { glass, texture, media, shadow, material, bounces } = row.features;
                [glass, texture, media, shadow, material, bounces]
            },
        }
    }
}

impl TryFrom<WorkRecord> for WorkRow {
    type Error = WireError;

    fn try_from(record: WorkRecord) -> Result<Self, WireError> {
        let end = |value| finite("the end of an interval", value);
        let interval = |(min, max)| Ok::<_, WireError>(Interval { min: end(min)?, max: end(max)? });
        let [complexity_density, neighbor_difference, size] = record.ranges;
        let share = |value| finite("a feature of the picture", value);
        let [glass, texture, media, shadow, material, bounces] = record.features;
        let settings = WorkSettings {
            picture: rect(record.picture)?,
            frame: rect(record.frame)?,
            samples: record.samples,
            goal: match record.goal {
                GoalRecord::Samples => Goal::Samples,
                GoalRecord::Error(error) => Goal::Error(finite("the error goal", error)?),
                GoalRecord::Time(time) => Goal::Time(Duration::from_nanos(time)),
            },
            tunables: Tunables { max_depth: record.max_depth, light_samples: record.light_samples },
            optimization: record.optimization,
        };
        let ranges = InputRanges {
            complexity_density: interval(complexity_density)?,
            neighbor_difference: interval(neighbor_difference)?,
            size: interval(size)?,
        };
        let features = TaskFeatures {
            glass: share(glass)?,
            texture: share(texture)?,
            media: share(media)?,
            shadow: share(shadow)?,
            material: share(material)?,
            bounces: share(bounces)?,
        };
        Ok(Self { work: WorkId(record.work), settings, zone_count: record.zone_count, ranges, features })
    }
}

#[derive(Serialize, Deserialize)]
pub(super) struct AgentRecord<'a> {
    agent: &'a str,
    power: f64,
    lanes: f64,
    /// The sum, and promised and measured times.
    credit: [f64; 3],
    agreed: u32,
    failures: u32,
    left_out: Option<&'a str>,
}

impl<'a> From<&'a AgentRow> for AgentRecord<'a> {
    fn from(row: &'a AgentRow) -> Self {
        Self {
            agent: name(&row.agent),
            power: row.power.get(),
            lanes: row.lanes,
            credit: [row.credit.sum, row.credit.promised, row.credit.taken],
            agreed: row.agreed,
            failures: row.failures,
            left_out: row.left_out.as_deref().map(short_reason),
        }
    }
}

impl TryFrom<AgentRecord<'_>> for AgentRow {
    type Error = WireError;

    fn try_from(record: AgentRecord<'_>) -> Result<Self, WireError> {
        let [sum, promised, taken] = record.credit;
        Ok(Self {
            agent: agent(record.agent)?,
            power: RelativePower::new(finite("the power of an agent", record.power)?),
            lanes: finite("the number of an agent's processors", record.lanes)?,
            credit: Credit {
                sum: finite("the credit of an agent", sum)?,
                promised: finite("what an agent promised", promised)?,
                taken: finite("what that took it", taken)?,
            },
            agreed: record.agreed,
            failures: record.failures,
            left_out: record.left_out.map(reason).transpose()?,
        })
    }
}
