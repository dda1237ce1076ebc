//! Integrators: from a pixel's sample to radiance.

mod path;
mod photon;
mod planned;
mod record;
mod transport;
mod turns;
mod volume;
mod wave;

pub use path::{PathIntegrator, learn_together};
pub use photon::PhotonIntegrator;
pub(crate) use photon::{Hands, SensorPlace, sensing_settings};
pub(crate) use record::{PathRecord, Wanted};
pub(crate) use transport::shadow_ray;
pub use transport::{ROULETTE_SURVIVAL_MAX, SCATTERED_SPREAD, SHADOW_MARGIN};
pub(crate) use turns::Painting;
pub use wave::{Wave, WaveAnswers};

use bottega_kernels::compiled;

use crate::{PathSettings, PreparedScene, Prepass, RenderError, View};

/// Whichever integrator the settings ask for.
pub(crate) enum Integrator<'a> {
    Paths(PathIntegrator<'a>),
    Photons(PhotonIntegrator<'a>),
}

impl<'a> Integrator<'a> {
    pub(crate) fn new(
        prepared: &'a PreparedScene,
        prepass: &Prepass,
        view: View,
        settings: &'a PathSettings,
        wanted: Wanted,
    ) -> Result<Self, RenderError> {
        Ok(match settings.photons {
            None => Self::Paths(PathIntegrator::new(prepared, prepass, view, settings)?.with_wanted(wanted)),
            Some(photons) => {
                Self::Photons(PhotonIntegrator::new(prepared, prepass, view, settings, photons)?.with_wanted(wanted))
            }
        })
    }

    /// Paints samples: pixels, each with the index of a sample. What comes of them is put into `records`, in their order.
    pub(crate) fn paint(&self, samples: &[(u32, u32, u32)], records: &mut Vec<PathRecord>) {
        match self {
            Self::Paths(integrator) => compiled::run(Painting { integrator, samples, records }),
            Self::Photons(integrator) => integrator.paint(samples, records),
        }
    }
}
