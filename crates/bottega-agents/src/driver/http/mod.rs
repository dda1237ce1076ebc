//! FIPA's message transport over HTTP (FIPA00084): what comes in by POST, what goes out by POST.
//!
//! Reading and writing are functions of bytes ([`head`], [`multipart`]), so that they can be tried with anything; the
//! sockets are in [`server`] and [`client`]. Why this is not hyper's business: see `docs/decisions.md`.

pub mod client;
pub mod head;
pub mod multipart;
pub mod server;

/// The path under which a platform takes messages.
pub const PATH: &str = "/acc";
/// The most bytes of a head, of an answer's too.
pub const HEAD_BYTES_MAX: usize = 1 << 14;
/// The most bytes of a body: a message and its envelope.
pub const BODY_BYTES_MAX: usize = crate::wire::TEXT_BYTES_MAX + (1 << 20);
