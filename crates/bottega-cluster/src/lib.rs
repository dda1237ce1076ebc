//! The farm on NATS: many machines paint one picture.
//!
//! A job is on the notices of the farm, its zones on the blackboard, its scene and pixels are blobs: whoever leads it may
//! die, and any other process goes on.
//!
//! # Where is what
//!
//! - [`up`]: the meeting place; its server (`server`, `keeper`, `room`), who is let in (`admission`, `members`), what is let go
//!   (`upkeep`). [`own_server`]: one for a test or a measurement.
//! - [`link`]: the way in (`address`, `discovery`, `names`); who waits for a farm that does not answer: `patience`.
//! - [`job`]: what the farm keeps of a job: a [`Request`](bottega::Request) and the digests of its files; [`job_board`]: where;
//!   `refusals`: which machines leave it out; [`view`]: how it stands, for those who look.
//! - [`client`]: asks for a picture and has it in the end; [`animation`]: the same for frames. [`jobs`], [`machine`]: steers them.
//! - `scene_files`, `chunks`, `transfer`, [`cache`]: how scenes travel.
//! - [`worker`]: a machine that paints whatever is asked for: `shares` says which job, `studio` makes it ready, `part` paints it
//!   or leads it, `together` shares out what comes before the first zone.

pub mod address;
mod admission;
pub mod animation;
pub mod build;
pub mod cache;
mod chunks;
pub mod client;
mod discovery;
pub mod error;
pub mod job;
pub mod job_board;
pub mod jobs;
mod keeper;
pub mod link;
pub mod machine;
mod members;
pub mod names;
pub mod own_server;
mod part;
mod patience;
pub mod refusals;
pub mod room;
mod scene_files;
mod server;
mod shares;
mod studio;
mod together;
mod transfer;
pub mod up;
mod upkeep;
pub mod view;
pub mod worker;

pub use self::{
    address::FarmAddress,
    client::{SubmittedJob, render},
    error::Error,
    job::{Job, JobState},
    job_board::JobBoard,
    link::{Credentials, FarmLink, link},
};
