//! The policy: all decisions without side effects, about order, placement, window and packet sizes, residency,
//! suspension and costs.
//!
//! Plain state machines: an event and the time go in, decisions come out. No clocks, locks, threads or user code. The
//! threads of `crate::threads` and the virtual time of `crate::simulate` drive the same [`Core`](core::Core).

pub(crate) mod account;
pub(crate) mod backoff;
pub(crate) mod bin;
pub(crate) mod bin_log;
pub(crate) mod book;
pub(crate) mod cable;
pub(crate) mod capabilities;
mod choice;
pub(crate) mod core;
pub(crate) mod cost;
pub(crate) mod demand;
pub(crate) mod expiries;
pub(crate) mod faults;
pub(crate) mod flow;
pub(crate) mod incident;
pub(crate) mod lane;
pub(crate) mod ledger;
pub(crate) mod length;
pub(crate) mod placement;
pub(crate) mod plan;
pub(crate) mod residency;
pub(crate) mod resource_states;
pub(crate) mod time;
pub(crate) mod timeline;
pub(crate) mod unit;
pub(crate) mod waiting;

#[cfg(test)]
mod tests;
