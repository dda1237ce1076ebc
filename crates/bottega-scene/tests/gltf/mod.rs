//! The glTF importer, tested by its input files and its scenes or errors.

mod animation;
mod bad_input;
mod compressed;
mod fuzz;
mod geometry;
mod materials;
mod pictures;
mod sample_scenes;
mod size;
pub(crate) mod support;
mod view;

use crate::mutation;
