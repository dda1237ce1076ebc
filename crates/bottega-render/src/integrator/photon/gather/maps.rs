//! Indirect light from photon maps, the irradiance cache and agents.

use std::f32::consts::FRAC_1_PI;

use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    GatherPath,
    buffers::GatherBuffers,
    state::{ArrivalKind, GatherState, is_sharp},
};
use crate::{
    ala::LightUse,
    bsdf::Bsdf,
    photon::{PhotonContribution, kept},
    shading::is_matte,
    vertex::SurfaceVertex,
};

impl GatherPath<'_> {
    /// Adds the reflection of interpolated indirect light at a matte surface. Returns the share of it that is known, in
    /// [0, 1]: fractional only where the camera sees the surface, so that the agents' regions have no visible edges.
    pub(super) fn add_interpolated(&mut self, state: &GatherState, vertex: &SurfaceVertex<'_>, bsdf: &Bsdf<'_>) -> f32 {
        let Some(agents) = self.agents else { return f32::from(u8::from(self.add_cached(state, vertex, bsdf))) };
        let point = vertex.point;
        let normals = [point.facing_ng(), point.frame[2]];
        let bounces = self.bounces_left(state);
        let is_shown = matches!(state.comes, ArrivalKind::Camera);
        let what_for = if is_shown { LightUse::Shown } else { LightUse::Gathered };
        // Interpolate between the agents' records at matte surfaces
        let ask = || agents.irradiance_at(point.p, normals, bounces, &mut self.buffers.sensors, what_for);
        let known = is_matte(bsdf).then(ask).flatten();
        let share = known.map_or(0.0, |known| known.share);
        self.buffers.tally.irradiance_computed += u64::from(share < 1.0);
        self.buffers.tally.irradiance_interpolated += u64::from(share == 1.0);
        // Reflect the known share: one bounce at the record, one here
        if let Some(known) = known.filter(|_| bounces >= 2) {
            let light = state.throughput * bsdf.albedo(vertex.wo) * known.irradiance * (FRAC_1_PI * share);
            self.add_shared(light, state.depth, |_| agents.shares_at(point.p, normals[1], bounces));
        }
        share
    }

    /// Adds the light of the photons at the place.
    pub(super) fn add_photons(&mut self, state: &GatherState, vertex: &SurfaceVertex<'_>, is_gathered: bool) {
        let SurfaceVertex { point, bsdf, .. } = vertex;
        let normal = point.facing_ng();
        let (prepared, most) = (self.prepared, self.bounces_left(state));
        let GatherBuffers { found, by_bounces, .. } = &mut *self.buffers;
        let mut sum = Spectrum::ZERO;
        let take = |photon: &PhotonContribution| {
            // Count the scattering here
            if photon.bounces >= most {
                return;
            }
            let wi = point.to_local(photon.to_light);
            // Reject photons that graze the surface and seem to arrive from its other side
            let is_sound = (wi.z > 0.0) == photon.is_before && photon.is_before == point.is_reflection(photon.to_light);
            let (f, pdf) = if is_sound { bsdf.eval_pdf(wi) } else { (Spectrum::ZERO, 0.0) };
            if is_gathered && is_sharp(prepared, pdf) {
                return;
            }
            let light = state.throughput * f * photon.light;
            sum += light;
            if let Some(sums) = by_bounces {
                sums[kept(state.depth + 1 + photon.bounces)] += light;
            }
        };
        let maps = self.maps;
        if self.integrator.photons.progressive {
            maps.estimator.gather_within(&maps.seen, point.p, normal, maps.reach_at(point.p), take);
        } else {
            // Caustics are sharper than diffuse light: use the smaller radius
            let reach = if is_gathered { maps.reach_at(point.p) } else { maps.irradiance_reach_at(point.p) };
            maps.estimator.gather(&maps.seen, point.p, normal, reach, found, take);
        }
        self.radiance += sum;
    }

    /// Adds the reflection of all light that the map has for a matte surface. Returns `false` if it has none there.
    pub(super) fn add_known(&mut self, state: &GatherState, vertex: &SurfaceVertex<'_>, bsdf: &Bsdf<'_>) -> bool {
        let point = vertex.point;
        let normal = point.facing_ng();
        if self.integrator.photons.separate_maps {
            return self.add_estimated(state, vertex, bsdf, normal);
        }
        let Some(number) = self.maps.irradiance_near(point.p, normal) else { return false };
        let reflected = state.throughput * bsdf.albedo(vertex.wo) * FRAC_1_PI;
        // Count the scattering here
        let most = self.bounces_left(state).saturating_sub(1);
        let known = &self.maps.irradiance;
        self.radiance += reflected * known.irradiance(number, most);
        if let Some(sums) = &mut self.buffers.by_bounces {
            for (light, bounces) in known.by_bounces(number).iter().zip(0..=most) {
                sums[kept(state.depth + 1 + bounces)] += reflected * *light;
            }
        }
        true
    }

    /// Adds light from separate maps: estimates the density of the photons near the place.
    fn add_estimated(
        &mut self,
        state: &GatherState,
        vertex: &SurfaceVertex<'_>,
        bsdf: &Bsdf<'_>,
        normal: Vec3,
    ) -> bool {
        let reflected = state.throughput * bsdf.albedo(vertex.wo) * FRAC_1_PI;
        let most = self.bounces_left(state);
        let GatherBuffers { found, by_bounces, .. } = &mut *self.buffers;
        let mut sum = Spectrum::ZERO;
        let is_known = self.maps.all_light_at(vertex.point.p, normal, found, |photon| {
            // Count the scattering here
            if photon.bounces < most {
                sum += reflected * photon.light;
                if let Some(sums) = by_bounces {
                    sums[kept(state.depth + 1 + photon.bounces)] += reflected * photon.light;
                }
            }
        });
        self.radiance += sum;
        is_known
    }

    /// Adds the reflection of cached indirect light at a matte surface. Returns `false` if the cache has none there.
    pub(super) fn add_cached(&mut self, state: &GatherState, vertex: &SurfaceVertex<'_>, bsdf: &Bsdf<'_>) -> bool {
        let Some(cache) = self.cache.filter(|_| is_matte(bsdf)) else { return false };
        let bounces = self.bounces_left(state);
        let Some(irradiance) = cache.at(vertex.point.p, vertex.point.frame[2], bounces) else { return false };
        if bounces >= 2 {
            self.radiance += state.throughput * bsdf.albedo(vertex.wo) * irradiance * FRAC_1_PI;
        }
        true
    }
}
