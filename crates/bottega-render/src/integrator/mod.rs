//! Integrators: from a pixel's sample to radiance.

mod path;

pub use path::PathIntegrator;
pub(crate) use path::{Wanted, bsdf_at};
