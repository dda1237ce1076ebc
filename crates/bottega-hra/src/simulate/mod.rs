//! The allocator in virtual time: the very policy that the threads run, over modelled resources.
//!
//! For tests and for planning: hours of load over many resources take seconds, any fault can be injected, and the same
//! seed gives the same run. The world checks while it runs that every unit is answered exactly once and that no
//! resource is made to hold more data than it has memory for.

mod device;
mod load;
mod model;
mod random;
mod world;

pub use load::{Arrival, Load};
pub use model::{Faults, Model};
pub use random::LoadRandom;
pub use world::{AnsweredUnit, DayOutcome, simulate};
