//! Participating media: homogeneous, or with coefficients from grids.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use serde::{Deserialize, Serialize};

use crate::blackbody::Blackbody;
use crate::color::Spectrum;
use crate::grid::Grid;

/// Index into [`Scene::media`](crate::Scene::media).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct MediumId(pub u32);

/// A participating medium with Henyey-Greenstein scattering.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Medium {
    /// The name in the file; may be empty.
    pub name: String,
    /// Absorption coefficient σ_a, per scene unit.
    #[serde(with = "crate::numbers")]
    pub absorption: Spectrum,
    /// Scattering coefficient σ_s, per scene unit.
    #[serde(with = "crate::numbers")]
    pub scattering: Spectrum,
    /// Radiance emitted per scene unit along a ray, in W·sr⁻¹·m⁻².
    #[serde(with = "crate::numbers")]
    pub emission: Spectrum,
    /// Henyey-Greenstein asymmetry: mean cosine of the scattering angle, in (−1, 1); above 0: forward (Henyey and
    /// Greenstein 1941).
    pub g: f32,
    /// Spatial variation of the coefficients; `None`: homogeneous.
    #[serde(skip)]
    pub variation: Option<Arc<Variation>>,
}

/// The spatial variation of a medium's coefficients: grids that multiply them.
#[derive(Clone, Debug, PartialEq)]
pub struct Variation {
    /// Factors of absorption and scattering.
    pub density: Density,
    /// Factor of emission; `None`: 1. Emission is also multiplied by the factor of absorption (of the extinction, with
    /// [`Density::WithAlbedo`]), except with [`Blackbody::times_density`] `false`.
    pub emission: Option<EmissionVariation>,
    /// World space to the unit cube of the grids. Outside, the medium is empty.
    pub grid_from_world: Affine3A,
}

/// The grids that multiply the coefficients of a medium.
#[derive(Clone, Debug, PartialEq)]
pub enum Density {
    /// One grid for absorption and scattering.
    Both(Grid),
    /// One grid each.
    Each {
        /// Factor of σ_a.
        absorption: Grid,
        /// Factor of σ_s.
        scattering: Grid,
    },
    /// A grid of the extinction and one of the albedo.
    WithAlbedo {
        /// Factor of σ_a + σ_s.
        extinction: Grid,
        /// Scattering albedo, σ_s / (σ_a + σ_s), in [0, 1].
        albedo: Grid,
    },
}

/// The spatial variation of a medium's emission.
#[derive(Clone, Debug, PartialEq)]
pub enum EmissionVariation {
    /// A grid of factors.
    Factor(Grid),
    /// The colors of black bodies at the temperatures of a grid, as factors.
    Blackbody(Blackbody),
}

impl EmissionVariation {
    /// Returns the factor at point `p` of the unit cube.
    fn at(&self, p: Vec3) -> Spectrum {
        match self {
            Self::Factor(grid) => grid.at(p),
            Self::Blackbody(blackbody) => blackbody.at(p),
        }
    }

    /// Returns true if the factor is not 0 everywhere between two corners of the unit cube.
    fn may_shine(&self, corners: [Vec3; 2]) -> bool {
        match self {
            Self::Factor(grid) => grid.max_within(corners) != Spectrum::ZERO,
            Self::Blackbody(blackbody) => {
                let hottest = (blackbody.temperatures.max_within(corners).x - blackbody.offset) * blackbody.scale;
                blackbody.scale < 0.0 || blackbody.color(hottest) != Spectrum::ZERO
            }
        }
    }

    /// Returns true if emission is also proportional to absorption.
    fn times_density(&self) -> bool {
        match self {
            Self::Factor(_) => true,
            Self::Blackbody(blackbody) => blackbody.times_density,
        }
    }

    /// Returns the grid: of factors, or of temperatures.
    pub fn grid(&self) -> &Grid {
        match self {
            Self::Factor(grid) => grid,
            Self::Blackbody(blackbody) => &blackbody.temperatures,
        }
    }
}

/// The coefficients of a medium at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    /// Absorption coefficient σ_a, per scene unit.
    pub absorption: Spectrum,
    /// Scattering coefficient σ_s, per scene unit.
    pub scattering: Spectrum,
    /// Radiance emitted per scene unit along a ray, in W·sr⁻¹·m⁻².
    pub emission: Spectrum,
}

