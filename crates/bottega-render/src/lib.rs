//! Light transport: samplers, BSDFs, lights and integrators over a prepared scene.
//!
//! No network, no agents. All heavy work is handed to the Hardware Resource Allocator as work units; this crate says
//! what a unit computes on a processor, and owns all recursion above it.

pub mod bsdf;
pub mod camera;
pub mod filter;
pub mod flat;
pub mod integrator;
pub mod photon;
pub mod sampler;
pub mod survey;

mod error;
mod guide;
mod interaction;
mod lights;
mod media;
mod prepare;
mod sampling;
mod settings;
mod work;

pub use error::RenderError;
pub use filter::Filter;
pub use guide::UnreadGuide;
pub use prepare::{PrepareOptions, PreparedScene, build_accel};
pub use settings::{AgentUse, DirectLight, PathSettings, PhotonFilter, PhotonSettings, View};
pub use survey::survey;
pub use work::{BlockOutput, BlockWork, ProbeWork, RenderOutput, RenderWork};

/// Luminance of linear Rec. 709 RGB.
pub(crate) fn luminance(color: bottega_scene::Spectrum) -> f32 {
    color.dot(glam::Vec3::new(0.2126, 0.7152, 0.0722))
}

#[doc(hidden)]
pub static TUNE: [std::sync::atomic::AtomicU32; 8] = {
    use std::sync::atomic::AtomicU32;
    const fn a(x: f32) -> AtomicU32 {
        AtomicU32::new(x.to_bits())
    }
    [a(1.0), a(0.7), a(1.4), a(1.8), a(0.1), a(0.0), a(0.2), a(0.0)]
};
#[inline(always)]
pub(crate) fn tune(i: usize) -> f32 {
    f32::from_bits(TUNE[i].load(std::sync::atomic::Ordering::Relaxed))
}
