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
    /// The agents: V_cp, credit, reliability.
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
    /// `busy`: working for its job; `waiting`: without a job, or without work in it at present.
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
    /// The machine's reliability in the jobs so far: estimated over measured time, 1 if zones took as long as promised.
    /// `null`: unknown.
    pub reliability: Option<f64>,
    /// V_cp, credit and failures of its agents in its current job.
    pub agents: Vec<AgentEvent>,
    /// The last jobs that the machine has refused, with reasons.
    pub refusals: Vec<MachineRefusal>,
    /// The energy the machine has used for its current job, as reported by the job's leader.
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
    /// Those of [`Self::job`].
    fn request(&self, number: u32) -> Result<Value, Problem>;

    /// Returns the rows of a job's Blackboard: zones and agents.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn rows(&self, number: u32) -> Result<Vec<Event>, Problem>;

    /// Returns the agents of a job.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn agents(&self, number: u32) -> Result<JobAgents, Problem>;

    /// Returns the energy of a job, and its cost.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn energy(&self, number: u32) -> Result<JobEnergy, Problem>;

    /// Returns messages between the agents of a job from number `from` on, a limited number at a time. A farm collects them
    /// from the first call on.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn messages(&self, number: u32, from: u64) -> Result<SeenMessages, Problem>;

    /// Returns the rules that choose the settings of a job's zones.
    ///
    /// # Errors
    /// Those of [`Self::job`]; or the rules cannot be read.
    fn rules(&self, number: u32) -> Result<JobRules, Problem>;

    /// Returns the result of the rules for a zone.
    ///
    /// # Errors
    /// Those of [`Self::job`]; or there is no such zone.
    fn zone_rules(&self, number: u32, zone: u32) -> Result<ZoneRules, Problem>;

    /// Returns the log of a job, oldest line first.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn log(&self, number: u32) -> Result<Vec<LogLine>, Problem>;

    /// Returns the preview of a job as a PNG file; `None`: nothing is painted yet.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn preview(&self, number: u32) -> Result<Option<Vec<u8>>, Problem>;

    /// Returns the importance map as a PNG file; `None`: it is unknown.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn importance(&self, number: u32) -> Result<Option<Vec<u8>>, Problem>;

    /// Returns the finished picture.
    ///
    /// # Errors
    /// The picture is not finished, or not available here.
    fn picture(&self, number: u32) -> Result<PictureFile, Problem>;

    /// Returns the live state of a job.
    ///
    /// # Errors
    /// Those of [`Self::job`].
    fn live(&self, number: u32) -> Result<Arc<LiveJob>, Problem>;

    /// Returns the machines that are present.
    ///
    /// # Errors
    /// Those of [`Self::jobs`].
    fn machines(&self) -> Result<Vec<MachineStatus>, Problem>;

    /// Executes an order to a job.
    ///
    /// - `by`: author of the order, for logs; the same holds for all other methods that change something.
    ///
    /// # Errors
    /// The state of the job does not allow the order.
    fn steer(&self, number: u32, order: JobOrder, by: &str) -> Result<(), Problem>;

    /// Requests that a finished or failed zone of a job is painted again.
    ///
    /// # Errors
    /// There is no such zone, or it is not finished.
    fn requeue(&self, number: u32, zone: u32, by: &str) -> Result<(), Problem>;

    /// Orders a machine to take a state.
    ///
    /// # Errors
    /// The machine is absent, or takes no orders.
    fn tell(&self, machine: &str, standing: PresenceState, by: &str) -> Result<(), Problem>;

    /// Registers a file that a client is about to upload. Returns the missing pieces.
    ///
    /// # Errors
    /// The offer is inconsistent or too large, or there is no room.
    fn offer(&self, offer: &UploadOffer) -> Result<UploadState, Problem>;

    /// Stores a piece of a file.
    ///
    /// - `digest`: the BLAKE3 hash of the piece, in hexadecimal.
    ///
    /// # Errors
    /// The piece does not match its digest, or cannot be stored.
    fn put_piece(&self, digest: &str, bytes: &[u8]) -> Result<(), Problem>;

    /// Submits a picture, or the frames of an animation. Returns the numbers of the jobs.
    ///
    /// # Errors
    /// The request cannot be rendered.
    fn submit(&self, submission: Submission, by: &str) -> Result<Vec<u32>, Problem>;

    /// Returns the request of a submission with its files on this machine, so that its scene can be viewed.
    ///
    /// # Errors
    /// A file is missing, or the source is not a farm.
    fn uploaded_here(&self, submission: Submission) -> Result<Request, Problem>;

    /// Lets free machines render samples of a viewport until the returned value is dropped. `None`: there are no other machines.
    fn share(&self, viewport: &Arc<Viewport>) -> Option<SharedViewport>;

    /// Returns the holder of a token; `None`: the token is unknown or revoked. Returns at once.
    fn holder(&self, token: &str) -> Option<TokenHolder>;

    /// Returns the token of a role that is printed when the door opens.
    fn own_token(&self, role: TokenRole) -> String;

    /// Returns all tokens, sorted by name, without their secrets.
    ///
    /// # Errors
    /// The farm does not answer.
    fn tokens(&self) -> Result<Vec<WebToken>, Problem>;

    /// Makes a token. Returns it; it cannot be shown again.
    ///
    /// # Errors
    /// The name is invalid or taken.
    fn make_token(&self, name: &str, role: TokenRole, by: &str) -> Result<String, Problem>;

    /// Revokes a token.
    ///
    /// # Errors
    /// No token has that name.
    fn revoke_token(&self, name: &str, by: &str) -> Result<(), Problem>;
}
