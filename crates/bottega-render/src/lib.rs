//! Light transport: samplers, BSDFs, lights and integrators over a prepared scene.
//!
//! No network, no agents. All heavy work is handed to the Hardware Resource Allocator as work units; this crate says
//! what a unit computes on a processor, and owns all recursion above it.

pub mod ala;
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
mod mapping;
mod media;
mod prepare;
mod sampling;
mod settings;
mod sharing;
mod work;

pub use error::RenderError;
pub use filter::Filter;
pub use guide::UnreadGuide;
pub use prepare::{PrepareOptions, PreparedScene, SceneGeometry, build_accel};
pub use settings::{AgentSettings, AgentUse, DirectLight, Oracle, PathSettings, PhotonFilter, PhotonSettings, View};
pub use sharing::Sharing;
pub use survey::survey;
pub use work::{BlockOutput, BlockWork, ProbeWork, RenderOutput, RenderWork};

/// Luminance of linear Rec. 709 RGB.
pub(crate) fn luminance(color: bottega_scene::Spectrum) -> f32 {
    color.dot(glam::Vec3::new(0.2126, 0.7152, 0.0722))
}
