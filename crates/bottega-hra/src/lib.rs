//! The Hardware Resource Allocator: keeps every processor of one machine at work.
//!
//! The renderer puts *work units* into a bounded *work bin* (a full one makes it wait) and takes answers from a
//! *results bin* of its own. A unit names a [`Primitive`] and refers to its data; *resources* (CPU lanes, a GPU, a
//! board) take from the bin what they can do. A resource that fails gives its unit back, to be done elsewhere, and is
//! suspended for a while. Every submitted unit is answered exactly once, or given back on cancellation.
//!
//! Source: Pereira et al., *Efficient use of Multiple Hardware Components for Image Synthesis*.
//!
//! **Not for** knowing what a primitive computes or what a device is: this crate sees only the cost and the bounds of a
//! unit. No recursion either: a work unit never submits another; the loop that takes answers does.
//!
//! **The decision that shaped this crate**: resources *pull*. There is no dispatcher thread between bin and resources,
//! so a unit costs two short locks and wakes only the threads that wait for it.
//!
//! ```
//! use bottega_hra::{Hra, HraConfig, Primitive, VirtualCpu, Work, WorkUnit};
//!
//! struct Square(u64);
//! impl Work for Square {
//!     type Output = u64;
//!     fn primitive(&self) -> Primitive {
//!         Primitive::PixelBlock
//!     }
//!     fn size(&self) -> u64 {
//!         1
//!     }
//! }
//!
//! let hra = Hra::new(HraConfig::default(), VirtualCpu::lanes(2, |work: Square| work.0 * work.0));
//! let client = hra.client();
//! client.submit_group((0..10).map(|n| WorkUnit::new(Square(n), n)).collect())?;
//! while let Some(answer) = client.take() {
//!     assert_eq!(answer.output, Ok(answer.ticket * answer.ticket));
//! }
//! # Ok::<(), bottega_hra::SubmitError>(())
//! ```
//!
//! # Modules
//!
//! | subject | files |
//! |---|---|
//! | units, primitives, resources | `src/work.rs`, `src/primitive.rs`, `src/resource.rs` |
//! | the allocator and its clients | `src/allocator.rs`, `src/client.rs` |
//! | all decisions | `src/policy/`: `core.rs` and `faults.rs` pass events to the values that decide |
//! | waiting work; resources and which are woken | `src/policy/waiting.rs`; `src/policy/resource_states.rs` |
//! | number and size of packets to a far resource; assignment of work | `src/policy/flow.rs`, `src/policy/cable.rs`, `src/policy/plan.rs`, `src/policy/placement.rs` |
//! | learned costs of primitives, kept between runs | `src/policy/cost.rs`, `src/policy/book.rs` |
//! | the policy on threads | `src/threads/` |
//! | the policy in virtual time | `src/simulate/` |
//! | activity of resources and bin: report, drawing, data | `src/report.rs`, `src/drawing.rs`, `src/timeline.rs` |
//! | batches of rays as work | `src/rays.rs` |
//! | adding a board | `examples/board.rs`; rules and guarantees: `docs/hra.md` |

mod activity;
mod allocator;
mod client;
mod config;
mod drawing;
mod policy;
mod primitive;
mod rays;
mod report;
mod resource;
mod resource_id;
pub mod simulate;
mod threads;
mod timeline;
mod transfer;
mod work;

pub use activity::Activity;
pub use allocator::{Hra, Lane};
pub use client::{HraClient, LifeTime};
pub use config::HraConfig;
pub use drawing::timeline_svg;
pub use policy::bin_log::{BinReport, BinStep};
pub use policy::book::{CostBook, CostBookError};
pub use policy::cost::{CostModel, split_work};
pub use policy::expiries::Expiries;
pub use policy::incident::{Fault, Incident};
pub use policy::time::Time;
pub use policy::timeline::Span;
pub use primitive::{DataId, Primitive, PrimitiveSet};
pub use rays::{RayQuery, RayWork};
pub use report::{HraReport, ResourceReport};
pub use resource::{Link, Resource, ResourceDescriptor, VirtualCpu, Window};
pub use resource_id::ResourceId;
pub use threads::far::{Packet, Reply, WindowedResource};
pub use threads::simulated::{Simulated, SimulatedModel};
pub use timeline::timeline_json;
pub use transfer::{CableUse, PacketUse, Transfer};
pub use work::{Closed, Completed, Failed, SubmitError, TrySubmit, UnitError, Work, WorkUnit};
