//! The paper's oracle: four kinds of sensors with their medians, gold miners, and medians of neighbours.

mod answer;
mod dig;
mod fitted;
mod miner;

pub(super) use answer::answers;
pub(super) use dig::dig;
pub(super) use fitted::FittedSensors;
