//! What the farm keeps of a job: enough for any of its processes to paint it, or to say how it stands.

use std::{
    path::{Path, PathBuf},
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use clap::Parser;
use serde::{Deserialize, Serialize};

use super::scene_files::SceneFiles;
use crate::{
    cli::{Cli, Command, EnvironmentArg, RenderArgs},
    devices::DeviceChoice,
    error::CliError,
    rules::RulesText,
};

/// Lines that a job's log has at most; older ones go.
const LOG_LINES_MAX: usize = 200;
/// What a job is worth where nobody says.
pub(crate) const PRIORITY: u32 = 10;
/// The most that a job can be worth.
pub(crate) const PRIORITY_MAX: u32 = 1000;

/// How a job stands.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "state", rename_all = "lowercase")]
pub(crate) enum JobState {
    /// Whoever is there paints it.
    Active,
    /// Nobody paints it until it is resumed.
    Paused,
    /// It is painted.
    Done {
        /// Whether the farm has the picture: not where the process that asked for it wrote it itself.
        kept: bool,
    },
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
    pub(crate) fn is_over(&self) -> bool {
        !matches!(self, Self::Active | Self::Paused)
    }

    pub(crate) fn word(&self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::Paused => "paused",
            Self::Done { .. } => "done",
            Self::Failed { .. } => "failed",
            Self::Cancelled => "cancelled",
        }
    }
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct LogLine {
    /// Seconds since 1970, by the clock of the machine that wrote it.
    pub(crate) at: u64,
    pub(crate) text: String,
}

/// A job as everybody may read it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Job {
    /// The identity of the build: pictures are the same bits for the same one alone.
    pub(crate) version: String,
    /// The commit of its sources, for people; empty: unknown.
    #[serde(default)]
    pub(crate) commit: String,
    /// The number under which its zones are kept, which no other job has had.
    pub(crate) work: u64,
    pub(crate) scene: String,
    pub(crate) output: String,
    /// The process that asked for it.
    pub(crate) from: String,
    /// Seconds since 1970.
    pub(crate) submitted: u64,
    /// Its share of the machines is to that of another as their priorities are.
    pub(crate) priority: u32,
    #[serde(flatten)]
    pub(crate) state: JobState,
    pub(crate) log: Vec<LogLine>,
}

impl Job {
    pub(crate) fn say(&mut self, text: impl Into<String>) {
        self.log.push(LogLine { at: unix_seconds(), text: text.into() });
        let old = self.log.len().saturating_sub(LOG_LINES_MAX);
        self.log.drain(..old);
    }
}

/// What a job asks for.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Order {
    /// What its user wrote, from `render` on.
    pub(crate) words: Vec<String>,
    pub(crate) files: SceneFiles,
    /// The rules of the agents: FCL; none: those that come with the program.
    pub(crate) rules: Vec<RulesText>,
    /// The rules for who paints a zone, where two engines may.
    #[serde(default)]
    pub(crate) choice: Option<RulesText>,
    /// The frame, where it is one of an animation.
    pub(crate) frame: Option<i32>,
    /// The engine of other people that paints it, as all machines must have it; none: our own.
    #[serde(default)]
    pub(crate) engine: Option<String>,
    /// How the one who asks calls the picture in the journal beside it, where there is one.
    #[serde(default)]
    pub(crate) journal: Option<String>,
}

impl Order {
    /// What the words ask of this machine: the scene is here, and how many processors it has is its own matter.
    pub(crate) fn as_asked(&self, scene: &Path, environment: Option<PathBuf>) -> Result<RenderArgs, CliError> {
        let words = std::iter::once("bottega").chain(self.words.iter().map(String::as_str));
        let Ok(Cli { command: Command::Render(mut args) }) = Cli::try_parse_from(words) else {
            return Err(CliError::failed(
                "the job was asked for in words that are not understood here",
                "install the same version of bottega on all machines",
            ));
        };
        if let Some(frame) = self.frame {
            *args = args.at_frame(frame)?;
        }
        args.scene.file.scene = scene.to_owned();
        // References out of the scene's folder lie within the cache: where they are was decided when they were fetched. This
        // machine's own files are no business of the scene.
        let root = SceneFiles::root_of(scene);
        args.scene.file.allow_outside = false;
        args.scene.file.asset_roots = vec![root.clone()];
        args.engines.sent = Some(root);
        if let Some(environment) = environment {
            args.scene.env = Some(EnvironmentArg::Picture(environment));
        }
        (args.scene.threads, args.agents, args.rules) = (None, None, Vec::new());
        args.engines.choice = None;
        // Whom a machine trusts is for its owner to say.
        args.engines.trust = false;
        args.devices = DeviceChoice::Auto;
        Ok(*args)
    }
}

/// Seconds since 1970.
pub(crate) fn unix_seconds() -> u64 {
    since_1970().as_secs()
}

pub(super) fn since_1970() -> Duration {
    // A clock that stands before 1970 has been set by nobody.
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}
