//! Rays and paths on a GPU, as WGSL compute through wgpu: resources of the allocator.
//!
//! - [`GpuRays`] puts a scene's triangles and spheres on a device and answers batches of rays: closest hits and occlusion. It is
//!   a [`Resource`](bottega_hra::Resource) for every work that is a [`RayWork`](bottega_hra::RayWork).
//! - [`GpuPaths`] puts whole scenes there, lights, materials and textures, and paints blocks of pixels: a
//!   [`WindowedResource`](bottega_hra::WindowedResource) for [`RenderWork`](bottega_render::RenderWork). The blocks of
//!   a packet make one batch of paths, which go on from kernel to kernel by queues on the device; nothing comes back but sums.
//!
//! They decide nothing about which work they get: that is the allocator's part. Paths are the processor's path integrator,
//! number for number, but for the guide; `bottega_render::flat` tells the shaders of the scene.
//!
//! A device that is lost gives its unit back and is made anew when the allocator tries it again; a command that wgpu
//! refuses is an error, never a panic. Software adapters (llvmpipe) are used when asked for by name, to test with.
//!
//! **The decision that shaped it**: instances are placed in world space before they are uploaded, so that the shader
//! has one tree and one stack. Scenes whose instances would not fit are refused to the GPU, not to the job.
//!
//! # Modules
//!
//! | what | where |
//! |---|---|
//! | devices, and one that is open | `src/adapter.rs`, `src/context.rs`, `src/memory.rs` |
//! | scenes that a device may paint, and those in its memory | `src/paths/shelf.rs`, `src/paths/resident.rs` |
//! | rays on a device: the tree, the traversal | `src/rays.rs`, `src/bvh.rs`, `src/traversal.rs`, `src/wgsl/traverse.wgsl` |
//! | paths on a device; which kernel comes after which | `src/paths.rs`, `src/paths/`, `src/wgsl/plan.wgsl` |
//! | scattering on a device, and the records that it reads | `src/wgsl/bsdf/`, `src/material/` |
//! | what shaders and Rust share: constants, codes, places in records | `src/shared/` |
//! | compiled kernels, kept between runs; which device compiles just now | `src/pipeline_cache.rs`; `src/compiling.rs` |

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
