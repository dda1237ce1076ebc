//! Integrators: from a pixel's sample to radiance.

mod path;
mod turns;
mod volume;

pub use path::PathIntegrator;

pub(crate) use path::{PathRecord, Wanted, bsdf_at};
pub(crate) use turns::Painting;
