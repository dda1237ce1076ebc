//! Photon mapping with final gathering.
//!
//! A camera path follows mirrors and glass to the first surface with a BSDF that is not specular. Direct light there is
//! sampled as in path tracing. Caustics, light that arrives over mirrors and glass, are the density of the caustic
//! photons. All other indirect light is gathered by rays drawn from the BSDF; the photon map gives the radiance where
//! they end. Without final gathering, and in progressive pictures, the photon density at the surface itself gives all
//! indirect light.
//!
//! With Autonomous Lighting Agents, only caustic photons are traced. Agents decide which shadow rays are needed, and
//! give the indirect light on matte surfaces. Where they do not know, gathering rays are traced that end where agents
//! know.
//!
//! Sources: Jensen 1996, *Global Illumination using Photon Maps*; Christensen 1999, *Faster Photon Map Global
//! Illumination*.

mod gather;
mod paint;
mod place;
mod sense;

use std::sync::{Arc, OnceLock};

use bottega_scene::MediumId;

use super::{path::PathIntegrator, record::Wanted};
use crate::{
    error::RenderError,
    photon::{Passes, cache::IrradianceCache},
    prepare::PreparedScene,
    prepass::Prepass,
    settings::{PathSettings, PhotonSettings, View},
};
pub(crate) use gather::GatherBuffers;
pub(crate) use sense::{SensorPlace, sensing_settings};

/// Greatest total size of the maps of a progressive picture, in bytes. Samples beyond the affordable number of passes
/// reuse the passes from the first one.
const PASSES_BYTES: u64 = 1 << 30;
/// Memory of a photon with its hits on some surfaces, in bytes.
const PHOTON_BYTES: u64 = 48;

/// The photon mapping integrator of one picture. Cheap to create once the maps exist: one per block of work.
pub struct PhotonIntegrator<'a> {
    base: PathIntegrator<'a>,
    photons: PhotonSettings,
    passes: Arc<Passes>,
    /// Irradiance cache; `None`: not used.
    cache: Option<Arc<OnceLock<IrradianceCache>>>,
    view: View,
}

impl<'a> PhotonIntegrator<'a> {
    /// Creates an integrator for the picture `view`.
    ///
    /// - `prepass`: belongs to `prepared`.
    /// - `photons`: the settings of photons in `settings`.
    ///
    /// # Errors
    /// [`RenderError::PhotonsInMedia`], [`RenderError::EmptyPicture`].
    pub fn new(
        prepared: &'a PreparedScene,
        prepass: &Prepass,
        view: &View,
        settings: &'a PathSettings,
        photons: PhotonSettings,
    ) -> Result<Self, RenderError> {
        let base = PathIntegrator::unguided(prepared, view, settings)?;
        if prepared.has_media() {
            return Err(RenderError::PhotonsInMedia);
        }
        let affordable = PASSES_BYTES / (u64::from(photons.count.max(1)) * PHOTON_BYTES);
        let pass_count =
            if photons.progressive { u64::from(settings.planned_samples).min(affordable).max(1) as u32 } else { 1 };
        let passes = prepass.passes(prepared, view, photons, settings.seed, pass_count);
        let is_cached = photons.irradiance_cache > 0.0 && photons.final_rays > 0 && !photons.progressive;
        let cache = is_cached.then(|| passes.cache(view));
        Ok(Self { base, photons, passes, cache, view: view.clone() })
    }

    /// Returns a copy of this integrator with other settings, such as another seed, and the same maps.
    pub(super) fn with_settings(&self, settings: &'a PathSettings) -> Self {
        Self {
            base: self.base.with_settings(settings),
            photons: self.photons,
            passes: Arc::clone(&self.passes),
            cache: self.cache.clone(),
            view: self.view.clone(),
        }
    }

    /// Returns this integrator with other optional values requested.
    pub(crate) fn with_wanted(self, wanted: Wanted) -> Self {
        Self { base: self.base.with_wanted(wanted), ..self }
    }

    /// Returns the path integrator whose camera and settings this one uses.
    pub(crate) fn base(&self) -> &PathIntegrator<'a> {
        &self.base
    }

    /// Returns the medium that contains the camera; `None`: vacuum.
    fn camera_medium(&self) -> Option<MediumId> {
        self.base.camera_medium()
    }
}
