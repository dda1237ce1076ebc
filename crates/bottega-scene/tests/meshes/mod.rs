//! Mesh files, loaded as scenes: PLY, OBJ with MTL, Mitsuba's serialized meshes.

mod fuzz;
mod scenes;
mod support;

use crate::mutation;
