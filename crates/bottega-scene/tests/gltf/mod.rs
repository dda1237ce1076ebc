//! The glTF importer, through its front door: files in, scenes or errors out.

mod animation;
mod bad_input;
mod compressed;
mod fuzz;
mod geometry;
mod materials;
mod pictures;
mod sample_scenes;
mod size;
mod support;
mod view;

use crate::mutation;
