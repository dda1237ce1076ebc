//! The source behind a door: a farm, or the picture of one process. Both answer the same questions.

use std::sync::Arc;

use bottega::{
    Request,
    events::{AgentEvent, Event},
};
use bottega_cluster::{
    energy::{JobEnergy, MachineEnergy},
    job::LogLine,
    machine::PresenceState,
    messages::SeenMessages,
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
    /// Nobody paints it until it is resumed.
    Pause,
    /// It goes on.
    Resume,
    /// It is called off.
    Cancel,
    /// It is so urgent.
    Priority(u32),
    /// It is forgotten, with its picture.
    Remove,
}

/// The agents of a job, and what its auction came to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, JsonSchema)]
pub struct JobAgents {
    /// The agents: V_cp, credit, how far their promises held.
    pub agents: Vec<AgentEvent>,
    /// What all rounds of the auction came to.
    pub auction: AuctionSum,
}

/// The sum of all rounds of an auction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct AuctionSum {
    /// How many there were.
    pub rounds: u64,
    /// Of them those with several bidders.
    pub contested: u64,
    /// Of them those that would have been otherwise if all had been believed alike.
    pub credit_decided: u64,
    /// Bids for single zones, all rounds together.
    pub bids: u64,
    /// Zones, or parts of zones, that were given away.
    pub awards: u64,
    /// How often an agent took zones from another.
    pub thefts: u64,
    /// Zones that changed hands so.
    pub stolen: u64,
}

/// A machine that is there.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MachineStatus {
    /// The process.
    pub name: String,
    /// `active`, `suspended` or `terminated`.
    pub state: &'static str,
    /// What it is told to be.
    pub ordered: &'static str,
    /// `busy`: at work for its job; `waiting`: it has none, or there is nothing for it to do in it just now.
    pub activity: &'static str,
    /// Its processors.
    pub threads: usize,
    /// What paints beside them, where a job lets it: names of GPUs, addresses of boards.
    pub devices: Vec<String>,
    /// The job that it paints.
    pub job: Option<u32>,
    /// The identity of its build.
    pub version: String,
    /// Whether it can be suspended, resumed and terminated; not the process that asked for a job.
    pub takes_orders: bool,
    /// Whether it may paint and no more.
    pub is_guest: bool,
    /// What it says that it is, by which jobs ask for it.
    pub tags: Vec<String>,
    /// How far its promises held in the jobs so far: 1, when what it promised took as long as it said. `null`: not known.
    pub reliability: Option<f64>,
    /// V_cp, credit and failures in the job that it paints; there may be several agents.
    pub agents: Vec<AgentEvent>,
    /// The last jobs that it does not paint, and why.
    pub refusals: Vec<MachineRefusal>,
    /// What it has used for the job that it paints, as its leader tells.
    pub energy: Option<MachineEnergy>,
}

/// A job that a machine does not paint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct MachineRefusal {
    /// The job.
    pub job: u32,
    /// Why.
    pub reason: String,
}

/// The file of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PictureFile {
    /// What it is called.
    pub name: String,
    /// What is in it.
    pub bytes: Vec<u8>,
}

/// What a door shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum ShownKind {
    /// A farm: jobs and machines.
    Farm,
    /// The picture of one process: job 1.
    Picture,
}

