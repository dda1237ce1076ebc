//! The program, as a user runs it on one machine.

mod analysis;
mod bad_input;
mod blackboard;
mod configuration;
mod denoise;
mod layers;
mod learning;
mod names;
mod platform;
mod preview;
mod references;
mod requests;
mod rules;
mod said;
mod same_bits;
mod simulate;

use crate::support;
