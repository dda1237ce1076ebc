//! Drivers, which run state machines as agents.

mod alarm;
#[cfg(feature = "http")]
pub mod ams_client;
#[cfg(feature = "http")]
mod asker;
#[cfg(feature = "http")]
mod fitted;
#[cfg(feature = "http")]
pub mod http;
pub mod local;
#[cfg(feature = "nats")]
pub mod nats;
mod network;
#[cfg(feature = "http")]
pub mod node;
mod plan;
mod queues;
pub mod random;
pub mod simulator;

pub use local::{LocalBus, LocalPlatform, Mailbox, Performer, Uplink};
pub use random::Random;
pub use simulator::{Faults, Simulator, World};
