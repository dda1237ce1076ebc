//! The tests of bottega-farm that use it from outside, as one program.

mod common;
mod job;
mod peers;
mod sim;
mod simulate;
