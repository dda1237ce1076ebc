//! Nodes of a platform that speak with others over real sockets.

mod gateway;
mod jade;
mod nodes;
#[path = "../support/mod.rs"]
mod support;
