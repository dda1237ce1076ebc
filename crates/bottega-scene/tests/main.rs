//! The tests of bottega-scene that use it from outside, as one program.

mod gltf;
mod ies;
mod measured;
mod meshes;
mod mitsuba;
mod motion;
mod mutation;
mod pbrt;
mod pbrt_lenses;
mod pbrt_mappings;
mod pbrt_noise;
mod saved;
mod usd;
mod voxels;
