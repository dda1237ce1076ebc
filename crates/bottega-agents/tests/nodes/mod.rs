//! Nodes of a platform that speak with others over real sockets.

mod federation;
mod gateway;
mod jade;

use crate::support;
