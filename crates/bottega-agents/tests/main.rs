//! The tests of bottega-agents that use it from outside, as one program.

mod nodes;
mod platform;
mod protocols;
mod sim;
mod support;
mod wire;
