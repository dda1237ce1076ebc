//! Many machines: `bottega up` has a meeting place, `bottega join` offers this machine, `bottega render --farm` asks all of
//! them for a picture, `bottega jobs` and `bottega machines` see and steer.
//!
//! A job is on the notices of the farm, its zones on the blackboard, its scene and pixels are blobs: whoever leads it may
//! die, and any other process goes on.

mod address;
mod admission;
mod animation;
mod cache;
mod chunks;
mod client;
mod discovery;
mod job;
mod job_board;
mod jobs;
mod join;
mod keeper;
mod link;
mod machine;
mod machines;
mod members;
mod names;
mod own_server;
mod part;
mod patience;
mod refusals;
mod room;
mod scene_files;
mod server;
mod shares;
mod studio;
mod together;
mod transfer;
mod up;
mod upkeep;
mod view;
mod worker;

#[cfg(test)]
pub(crate) use self::job_board::Seat;
pub(crate) use self::{
    address::{FarmAddress, state_folder},
    animation::animate,
    client::{Asked, Painted, write_picture},
    job::{JobState, PRIORITY, PRIORITY_MAX},
    job_board::JobBoard,
    jobs::{JobsArgs, run as jobs, set_priority, steer},
    join::{JoinArgs, run as join},
    link::{FarmLink, LoginArgs, link},
    machine::{MachineOrder, Roster, Standing},
    machines::{MachinesArgs, run as machines},
    own_server::{Entry, OwnServer},
    part::Tools,
    room::bytes_said,
    up::{UpArgs, run as up},
    view::{FarmView, JobView, MachineView},
};
