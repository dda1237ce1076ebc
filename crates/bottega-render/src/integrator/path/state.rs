//! A path under way.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::{super::record::PathRecord, setup::PathIntegrator};
use crate::{
    camera::RayCone,
    guide::{Guide, Trail},
    lights::Receiver,
    sampler::PixelSampler,
};

/// Branches of a path that wait, at most.
pub(in crate::integrator) const BRANCHES_MAX: usize = 32;

/// Where the path comes from, as far as multiple importance sampling must know.
#[derive(Clone, Copy)]
pub(super) struct Previous {
    /// The point for which lights were sampled.
    pub(super) receiver: Receiver,
    /// Density per solid angle of the direction taken; `None`: light sampling could not have found what comes.
    pub(super) pdf: Option<f32>,
    /// The leaf of the guide whose agent chose among lights there; [`NO_LEAF`](super::guidance::NO_LEAF): none did.
    pub(super) leaf: u32,
}

/// A path under way.
pub(in crate::integrator) struct Path<'a> {
    pub(super) integrator: &'a PathIntegrator<'a>,
    pub(super) sampler: PixelSampler,
    pub(super) guide: Option<&'a Guide>,
    /// Where it is to be written down, to learn from it.
    pub(super) trail: Option<&'a mut Trail>,
    pub(super) throughput: Spectrum,
    pub(super) radiance: Spectrum,
    /// Of the solid that the path is in.
    pub(super) absorption: Spectrum,
    /// By how much the throughput is smaller than what the surfaces left of the light: because radiance was squeezed into
    /// a denser solid, or because the path was guided to where more light comes from than elsewhere.
    pub(super) roulette_scale: f32,
    pub(super) depth: u32,
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    pub(super) cone: RayCone,
    /// Where the camera's ray starts and how far it reaches, see [`CameraRay`].
    pub(super) start: f32,
    pub(super) reach: f32,
    pub(super) previous: Previous,
    /// What a unit of light is worth to the pixel; 0: nobody knows.
    pub(super) worth: f32,
    /// How much of one look at lights is due, below 1, on all branches together; `None`: no light was left out so far.
    pub(super) due: Option<f32>,
    pub(super) wants_albedo: bool,
    pub(super) record: PathRecord,
}

/// A path that waits to be followed from where it scattered. Its fields are those of [`Path`] once more: with this structure
/// in that one paths take a twentieth longer.
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
    pub(super) fn sampler(&self) -> &PixelSampler {
        &self.sampler
    }
}
