//! The source of a door's data: a farm, or the picture of one process, behind one trait.

use std::sync::Arc;

use bottega::{
    Request,
    events::{AgentEvent, Event},
    viewport::Viewport,
};
use bottega_cluster::{
    LogLine,
    client::SharedViewport,
    energy::{JobEnergy, MachineEnergy},
    messages::SeenMessages,
    presence::PresenceState,
    rules_of_job::{JobRules, ZoneRules},
    uploads::{Submission, UploadOffer, UploadState},
    view::JobView,
    web_secrets::TokenRole,
    web_tokens::{TokenHolder, WebToken},
};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use crate::{live::LiveJob, problem::Problem};

/// An order to a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobOrder {
    /// Suspends the job until it is resumed.
    Pause,
    /// Resumes the job.
    Resume,
    /// Cancels the job.
    Cancel,
    /// Sets the priority, 1 to 1000.
    Priority(u32),
    /// Removes the job with its picture.
    Remove,
}

/// The agents of a job, and the totals of its auction.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct JobAgents {
    /// The agents, each with its V_cp, credit and reliability.
    pub agents: Vec<AgentEvent>,
    /// The totals of the auction.
    pub auction: AuctionSum,
}

/// Totals over all rounds of an auction and all thefts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct AuctionSum {
    /// Total number of rounds.
    pub rounds: u64,
    /// Number of rounds with several bidders.
    pub contested: u64,
    /// Number of zones awarded to another agent than the first that needed one, because it finishes them sooner.
    pub outbid: u64,
    /// Number of rounds whose outcome was changed by credit.
    pub credit_decided: u64,
    /// Number of bids for single zones, over all rounds.
    pub bids: u64,
    /// Number of zones, or parts of zones, awarded.
    pub awards: u64,
    /// Number of thefts: an agent takes zones that wait at another agent.
    pub thefts: u64,
    /// Number of zones taken in all thefts.
    pub stolen: u64,
}

/// A machine that is present in the farm.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MachineStatus {
    /// Name of the process.
    pub name: String,
    /// The state: `active`, `suspended` or `terminated`.
    pub state: &'static str,
    /// The state that the machine was ordered to take.
    pub ordered: &'static str,
    /// `busy`: working for its job; `waiting`: without a job, or without work in it at present; `viewing`: rendering samples for
    /// a viewport.
    pub activity: &'static str,
    /// Number of CPU threads.
    pub threads: usize,
    /// Devices other than the processors, used if a job allows it: names of GPUs, addresses of boards.
    pub devices: Vec<String>,
    /// Number of the job that the machine works on; `null`: none.
    pub job: Option<u32>,
    /// The identity of the machine's build.
    pub version: String,
    /// True if the machine can be suspended, resumed and terminated; false for the process that submitted a job.
    pub takes_orders: bool,
    /// True if the machine may only paint zones.
    pub is_guest: bool,
    /// The machine's tags, which jobs can require.
    pub tags: Vec<String>,
    /// The machine's reliability in the jobs so far: predicted over measured time, 1 if zones took as long as predicted.
    /// `null`: unknown.
    pub reliability: Option<f64>,
    /// V_cp, credit and failures of its agents in its current job.
    pub agents: Vec<AgentEvent>,
    /// The last jobs that the machine has refused, with reasons.
    pub refusals: Vec<MachineRefusal>,
    /// The energy the machine has used for its current job, as reported by the job's leader. `null`: not reported.
    pub energy: Option<MachineEnergy>,
}

/// A job that a machine has refused.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct MachineRefusal {
    /// Number of the job.
    pub job: u32,
    /// The reason for the refusal, as text.
    pub reason: String,
}

/// The file of a picture: its name and its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PictureFile {
    /// Name of the file.
    pub name: String,
    /// Bytes of the file.
    pub bytes: Vec<u8>,
}

/// The kind of source that a door shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ShownKind {
    /// A farm: jobs and machines.
    Farm,
    /// The picture of one process: job 1.
    Picture,
}

