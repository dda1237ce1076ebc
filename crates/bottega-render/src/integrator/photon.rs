//! Photon mapping: what a camera sees by the light of photons.
//!
//! A path from the camera goes over mirrors and through glass to the first surface that spreads light. Light that comes
//! there straight is found as path tracing finds it. Light that was brought together by mirrors and glass is the density of
//! its photons. All other light is gathered by rays that are drawn by how the surface scatters; the map says what leaves the
//! place where one ends (Jensen 1996, *Global Illumination using Photon Maps*; Christensen 1999). Where rays are not
//! gathered, and in progressive pictures, the density of photons at the surface itself stands for all light but the direct.
//!
//! With Autonomous Lighting Agents there are photons for caustics alone. Agents are asked which shadow rays must be traced, and
//! what indirect light comes to matte surfaces; where they do not know, rays are gathered that end where they do.

mod eye;
mod paint;
mod place;
mod sense;

use std::sync::{Arc, OnceLock};

use bottega_scene::MediumId;

use super::{path::PathIntegrator, record::Wanted};
use crate::{
    PathSettings, PhotonSettings, PreparedScene, Prepass, RenderError, View,
    photon::{Passes, cache::IrradianceCache},
};
pub(crate) use eye::Hands;
pub(crate) use sense::{SensorPlace, sensing_settings};

/// What the maps of all passes of a progressive picture may take. Samples beyond those that have passes of their own take
/// the passes again from the first.
const PASSES_BYTES: u64 = 1 << 30;
/// What a photon takes on its way over some surfaces.
const PHOTON_BYTES: u64 = 48;

/// Paints samples of one picture. Cheap to make once the maps are there: one for each block of work.
pub struct PhotonIntegrator<'a> {
    base: PathIntegrator<'a>,
    photons: PhotonSettings,
    passes: Arc<Passes>,
    /// Where irradiance is kept, if it is.
    cache: Option<Arc<OnceLock<IrradianceCache>>>,
    view: View,
}

impl<'a> PhotonIntegrator<'a> {
    /// An integrator for the picture `view`; the settings say that it is one of photons.
    ///
    /// # Errors
    /// There is no such picture, or the scene has media that photons know nothing of.
    pub fn new(
        prepared: &'a PreparedScene,
        prepass: &Prepass,
        view: View,
        settings: &'a PathSettings,
        photons: PhotonSettings,
    ) -> Result<Self, RenderError> {
        let base = PathIntegrator::unguided(prepared, view, settings)?;
        if prepared.needs_volume() {
            return Err(RenderError::PhotonsInMedia);
        }
        let affordable = PASSES_BYTES / (u64::from(photons.count.max(1)) * PHOTON_BYTES);
        let pass_count =
            if photons.progressive { u64::from(settings.planned_samples).min(affordable).max(1) as u32 } else { 1 };
        let passes = prepass.passes(prepared, view, photons, settings.seed, pass_count);
        let is_cached = photons.irradiance_cache > 0.0 && photons.final_rays > 0 && !photons.progressive;
        let cache = is_cached.then(|| passes.cache(view));
        Ok(Self { base, photons, passes, cache, view })
    }

    pub(crate) fn with_wanted(self, wanted: Wanted) -> Self {
        Self { base: self.base.with_wanted(wanted), ..self }
    }

    /// What its paths from the camera go by.
    pub(crate) fn base(&self) -> &PathIntegrator<'a> {
        &self.base
    }

    fn camera_medium(&self) -> Option<MediumId> {
        self.base.camera_medium()
    }
}
