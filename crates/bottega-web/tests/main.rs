//! The tests of bottega-web that use it from outside, as one program.

mod door;
mod scripts;
