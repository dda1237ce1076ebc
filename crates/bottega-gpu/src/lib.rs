//! Rays and paths on a GPU, as WGSL compute shaders through wgpu: resources of the allocator.
//!
//! - [`GpuRays`] puts a scene's triangles and spheres on a device and answers batches of rays: closest hits and occlusion. It is
//!   a [`Resource`](bottega_hra::Resource) for any work that implements [`RayWork`](bottega_hra::RayWork).
//! - [`GpuPaths`] puts whole scenes on a device, with lights, materials and textures, and renders blocks of pixels: a
//!   [`WindowedResource`](bottega_hra::WindowedResource) for [`RenderWork`](bottega_render::RenderWork). The blocks of a packet
//!   make one batch of paths, which move from kernel to kernel through queues on the device; only the sums per pixel come back.
//!
//! The allocator decides which work they get. The paths are those of the CPU's path integrator, with the same random numbers, but
//! without path guiding; `bottega_render::flat` writes the scene for the shaders.
//!
//! When a device is lost, its unit of work is returned and the device is opened again the next time the allocator tries it. A
//! command that wgpu refuses is an error, never a panic. Software adapters (llvmpipe) are used only when selected by name, for
//! tests.
//!
//! **The decision that shaped it**: instances are placed in world space before the upload, so that the shader has one tree and
//! one stack. A scene whose placed instances do not fit is refused by the GPU; the CPU can still render it.
//!
//! # Modules
//! | subject | files |
//! |---|---|
//! | adapters, an open device, the adapter's memory | `src/adapter.rs`, `src/context.rs`, `src/memory.rs` |
//! | scenes that a device may render, and those in its memory | `src/paths/shelf.rs`, `src/paths/resident.rs` |
//! | rays on a device: the tree, the traversal | `src/rays.rs`, `src/bvh.rs`, `src/traversal.rs`, `src/wgsl/traverse.wgsl` |
//! | paths on a device; the order of the kernels | `src/paths.rs`, `src/paths/`, `src/wgsl/plan.wgsl` |
//! | scattering on a device, and the records that it reads | `src/wgsl/bsdf/`, `src/material/` |
//! | constants, codes and record layouts shared by shaders and Rust | `src/shared/` |
//! | compiled kernels, kept between runs; the devices that are compiling | `src/pipeline_cache.rs`; `src/compiling.rs` |

mod adapter;
mod bvh;
mod compiling;
mod context;
mod device;
mod error;
mod geometry;
mod material;
mod memory;
mod paths;
mod pipeline_cache;
mod rays;
mod shared;
mod traversal;

pub use adapter::{AdapterInfo, AdapterKind, adapters};
pub use compiling::compiling;
pub use error::GpuError;
pub use memory::AdapterMemory;
pub use paths::{EncodedScene, GpuAdapter, GpuPaths, GpuScenes, PathOptions};
pub use rays::{GpuOptions, GpuRays};
