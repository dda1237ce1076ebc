//! Photon maps: photons traced from the lights, stored where they hit surfaces, and found by position.
//!
//! Sources: Jensen 2001, *Realistic Image Synthesis Using Photon Mapping*; Christensen 1999, *Faster Photon Map Global
//! Illumination*.

mod around;
mod arrivals;
pub(crate) mod bounces;
pub(crate) mod bytes;
pub(crate) mod cache;
mod cast;
mod estimator;
mod extent;
mod irradiance;
mod lookouts;
mod map;
mod maps;
mod plan;
mod projection;
mod record;
mod store;
mod trace;
mod trial;
mod units;

pub(crate) use arrivals::LightDirections;
pub use bounces::IrradiancePlaces;
pub(crate) use bounces::{BOUNCES_KEPT, BounceShares, ByBounces, IrradianceMap, kept};
pub use cast::{cast_photons, prepare_techniques};
pub(crate) use estimator::{Estimator, PhotonContribution};
pub(crate) use lookouts::places_seen;
pub use map::{NEAREST_MAX, Nearest, PhotonMap};
pub(crate) use maps::{PhotonMaps, traced, tracer};
pub(crate) use plan::{PhotonPlan, PhotonPlans};
pub use record::{Mark, Photon};
pub use store::MapBytes;
pub(crate) use store::{Passes, PhotonStore};
pub use trace::TracedPhotons;
pub(crate) use trace::is_alike;
pub use units::{IrradianceWork, PhotonWork};
