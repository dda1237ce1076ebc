//! Light transport: samplers, BSDFs, lights and integrators over a prepared scene.
//!
//! No network, no agents. All heavy work is handed to the Hardware Resource Allocator as work units; this crate says
//! what a unit computes on a processor, and owns all recursion above it.
//!
//! # Where is what
//!
//! | what | where |
//! |---|---|
//! | a scene made ready: its surfaces, all of it | `src/surfaces.rs`, `src/prepare.rs` |
//! | what is found out of it before a picture | `src/prepass.rs` |
//! | numbers that are not random | `src/sampler.rs`, `src/sampler/sobol.rs` |
//! | scattering at a surface, and at one of its points | `src/bsdf/`, `src/shading.rs` |
//! | choice of a light: among many, through windows | `src/lights/tree.rs`, `src/lights/portal.rs` |
//! | textures laid by a place in the world | `src/mapping.rs` |
//! | media; those that vary in space | `src/media.rs`, `src/media/varying.rs` |
//! | paths: their light, where they go on, several in turn, through media | `src/integrator/path.rs`, `src/integrator/path/`, `src/integrator/turns.rs`, `src/integrator/volume.rs` |
//! | what all integrators share; what comes of a sample | `src/integrator/transport.rs`, `src/integrator/record.rs` |
//! | where light comes from, which lights matter and are seen | `src/guide/`, `src/lights/choice.rs` |
//! | ending and splitting of paths; whether it pays | `src/guide/agent.rs`, `src/guide/expected.rs`, `src/integrator/path/branch.rs`, `src/integrator/path/trial.rs` |
//! | photons: emission, tracing, map, casting, keeping | `src/lights/emission.rs`, `src/photon/trace.rs`, `src/photon/map.rs`, `src/photon/cast.rs`, `src/photon/store.rs` |
//! | how wide the visible part is; where photons and agents are sent | `src/extent.rs`, `src/photon/extent.rs`, `src/photon/plan.rs`, `src/lights/emission/plan.rs` |
//! | light by its number of bounces | `src/photon/bounces.rs` |
//! | pictures of photons, irradiance kept between places | `src/integrator/photon/`, `src/photon/cache.rs` |
//! | lighting agents: by the paper, by expected error; what a picture asks them | `src/ala/sense.rs`, `src/ala/paper/`, `src/ala/own/`, `src/integrator/photon/eye.rs` |
//! | useful data density | `src/ala/ludd.rs` |
//! | casting shared out among machines; photons and agents as bytes | `src/sharing.rs`, `src/photon/bytes.rs`, `src/ala/bytes.rs` |
//! | what a place costs, the survey; a glimpse for who looks around | `src/survey.rs`, `src/survey/probe.rs`, `src/survey/glimpse.rs` |
//! | a scene for devices, and the layout of its records | `src/flat.rs`, `src/flat/`, `src/flat/layout.rs` |
//! | paths in waves: rays asked of others, shading between | `src/integrator/wave.rs`, `src/wave_work.rs` |
//! | work units of the allocator | `src/work.rs`, `src/photon/units.rs`, `src/ala/units.rs` |
//! | laws of scattering; pictures held to those of others | `tests/bsdf_laws/`, `tests/pictures/` |

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
mod extent;
mod guide;
mod interaction;
mod lights;
mod mapping;
mod media;
mod parts;
mod prepare;
mod prepass;
mod sampling;
mod settings;
mod shading;
mod sharing;
mod speed;
mod surfaces;
mod wave_work;
mod work;

pub use bottega_kernels::Ray;
pub use error::RenderError;
pub use filter::Filter;
pub use guide::UnreadGuide;
pub use prepare::{PrepareOptions, PreparedScene, SceneGeometry, build_accel};
pub use prepass::Prepass;
pub use settings::{AgentSettings, AgentUse, DirectLight, Oracle, PathSettings, PhotonFilter, PhotonSettings, View};
pub use sharing::Sharing;
pub use speed::SpeedProbe;
pub use surfaces::Surfaces;
pub use survey::survey;
pub use wave_work::WaveWork;
pub use work::{BlockOutput, BlockWork, ProbeWork, RenderOutput, RenderWork};

/// Luminance of linear Rec. 709 RGB.
pub(crate) fn luminance(color: bottega_scene::Spectrum) -> f32 {
    color.dot(glam::Vec3::new(0.2126, 0.7152, 0.0722))
}
