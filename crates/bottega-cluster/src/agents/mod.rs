//! The farm as a FIPA platform, with its directories.

pub mod directories;
pub mod platform;
