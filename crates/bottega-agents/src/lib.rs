//! The FIPA agent platform: identifiers, messages, directories, life cycle, and the buses that carry them.
//!
//! No rendering words here. The decision that shaped it: every agent is a state machine (an event and the present
//! time go in, actions come out) and does no I/O; *drivers* carry its actions out, over channels in one process, over
//! a network, or in a simulator with virtual time.

pub mod acc;
mod acl;
pub mod bus;
pub mod driver;
mod id;
mod machine;
pub mod platform;
pub mod protocol;
pub mod store;
mod time;
pub mod wire;

pub use acl::{AclMessage, Performative};
pub use bus::{Blob, BlobId, Bus};
pub use driver::{Faults, LocalBus, LocalPlatform, Mailbox, Performer, Random, Simulator, World};
pub use id::AgentId;
pub use machine::{Action, ActionOf, BoxedMachine, Event, EventOf, StateMachine};
pub use store::{Entry, Key, Revision, StoreReply, StoreRequest, Ticket};
pub use time::Time;
