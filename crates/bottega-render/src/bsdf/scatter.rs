//! The trait of every kind of scattering.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::{BsdfSample, LobeFlags, TransportMode};

/// The scattering at one point, of one kind. `wo` is above the surface.
pub(super) trait Scatter {
    /// f in sr⁻¹ without the cosine, and the density with which `sample` draws `wi`; Dirac lobes left out of both. Where f is
    /// an estimate, the density may be one that is only like that of the samples.
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> (Spectrum, f32);

    /// Draws a direction, from numbers in [0, 1). Its weight has the right mean, also where density and value are estimates.
    fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample>;

    /// Share of the light arriving along `wo` that is scattered anywhere: an estimate.
    fn albedo(&self, wo: Vec3) -> Spectrum;

    /// What there is.
    fn lobes(&self) -> Lobes;

    /// The sample of a lobe that is spread over directions, `wi` drawn.
    #[inline]
    fn spread(&self, wo: Vec3, wi: Vec3, mode: TransportMode, lobe: LobeFlags, eta: f32) -> Option<BsdfSample> {
        let (value, pdf) = self.eval_pdf(wo, wi, mode);
        (pdf > 0.0 && value.max_element() > 0.0).then_some(BsdfSample { wi, value, pdf, lobe, eta })
    }
}

/// What lobes there are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lobes {
    /// Some light is spread over solid angles.
    pub(super) has_non_delta: bool,
    /// Light may go to the other side.
    pub(super) is_transmissive: bool,
    /// Perceptual roughness of the sharpest lobe.
    pub(super) roughness: f32,
}

impl BsdfSample {
    /// The sample of a Dirac lobe that scatters `energy` (f |cos θi|) into the one direction `wi`, chosen with
    /// probability `chance`.
    #[inline]
    pub(super) fn delta(wi: Vec3, energy: Spectrum, chance: f32, side: LobeFlags, eta: f32) -> Option<Self> {
        let value = energy / wi.z.abs();
        let sound = chance > 0.0 && value.max_element() > 0.0 && value.is_finite();
        sound.then_some(Self { wi, value, pdf: chance, lobe: side.union(LobeFlags::DELTA), eta })
    }
}

/// Splits a number in [0, 1) at `chance`: whether it is below, and where in its part it lies.
#[inline]
pub(super) fn split(u: f32, chance: f32) -> (bool, f32) {
    let first = u < chance;
    let rest = if first { u / chance } else { (u - chance) / (1.0 - chance) };
    (first, rest.clamp(0.0, super::warp::ONE_MINUS_EPSILON))
}
