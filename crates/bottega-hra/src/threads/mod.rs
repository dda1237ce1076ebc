//! The policy run by threads in real time: one a resource, one that watches, and those of the submitters.
//!
//! No thread ever spins. Submitters put units into inlets, each with a lock of its own; whoever needs work, and only
//! then, takes the lock of the policy, empties all inlets and takes a packet. So the lock is taken once a packet, not
//! once a unit, and what is done under it goes by chunks of units. No code of the user runs under any lock, and no two
//! locks are held together but the policy's and that of an inlet, or of the list of clients.

pub(crate) mod alarm;
pub(crate) mod clients;
pub(crate) mod direct;
pub(crate) mod far;
pub(crate) mod inlets;
pub(crate) mod results_bin;
pub(crate) mod room;
pub(crate) mod settle;
pub(crate) mod shared;
pub(crate) mod simulated;
pub(crate) mod submit;
pub(crate) mod sync;
pub(crate) mod watch;
