//! The record of a job: enough for any process of the farm to render it and to show its state.

use std::path::{Path, PathBuf};

use bottega::{
    Request,
    agent_rules::RuleTexts,
    devices::DeviceChoice,
    request::{DeviceOptions, EnvironmentLight, RulesSource, WorkOptions},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{error::Error, files::sent_files::SentFiles, names::fresh_number};

/// The most lines that a job's log keeps; older ones are dropped.
const LOG_LINES_MAX: usize = 200;

/// The state of a job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "state", rename_all = "lowercase")]
pub enum JobState {
    /// Machines of the farm render the job.
    Active,
    /// No machine renders the job until it is resumed.
    Paused,
    /// The picture is complete.
    Done,
    /// The job cannot be rendered, or some of its zones cannot.
    Failed {
        /// The cause, for display.
        reason: String,
    },
    /// A user has cancelled the job.
    Cancelled,
}

impl JobState {
    /// Returns true if the state does not change again without a user.
    pub fn is_over(&self) -> bool {
        !matches!(self, Self::Active | Self::Paused)
    }

    /// Returns the name of the state, such as `done`: in messages, JSON and the HTTP API.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::Paused => "paused",
            Self::Done => "done",
            Self::Failed { .. } => "failed",
            Self::Cancelled => "cancelled",
        }
    }
}

/// The position of a job in an animation: the frame that it renders.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct AnimationFrame {
    /// The identifier of the animation: the same for all its frames, and for no other job.
    pub animation: String,
    /// The number of the frame.
    pub frame: i32,
    /// The number of frames that the animation has.
    pub frames: u32,
}

/// A line of a job's log.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LogLine {
    /// Seconds since 1970, by the clock of the machine that wrote it.
    pub at: u64,
    /// The text of the line.
    pub text: String,
}

/// The public record of a job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Job {
    /// The identity of the build that submitted it; only the same build renders bit-identical pictures.
    pub version: String,
    /// The Git commit of that build, for display; empty: unknown.
    #[serde(default)]
    pub commit: String,
    /// The unique number under which its spec and its picture are stored. Jobs of older versions have 0.
    #[serde(default)]
    pub origin: u64,
    /// The unique number of the current painting, under which its zones are stored. It changes each time the job is
    /// rendered again, so that no part of an earlier painting is reused.
    pub work: u64,
    /// The number of restarts of all processes of this painting, because it made no progress.
    #[serde(default)]
    pub stirs: u32,
    /// True if the farm stores its picture; false if the process that submitted it wrote the picture itself. While the job
    /// is rendered again, the stored picture is that of the previous painting.
    #[serde(default)]
    pub kept: bool,
    /// The name of the scene, as its submitter wrote it.
    pub scene: String,
    /// The name of the picture, as its submitter wrote it.
    pub output: String,
    /// The name of the process that submitted the job.
    pub from: String,
    /// The time of submission, in seconds since 1970.
    pub submitted: u64,
    /// The job's weight when jobs share the machines: a job with twice the priority gets twice the share.
    pub priority: u32,
    /// Tags that a machine must have to render it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub require: Vec<String>,
    /// The job's place in an animation; none: it is not a frame of one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub animation: Option<AnimationFrame>,
    /// The state: active, paused or over.
    #[serde(flatten)]
    pub state: JobState,
    /// The last lines of the job's log, oldest first.
    pub log: Vec<LogLine>,
}

/// A painting of a job and its restart count. A process that has left a turn does not join that turn again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PaintingTurn {
    pub(crate) work: u64,
    pub(crate) stirs: u32,
}

impl Job {
    /// Returns the current painting.
    pub(crate) fn turn(&self) -> PaintingTurn {
        PaintingTurn { work: self.work, stirs: self.stirs }
    }

    /// Starts a new painting, from the first sample.
    pub(crate) fn paint_again(&mut self) {
        (self.work, self.stirs, self.state) = (fresh_number(), 0, JobState::Active);
    }

    /// Adds a line to the log, with the current time. The log keeps the last 200 lines.
    pub fn say(&mut self, text: impl Into<String>) {
        self.log.push(LogLine { at: unix_seconds(), text: text.into() });
        let old = self.log.len().saturating_sub(LOG_LINES_MAX);
        self.log.drain(..old);
    }
}

/// The specification of a job: a request, and the digests of the files that it names.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JobSpec {
    /// The request. Its rules are inline text; its files are those of `files`, whatever paths it names.
    #[serde(with = "request_json")]
    pub request: Request,
    /// The names and digests of the files of the scene, and of its environment map.
    pub files: SentFiles,
    /// The name of the external engine that renders it, which each machine must have; `None`: the built-in engine.
    #[serde(default)]
    pub engine: Option<String>,
    /// The name of the picture in the submitter's journal, if there is one.
    #[serde(default)]
    pub journal: Option<String>,
}

