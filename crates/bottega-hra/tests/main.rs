//! The tests of bottega-hra that use it from outside, as one program.

mod behavior;
mod exactly_once;
mod faults;
mod finish_together;
mod simulated_day;
mod support;
