//! The tests of bottega-render that use it from outside, as one program.

mod bsdf_laws;
mod pictures;
mod render;