/// A farm, or the picture of one process. Its methods may take some seconds.
pub trait ShownFarm: Send + Sync + 'static {
    /// Which of the two it is.
    fn kind(&self) -> ShownKind;

    /// All jobs, by number.
    ///
    /// # Errors
    /// The farm does not answer; so of all others.
    fn jobs(&self) -> Result<Vec<JobView>, Problem>;

    /// A job.
    ///
    /// # Errors
    /// There is none of that number; so of all others that take a number.
    fn job(&self, number: u32) -> Result<JobView, Problem>;

    /// The request of a job, as [`Self::submit`] takes it with the files of that job: fields that differ from their defaults.
    ///
    /// # Errors
    /// As above.
    fn request(&self, number: u32) -> Result<Value, Problem>;

    /// The rows of a job's Blackboard: zones and agents.
    ///
    /// # Errors
    /// As above.
    fn rows(&self, number: u32) -> Result<Vec<Event>, Problem>;

    /// The agents of a job.
    ///
    /// # Errors
    /// As above.
    fn agents(&self, number: u32) -> Result<JobAgents, Problem>;

    /// The energy of a job, and what it costs.
    ///
    /// # Errors
    /// As above.
    fn energy(&self, number: u32) -> Result<JobEnergy, Problem>;

    /// Messages between the agents of a job from a number on, some at once; of a farm those since somebody has asked for them.
    ///
    /// # Errors
    /// As above.
    fn messages(&self, number: u32, from: u64) -> Result<SeenMessages, Problem>;

    /// The rules by which zones of a job are painted.
    ///
    /// # Errors
    /// As above, or they cannot be read.
    fn rules(&self, number: u32) -> Result<JobRules, Problem>;

    /// What the rules say of a zone.
    ///
    /// # Errors
    /// As above, or there is no such zone.
    fn zone_rules(&self, number: u32, zone: u32) -> Result<ZoneRules, Problem>;

    /// What has happened to a job.
    ///
    /// # Errors
    /// As above.
    fn log(&self, number: u32) -> Result<Vec<LogLine>, Problem>;

    /// What is painted by now, as a PNG file; `None`: nothing.
    ///
    /// # Errors
    /// As above.
    fn preview(&self, number: u32) -> Result<Option<Vec<u8>>, Problem>;

    /// The importance map as a PNG file, if it is known.
    ///
    /// # Errors
    /// As above.
    fn importance(&self, number: u32) -> Result<Option<Vec<u8>>, Problem>;

    /// The picture that is done.
    ///
    /// # Errors
    /// There is none, or not here.
    fn picture(&self, number: u32) -> Result<PictureFile, Problem>;

    /// A job as it changes.
    ///
    /// # Errors
    /// As above.
    fn live(&self, number: u32) -> Result<Arc<LiveJob>, Problem>;

    /// The machines that are there.
    ///
    /// # Errors
    /// As above.
    fn machines(&self) -> Result<Vec<MachineStatus>, Problem>;

    /// Steers a job.
    ///
    /// - `by`: who wants it, for logs; so of all others that change something.
    ///
    /// # Errors
    /// It cannot be done to this job, now or ever.
    fn steer(&self, number: u32, order: JobOrder, by: &str) -> Result<(), Problem>;

    /// Has a zone of a job painted again.
    ///
    /// # Errors
    /// There is none of that number, or it is not done.
    fn requeue(&self, number: u32, zone: u32, by: &str) -> Result<(), Problem>;

    /// Tells a machine what to do.
    ///
    /// # Errors
    /// It is not there, or takes no orders.
    fn tell(&self, machine: &str, standing: PresenceState, by: &str) -> Result<(), Problem>;

    /// Takes note of a file that a client is about to send.
    ///
    /// # Errors
    /// The offer contradicts itself, is too large, or there is no room.
    fn offer(&self, offer: &UploadOffer) -> Result<UploadState, Problem>;

    /// Takes a piece of a file.
    ///
    /// # Errors
    /// It is not what its digest says, or is not kept.
    fn put_piece(&self, digest: &str, bytes: &[u8]) -> Result<(), Problem>;

    /// Asks for a picture, or for the frames of an animation. Returns the numbers of the jobs.
    ///
    /// # Errors
    /// It cannot be painted.
    fn submit(&self, asked: Submission, by: &str) -> Result<Vec<u32>, Problem>;

    /// A request with its files on this machine, so that its scene can be looked at.
    ///
    /// # Errors
    /// There is no such file, or this is no farm.
    fn uploaded_here(&self, asked: Submission) -> Result<Request, Problem>;

    /// Whose token is shown. `None`: it is nobody's, or was revoked. Answered at once.
    fn holder(&self, token: &str) -> Option<TokenHolder>;

    /// The token of a role that whoever opened the door is told.
    fn own_token(&self, role: TokenRole) -> String;

    /// All tokens, by name.
    ///
    /// # Errors
    /// The farm does not answer.
    fn tokens(&self) -> Result<Vec<WebToken>, Problem>;

    /// Makes a token.
    ///
    /// # Errors
    /// The name is none or is taken.
    fn make_token(&self, name: &str, role: TokenRole, by: &str) -> Result<String, Problem>;

    /// Revokes a token.
    ///
    /// # Errors
    /// There is none of that name.
    fn revoke_token(&self, name: &str, by: &str) -> Result<(), Problem>;
}
