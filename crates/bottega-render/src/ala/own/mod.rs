//! Our own rules: agents decide by the error that is to be expected of them, and go where it is great.

mod look;
mod measure;
mod rounds;

pub(super) use look::look;
pub(super) use measure::measure;
pub(super) use rounds::sense;
