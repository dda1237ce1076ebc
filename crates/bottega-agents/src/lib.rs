//! The FIPA agent platform: identifiers, messages, directories, life cycle, and the buses that carry them.
//!
//! No rendering words here. The decision that shaped it: every agent is a state machine (an event and the present
//! time go in, actions come out) and does no I/O; *drivers* carry its actions out, over channels in one process, over
//! a network, or in a simulator with virtual time. So one and the same value serves users and is put through a
//! thousand bad days by a test.
//!
//! | where | what |
//! |---|---|
//! | [`StateMachine`], [`Event`], [`Action`] | the shape of every agent |
//! | [`store`] | shared entries with revisions: compare-and-set, watches, fencing tokens |
//! | [`bus`], [`driver`] | what carries actions out: [`LocalPlatform`] on threads, [`Simulator`] in virtual time with faults |
//! | [`protocol`] | contract net, request, subscribe as parts that agents are built of |
//! | [`platform`] | Start Service, AMS, DF; [`platform::StandardAgent`] makes any machine obey the life cycle |
//! | [`wire`], [`sl`] | messages, envelopes and content as text |
//! | [`acc`], [`gateway`] | the channel that messages take in and out, and what makes strangers and agents understand each other |
//! | `driver::http`, `driver::node` (feature `http`) | the transport over sockets, and a whole platform that JADE can talk to |
//! | `driver::nats` (feature `nats`); [`codec`] | many machines over NATS; the form in which their messages travel |
//! | [`entry_store`], [`file_store`] | stores that drivers can use: in memory, shared, in a file that several processes have open |
//!
//! An agent that repeats what it hears, and one that asks it:
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
//! # Where is what
//!
//! | what | where |
//! |---|---|
//! | reading and writing of SL, ACL and envelopes | `src/sl.rs`, `src/platform/ontology/`, `src/wire/` |
//! | agents and services; how pages are kept in the store; life cycle | `src/platform/`; `src/platform/service.rs`; `src/platform/life_cycle.rs` |
//! | the protocols | `src/protocol/` |
//! | strangers: the gateway, the channel, the transport over sockets, all of it together | `src/gateway/`, `src/acc.rs`, `src/driver/http/`, `src/driver/node.rs` |
//! | agents in one process; in virtual time, and what is planned there | `src/driver/local/`; `src/driver/simulator.rs`, `src/driver/network.rs`, `src/driver/plan.rs` |
//! | messages, rows and pixels between machines, and the rights of a server's users | `src/driver/nats/`, `src/driver/nats/rights.rs` |
//! | shared rows and their names | `src/store.rs`, `src/key.rs` |
//! | a platform's pages in a file; the framing of logs | `src/file_store/`; `src/framing.rs` |
//! | a platform of two processes in bad weather | `tests/sim/` |

pub mod acc;
mod acl;
pub mod bus;
pub mod codec;
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
