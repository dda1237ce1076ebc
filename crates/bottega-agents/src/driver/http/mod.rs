//! FIPA's message transport over HTTP (FIPA00084): messages arrive and leave by POST.
//!
//! Parsing and formatting are functions of bytes ([`head`], [`multipart`]), so that they can be tested with any input;
//! the sockets are in [`server`] and [`client`]. For why hyper is not used see `docs/decisions.md`.

pub mod client;
pub mod head;
pub mod multipart;
pub mod server;

/// The path at which a platform accepts messages.
pub const PATH: &str = "/acc";
/// Maximum length of a header, in bytes, also of responses.
pub const HEAD_BYTES_MAX: usize = 1 << 14;
/// Maximum length of a body, in bytes: a message with its envelope.
pub const BODY_BYTES_MAX: usize = crate::wire::TEXT_BYTES_MAX + (1 << 20);
