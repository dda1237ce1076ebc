//! `bottega up`, `web`, `join`, `jobs`, `machines` and `tokens`: the commands for farms.

mod blackboard;
mod energy;
mod jobs;
mod join;
mod learnt;
mod machines;
mod page_rows;
mod tokens;
mod up;
mod web;

pub(crate) use self::{
    blackboard::{BlackboardArgs, run as blackboard},
    jobs::{JobsArgs, run as jobs},
    join::{JoinArgs, run as join},
    machines::{MachinesArgs, run as machines},
    tokens::{TokensArgs, run as tokens},
    up::{UpArgs, run as up},
    web::{WebCommandArgs, run as web},
};
