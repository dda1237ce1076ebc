//! A board behind a cable: another process, or another machine, that follows rays for the allocator of this one.
//!
//! The paper's low-bandwidth resource (Pereira et al., *Efficient use of Multiple Hardware Components for Image Synthesis*,
//! sections 3.2.1 and 3.3.6): it has the shapes of scenes in its memory and answers batches of rays, closest hits and
//! occlusion, that are sent in packets without waiting for answers. Its kernels are those of this program, so hits have the
//! same bits, and so has the picture.
//!
//! **Not for** deciding what it gets: that is the allocator's part. It shades nothing and knows no materials.
//!
//! # Modules
//!
//! | what | where |
//! |---|---|
//! | the board: its listener, its scenes, its limits | `src/server.rs` |
//! | the resource that sends packets to it | `src/remote.rs` |
//! | frames on the wire | `src/wire.rs` |
//! | shapes and rays as bytes | `src/codec.rs` |
//! | a cable that is slower than it is | `src/throttle.rs` |
//! | how fast bytes come | `src/timed_reader.rs` |

mod codec;
mod error;
mod remote;
mod server;
mod throttle;
mod timed_reader;
mod wire;

pub use error::BoardError;
pub use remote::{BoardAddress, RemoteBoard};
pub use server::{BoardOptions, BoardServer};
