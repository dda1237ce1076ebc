//! The policy on threads in real time: one per resource, one for the watch, and those of the submitters.
//!
//! No thread ever spins. Submitters put units into inlets, each with its own lock; only a thread that needs work takes
//! the lock of the policy, empties all inlets and takes a packet. So the lock is taken once per packet, not per unit,
//! and the work under it is per chunk of units. No user code runs under any lock, and no two locks are held together
//! except the policy's with that of an inlet, or of the list of clients.

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