/// A source of a door's data: a farm, or the picture of one process. Its methods may take some seconds.
pub trait ShownFarm: Send + Sync + 'static {
    /// Returns the kind of source.
    fn kind(&self) -> ShownKind;

    /// Returns all jobs, in the order of their numbers.
    ///
    /// # Errors
    /// The farm does not answer; the same holds for all other methods.
    fn jobs(&self) -> Result<Vec<JobView>, Problem>;

    /// Returns a job.
    ///
    /// # Errors
    /// No job has that number; likewise for all other methods with a job number.
    fn job(&self, number: u32) -> Result<JobView, Problem>;

    /// Returns the request of a job, to submit it again by [`Self::submit`] with the files of that job. Only fields that differ
    /// from their defaults are in it.
    ///
    /// # Errors
    /// Those of [`Self::job`]; or its request cannot be read, or the source is not a farm.
    fn request(&self, number: u32) -> Result<Value, Problem>;

    /// Returns the rows of a job's Blackboard: zones and agents.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn rows(&self, number: u32) -> Result<Vec<Event>, Problem>;

    /// Returns the agents of a job, and the totals of its auction; without agents and with zeros while they are unknown.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn agents(&self, number: u32) -> Result<JobAgents, Problem>;

    /// Returns the energy of a job, and its cost.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn energy(&self, number: u32) -> Result<JobEnergy, Problem>;

    /// Returns messages between the agents of a job from number `from` on, at most 2000 at a time. A farm collects them from the
    /// first call on.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn messages(&self, number: u32, from: u64) -> Result<SeenMessages, Problem>;

    /// Returns the rules that choose the settings of a job's zones.
    ///
    /// # Errors
    /// Those of [`Self::job`]; or the rules cannot be read, or the source is not a farm.
    fn rules(&self, number: u32) -> Result<JobRules, Problem>;

    /// Returns the verdict of the rules on a zone.
    ///
    /// # Errors
    /// Those of [`Self::rules`]; or there is no such zone.
    fn zone_rules(&self, number: u32, zone: u32) -> Result<ZoneRules, Problem>;

    /// Returns the log of a job, oldest line first.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn log(&self, number: u32) -> Result<Vec<LogLine>, Problem>;

    /// Returns the preview of a job as the bytes of a PNG file; `None`: there is nothing to show yet.
    ///
    /// # Errors
    /// Those of [`Self::job`]; or the picture is too large to show or cannot be read.
    fn preview(&self, number: u32) -> Result<Option<Vec<u8>>, Problem>;

    /// Returns the importance map of a job as the bytes of a PNG file; `None`: it is unknown.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn importance(&self, number: u32) -> Result<Option<Vec<u8>>, Problem>;

    /// Returns the finished picture of a job.
    ///
    /// # Errors
    /// Those of [`Self::job`]; or the picture is not finished, or not available here.
    fn picture(&self, number: u32) -> Result<PictureFile, Problem>;

    /// Returns the live state of a job, which is updated while the caller keeps it.
    ///
    /// # Errors
    /// Those of [`Self::job`]; or a thread cannot be started.
    fn live(&self, number: u32) -> Result<Arc<LiveJob>, Problem>;

    /// Returns the machines that are present, each process counted.
    ///
    /// # Errors
    /// Those of [`Self::jobs`].
    fn machines(&self) -> Result<Vec<MachineStatus>, Problem>;

    /// Executes an order to a job.
    ///
    /// - `by`: author of the order, for logs; the same holds for all other methods that change something.
    ///
    /// # Errors
    /// Those of [`Self::job`]; or the state of the job does not allow the order, or this machine is a guest of the farm. A source
    /// that is not a farm executes [`JobOrder::Cancel`] only.
    fn steer(&self, number: u32, order: JobOrder, by: &str) -> Result<(), Problem>;

    /// Requests that a finished or failed zone of a job is painted again.
    ///
    /// # Errors
    /// Those of [`Self::job`]; or there is no such zone, it is not finished, the job is over and its picture not stored, this
    /// machine is a guest of the farm, or the source is not a farm.
    fn requeue(&self, number: u32, zone: u32, by: &str) -> Result<(), Problem>;

    /// Orders a machine to take a state.
    ///
    /// - `machine`: the name of its process, as in [`MachineStatus::name`].
    /// - `standing`: the state.
    ///
    /// # Errors
    /// The machine is absent or takes no orders, this machine is a guest of the farm, or the source is not a farm.
    fn tell(&self, machine: &str, standing: PresenceState, by: &str) -> Result<(), Problem>;

    /// Registers a file that a client is about to upload. Returns the missing pieces.
    ///
    /// # Errors
    /// The offer is inconsistent or too large, there is no room, this machine is a guest of the farm, or the source is not a
    /// farm.
    fn offer(&self, offer: &UploadOffer) -> Result<UploadState, Problem>;

    /// Stores a piece of a file.
    ///
    /// - `digest`: the BLAKE3 hash of the piece, in hexadecimal.
    ///
    /// # Errors
    /// The piece is too large, does not match its digest or cannot be stored, this machine is a guest of the farm, or the source
    /// is not a farm.
    fn put_piece(&self, digest: &str, bytes: &[u8]) -> Result<(), Problem>;

    /// Submits a picture, or the frames of an animation. Returns the numbers of the jobs, one per picture.
    ///
    /// # Errors
    /// The request is invalid, a file was not uploaded, the scene cannot be rendered, this machine is a guest of the farm, or the
    /// source is not a farm.
    fn submit(&self, submission: Submission, by: &str) -> Result<Vec<u32>, Problem>;

    /// Returns the request of a submission with its files on this machine, so that its scene can be viewed.
    ///
    /// # Errors
    /// The request is invalid, a file was not uploaded, or this machine is a guest of the farm. A source that is not a farm knows
    /// the files of job 1 only.
    fn uploaded_here(&self, submission: Submission) -> Result<Request, Problem>;

    /// Lets free machines render samples of a viewport until the returned value is dropped. `None`: the source is not a farm, or
    /// its machines cannot help.
    fn share(&self, viewport: &Arc<Viewport>) -> Option<SharedViewport>;

    /// Returns the holder of a token; `None`: the token is unknown or revoked. Returns at once.
    fn holder(&self, token: &str) -> Option<TokenHolder>;

    /// Returns the current token of a role that is derived from the secrets: the one printed when the door opens, unless it was
    /// revoked.
    fn own_token(&self, role: TokenRole) -> String;

    /// Returns all tokens without their secrets: `see` and `steer`, and then the named ones in the order of their names.
    ///
    /// # Errors
    /// The farm does not answer.
    fn tokens(&self) -> Result<Vec<WebToken>, Problem>;

    /// Makes a named token. Returns it; it cannot be shown again.
    ///
    /// # Errors
    /// The name is invalid or taken, there are too many tokens, this machine is a guest of the farm, or the source is not a farm.
    fn make_token(&self, name: &str, role: TokenRole, by: &str) -> Result<String, Problem>;

    /// Revokes a token; `see` and `steer` are replaced by new ones.
    ///
    /// # Errors
    /// No token has that name, it is `see` or `steer` of a process that shares its secrets with no other, this machine is a guest
    /// of the farm, or the source is not a farm.
    fn revoke_token(&self, name: &str, by: &str) -> Result<(), Problem>;
}
