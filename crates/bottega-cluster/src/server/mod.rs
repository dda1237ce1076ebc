//! The NATS server of a farm: its process, members, storage and secrets, and the link of a process to it.

pub mod address;
mod admission;
pub mod deed_log;
pub(crate) mod discovery;
pub mod link;
mod members;
pub mod own_server;
pub(crate) mod patience;
pub mod ports;
mod process;
pub mod room;
mod supervisor;
pub mod up;
pub(crate) mod upkeep;
pub mod web_secrets;
pub mod web_tokens;
