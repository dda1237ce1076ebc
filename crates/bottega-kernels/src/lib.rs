//! Rays, bounding volume hierarchies and the functions that must give equal bits everywhere.
//!
//! [`Accel`] answers the two questions that light transport asks of geometry: what does this ray hit first
//! ([`Accel::intersect`]), and does it hit anything ([`Accel::occluded`]). It holds triangle meshes, instances of
//! them and analytic spheres. It knows no material, no texture coordinate and no normal: a [`Hit`] names the
//! instance and the triangle, and the caller looks up the rest.
//!
//! The decision that shaped this crate: *a hit is a function of the ray and the scene*. Two processors with different
//! vector units give the same bits, a tree built by one thread is the tree built by sixty-four, and of two surfaces
//! at the same distance the one with the lower number is hit, in whatever order the tree was walked. So a picture
//! may be painted by unlike machines and compared bit for bit.
//!
//! [`math`] holds the elementary functions for the same end.
//!
//! # Where is what
//!
//! | what | where |
//! |---|---|
//! | rays and hits | `src/ray.rs` |
//! | geometry in, hits out | `src/accel.rs` |
//! | the closest hit, occlusion; one source for each vector unit | `src/traverse.rs`, `src/traverse/` |
//! | building of trees; binary trees for others | `src/build.rs`, `src/build/`; `src/build/binary.rs` |
//! | the tree in memory | `src/tree.rs`, `src/arena.rs` |
//! | functions of equal bits; SplitMix64 | `src/math.rs`; `src/split_mix.rs` |
//! | other work compiled for the vector unit at hand | `src/compiled.rs` |
//! | trees against brute force; rays that must not get out of closed meshes | `tests/rays.rs`; `tests/support/leaks.rs`, `examples/leaks.rs` |

pub mod math;

mod accel;
mod arena;
mod build;
pub mod compiled;
mod geometry;
mod instance;
mod memory;
mod ray;
mod split_mix;
mod traverse;
mod tree;

pub use accel::Accel;
pub use build::{Binary, BinaryTree, Shape};
pub use geometry::{BuildError, BuildOptions, InstanceGeometry, MeshGeometry, Precision, SphereGeometry};
pub use memory::prefetch;
pub use ray::{Aabb, Hit, Ray};
pub use split_mix::{SplitMix64, mix64};
