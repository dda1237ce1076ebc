//! The directions of rays that gather light.

use glam::Vec3;

use super::walk::{ArrivalKind, Place, Walk};
use crate::{
    bsdf::{BsdfSample, LobeFlags},
    photon::LightDirections,
    sampler::Quad,
};

/// How light is gathered at a surface.
pub(super) struct Gathering<'a> {
    /// How many rays.
    pub(super) count: u32,
    /// Whether they look for what shines alone.
    pub(super) is_short: bool,
    /// How much counts of what does not shine: the rest is known.
    pub(super) unknown: f32,
    /// Whether light from directions that the surface scatters to broadly has been added.
    pub(super) is_known: bool,
    pub(super) aiming: Option<Aiming<'a>>,
}

/// Where gathering rays go that are sent where light comes from.
#[derive(Clone, Copy)]
pub(super) struct Aiming<'a> {
    pub(super) arrival: LightDirections<'a>,
    /// Then the surface has no say in it.
    pub(super) is_matte: bool,
}

impl Aiming<'_> {
    /// Density of a unit direction, in sr⁻¹.
    ///
    /// - `own`: with which the surface alone would draw it.
    #[inline(always)]
    pub(super) fn pdf(&self, w: Vec3, own: f32) -> f32 {
        self.arrival.mixed(w, own, self.is_matte)
    }
}

impl Gathering<'_> {
    /// A direction, with the density that the surface would draw it with, and the one that it was drawn with.
    #[inline(always)]
    pub(super) fn drawn(&self, place: &Place<'_>, u: Quad) -> Option<(BsdfSample, f32)> {
        let Some(aiming) = self.aiming else {
            let sample = place.bsdf.sample(u[0], [u[1], u[2]])?;
            return Some((sample, sample.pdf));
        };
        if !aiming.is_matte && u[3] >= LightDirections::SHARE {
            let sample = place.bsdf.sample(u[0], [u[1], u[2]])?;
            return Some((sample, aiming.pdf(place.point.to_world(sample.wi), sample.pdf)));
        }
        let w = aiming.arrival.sample([u[1], u[2]]);
        let wi = place.point.to_local(w);
        let (value, pdf) = place.bsdf.eval_pdf(wi);
        let sample = BsdfSample { wi, value, pdf, lobe: LobeFlags::DIFFUSE, eta: 1.0 };
        (pdf > 0.0).then_some((sample, aiming.pdf(w, pdf)))
    }
}

impl Walk {
    /// Tells a path that has just been scattered that its direction was drawn with another density than the surface has for it.
    #[inline(always)]
    pub(super) fn redraw(&mut self, own: f32, density: f32) {
        if let ArrivalKind::Spread { pdf, .. } = &mut self.comes {
            self.throughput *= own / density;
            *pdf = density;
        }
    }
}
