//! The Blackboard of a job, for people and programs: the rows of its zones and of its agents.
//!
//! While a job is rendered, its rows are entries of the farm's store, which its leader writes. When the job is done, the
//! leader stores their last state as a blob.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use bottega::events::{AgentEvent, Event, ZoneEvent};
use bottega_agents::driver::nats::EntryUpdate;
use bottega_farm::{FarmValue, WorkId, WorkKeys, ZoneRow};

use crate::{
    error::Error,
    job::{board::JobBoard, record::Job},
};

/// The largest stored Blackboard that is read, in bytes.
const ROWS_BYTES_MAX: usize = 1 << 28;
/// The time after which a server that sends nothing counts as unavailable.
const SILENT: Duration = Duration::from_secs(10);

/// An update for observers of a Blackboard: a changed row, or the state of the observation.
#[derive(Clone, Debug, PartialEq)]
pub enum RowUpdate {
    /// The current state of a row: an [`Event::Zone`] or an [`Event::Agent`].
    Row(Box<Event>),
    /// All existing rows have been reported.
    CaughtUp,
    /// No change of these rows for some seconds, or a change of something else; sent so that the observer can stop.
    Nothing,
}

impl JobBoard {
    /// Reports all rows of a job, and then each change, until `tell` returns `false`; a server that does not answer gives
    /// [`RowUpdate::Nothing`] every few seconds. For a job that is over, reports the stored rows, if there are any, and returns.
    ///
    /// # Errors
    /// The job is over, and the farm does not return its stored rows.
    pub fn watch_rows(&self, job: &Job, mut tell: impl FnMut(RowUpdate) -> bool) -> Result<(), Error> {
        if job.state.is_over() {
            let rows = self.kept_rows(job)?;
            _ = rows.into_iter().map(|row| RowUpdate::Row(Box::new(row))).chain([RowUpdate::CaughtUp]).all(tell);
            return Ok(());
        }
        let prefix = WorkKeys::new(WorkId(job.work)).prefix();
        self.uplink.follow_entries(&prefix, |update| match update {
            EntryUpdate::Entry(entry) => {
                tell(as_event(&entry.value).map_or(RowUpdate::Nothing, |row| RowUpdate::Row(Box::new(row))))
            }
            EntryUpdate::CaughtUp => tell(RowUpdate::CaughtUp),
            EntryUpdate::Nothing => tell(RowUpdate::Nothing),
        });
        Ok(())
    }

    /// Returns all rows of a job's Blackboard: an [`Event::Zone`] or an [`Event::Agent`] each. For a job that is over, these are
    /// the rows stored at its end; empty if none are stored.
    ///
    /// # Errors
    /// The farm does not answer, or does not deliver all rows within 10 s.
    pub fn rows(&self, job: &Job) -> Result<Vec<Event>, Error> {
        let mut rows = Vec::new();
        let (begun, mut is_whole) = (Instant::now(), false);
        self.watch_rows(job, |update| match update {
            RowUpdate::Row(row) => {
                rows.push(*row);
                true
            }
            RowUpdate::CaughtUp => {
                is_whole = true;
                false
            }
            RowUpdate::Nothing => begun.elapsed() < SILENT,
        })?;
        if is_whole { Ok(rows) } else { Err(silent()) }
    }

    /// Returns the zone rows of a job while it is rendered.
    ///
    /// # Errors
    /// The farm does not deliver all rows within 10 s.
    pub(crate) fn zone_rows(&self, job: &Job) -> Result<Vec<Arc<ZoneRow>>, Error> {
        let mut rows = Vec::new();
        let (begun, mut is_whole) = (Instant::now(), false);
        self.uplink.follow_entries(&WorkKeys::new(WorkId(job.work)).prefix(), |update| match update {
            EntryUpdate::Entry(entry) => {
                if let FarmValue::Zone(row) = &entry.value {
                    rows.push(Arc::clone(row));
                }
                true
            }
            EntryUpdate::CaughtUp => {
                is_whole = true;
                false
            }
            EntryUpdate::Nothing => begun.elapsed() < SILENT,
        });
        if is_whole { Ok(rows) } else { Err(silent()) }
    }

    /// Stores the last state of a job's rows. Failures are only logged.
    pub(crate) fn keep_rows(&self, job: &Job) {
        let kept = self.rows(job).and_then(|rows| {
            let mut text = Vec::new();
            for row in rows {
                text.extend(row.to_json().into_bytes());
                text.push(b'\n');
            }
            self.uplink.blobs().put(&rows_blob(job.work), &text).map_err(Error::Blob)
        });
        if let Err(error) = kept {
            tracing::debug!(%error, "cannot store the rows of the job");
        }
    }

    fn kept_rows(&self, job: &Job) -> Result<Vec<Event>, Error> {
        let bytes = self.uplink.blobs().get(&rows_blob(job.work), ROWS_BYTES_MAX).map_err(Error::Blob)?;
        let bytes = bytes.unwrap_or_default();
        Ok(bytes.split(|byte| *byte == b'\n').filter_map(|line| serde_json::from_slice(line).ok()).collect())
    }
}

fn silent() -> Error {
    Error::failed("the farm's server does not deliver the rows of the job", "check whether it runs: bottega jobs list")
}

/// Returns a row as an event; `None`: the row is internal.
fn as_event(row: &FarmValue) -> Option<Event> {
    match row {
        FarmValue::Zone(row) => Some(Event::Zone(Box::new(ZoneEvent::from(&**row)))),
        FarmValue::Agent(row) => Some(Event::Agent(AgentEvent::new(row, None))),
        FarmValue::Work(_) | FarmValue::Page(_) => None,
    }
}

fn rows_blob(work: u64) -> String {
    format!("job-{work}/rows")
}
