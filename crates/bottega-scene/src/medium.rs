//! What fills space.

use crate::Spectrum;

/// Index into [`Scene::media`](crate::Scene::media).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MediumId(pub u32);

/// A homogeneous participating medium.
#[derive(Clone, Debug, PartialEq)]
pub struct Medium {
    /// The name in the file; may be empty.
    pub name: String,
    /// Absorption coefficient σ_a, per scene unit.
    pub absorption: Spectrum,
    /// Scattering coefficient σ_s, per scene unit.
    pub scattering: Spectrum,
    /// Radiance emitted per scene unit.
    pub emission: Spectrum,
    /// Mean cosine of the angle of scattering, in (−1, 1): forwards above 0 (Henyey and Greenstein 1941).
    pub g: f32,
}

impl Medium {
    /// What absorbs and does not scatter.
    pub fn absorbing(absorption: Spectrum) -> Self {
        Self { name: String::new(), absorption, scattering: Spectrum::ZERO, emission: Spectrum::ZERO, g: 0.0 }
    }

    /// Whether it only absorbs.
    pub fn is_clear(&self) -> bool {
        self.scattering == Spectrum::ZERO && self.emission == Spectrum::ZERO
    }
}
