//! The importer of Mitsuba's scenes, at its boundary: text in, scene out.

mod bad_input;
mod files;
mod fuzz;
mod lights;
mod materials;
#[path = "../mutation/mod.rs"]
mod mutation;
mod parameters;
mod real_scenes;
mod sensors;
mod shapes;
mod support;
