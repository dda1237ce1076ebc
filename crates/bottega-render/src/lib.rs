//! Light transport: samplers, BSDFs, lights and integrators over a prepared scene.
//!
//! No network, no agents. All heavy work is submitted to the Hardware Resource Allocator as work units; this crate
//! defines what a unit computes on a CPU, and controls all recursion above it.
//!
//! # Modules
//!
//! | what | where |
//! |---|---|
//! | prepared scenes: surfaces, everything | `src/surfaces.rs`, `src/prepare.rs` |
//! | prepass of a picture | `src/prepass.rs` |
//! | the technique of each zone, paths or photons; the trial that chooses it | `src/technique.rs`, `src/integrator/by_zone.rs` |
//! | luminance | `src/color.rs` |
//! | densities of light sampling, by solid angle and by area | `src/density.rs` |
//! | quasi-random numbers | `src/sampler.rs`, `src/sampler/sobol.rs` |
//! | BSDFs; the BSDF at a point | `src/bsdf/`, `src/shading.rs` |
//! | light below surfaces: the medium inside, the walk | `src/bsdf/subsurface.rs`, `src/integrator/volume/subsurface.rs` |
//! | light sampling: light tree, portals | `src/lights/tree.rs`, `src/lights/portal.rs` |
//! | light kept apart by groups of lights or kinds of paths | `src/lights/groups.rs`, `src/lights/path_kind.rs`, `src/integrator/group_sums.rs` |
//! | steps of all integrators at a vertex; the rays that leave it | `src/vertex.rs`, `src/segment.rs` |
//! | textures mapped by position | `src/mapping.rs` |
//! | meshes displaced by textures; refined meshes | `src/displacement.rs`, `src/displacement/refined.rs` |
//! | media: homogeneous, varying in space | `src/media.rs`, `src/media/varying.rs` |
//! | path tracing: direct light and continuation, interleaved paths, media | `src/integrator/path.rs`, `src/integrator/path/`, `src/integrator/turns.rs`, `src/integrator/volume.rs` |
//! | what moves while the shutter is open; surfaces and lights at a time | `src/motion.rs`; `src/interaction/moving.rs`, `src/lights/posed.rs` |
//! | parts common to all integrators; the record of a sample | `src/integrator/transport.rs`, `src/integrator/record.rs` |
//! | path guiding; learnt choice of lights | `src/guide/`, `src/lights/choice.rs` |
//! | Russian roulette and splitting by agents; the trial of their efficiency | `src/guide/agent.rs`, `src/guide/expected.rs`, `src/integrator/path/branch.rs`, `src/integrator/path/trial.rs` |
//! | photons: emission, tracing, map, casting, storage | `src/lights/emission.rs`, `src/photon/trace.rs`, `src/photon/map.rs`, `src/photon/cast.rs`, `src/photon/store.rs` |
//! | Cryptomatte identities of the scene's parts; first surfaces of samples | `src/identities.rs`; `src/integrator/surface.rs` |
//! | extent of the visible part; plans of photons and agents | `src/extent.rs`, `src/photon/extent.rs`, `src/photon/plan.rs`, `src/lights/emission/plan.rs` |
//! | light by its number of bounces | `src/photon/bounces.rs` |
//! | photon integrator, irradiance cache | `src/integrator/photon/`, `src/photon/cache.rs` |
//! | lighting agents: by the paper, by expected error; their use by the integrator | `src/ala/sense.rs`, `src/ala/paper/`, `src/ala/own/`, `src/integrator/photon/gather.rs` |
//! | useful data density | `src/ala/ludd.rs` |
//! | casting shared among machines; serialized photons and agents | `src/sharing.rs`, `src/photon/bytes.rs`, `src/ala/bytes.rs` |
//! | survey, its probes of cost; glimpses for preview | `src/survey.rs`, `src/survey/probe.rs`, `src/survey/glimpse.rs` |
//! | flat scenes for GPUs, and the layout of their records | `src/flat.rs`, `src/flat/`, `src/flat/layout.rs` |
//! | wavefront path tracing: rays traced by other devices, shading in between | `src/integrator/wave.rs`, `src/wave_work.rs` |
//! | work units of the allocator | `src/work.rs`, `src/photon/units.rs`, `src/ala/units.rs` |
//! | tests of scattering laws; comparison with pictures of other renderers | `tests/bsdf_laws/`, `tests/pictures/` |

pub mod ala;
pub mod bsdf;
pub mod camera;
pub mod filter;
pub mod flat;
pub mod integrator;
pub mod photon;
pub mod sampler;
pub mod survey;

mod catchers;
mod color;
mod density;
mod displacement;
mod error;
mod extent;
mod guide;
mod identities;
mod interaction;
mod lights;
mod mapping;
mod media;
mod motion;
mod parts;
mod prepare;
mod prepass;
mod sampling;
mod segment;
mod settings;
mod shading;
mod sharing;
mod speed;
mod surfaces;
mod technique;
mod vertex;
mod wave_work;
mod work;

pub use bottega_kernels::Ray;
pub use catchers::ShadowCatchers;
pub use displacement::{DISPLACED_FACES_MAX, displace};
pub use error::RenderError;
pub use filter::Filter;
pub use guide::UnreadGuide;
pub use lights::{LightFinder, LightGroups, PathKind};
pub use prepare::{PrepareOptions, PreparedScene, SceneGeometry, build_accel};
pub use prepass::Prepass;
pub use settings::{AgentSettings, AgentUse, DirectLight, Oracle, PathSettings, PhotonFilter, PhotonSettings, View};
pub use sharing::Sharing;
pub use speed::SpeedProbe;
pub use surfaces::Surfaces;
pub use survey::survey;
pub use technique::{TechniqueEvidence, TechniqueJudge};
pub use wave_work::WaveWork;
pub use work::{BlockOutput, BlockWork, ProbeWork, RenderOutput, RenderWork};
