//! The use of a farm: submitting pictures and animations, sending files, controlling jobs, fetching pictures.

pub mod animation;
pub mod jobs;
mod resubmission;
mod shared_viewport;
mod shown_farm;
pub mod submit;
mod transfer;
pub mod uploads;

pub use self::{
    shared_viewport::{SharedViewport, ViewportMachine, share_viewport},
    submit::{FarmPicture, RenderOutcome, SubmittedJob, render, submit},
};

/// The name of a picture for which a submission gives none.
const PICTURE: &str = "picture.exr";
