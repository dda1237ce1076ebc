//! The record of a job: enough for any process of the farm to paint it, or to say how it stands.

use std::path::{Path, PathBuf};

use bottega::{
    Request,
    devices::DeviceChoice,
    engines::{agent_rules, choice_rules},
    request::{DeviceOptions, EnvironmentLight, RulesSource, WorkOptions},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{error::Error, names::fresh_number, sent_files::SentFiles};

/// Lines that a job's log has at most; older ones go.
const LOG_LINES_MAX: usize = 200;

/// The state of a job.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "state", rename_all = "lowercase")]
pub enum JobState {
    /// Whoever is there paints it.
    Active,
    /// Nobody paints it until it is resumed.
    Paused,
    /// It is painted.
    Done,
    /// It cannot be painted.
    Failed {
        /// Why not.
        reason: String,
    },
    /// Somebody called it off.
    Cancelled,
}

impl JobState {
    /// Whether it will not change by itself any more.
    pub fn is_over(&self) -> bool {
        !matches!(self, Self::Active | Self::Paused)
    }

    /// As people read it.
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

/// A job that paints a frame of an animation.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct AnimationFrame {
    /// What all frames of the animation have in common, and no other job has.
    pub animation: String,
    /// The number of the frame.
    pub frame: i32,
    /// How many frames were asked for.
    pub frames: u32,
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LogLine {
    /// Seconds since 1970, by the clock of the machine that wrote it.
    pub at: u64,
    /// What.
    pub text: String,
}

/// A job as everybody may read it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Job {
    /// The identity of the build: pictures are the same bits for the same one alone.
    pub version: String,
    /// The commit of its sources, for people; empty: unknown.
    #[serde(default)]
    pub commit: String,
    /// The number under which what it asks for and its picture are kept, which no other job has had. Jobs of older versions have none.
    #[serde(default)]
    pub origin: u64,
    /// The number of its painting, under which its zones are kept, and which no other painting has had: another one each time the job
    /// is painted again, so that nothing of an earlier painting is taken for a part of it.
    pub work: u64,
    /// How often all who paint it were told to begin again with it, because nothing went on.
    #[serde(default)]
    pub stirs: u32,
    /// Whether the farm has a picture of it: not where the process that asked for it wrote it itself. While it is painted again, that
    /// of the painting before.
    #[serde(default)]
    pub kept: bool,
    /// The scene, as its asker calls it.
    pub scene: String,
    /// The picture, as its asker calls it.
    pub output: String,
    /// The process that asked for it.
    pub from: String,
    /// Seconds since 1970.
    pub submitted: u64,
    /// Its share of the machines is to that of another as their priorities are.
    pub priority: u32,
    /// Tags that a machine must have to paint it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub require: Vec<String>,
    /// Of which animation it is a frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub animation: Option<AnimationFrame>,
    /// How it stands.
    #[serde(flatten)]
    pub state: JobState,
    /// What has happened to it; the last lines.
    pub log: Vec<LogLine>,
}

/// One painting of a job, and how often it was begun again. A process that has left a turn does not come back to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PaintingTurn {
    pub(crate) work: u64,
    pub(crate) stirs: u32,
}

impl Job {
    /// Which painting of it is under way.
    pub(crate) fn turn(&self) -> PaintingTurn {
        PaintingTurn { work: self.work, stirs: self.stirs }
    }

    /// Has it painted from its first sample.
    pub(crate) fn paint_again(&mut self) {
        (self.work, self.stirs, self.state) = (fresh_number(), 0, JobState::Active);
    }

    /// Adds a line to the log.
    pub fn say(&mut self, text: impl Into<String>) {
        self.log.push(LogLine { at: unix_seconds(), text: text.into() });
        let old = self.log.len().saturating_sub(LOG_LINES_MAX);
        self.log.drain(..old);
    }
}

/// The order of a job: a request, and the files that it names by their digests.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JobSpec {
    /// The picture. Its rules are texts; its files are those of `files`, whatever it calls them.
    #[serde(with = "request_json")]
    pub request: Request,
    /// The files of the scene.
    pub files: SentFiles,
    /// The engine of other people that paints it, as all machines must have it; none: our own.
    #[serde(default)]
    pub engine: Option<String>,
    /// How the one who asks calls the picture in the journal beside it, where there is one.
    #[serde(default)]
    pub journal: Option<String>,
}

/// Requests are read as they are everywhere: each field checked, a newer version refused.
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

/// The same request as others may read it: rules as texts, and nothing that concerns this machine alone.
///
/// # Errors
/// A file of rules cannot be read.
pub fn for_others(request: &Request) -> Result<Request, Error> {
    let mut request = request.clone();
    request.work.rules = agent_rules(&request)?.into_iter().map(RulesSource::Text).collect();
    request.engine.rules = choice_rules(&request)?.map(RulesSource::Text);
    let WorkOptions { agents, .. } = &mut request.work;
    *agents = None;
    let DeviceOptions { threads, names, .. } = &mut request.devices;
    (*threads, *names) = (None, DeviceChoice::Auto.names());
    Ok(request)
}

impl JobSpec {
    /// What is asked of this machine: the scene is here, and how many processors it has is its own matter.
    ///
    /// - `scene`, `environment`: where the files are that were fetched.
    ///
    /// # Errors
    /// The request names files that were not sent.
    pub(crate) fn on_this_machine(&self, scene: &Path, environment: Option<PathBuf>) -> Result<Request, Error> {
        let mut request = self.request.clone();
        self.refuse_files_of_others(environment.is_some())?;
        request.scene.file = scene.to_owned();
        // References out of the scene's folder lie within the cache: where they are was decided when they were fetched. This
        // machine's own files are no business of the scene.
        request.scene.allow_outside = false;
        request.scene.asset_roots = vec![SentFiles::root_of(scene)];
        if let Some(environment) = environment {
            request.environment.light = Some(EnvironmentLight::File(environment));
        }
        (request.devices.threads, request.work.agents) = (None, None);
        request.devices.names = DeviceChoice::Auto.names();
        // Whom a machine trusts is for its owner to say.
        request.engine.trust = false;
        Ok(request)
    }

    /// A request may only name what was sent with it: whatever else it names would be a file of this machine.
    fn refuse_files_of_others(&self, has_environment: bool) -> Result<(), Error> {
        let is_file = |rules: &RulesSource| matches!(rules, RulesSource::File(_));
        let named = [
            ("work.rules", self.request.work.rules.iter().any(is_file)),
            ("engine.rules", self.request.engine.rules.as_ref().is_some_and(is_file)),
            (
                "environment.light",
                !has_environment && matches!(self.request.environment.light, Some(EnvironmentLight::File(_))),
            ),
        ];
        match named.into_iter().find(|(_, is_named)| *is_named) {
            None => Ok(()),
            Some((field, _)) => Err(Error::failed(
                format!("the job names a file in `{field}` that was not sent with it"),
                "who asked for it is of another mind, or is not to be trusted",
            )),
        }
    }
}

/// Seconds since 1970.
pub fn unix_seconds() -> u64 {
    crate::clock::since_1970().as_secs()
}
