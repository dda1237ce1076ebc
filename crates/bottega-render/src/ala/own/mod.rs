//! The error oracle: agents answer by their expected error, and measure where it is large.

mod look;
mod measure;
mod rounds;

pub(super) use look::look;
pub(super) use measure::measure;
pub(super) use rounds::sense;
