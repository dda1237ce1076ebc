//! What users do with a farm: submit pictures and animations, send files, control jobs, fetch pictures.

pub mod animation;
mod asked_again;
pub mod jobs;
mod shown_farm;
pub mod submit;
mod transfer;
pub mod uploads;

pub use self::submit::{RenderOutcome, SubmittedJob, render, submit};
