//! The FIPA agent platform: identifiers, messages, directories, life cycle, and the buses that carry them.
//!
//! No rendering terms here. The decision that shaped this crate: every agent is a state machine (an event and the
//! current time go in, actions come out) without I/O; *drivers* execute its actions, over channels in one process, over
//! a network, or in a simulator with virtual time. So the same code serves users and is tested in simulation against
//! thousands of failures.
//!
//! | item | content |
//! |---|---|
//! | [`StateMachine`], [`Event`], [`Action`] | the shape of every agent |
//! | [`store`] | shared entries with revisions: compare-and-set, watches, fencing tokens |
//! | [`bus`], [`driver`] | execution of actions: [`LocalPlatform`] on threads, [`Simulator`] in virtual time with faults |
//! | [`protocol`] | contract net, request and subscribe, as components of agents |
//! | [`platform`] | Start Service, AMS, DF; [`platform::StandardAgent`] makes any state machine obey the life cycle |
//! | [`wire`], [`sl`] | messages, envelopes and content as text |
//! | [`acc`], [`gateway`] | the channel for messages to and from other platforms, and the translation of their content |
//! | `driver::http`, `driver::node` (feature `http`) | the transport over sockets, and a whole platform that JADE can talk to |
//! | `driver::nats` (feature `nats`); [`codec`] | several machines over NATS; the encoding of their messages |
//! | [`entry_store`], [`file_store`] | stores for drivers: in memory, shared, or in a file that several processes use |
//!
//! Example: an agent that repeats messages, and one that asks it:
//!
//! ```
//! use bottega_agents::*;
//!
//! struct Echo(AgentId);
//!
//! impl StateMachine for Echo {
//!     type Content = String;
//!     type Value = ();
//!     type Effect = String; // "show this to the user"
//!     type Completion = ();
//!
//!     fn handle(&mut self, _: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
//!         match event {
//!             Event::Message(message) if message.performative == Performative::QueryRef => {
//!                 let text = message.content.clone();
//!                 actions.push(Action::Send(message.reply(Performative::Inform, self.0.clone(), text)));
//!                 actions.push(Action::Stop);
//!             }
//!             Event::Message(message) => {
//!                 actions.push(Action::Effect(message.content));
//!                 actions.push(Action::Stop);
//!             }
//!             _ => {}
//!         }
//!     }
//!
//!     fn next_deadline(&self) -> Option<Time> {
//!         None
//!     }
//! }
//!
//! let (shown, show) = std::sync::mpsc::channel();
//! let platform = LocalPlatform::new(2)?;
//! for name in ["asker@here", "echo@here"] {
//!     let (id, shown) = (AgentId::new(name), shown.clone());
//!     platform.add(&id, Echo(id.clone()), Box::new(move |text, _| shown.send(text).unwrap()))?;
//! }
//! let (asker, echo) = (AgentId::new("asker@here"), AgentId::new("echo@here"));
//! platform.bus().publish(AclMessage::new(Performative::QueryRef, asker, echo, "ciao".to_owned()));
//! platform.wait();
//! assert_eq!(show.recv()?, "ciao");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Modules
//!
//! | subject | files |
//! |---|---|
//! | reading and writing of SL, ACL and envelopes | `src/sl.rs`, `src/platform/ontology/`, `src/wire/` |
//! | agents and services; their pages in the store; life cycle | `src/platform/`; `src/platform/service.rs`; `src/platform/life_cycle.rs` |
//! | the protocols | `src/protocol/` |
//! | other platforms: gateway, channel, HTTP transport, complete node | `src/gateway/`, `src/acc.rs`, `src/driver/http/`, `src/driver/node.rs` |
//! | agents in one process; in virtual time, with planned faults | `src/driver/local/`; `src/driver/simulator.rs`, `src/driver/network.rs`, `src/driver/plan.rs` |
//! | messages, rows and payloads between machines; rights of a server's users | `src/driver/nats/`, `src/driver/nats/rights.rs` |
//! | shared entries and their keys | `src/store.rs`, `src/key.rs` |
//! | a platform's pages in a file; the framing of logs | `src/file_store/`; `src/framing.rs` |
//! | test: a platform of two processes on a faulty network | `tests/sim/` |

pub mod acc;
mod acl;
pub mod bus;
pub mod codec;
mod conversation;
pub mod driver;
pub mod entry_store;
pub mod file_store;
pub mod framing;
pub mod gateway;
mod id;
mod key;
mod machine;
mod number_map;
pub mod platform;
pub mod protocol;
pub mod sl;
pub mod store;
mod time;
pub mod wire;

pub use acl::{AclMessage, Performative};
pub use bus::{Blob, BlobId, Bus};
pub use driver::{Faults, LocalBus, LocalPlatform, Mailbox, Performer, Random, Simulator, Uplink, World};
pub use id::{AgentId, machine_of};
pub use key::Key;
pub use machine::{Action, ActionOf, BoxedMachine, Event, EventOf, StateMachine};
pub use number_map::NumberMap;
pub use store::{Entry, Revision, StoreReply, StoreRequest, Ticket};
pub use time::Time;
