//! The fuzzy rules by which agents choose the parameters of a job's zones, and their verdict on a zone.
//!
//! While a job is rendered, the value ranges of its rules' inputs are in the farm's store; when it is done, its leader
//! stores them as a blob.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use bottega::{
    Event,
    agent_rules::RuleTexts,
    events::ZoneEvent,
    request::{RulesSource, RulesText},
    rule_view::{RuleInputs, RuleSetView, RuleVerdict},
};
use bottega_agents::driver::nats::EntryUpdate;
use bottega_farm::{FarmValue, Technique, WorkId, WorkKeys, WorkRow};
use schemars::JsonSchema;
use serde::Serialize;

use crate::{
    error::Error,
    job::{board::JobBoard, record::Job},
};

/// The time after which a server that sends nothing counts as unavailable.
const SILENT: Duration = Duration::from_secs(10);
/// The largest stored inputs that are read, in bytes.
const INPUTS_BYTES_MAX: usize = 1 << 16;

/// The rules of a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct JobRules {
    /// The value ranges of the rules' inputs in this picture. `null`: not known yet.
    pub inputs: Option<RuleInputs>,
    /// The rule sets, which the agents use in turn. Machines may have others of their own (`join --rules`).
    pub sets: Vec<RuleSetView>,
}

/// The verdict of the rules on a zone.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct ZoneRules {
    /// The identifier of the zone (IdZone).
    pub zone: u32,
    /// The rules that decided the parameters of its painting, as its agent reported them. `null`: it has reported none.
    pub reasons: Option<String>,
    /// The verdict of each set on the zone's current row. Empty: optimization is off, or the rules' inputs are not known yet.
    pub verdicts: Vec<RuleVerdict>,
}

impl JobBoard {
    /// Returns the rules of a job: the built-in ones if it names none.
    ///
    /// # Errors
    /// The farm does not answer, or the specification of the job or its rules cannot be read.
    pub fn rules(&self, job: &Job) -> Result<JobRules, Error> {
        let inputs = self.rule_inputs(job)?;
        let texts = self.rule_texts(job)?;
        let sets = texts.iter().map(|text| RuleSetView::new(text, inputs.as_ref())).collect::<Result<_, _>>()?;
        Ok(JobRules { inputs, sets })
    }

    /// Returns the verdict of a job's rules on a zone. `None`: there is no such zone.
    ///
    /// # Errors
    /// The farm does not answer, or the specification of the job or its rules cannot be read.
    pub fn zone_rules(&self, job: &Job, zone: u32) -> Result<Option<ZoneRules>, Error> {
        let rows = self.rows(job)?;
        let found = rows.into_iter().find_map(|row| match row {
            Event::Zone(row) if row.id == zone => Some(row),
            _ => None,
        });
        let Some(row) = found else { return Ok(None) };
        let ZoneEvent { reasons, .. } = &*row;
        let reasons = reasons.clone();
        let Some(inputs) = self.rule_inputs(job)? else {
            return Ok(Some(ZoneRules { zone, reasons, verdicts: Vec::new() }));
        };
        let mut verdicts = Vec::new();
        for text in self.rule_texts(job)? {
            verdicts.extend(RuleVerdict::new(&text, &inputs, &row)?);
        }
        Ok(Some(ZoneRules { zone, reasons, verdicts }))
    }

    /// Returns the texts of the rules; the built-in ones if the job names none.
    fn rule_texts(&self, job: &Job) -> Result<Vec<RulesText>, Error> {
        let mut texts = RuleTexts::of(&self.spec(job)?.request)?.agents;
        if texts.is_empty() {
            texts.push(RulesSource::File(Technique::PathTracing.rules_name().into()).read()?);
        }
        Ok(texts)
    }

    /// Returns the value ranges of the rules' inputs.
    fn rule_inputs(&self, job: &Job) -> Result<Option<RuleInputs>, Error> {
        if !job.state.is_over() {
            return Ok(self.work_row(job.work).map(|row| RuleInputs::new(&row.ranges, row.settings.optimization)));
        }
        let bytes = self.uplink.blobs().get(&inputs_blob(job.work), INPUTS_BYTES_MAX).map_err(Error::Blob)?;
        Ok(bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok()))
    }

    /// Returns the row of a work while it is rendered.
    fn work_row(&self, work: u64) -> Option<Arc<WorkRow>> {
        let (mut found, begun) = (None, Instant::now());
        self.uplink.follow_entries(&WorkKeys::new(WorkId(work)).prefix(), |update| match update {
            EntryUpdate::Entry(entry) => {
                if let FarmValue::Work(row) = &entry.value {
                    found = Some(Arc::clone(row));
                }
                found.is_none()
            }
            // The row does not exist yet.
            EntryUpdate::CaughtUp => false,
            EntryUpdate::Nothing => begun.elapsed() < SILENT,
        });
        found
    }

    /// Stores the value ranges of the rules' inputs. Failures are only logged.
    pub(crate) fn keep_rule_inputs(&self, work: u64) {
        let Some(row) = self.work_row(work) else { return };
        let inputs = RuleInputs::new(&row.ranges, row.settings.optimization);
        let kept = self.uplink.blobs().put(&inputs_blob(work), &serde_json::to_vec(&inputs).unwrap_or_default());
        if let Err(error) = kept {
            tracing::debug!(%error, "cannot store the ranges of the rules");
        }
    }
}

fn inputs_blob(work: u64) -> String {
    format!("job-{work}/rule-inputs")
}
