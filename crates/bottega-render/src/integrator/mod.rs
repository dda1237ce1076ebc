//! Integrators: they estimate the radiance of a pixel's samples.

mod by_zone;
mod caught;
mod group_sums;
mod movement;
mod path;
mod photon;
mod planned;
mod record;
mod surface;
mod transport;
mod turns;
mod volume;
mod wave;

pub(crate) use by_zone::choose_techniques;
use by_zone::{ByZone, Chosen};
pub(crate) use group_sums::GroupBuffer;
pub(crate) use path::LEARNING_STAGES;
pub use path::{PathIntegrator, learn_together};
pub use photon::PhotonIntegrator;
pub(crate) use photon::{GatherBuffers, SensorPlace, sensing_settings};
pub(crate) use record::{PathRecord, Wanted};
pub(crate) use surface::WantedSurface;
pub(crate) use transport::shadow_ray;
pub use transport::{ROULETTE_SURVIVAL_MAX, SCATTERED_SPREAD, SHADOW_MARGIN};
pub(crate) use turns::SampleBatch;
pub use wave::{Wave, WaveAnswers};

use bottega_kernels::compiled;

use crate::{
    error::RenderError,
    prepare::PreparedScene,
    prepass::Prepass,
    settings::{PathSettings, View},
};

/// The integrator that the settings ask for.
pub(crate) enum Integrator<'a> {
    Paths(PathIntegrator<'a>),
    Photons(PhotonIntegrator<'a>),
    /// Both, each in some zones.
    ByZone(Box<ByZone<'a>>),
}

impl<'a> Integrator<'a> {
    /// Creates the integrator of `settings` for the picture `view`. `wanted`: optional values of each sample.
    pub(crate) fn new(
        prepared: &'a PreparedScene,
        prepass: &Prepass,
        view: &View,
        settings: &'a PathSettings,
        wanted: Wanted,
    ) -> Result<Self, RenderError> {
        if settings.tries_photons && settings.photons.is_some() {
            return Ok(match Chosen::new(prepared, prepass, view, settings, wanted)? {
                Chosen::Paths(paths) => Self::Paths(paths),
                Chosen::Photons(photons) => Self::Photons(photons),
                Chosen::ByZone(both) => Self::ByZone(both),
            });
        }
        Ok(match settings.photons {
            None => Self::Paths(PathIntegrator::new(prepared, prepass, view, settings)?.with_wanted(wanted)),
            Some(photons) => {
                Self::Photons(PhotonIntegrator::new(prepared, prepass, view, settings, photons)?.with_wanted(wanted))
            }
        })
    }

    /// Traces samples, given as (x, y, sample index). Replaces the contents of `records` with their records, in the
    /// same order.
    ///
    /// - `groups`: receives the light by groups of lights; photons fill none.
    pub(crate) fn paint(
        &self,
        samples: &[(u32, u32, u32)],
        records: &mut Vec<PathRecord>,
        groups: Option<GroupBuffer<'_>>,
    ) {
        match self {
            Self::Paths(integrator) => compiled::run(SampleBatch { integrator, samples, records, groups }),
            Self::Photons(integrator) => integrator.paint(samples, records),
            Self::ByZone(both) => both.paint(samples, records),
        }
    }
}
