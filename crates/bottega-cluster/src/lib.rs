//! The farm on NATS: many machines render one picture together.
//!
//! A job is a notice of the farm, its zones are rows of the Blackboard, and its scene and pixels are blobs. If the process
//! that leads a job dies, any other process takes over from what is stored.
//!
//! # Modules
//!
//! | what | where |
//! |---|---|
//! | the NATS server of a farm, run as a child process, and its configuration | [`up`], `src/server.rs`, `src/keeper.rs`, [`room`]; a server for one test or measurement: [`own_server`] |
//! | members of a farm and their permissions | `src/admission.rs`, `src/members.rs` |
//! | ports of a farm | [`ports`] |
//! | removal of old data of a farm | `src/upkeep.rs` |
//! | connecting to a farm: addresses, discovery on the local network, names | [`link`](mod@link), [`address`], `src/discovery.rs`, [`names`] |
//! | retries while a farm does not answer | `src/patience.rs` |
//! | the record of a job: a [`Request`](bottega::Request) and the digests of its files | [`job`](mod@job) |
//! | the jobs of a farm, their leaders and progress | [`job_board`], [`view`]; machines that refuse a job: [`refusals`] |
//! | submitting a picture; an animation | [`client`], [`animation`] |
//! | the Blackboard rows of a job; its agents, its auction and the credit of machines | [`blackboard`], [`society`] |
//! | processor time and energy of jobs: counters, totals, prices | [`usage`], `src/power_counters.rs`; [`energy`] |
//! | learned zone times of machines | `src/experience.rs` |
//! | what a user may see of a farm; guests see only their own jobs | `src/shown_farm.rs` |
//! | the presence of a machine; its activity | `src/presence.rs`, `src/activity.rs` |
//! | detection of jobs that wait although machines are free | `src/stall_watch.rs` |
//! | messages between the agents of a job, for observers | [`messages`] |
//! | the fuzzy rules of a job, evaluated for a zone | [`rules_of_job`] |
//! | commands to jobs and machines | [`jobs`], [`machine`]; rendering zones again: `src/requeue.rs` |
//! | the preview of a job while it is rendered; before its first zone | [`job_preview`]; `src/first_look.rs` |
//! | uploads in pieces from clients that are not machines of the farm, and jobs submitted with them | [`uploads`] |
//! | requests of jobs, to be submitted again with the same files | `src/asked_again.rs` |
//! | secrets that the HTTP servers of one farm share: token, certificate; access tokens of users; the log of actions | [`web_secrets`]; [`web_tokens`]; [`deed_log`] |
//! | transfer of scenes: files, pieces, sending, the cache | `src/sent_files.rs`, `src/chunks.rs`, `src/pieces.rs`, `src/transfer.rs`, [`cache`] |
//! | a machine that works for a farm; its choice of a job | [`worker`]; `src/shares.rs` |
//! | when the owner of a machine lets it work | [`owner`] |
//! | the transport between the processes of a job, over NATS | `src/transport.rs` |
//! | a job prepared on this machine; led or helped | `src/prepared_job.rs`, `src/part.rs`, `src/part_observer.rs` |
//! | photons and lighting agents, shared by all machines | `src/together.rs` |
//! | the farm as a FIPA platform; its jobs and machines as agents; painting agents of other platforms | [`platform`]; `src/platform/farm_agents/`; `src/platform/strangers/` |
//! | agents of jobs in the directories; removal of those whose process was killed | [`directories`] |
//! | the build identity of this farm process | [`build`](mod@build) |
//! | submitting a picture from a program | `examples/submit.rs` |

mod activity;
pub mod address;
mod admission;
pub mod animation;
mod asked_again;
pub mod blackboard;
pub mod build;
pub mod cache;
mod chunks;
pub mod client;
mod clock;
pub mod deed_log;
pub mod directories;
mod discovery;
pub mod energy;
pub mod error;
mod experience;
mod first_look;
pub mod job;
pub mod job_board;
pub mod job_preview;
pub mod jobs;
mod keeper;
pub mod link;
pub mod machine;
mod member;
mod members;
pub mod messages;
pub mod names;
pub mod own_server;
pub mod owner;
mod part;
mod part_observer;
mod patience;
mod pieces;
pub mod platform;
pub mod ports;
mod power_counters;
mod prepared_job;
mod presence;
pub mod refusals;
mod requeue;
pub mod room;
pub mod rules_of_job;
mod sent_files;
mod server;
mod shares;
mod shown_farm;
pub mod society;
mod stall_watch;
mod together;
mod transfer;
mod transport;
pub mod up;
mod upkeep;
pub mod uploads;
pub mod usage;
pub mod view;
pub mod web_secrets;
pub mod web_tokens;
pub mod worker;

pub use self::{
    activity::Activity,
    address::FarmAddress,
    client::{SubmittedJob, render},
    error::Error,
    job::{Job, JobState},
    job_board::JobBoard,
    link::{Credentials, FarmLink, link, link_as},
    transport::job_link,
};
