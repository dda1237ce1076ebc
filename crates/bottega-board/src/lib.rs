//! A board behind a cable: another process or machine that traces rays for this machine's allocator.
//!
//! The paper's low-bandwidth resource (Pereira et al., *Efficient use of Multiple Hardware Components for Image Synthesis*,
//! sections 3.2.1 and 3.3.6): it holds the shapes of scenes in its memory and answers batches of rays, closest hits and
//! occlusion, which are sent in packets without waiting for answers. Its kernels are those of this program, so hits are
//! bit-identical, and so is the image.
//!
//! **Not for** deciding which work it gets: that is the allocator's task. It does not shade, and knows no materials.
//!
//! # Modules
//!
//! | subject | files |
//! |---|---|
//! | the board: its listener, its scenes, its limits | `src/server.rs` |
//! | the resource that sends packets to it | `src/remote.rs` |
//! | frames on the wire | `src/wire.rs` |
//! | shapes and rays as bytes | `src/codec.rs` |
//! | bandwidth limits for experiments | `src/throttle.rs` |
//! | measurement of the receiving rate | `src/timed_reader.rs` |

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
