//! The irradiance sensor of a lighting agent.

use std::{f32::consts::PI, sync::Arc};

use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    PhotonIntegrator,
    gather::{GatherBuffers, GatherPath, KnownLight, RecordPoint},
};
use crate::{
    ala::Agents,
    bsdf::warp::cosine_hemisphere,
    error::RenderError,
    integrator::path::PathIntegrator,
    interaction::Interaction,
    photon::{
        Passes, PhotonMaps, PhotonPlan,
        cache::{self, GatherSample, IrradianceRecord, Measurement},
    },
    prepare::PreparedScene,
    sampler::{DimensionSet, PixelSampler},
    sampling::orthonormal_basis,
    settings::{PathSettings, PhotonSettings, View},
};

/// Number of rays of an irradiance sensor, and the number after which it counts as dark if none found light.
const RAYS: u32 = 256;
const RAYS_IN_THE_DARK: u32 = 48;

/// A place where an agent measures irradiance by the error oracle.
pub(crate) struct SensorPlace {
    /// Surface point, with its frame.
    pub(crate) point: Interaction,
    /// Width of the surroundings that the sensor represents, as a length.
    pub(crate) width: f32,
    /// Least and greatest radius of the record, as lengths.
    pub(crate) reach: [f32; 2],
    /// Rays per cell of the hemisphere.
    pub(crate) effort: u32,
    /// `true`: also record the directions that the light comes from.
    pub(crate) is_directed: bool,
}

/// Returns the settings of the paths that sensors trace: those of the whole picture, even where a zone has others.
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
    /// Creates an integrator that traces the paths of sensors.
    ///
    /// - `settings`: from [`sensing_settings`].
    ///
    /// # Errors
    /// [`RenderError::PhotonsInMedia`], [`RenderError::NoCamera`].
    pub(crate) fn sensing(
        prepared: &'a PreparedScene,
        settings: &'a PathSettings,
        photons: PhotonSettings,
        passes: Arc<Passes>,
    ) -> Result<Self, RenderError> {
        if prepared.needs_volume() || prepared.moves() {
            return Err(RenderError::PhotonsInMedia);
        }
        // Sensors belong to no view
        let view = View::of_scene(prepared.scene(), 0, 1, 1)?;
        let base = PathIntegrator::unguided(prepared, &view, settings)?;
        Ok(Self { base, photons, passes, cache: None, view })
    }

    /// Returns the scene.
    pub(crate) fn prepared(&self) -> &'a PreparedScene {
        self.base.prepared()
    }

    /// Returns the plan of photon and agent emission.
    pub(crate) fn plan(&self) -> &PhotonPlan {
        self.passes.plan()
    }

    /// Estimates the indirect irradiance at a point, on the side that faces its `wo`. Direct light is left out, and so
    /// is light over mirrors and glass alone, which photons give.
    ///
    /// - `width`: width of the surroundings that the sensor represents.
    pub(crate) fn irradiance(
        &self,
        maps: &PhotonMaps,
        point: Interaction,
        width: f32,
        sampler: PixelSampler,
        buffers: &mut GatherBuffers,
    ) -> Spectrum {
        let n: Vec3 = point.frame[2];
        let (s, t) = orthonormal_basis(n);
        let place = RecordPoint::new(point, width);
        let known = KnownLight { maps, cache: None, agents: None };
        buffers.clear_bounces();
        let mut path = GatherPath::new(self, known, sampler, &mut *buffers);
        let mut sum = Spectrum::ZERO;
        for index in 0..RAYS {
            // Stop early in the dark
            if index == RAYS_IN_THE_DARK && sum == Spectrum::ZERO {
                return Spectrum::ZERO;
            }
            let [u, v, ..] = sampler.split_quad(DimensionSet::scattering(0), index, RAYS);
            // Sample a cosine-weighted direction and trace it
            let local = cosine_hemisphere([u, v]);
            sum += path.gather_from(&place, s * local.x + t * local.y + n * local.z, index).radiance;
        }
        buffers.scale_bounces(PI / RAYS as f32);
        sum * (PI / RAYS as f32)
    }

    /// Measures the indirect irradiance with its gradients, by the error oracle.
    ///
    /// - `others`: agents that stand for the light of all surfaces that they know.
    pub(crate) fn record(
        &self,
        maps: &PhotonMaps,
        place: SensorPlace,
        sampler: PixelSampler,
        others: &Agents,
        buffers: &mut GatherBuffers,
    ) -> IrradianceRecord {
        let SensorPlace { point, width, reach, effort, is_directed } = place;
        let place = RecordPoint::new(point, width);
        let known = KnownLight { maps, cache: None, agents: Some(others) };
        let n = place.n();
        buffers.clear_bounces();
        let mut path = GatherPath::new(self, known, sampler, &mut *buffers);
        let gather = |index: u32| {
            let [u, v, ..] = sampler.split_quad(DimensionSet::scattering(0), index, cache::RAYS * effort);
            path.gather_from(&place, cache::direction(n, index / effort, [u, v]), index)
        };
        // Trace all rays: stopping after dark ones takes dim corners for dark
        let samples: Vec<GatherSample> = (0..cache::RAYS * effort).map(gather).collect();
        let found = Measurement::new(samples, effort);
        let record = IrradianceRecord::new(place.p(), n, &found, reach).with_bounces(buffers.bounces());
        if is_directed { record.with_directions(&found) } else { record }
    }
}
