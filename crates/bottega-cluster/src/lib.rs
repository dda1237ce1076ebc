//! The farm on NATS: many machines paint one picture.
//!
//! A job is on the notices of the farm, its zones on the blackboard, its scene and pixels are blobs: whoever leads it may
//! die, and any other process goes on.
//!
//! # Modules
//!
//! | what | where |
//! |---|---|
//! | the meeting place, its server as a child process | [`up`], `src/server.rs`, `src/keeper.rs`, [`room`]; one for a test or a measurement: [`own_server`] |
//! | who is let in, and what each may do | `src/admission.rs`, `src/members.rs` |
//! | ports on which a farm listens | [`ports`] |
//! | what a farm lets go of | `src/upkeep.rs` |
//! | the way in: addresses, the local network, names | [`link`](mod@link), [`address`], `src/discovery.rs`, [`names`] |
//! | waiting for a farm that does not answer | `src/patience.rs` |
//! | a job: a [`Request`](bottega::Request) and the digests of its files | [`job`](mod@job) |
//! | jobs on the notices, who leads them; how they stand | [`job_board`], [`view`]; machines that leave a job out: [`refusals`] |
//! | asking for a picture; for frames | [`client`], [`animation`] |
//! | rows of a job, for people; its agents, its auction and the credit of machines | [`blackboard`], [`society`] |
//! | processor time and energy of jobs: counted, added up, priced | [`usage`], `src/power_counters.rs`; [`energy`] |
//! | what machines have learnt of how long zones take | `src/experience.rs` |
//! | what people are shown of it all: to a guest its own work alone | `src/shown_farm.rs` |
//! | a machine as its seat shows it; what it does | `src/presence.rs`, `src/activity.rs` |
//! | jobs that wait though machines are free | `src/stall_watch.rs` |
//! | messages between the agents of a job, for those who look on | [`messages`] |
//! | rules of a job, and what they say of a zone | [`rules_of_job`] |
//! | steering of jobs and machines | [`jobs`], [`machine`]; zones painted again: `src/requeue.rs` |
//! | a job as it looks while it is painted; before | [`job_preview`]; `src/first_look.rs` |
//! | files sent piece by piece by one who is no machine of the farm, and jobs asked for with them | [`uploads`] |
//! | requests of jobs, to be submitted again with the same files | `src/asked_again.rs` |
//! | what the HTTP doors of one farm know each other by: tokens, certificate; tokens that people make and revoke; what was done by them | [`web_secrets`]; [`web_tokens`]; [`deed_log`] |
//! | how scenes travel: files, pieces, sending, the cache | `src/sent_files.rs`, `src/chunks.rs`, `src/pieces.rs`, `src/transfer.rs`, [`cache`] |
//! | a machine that paints for a farm; which job it paints | [`worker`]; `src/shares.rs` |
//! | when the owner of a machine lets it paint | [`owner`] |
//! | the processes of a job, joined by NATS | `src/transport.rs` |
//! | a job made ready here; led or helped | `src/prepared_job.rs`, `src/part.rs`, `src/part_observer.rs` |
//! | photons and lighting agents, cast by all machines | `src/together.rs` |
//! | the farm as a FIPA platform; its jobs and machines as agents; agents of other platforms that paint | [`platform`]; `src/platform/farm_agents/`; `src/platform/strangers/` |
//! | agents of jobs in the directories; those of processes that were killed | [`directories`] |
//! | which build of the farm this is | [`build`](mod@build) |
//! | a picture asked for without a command line | `examples/submit.rs` |

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
