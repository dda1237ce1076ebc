//! The tests of bottega-image that use it from outside, as one program.

mod cryptomatte;
mod files;
