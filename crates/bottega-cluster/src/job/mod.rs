//! The jobs of a farm as its server stores them, and the machines that work on them.
//!
//! [`JobBoard`](board::JobBoard) stores them; most other files here add methods to it, for one kind of data each.

pub(crate) mod activity;
pub mod blackboard;
pub(crate) mod board;
pub(crate) mod completion;
pub mod energy;
pub(crate) mod experience;
pub(crate) mod first_look;
pub mod job_film;
pub mod job_preview;
pub mod machines;
pub mod messages;
pub mod presence;
pub(crate) mod record;
pub mod refusals;
pub(crate) mod requeue;
pub mod rules_of_job;
pub(crate) mod shared_parts;
pub mod society;
pub(crate) mod stall_watch;
pub(crate) mod transport;
pub mod usage;
pub mod view;
mod zone_pixels;
