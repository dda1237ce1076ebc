//! The use of a farm: submitting pictures and animations, sending files, controlling jobs, fetching pictures.

pub mod animation;
mod asked_again;
pub mod jobs;
mod shown_farm;
pub mod submit;
mod transfer;
pub mod uploads;

pub use self::submit::{FarmPicture, RenderOutcome, SubmittedJob, render, submit};