impl Medium {
    /// Returns a homogeneous medium without a name that absorbs and does not scatter; `absorption`: σ_a, per scene
    /// unit.
    pub fn absorbing(absorption: Spectrum) -> Self {
        Self {
            name: String::new(),
            absorption,
            scattering: Spectrum::ZERO,
            emission: Spectrum::ZERO,
            g: 0.0,
            variation: None,
        }
    }

    /// Returns true if the medium is homogeneous and only absorbs.
    pub fn is_clear(&self) -> bool {
        self.scattering == Spectrum::ZERO && self.emission == Spectrum::ZERO && self.variation.is_none()
    }

    /// Returns the coefficients at point `p` of the variation's unit cube.
    ///
    /// - `variation`: that of this medium.
    pub fn coefficients(&self, variation: &Variation, p: Vec3) -> Coefficients {
        let (absorbing, absorption, scattering) = match &variation.density {
            Density::Both(grid) => {
                let factor = grid.at(p);
                (factor, factor * self.absorption, factor * self.scattering)
            }
            Density::Each { absorption, scattering } => {
                let factor = absorption.at(p);
                (factor, factor * self.absorption, scattering.at(p) * self.scattering)
            }
            Density::WithAlbedo { extinction, albedo } => {
                let factor = extinction.at(p);
                let extinction = factor * (self.absorption + self.scattering);
                let scattering = extinction * albedo.at(p).min(Spectrum::ONE);
                (factor, extinction - scattering, scattering)
            }
        };
        let mut emission = self.emission;
        if emission != Spectrum::ZERO {
            emission *= variation.emission.as_ref().map_or(Spectrum::ONE, |emission| emission.at(p));
            if variation.emission.as_ref().is_none_or(EmissionVariation::times_density) {
                emission *= absorbing;
            }
        }
        Coefficients { absorption, scattering, emission }
    }

    /// Returns false if the medium emits nothing in the box between two corners within the unit cube, the least and the
    /// greatest one; true if it may emit.
    ///
    /// - `variation`: that of this medium.
    pub fn may_emit(&self, variation: &Variation, corners: [Vec3; 2]) -> bool {
        let Some(emission) = &variation.emission else {
            return self.emission != Spectrum::ZERO && variation.may_absorb(corners);
        };
        self.emission != Spectrum::ZERO
            && emission.may_shine(corners)
            && (!emission.times_density() || variation.may_absorb(corners))
    }

    /// Returns an upper bound of σ_a + σ_s, per scene unit, over all channels in the box between two corners within the
    /// unit cube, the least and the greatest one.
    ///
    /// - `variation`: that of this medium.
    pub fn extinction_max(&self, variation: &Variation, corners: [Vec3; 2]) -> f32 {
        let most = |grid: &Grid, coefficient: Spectrum| (grid.max_within(corners) * coefficient).max_element();
        match &variation.density {
            Density::Both(grid) | Density::WithAlbedo { extinction: grid, .. } => {
                most(grid, self.absorption + self.scattering)
            }
            Density::Each { absorption, scattering } => {
                most(absorption, self.absorption) + most(scattering, self.scattering)
            }
        }
    }
}

impl Variation {
    /// Returns true if the factor of absorption is not 0 everywhere between two corners of the unit cube.
    fn may_absorb(&self, corners: [Vec3; 2]) -> bool {
        let (Density::Both(grid)
        | Density::Each { absorption: grid, .. }
        | Density::WithAlbedo { extinction: grid, .. }) = &self.density;
        grid.max_within(corners) != Spectrum::ZERO
    }

    /// Returns the grids of the variation: one or two of density, then that of emission, if any.
    pub fn grids(&self) -> impl Iterator<Item = &Grid> {
        let (first, second) = match &self.density {
            Density::Both(grid) => (grid, None),
            Density::Each { absorption, scattering } => (absorption, Some(scattering)),
            Density::WithAlbedo { extinction, albedo } => (extinction, Some(albedo)),
        };
        [Some(first), second, self.emission.as_ref().map(EmissionVariation::grid)].into_iter().flatten()
    }

    /// Returns the numbers of cells along x, y and z, each the greatest of all grids of the variation.
    pub fn resolution(&self) -> [u32; 3] {
        self.grids().fold([1; 3], |size, grid| [0, 1, 2].map(|axis| size[axis].max(grid.size()[axis])))
    }
}
