//! The state of a path.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    super::{group_sums::GroupSums, record::PathRecord},
    setup::PathIntegrator,
};
use crate::{
    camera::RayCone,
    density::SolidAnglePdf,
    guide::{Guide, Trail},
    lights::Receiver,
    sampler::PixelSampler,
};

/// Greatest number of branches of one path that wait at a time.
pub(in crate::integrator) const BRANCHES_MAX: usize = 32;

/// The previous vertex, as multiple importance sampling needs it.
#[derive(Clone, Copy)]
pub(super) struct Previous {
    /// The point that lights were sampled for.
    pub(super) receiver: Receiver,
    /// Density of the direction taken from there; `None`: light sampling could not have found light in that
    /// direction (the camera, or a perfectly specular lobe).
    pub(super) pdf: Option<SolidAnglePdf>,
    /// Guide leaf whose agent sampled the lights there; [`NO_LEAF`](super::guidance::NO_LEAF): no agent did.
    pub(super) leaf: u32,
}

/// A path being traced.
pub(in crate::integrator) struct Path<'a> {
    /// Integrator of the pixel.
    pub(super) integrator: &'a PathIntegrator<'a>,
    /// Random numbers of the sample and branch.
    pub(super) sampler: PixelSampler,
    /// Guide for directions and agents; `None`: not guided.
    pub(super) guide: Option<&'a Guide>,
    /// Receives the path's vertices for learning; `None` while rendering.
    pub(super) trail: Option<&'a mut Trail>,
    /// Throughput of the path, β.
    pub(super) throughput: Spectrum,
    /// Radiance found so far, by all branches.
    pub(super) radiance: Spectrum,
    /// Absorption coefficient of the solid that the path is in, per length.
    pub(super) absorption: Spectrum,
    /// Factor by which the throughput is smaller than the light that the surfaces passed on: because radiance was
    /// compressed on entering a denser solid, or because the path was guided to where more light comes from. Russian
    /// roulette multiplies by it.
    pub(super) roulette_scale: f32,
    /// Number of scattering events so far.
    pub(super) depth: u32,
    /// Start of the next ray.
    pub(super) origin: Vec3,
    /// Direction of the next ray; unit length.
    pub(super) direction: Vec3,
    /// Ray cone, for texture filtering.
    pub(super) cone: RayCone,
    /// Start of the camera ray and its length; see [`CameraRay`].
    pub(super) start: f32,
    pub(super) reach: f32,
    /// The previous vertex, for MIS.
    pub(super) previous: Previous,
    /// Importance of a unit of radiance to the pixel; 0: unknown. See [`RegionAgent::worth`](crate::guide::RegionAgent::worth).
    pub(super) worth: f32,
    /// Fraction of the next shadow ray that has accumulated, below 1, over all branches; `None`: no shadow ray has been
    /// skipped yet. See `is_due`.
    pub(super) due: Option<f32>,
    /// `true`: the albedo is wanted and not recorded yet.
    pub(super) wants_albedo: bool,
    /// Record of the path, over all branches.
    pub(super) record: PathRecord,
    /// Light of all branches by groups of lights, if it is wanted.
    pub(in crate::integrator) groups: Option<GroupSums<'a>>,
}

/// A branch that waits to be traced from the vertex it left. It repeats fields of [`Path`] because paths that contain
/// this structure trace a twentieth slower.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct Branch {
    pub(super) sampler: PixelSampler,
    pub(super) throughput: Spectrum,
    pub(super) absorption: Spectrum,
    pub(super) roulette_scale: f32,
    pub(super) depth: u32,
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    pub(super) cone: RayCone,
    pub(super) previous: Previous,
}

impl Branch {
    #[inline(always)]
    /// Returns the random numbers of the branch.
    pub(super) fn sampler(&self) -> &PixelSampler {
        &self.sampler
    }
}
