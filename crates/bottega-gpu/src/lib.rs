//! Rays on a GPU: closest hits and occlusion as WGSL compute through wgpu, as one resource of the allocator.
//!
//! [`GpuRays`] puts a scene's triangles and spheres on a device and answers batches of rays. It is a
//! [`Resource`](bottega_hra::Resource) for every work that is a [`RayWork`](bottega_hra::RayWork). It decides nothing
//! about which batches it gets: that is the allocator's part.
//!
//! A device that is lost gives its unit back and is made anew when the allocator tries it again; a command that wgpu
//! refuses is an error, never a panic. Software adapters (llvmpipe) are used when asked for by name, to test with.
//!
//! **The decision that shaped it**: instances are placed in world space before they are uploaded, so that the shader
//! has one tree and one stack. Scenes whose instances would not fit are refused to the GPU, not to the job.

mod adapter;
mod bvh;
mod device;
mod error;
mod geometry;
mod rays;

pub use adapter::{AdapterInfo, AdapterKind, adapters};
pub use error::GpuError;
pub use rays::{GpuOptions, GpuRays};
