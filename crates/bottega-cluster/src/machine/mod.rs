//! A machine that works for a farm: its choice of a job, its part in it, and its owner's conditions.

pub(crate) mod member;
pub mod owner;
pub(crate) mod part;
mod part_observer;
mod power_counters;
pub(crate) mod prepared_job;
mod shares;
pub(crate) mod together;
pub mod usage_meter;
mod viewport_helper;
pub mod worker;
