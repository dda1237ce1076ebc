//! The tests of bottega-fuzzy that use it from outside, as one program.

mod hostile;
mod language;
mod reference;
mod rules;
mod verify;
