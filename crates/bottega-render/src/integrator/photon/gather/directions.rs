//! The directions of final gathering rays.

use glam::Vec3;

use super::state::{ArrivalKind, GatherState};
use crate::{
    bsdf::{BsdfSample, LobeFlags},
    density::SolidAnglePdf,
    photon::LightDirections,
    sampler::Quad,
    vertex::SurfaceVertex,
};

/// Settings of the final gathering at a surface.
pub(super) struct GatherSettings<'a> {
    /// Number of rays.
    pub(super) count: u32,
    /// `true`: the rays look only for emitters.
    pub(super) is_short: bool,
    /// Weight of reflected light, in [0, 1]: the rest is already interpolated.
    pub(super) unknown: f32,
    /// `true`: light in the broad lobes of the surface is already added.
    pub(super) is_known: bool,
    /// Distribution of incident light that directions are drawn from; `None`: the BSDF alone draws them.
    pub(super) aiming: Option<IncidentSampling<'a>>,
}

/// Importance sampling of gathering rays by the incident light.
#[derive(Clone, Copy)]
pub(super) struct IncidentSampling<'a> {
    /// Distribution of incident light.
    pub(super) arrival: LightDirections<'a>,
    /// `true`: the incident light alone draws directions; the BSDF does not.
    pub(super) is_matte: bool,
}

impl IncidentSampling<'_> {
    /// Returns the density of a unit direction.
    ///
    /// - `own`: its density by the BSDF.
    #[inline(always)]
    pub(super) fn pdf(&self, w: Vec3, own: SolidAnglePdf) -> SolidAnglePdf {
        SolidAnglePdf::new(self.arrival.mixed(w, own.per_sr(), self.is_matte))
    }
}

impl GatherSettings<'_> {
    /// Draws a direction. Returns it with its density by the BSDF, and the density that it was drawn with. `None`: the
    /// BSDF scatters nothing for these numbers.
    #[inline(always)]
    pub(super) fn drawn(&self, vertex: &SurfaceVertex<'_>, u: Quad) -> Option<(BsdfSample, SolidAnglePdf)> {
        // Sample the BSDF alone if the directions of light are unknown
        let Some(aiming) = self.aiming else {
            let sample = vertex.bsdf.sample(u[0], [u[1], u[2]])?;
            return Some((sample, SolidAnglePdf::new(sample.pdf)));
        };
        // Sample the BSDF for a share of the rays, except at matte surfaces
        if !aiming.is_matte && u[3] >= LightDirections::SHARE {
            let sample = vertex.bsdf.sample(u[0], [u[1], u[2]])?;
            let w = vertex.point.to_world(sample.wi);
            return Some((sample, aiming.pdf(w, SolidAnglePdf::new(sample.pdf))));
        }
        // Sample the distribution of incident light
        let w = aiming.arrival.sample([u[1], u[2]]);
        let wi = vertex.point.to_local(w);
        let (value, pdf) = vertex.bsdf.eval_pdf(wi);
        let sample = BsdfSample { wi, value, pdf, lobe: LobeFlags::DIFFUSE, eta: 1.0 };
        (pdf > 0.0).then_some((sample, aiming.pdf(w, SolidAnglePdf::new(pdf))))
    }
}

impl GatherState {
    /// Corrects throughput and MIS density of a path that has just scattered: its direction was drawn with `density`,
    /// not with the BSDF's density `own`.
    #[inline(always)]
    pub(super) fn redraw(&mut self, own: SolidAnglePdf, density: SolidAnglePdf) {
        if let ArrivalKind::Spread { pdf, .. } = &mut self.comes {
            self.throughput *= own / density;
            *pdf = density;
        }
    }
}
