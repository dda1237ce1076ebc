//! The tests of bottega that use it from outside, as one program.

#[cfg(feature = "board")]
mod board;
mod request;
mod resources;
mod support;
mod techniques;
mod tev;
mod urgency;
mod viewport;
