//! The tests of bottega-gpu that use it from outside, as one program.

mod device;
mod paths;
mod pictures;
mod residency;
