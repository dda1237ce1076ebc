//! Measured materials: a reflectance as a table, after Dupuy and Jakob 2018, *An Adaptive Parameterization for Efficient
//! Material Acquisition and Rendering*.
//!
//! Such a file (`.bsdf`) holds tensors: named arrays of numbers. For some directions of view, the *nodes*, it has a table
//! over the unit square. A point of the square stands for a direction of light: two warps lead from the square to the
//! facet that reflects it, so that most points fall where the material reflects most.

mod error;
mod files;
mod material;
mod node;
mod read;
pub(crate) mod stored;
mod tensor;
mod warp;

pub(crate) use files::MeasuredFiles;
pub use material::{Measured, Symmetry};
pub use node::NodeWeights;
pub use warp::{SquareTable, Warp};
