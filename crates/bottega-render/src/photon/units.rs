//! Work on photons, as the allocator hands it out.

use std::{ops::Range, sync::Arc};

use bottega_kernels::compiled;

use super::{
    bounces::IrradiancePlaces,
    estimator::Estimator,
    irradiance::IrradianceAt,
    map::PhotonMap,
    maps::{caustic_tracer, tracer},
    trace::{TracedPhotons, Tracing},
};
use crate::{PhotonSettings, PreparedScene, Prepass, View};

/// Photons to be traced.
#[derive(Clone)]
pub struct PhotonWork {
    /// The scene.
    pub scene: Arc<PreparedScene>,
    /// What is known of it.
    pub prepass: Arc<Prepass>,
    /// How.
    pub settings: PhotonSettings,
    /// The picture: photons are sent to what it shows.
    pub view: View,
    /// Whether they are sent to mirrors and glass alone.
    pub only_caustics: bool,
    /// Another seed gives other photons.
    pub seed: u64,
    /// Which photons.
    pub indices: Range<u32>,
}

/// Irradiance to be computed from photons at the places of some of them.
#[derive(Clone)]
pub struct IrradianceWork {
    /// The scene that the photons are of.
    pub(crate) scene: Arc<PreparedScene>,
    pub(crate) all: Arc<PhotonMap>,
    pub(crate) estimator: Estimator,
    pub(crate) points: Range<u32>,
}

impl PhotonWork {
    /// Traces them on the calling thread.
    pub fn perform(self) -> TracedPhotons {
        let Self { scene, prepass, settings, view, only_caustics, seed, indices } = self;
        let plan = prepass.photon_plan(&scene, view);
        let tracer = if only_caustics {
            caustic_tracer(&scene, &plan, &settings, seed)
        } else {
            tracer(&scene, &plan, &settings, seed, 0)
        };
        compiled::run(Tracing { tracer, indices })
    }
}

impl IrradianceWork {
    /// Computes it on the calling thread.
    pub fn perform(self) -> IrradiancePlaces {
        let (prepared, all) = (&*self.scene, &*self.all);
        compiled::run(IrradianceAt { prepared, estimator: self.estimator, all, points: self.points })
    }
}
