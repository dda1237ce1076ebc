//! Units of photon work for the allocator.

use std::{ops::Range, sync::Arc};

use bottega_kernels::compiled;

use super::{
    bounces::IrradiancePlaces,
    estimator::Estimator,
    irradiance::IrradianceAt,
    map::PhotonMap,
    maps::{caustic_tracer, tracer},
    trace::{TraceRange, TracedPhotons},
};
use crate::{
    prepare::PreparedScene,
    prepass::Prepass,
    settings::{PhotonSettings, View},
};

/// A unit of work that traces a range of photons from the lights.
#[derive(Clone)]
pub struct PhotonWork {
    /// The scene to trace in.
    pub scene: Arc<PreparedScene>,
    /// Prepass of the scene.
    pub prepass: Arc<Prepass>,
    /// Settings of the photons.
    pub settings: PhotonSettings,
    /// Picture that the photons are traced for: they are sent to what it shows.
    pub view: View,
    /// `true`: trace only caustic photons, sent to mirrors and glass.
    pub only_caustics: bool,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Indices of the photons.
    pub indices: Range<u32>,
}

/// A unit of work that estimates irradiance from photons at a range of points.
#[derive(Clone)]
pub struct IrradianceWork {
    /// The scene that the photons are of.
    pub(crate) scene: Arc<PreparedScene>,
    /// All photons of the picture.
    pub(crate) all: Arc<PhotonMap>,
    /// Density estimator of the picture.
    pub(crate) estimator: Estimator,
    /// Indices of the points.
    pub(crate) points: Range<u32>,
}

impl PhotonWork {
    /// Traces the photons on the calling thread. Returns what they stored on surfaces, in the order of their indices.
    pub fn perform(self) -> TracedPhotons {
        let Self { scene, prepass, settings, view, only_caustics, seed, indices } = self;
        let plan = prepass.photon_plan(&scene, &view);
        let tracer = if only_caustics {
            caustic_tracer(&scene, &plan, &settings, seed)
        } else {
            tracer(&scene, &plan, &settings, seed, 0)
        };
        compiled::run(TraceRange { tracer, indices })
    }
}

impl IrradianceWork {
    /// Estimates the irradiance on the calling thread. Returns the points with it, in their order.
    pub fn perform(self) -> IrradiancePlaces {
        let (prepared, all) = (&*self.scene, &*self.all);
        compiled::run(IrradianceAt { prepared, estimator: self.estimator, all, points: self.points })
    }
}
