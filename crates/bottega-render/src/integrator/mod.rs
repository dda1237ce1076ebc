//! Integrators: from a pixel's sample to radiance.

mod path;
mod volume;

pub use path::PathIntegrator;
pub(crate) use path::Painting;
pub(crate) use path::{Wanted, bsdf_at};
