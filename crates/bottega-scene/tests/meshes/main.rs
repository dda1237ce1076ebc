//! Files that hold a mesh, loaded as scenes: PLY, OBJ with MTL, Mitsuba's serialized meshes.

mod fuzz;
#[path = "../mutation/mod.rs"]
mod mutation;
mod scenes;
mod support;
