//! The irradiance sensor of an agent.

use std::{f32::consts::PI, sync::Arc};

use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    PhotonIntegrator,
    eye::{Eye, Hands, KnownLight, Spot},
};
use crate::{
    PathSettings, PhotonSettings, PreparedScene, RenderError, View,
    ala::Agents,
    bsdf::warp::cosine_hemisphere,
    integrator::path::PathIntegrator,
    interaction::Interaction,
    photon::{
        Passes, PhotonMaps, PhotonPlan,
        cache::{self, GatherSample, IrradianceRecord, Measurement},
    },
    sampler::{DimensionSet, PixelSampler},
    sampling::orthonormal_basis,
};

/// Rays by which the irradiance at a sensor is found, and those after which it is dark if none found any.
const RAYS: u32 = 256;
const RAYS_IN_THE_DARK: u32 = 48;

/// Where a sensor that goes by our own rules measures.
pub(crate) struct SensorPlace {
    pub(crate) point: Interaction,
    /// Of the surroundings that it stands for.
    pub(crate) width: f32,
    /// Least and greatest radius within which it may count.
    pub(crate) reach: [f32; 2],
    /// Rays to a cell of the hemisphere.
    pub(crate) effort: u32,
    /// Whether it is to be known where the light comes from.
    pub(crate) is_directed: bool,
}

/// The settings of the paths that sensors follow: those of the whole picture, whatever a zone of it is painted with.
pub(crate) fn sensing_settings(photons: &PhotonSettings, seed: u64) -> PathSettings {
    PathSettings {
        seed,
        max_depth: photons.bounces,
        guiding: false,
        photons: Some(*photons),
        ..PathSettings::default()
    }
}

impl<'a> PhotonIntegrator<'a> {
    /// One that sensors follow paths with.
    ///
    /// - `settings`: by [`sensing_settings`].
    pub(crate) fn sensing(
        prepared: &'a PreparedScene,
        settings: &'a PathSettings,
        photons: PhotonSettings,
        passes: Arc<Passes>,
    ) -> Result<Self, RenderError> {
        if prepared.needs_volume() {
            return Err(RenderError::PhotonsInMedia);
        }
        // Sensors are no one's view.
        let view = View { camera: 0, width: 1, height: 1 };
        let base = PathIntegrator::unguided(prepared, view, settings)?;
        Ok(Self { base, photons, passes, cache: None, view })
    }

    pub(crate) fn prepared(&self) -> &'a PreparedScene {
        self.base.prepared()
    }

    /// Where photons and agents are sent.
    pub(crate) fn plan(&self) -> &PhotonPlan {
        self.passes.plan()
    }

    /// Indirect irradiance at a point, on the side that it was looked at from: light that shines there straight is left out,
    /// and so is light over mirrors and glass alone, which photons bring.
    ///
    /// - `width`: of the surroundings that the sensor stands for.
    pub(crate) fn irradiance(
        &self,
        maps: &PhotonMaps,
        point: Interaction,
        width: f32,
        sampler: PixelSampler,
        hands: &mut Hands,
    ) -> Spectrum {
        let n: Vec3 = point.frame[2];
        let (s, t) = orthonormal_basis(n);
        let spot = Spot::new(point, width);
        let known = KnownLight { maps, cache: None, agents: None };
        hands.clear_bounces();
        let mut eye = Eye::new(self, known, sampler, &mut *hands);
        let mut sum = Spectrum::ZERO;
        for index in 0..RAYS {
            if index == RAYS_IN_THE_DARK && sum == Spectrum::ZERO {
                return Spectrum::ZERO;
            }
            let [u, v, ..] = sampler.split_quad(DimensionSet::scattering(0), index, RAYS);
            let local = cosine_hemisphere([u, v]);
            sum += eye.look_from(&spot, s * local.x + t * local.y + n * local.z, index).radiance;
        }
        hands.scale_bounces(PI / RAYS as f32);
        sum * (PI / RAYS as f32)
    }

    /// What a sensor that goes by our own rules measures: the same, with how it changes around.
    ///
    /// - `others`: stand for the light of all surfaces that they know.
    pub(crate) fn record(
        &self,
        maps: &PhotonMaps,
        place: SensorPlace,
        sampler: PixelSampler,
        others: &Agents,
        hands: &mut Hands,
    ) -> IrradianceRecord {
        let SensorPlace { point, width, reach, effort, is_directed } = place;
        let spot = Spot::new(point, width);
        let known = KnownLight { maps, cache: None, agents: Some(others) };
        let n = spot.n();
        hands.clear_bounces();
        let mut eye = Eye::new(self, known, sampler, &mut *hands);
        let look = |index: u32| {
            let [u, v, ..] = sampler.split_quad(DimensionSet::scattering(0), index, cache::RAYS * effort);
            eye.look_from(&spot, cache::direction(n, index / effort, [u, v]), index)
        };
        // Who stopped where the first rays found nothing would take dim corners for dark ones.
        let looks: Vec<GatherSample> = (0..cache::RAYS * effort).map(look).collect();
        let found = Measurement::new(looks, effort);
        let record = IrradianceRecord::new(spot.p(), n, &found, reach).with_bounces(hands.bounces());
        if is_directed { record.with_directions(&found) } else { record }
    }
}
