//! Rays, bounding volume hierarchies, and functions that are bit-identical on all platforms.
//!
//! [`Accel`] answers the two questions that light transport asks of geometry: what does this ray hit first
//! ([`Accel::intersect`]), and does it hit anything ([`Accel::occluded`])? It holds triangle meshes, instances of them
//! and analytic spheres. It knows no materials, texture coordinates or normals: a [`Hit`] names the instance and the
//! triangle, and the caller looks up the rest.
//!
//! The decision that shaped this crate: *a hit is a function of the ray and the scene*. Two processors with different
//! vector units give the same bits, a tree built by one thread equals the tree built by sixty-four, and of two surfaces
//! at the same distance the one with the lower number is hit, for any order of traversal. So different
//! machines may render parts of a picture, and pictures can be compared bit for bit.
//!
//! [`math`] has the elementary functions for the same purpose.
//!
//! # Modules
//!
//! | contents | files |
//! |---|---|
//! | rays and hits | `src/ray.rs` |
//! | the acceleration structure | `src/accel.rs` |
//! | traversal: closest hit and occlusion, one source for all vector units | `src/traverse.rs`, `src/traverse/` |
//! | tree build; binary trees for other node formats | `src/build.rs`, `src/build/`; `src/build/binary.rs` |
//! | the tree in memory | `src/tree.rs`, `src/arena.rs` |
//! | geometry that moves; its trees | `src/motion.rs`; `src/moving_tree.rs`, `src/build/moving.rs`, `src/traverse/moving.rs` |
//! | bit-identical functions; SplitMix64 | `src/math.rs`; `src/split_mix.rs` |
//! | other code compiled for the available vector unit | `src/compiled.rs` |
//! | tests against brute force; rays that must not leave closed meshes | `tests/rays.rs`; `tests/support/leaks.rs`,
//! `examples/leaks.rs` |

pub mod math;

mod accel;
mod arena;
mod build;
pub mod compiled;
mod geometry;
mod instance;
mod memory;
mod motion;
mod moving_tree;
mod ray;
mod split_mix;
mod traverse;
mod tree;

pub use accel::Accel;
pub use build::{Binary, BinaryTree, Shape};
pub use geometry::{BuildError, BuildOptions, InstanceGeometry, MeshGeometry, Precision, SphereGeometry};
pub use memory::prefetch;
pub use motion::{KeySpan, MeshKeyGeometry, MotionGeometry, MovingTransform, SphereKeyGeometry};
pub use ray::{Aabb, Hit, Ray};
pub use split_mix::{SplitMix64, mix64};
