//! Light transport: samplers, BSDFs, lights and integrators over a prepared scene.
//!
//! No network, no agents. All heavy work is handed to the Hardware Resource Allocator as work units; this crate says
//! what a unit computes on a processor, and owns all recursion above it.

pub mod bsdf;
pub mod survey;
