//! Scene files as chunks named by their content hash, stored by a farm and cached by its machines.

pub mod cache;
pub(crate) mod chunks;
pub(crate) mod pieces;
pub(crate) mod sent_files;
