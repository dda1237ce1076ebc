//! The rules by which agents decide what zones of a job are painted with, and what they say of a zone.
//!
//! While a job is painted, what its rules are laid out over is in the farm's store; when it is done its leader keeps it as a blob.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use bottega::{
    Event,
    engines::agent_rules,
    events::ZoneEvent,
    request::{RulesSource, RulesText},
    rule_view::{RuleInputs, RuleSetView, RuleVerdict},
};
use bottega_agents::driver::nats::EntryNews;
use bottega_farm::{FarmValue, Technique, WorkId, WorkKeys, WorkRow};
use schemars::JsonSchema;
use serde::Serialize;

use crate::{error::Error, job::Job, job_board::JobBoard};

/// A server that tells nothing for so long is not waited for.
const SILENT: Duration = Duration::from_secs(10);
/// The most that is read of what is kept.
const INPUTS_BYTES_MAX: usize = 1 << 16;

/// The rules of a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct JobRules {
    /// Over what they are laid out in the picture. `null`: it is not known yet.
    pub inputs: Option<RuleInputs>,
    /// The sets, which agents have in turn. Machines may have others of their own (`join --rules`).
    pub sets: Vec<RuleSetView>,
}

/// What the rules say of a zone.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct ZoneRules {
    /// IdZone.
    pub zone: u32,
    /// Which rules decided what it is painted with, as its agent said then.
    pub reasons: Option<String>,
    /// What each set says of the zone as its row is now. Empty: optimization is off.
    pub verdicts: Vec<RuleVerdict>,
}

impl JobBoard {
    /// The rules of a job.
    ///
    /// # Errors
    /// The farm does not answer, or the rules cannot be read.
    pub fn rules(&self, job: &Job) -> Result<JobRules, Error> {
        let inputs = self.rule_inputs(job)?;
        let texts = self.rule_texts(job)?;
        let sets = texts.iter().map(|text| RuleSetView::new(text, inputs.as_ref())).collect::<Result<_, _>>()?;
        Ok(JobRules { inputs, sets })
    }

    /// What the rules of a job say of a zone. `None`: there is no such zone.
    ///
    /// # Errors
    /// The farm does not answer, or the rules cannot be read.
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

    /// The texts of the rules: of a job that names none, those that come with the program.
    fn rule_texts(&self, job: &Job) -> Result<Vec<RulesText>, Error> {
        let mut texts = agent_rules(&self.spec(job)?.request)?;
        if texts.is_empty() {
            texts.push(RulesSource::File(Technique::PathTracing.rules_name().into()).read()?);
        }
        Ok(texts)
    }

    /// Over what the rules are laid out.
    fn rule_inputs(&self, job: &Job) -> Result<Option<RuleInputs>, Error> {
        if !job.state.is_over() {
            return Ok(self.work_row(job.work).map(|row| RuleInputs::new(&row.ranges, row.settings.optimization)));
        }
        let bytes = self.uplink.blobs().get(&inputs_blob(job.work), INPUTS_BYTES_MAX).map_err(Error::Blob)?;
        Ok(bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok()))
    }

    /// The row of a work, while it is painted.
    fn work_row(&self, work: u64) -> Option<Arc<WorkRow>> {
        let (mut found, begun) = (None, Instant::now());
        self.uplink.follow_entries(&WorkKeys::new(WorkId(work)).prefix(), |news| match news {
            EntryNews::Entry(entry) => {
                if let FarmValue::Work(row) = &entry.value {
                    found = Some(Arc::clone(row));
                }
                found.is_none()
            }
            // There is none yet.
            EntryNews::CaughtUp => false,
            EntryNews::Nothing => begun.elapsed() < SILENT,
        });
        found
    }

    /// Keeps over what the rules were laid out. That it could not be kept spoils no picture.
    pub(crate) fn keep_rule_inputs(&self, work: u64) {
        let Some(row) = self.work_row(work) else { return };
        let inputs = RuleInputs::new(&row.ranges, row.settings.optimization);
        let kept = self.uplink.blobs().put(&inputs_blob(work), &serde_json::to_vec(&inputs).unwrap_or_default());
        if let Err(error) = kept {
            tracing::debug!(%error, "what the rules were laid out over was not kept");
        }
    }
}

fn inputs_blob(work: u64) -> String {
    format!("job-{work}/rule-inputs")
}
