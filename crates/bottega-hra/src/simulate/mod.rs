//! Simulation of the allocator in virtual time, with the same policy that the threads run, over modelled resources.
//!
//! For tests and planning: hours of load over many resources take seconds, any fault can be injected, and the same seed
//! gives the same run. Invariants are checked during the run: every unit is answered exactly once, and no resource has
//! to hold more data than its memory.

mod device;
mod load;
mod model;
mod random;
mod world;

pub use load::{Arrival, Load};
pub use model::{Faults, Model};
pub use random::LoadRandom;
pub use world::{AnsweredUnit, DayOutcome, simulate};
