//! The tests of bottega-engines that use it from outside, as one program.

mod builtin;
mod urgency;
