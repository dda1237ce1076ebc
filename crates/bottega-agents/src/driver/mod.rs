//! Drivers: they run state machines as agents.

mod alarm;
mod asker;
mod fitted;
pub mod http;
pub mod local;
pub mod nats;
mod network;
pub mod node;
mod plan;
mod queues;
pub mod random;
pub mod simulator;

pub use local::{LocalBus, LocalPlatform, Mailbox, Performer, Uplink};
pub use random::Random;
pub use simulator::{Faults, Simulator, World};
