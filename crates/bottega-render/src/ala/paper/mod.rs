//! The rules of Herubel, Biri and Deverly 2009: four kinds of sensors with their medians, gold miners, medians of neighbors.

mod answer;
mod dig;
mod fitted;
mod miner;

pub(super) use answer::answers;
pub(super) use dig::dig;
pub(super) use fitted::Fitted;
