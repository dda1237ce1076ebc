//! Microfacets of rough boundaries.

use serde::{Deserialize, Serialize};

use crate::param::ScalarParam;

/// The distribution of a rough boundary's microfacet normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// GGX, of Trowbridge and Reitz.
    #[default]
    Ggx,
    /// Beckmann and Spizzichino's.
    Beckmann,
}

/// The masking-shadowing function of microfacets: the probability that a facet is visible from two directions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shadowing {
    /// Height-correlated: a facet visible from one direction is more likely visible from the other (pbrt).
    #[default]
    Correlated,
    /// Separable: visibility from the two directions is independent (Mitsuba).
    Separable,
}

/// The relation of a roughness parameter to the α of the distribution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoughnessScale {
    /// The roughness is α.
    #[default]
    Alpha,
    /// α is the square root of the roughness (pbrt, with `remaproughness`).
    SquareRoot,
    /// α is the square of the roughness (glTF and Disney).
    Square,
}

/// The microfacets of a boundary. Single scattering: light that hits several facets is lost, as the formats define it.
/// ([`Layered`](super::Layered) compensates for it.)
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Facets {
    /// Distribution of the facet normals.
    pub distribution: Distribution,
    /// Masking-shadowing function of the facets.
    pub shadowing: Shadowing,
    /// Roughness along u and along v; both 0: smooth.
    pub roughness: [ScalarParam; 2],
    /// Relation of roughness to α.
    pub scale: RoughnessScale,
}

impl From<f32> for Facets {
    /// Returns GGX facets with the same α along u and v.
    fn from(alpha: f32) -> Self {
        Self { roughness: [alpha.into(), alpha.into()], ..Self::default() }
    }
}

impl Default for Facets {
    /// Returns no facets: a smooth boundary.
    fn default() -> Self {
        Self {
            distribution: Distribution::default(),
            shadowing: Shadowing::default(),
            roughness: [0.0.into(), 0.0.into()],
            scale: RoughnessScale::default(),
        }
    }
}

impl Facets {
    /// Returns the facets of a smooth boundary, with roughness 0.
    pub fn smooth() -> Self {
        Self::default()
    }

    /// Returns true if the boundary is smooth everywhere.
    pub fn is_smooth(&self) -> bool {
        self.roughness.iter().all(|roughness| roughness.factor == 0.0)
    }
}
