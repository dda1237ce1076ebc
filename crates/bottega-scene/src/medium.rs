//! Media that fill space.

use std::sync::Arc;

use glam::{Affine3A, Vec3};

use crate::{Grid, Spectrum};

/// Index into [`Scene::media`](crate::Scene::media).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MediumId(pub u32);

/// A participating medium.
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
    /// How the coefficients vary in space; `None`: not at all.
    pub variation: Option<Arc<Variation>>,
}

/// The variation of a medium's coefficients in space: they are multiplied by values of grids.
#[derive(Clone, Debug, PartialEq)]
pub struct Variation {
    /// What multiplies absorption and scattering.
    pub density: Density,
    /// What multiplies emission, beside what multiplies absorption.
    pub emission: Option<Grid>,
    /// World space to the unit cube that the grids fill. There is nothing outside of it.
    pub grid_from_world: Affine3A,
}

/// The density that multiplies the coefficients of a medium.
#[derive(Clone, Debug, PartialEq)]
pub enum Density {
    /// Absorption and scattering alike.
    Both(Grid),
    /// Each by its own.
    Each {
        /// Multiplies σ_a.
        absorption: Grid,
        /// Multiplies σ_s.
        scattering: Grid,
    },
    /// Their sum, of which a part that varies, too, is scattering.
    WithAlbedo {
        /// Multiplies σ_a + σ_s.
        extinction: Grid,
        /// σ_s over that, in [0, 1].
        albedo: Grid,
    },
}

/// The coefficients of a medium at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    /// σ_a.
    pub absorption: Spectrum,
    /// σ_s.
    pub scattering: Spectrum,
    /// Radiance emitted per scene unit.
    pub emission: Spectrum,
}

impl Medium {
    /// What absorbs and does not scatter.
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

    /// Whether it only absorbs, the same everywhere.
    pub fn is_clear(&self) -> bool {
        self.scattering == Spectrum::ZERO && self.emission == Spectrum::ZERO && self.variation.is_none()
    }

    /// The coefficients where its variation has the place `p` of the unit cube.
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
            emission *= absorbing * variation.emission.as_ref().map_or(Spectrum::ONE, |grid| grid.at(p));
        }
        Coefficients { absorption, scattering, emission }
    }

    /// No less than σ_a + σ_s of any channel anywhere between two corners of the unit cube.
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
    /// Its grids.
    pub fn grids(&self) -> impl Iterator<Item = &Grid> {
        let (first, second) = match &self.density {
            Density::Both(grid) => (grid, None),
            Density::Each { absorption, scattering } => (absorption, Some(scattering)),
            Density::WithAlbedo { extinction, albedo } => (extinction, Some(albedo)),
        };
        [Some(first), second, self.emission.as_ref()].into_iter().flatten()
    }

    /// Cells along each axis of the finest of its grids that absorb or scatter.
    pub fn resolution(&self) -> [u32; 3] {
        self.grids().fold([1; 3], |size, grid| [0, 1, 2].map(|axis| size[axis].max(grid.size()[axis])))
    }
}
