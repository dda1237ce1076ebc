//! The importer of Mitsuba's scenes, tested by its input text and output scene.

mod bad_input;
mod files;
mod fuzz;
mod lights;
mod materials;
mod parameters;
mod real_scenes;
mod sensors;
mod shapes;
mod support;

use crate::mutation;