/// (De)serialization of requests with full validation: each field is checked, and newer versions are refused.
mod request_json {
    use bottega::Request;
    use serde::{Deserialize, Deserializer, Serializer, de, ser};
    use serde_json::Value;

    pub(super) fn serialize<S: Serializer>(request: &Request, serializer: S) -> Result<S::Ok, S::Error> {
        let value = request.to_value().map_err(ser::Error::custom)?;
        serde::Serialize::serialize(&value, serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Request, D::Error> {
        let value = Value::deserialize(deserializer)?;
        Request::from_value(value).map_err(|error| de::Error::custom(bottega::error::error_chain(&error)))
    }
}

/// Returns the request for other machines: rules as inline text, without settings that only concern this machine.
///
/// - `rules`: the texts of the rules.
pub(crate) fn for_others(request: &Request, rules: &RuleTexts) -> Request {
    let mut request = request.clone();
    request.work.rules = rules.agents.iter().cloned().map(RulesSource::Text).collect();
    request.engine.rules = rules.choice.clone().map(RulesSource::Text);
    request.integrator.rules = rules.technique.clone().map(RulesSource::Text);
    let WorkOptions { agents, .. } = &mut request.work;
    *agents = None;
    let DeviceOptions { threads, names, .. } = &mut request.devices;
    (*threads, *names) = (None, DeviceChoice::Auto.names());
    request
}

impl JobSpec {
    /// Returns the request for this machine: with local file paths, and its own threads and devices.
    ///
    /// - `scene`, `environment`: the paths of the fetched files.
    ///
    /// # Errors
    /// The request names files that were not sent.
    pub(crate) fn on_this_machine(&self, scene: &Path, environment: Option<PathBuf>) -> Result<Request, Error> {
        let mut request = self.request.clone();
        self.refuse_files_of_others(environment.is_some())?;
        request.scene.file = scene.to_owned();
        // References outside the scene's folder point into the cache: they were resolved at the fetch. The scene may not
        // access other files of this machine.
        request.scene.allow_outside = false;
        request.scene.asset_roots = vec![SentFiles::root_of(scene)];
        if let Some(environment) = environment {
            request.environment.light = Some(EnvironmentLight::File(environment));
        }
        (request.devices.threads, request.work.agents) = (None, None);
        request.devices.names = DeviceChoice::Auto.names();
        // Only the owner of a machine decides which engines it trusts.
        request.engine.trust = false;
        Ok(request)
    }

    /// Refuses a request that names files that were not sent with it: they would be read from this machine.
    fn refuse_files_of_others(&self, has_environment: bool) -> Result<(), Error> {
        let is_file = |rules: &RulesSource| matches!(rules, RulesSource::File(_));
        let named = [
            ("work.rules", self.request.work.rules.iter().any(is_file)),
            ("engine.rules", self.request.engine.rules.as_ref().is_some_and(is_file)),
            ("integrator.rules", self.request.integrator.rules.as_ref().is_some_and(is_file)),
            (
                "environment.light",
                !has_environment && matches!(self.request.environment.light, Some(EnvironmentLight::File(_))),
            ),
        ];
        match named.into_iter().find(|(_, is_named)| *is_named) {
            None => Ok(()),
            Some((field, _)) => Err(Error::failed(
                format!("the job names a file in `{field}` that was not sent with it"),
                "remove the job; its submitter has another version of Bottega, or cannot be trusted",
            )),
        }
    }
}

/// Returns the current time in seconds since 1970, by the clock of this machine; 0 if that shows an earlier time.
pub fn unix_seconds() -> u64 {
    crate::clock::since_1970().as_secs()
}

#[cfg(test)]
mod tests {
    use bottega::request::RulesText;

    use super::*;

    #[test]
    fn a_request_for_other_machines_has_the_rules_that_were_read_and_no_devices_of_this_one() {
        let mut request = Request::new("scene.glb");
        request.work.rules = vec![RulesSource::File("no-such-file.fcl".into())];
        (request.work.agents, request.devices.threads) = (Some(3), Some(2));
        let text =
            RulesText { name: "no-such-file.fcl".into(), text: "FUNCTION_BLOCK mine END_FUNCTION_BLOCK".to_owned() };
        let sent = for_others(&request, &RuleTexts { agents: vec![text.clone()], ..RuleTexts::default() });
        assert_eq!(sent.work.rules, [RulesSource::Text(text)]);
        assert_eq!((sent.work.agents, sent.devices.threads, sent.engine.rules), (None, None, None));
    }
}
