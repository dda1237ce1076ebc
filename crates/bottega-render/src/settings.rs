//! What is painted, and how hard.

use crate::filter::Filter;

/// A picture of the scene: which camera, how many pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct View {
    /// Index into [`Scene::cameras`](bottega_scene::Scene::cameras).
    pub camera: usize,
    /// Columns of the whole picture.
    pub width: u32,
    /// Rows of the whole picture.
    pub height: u32,
}

/// Which strategies find direct light. All have the same mean; that is what the others are for: to test it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DirectLight {
    /// Light sampling and BSDF sampling, combined by the power heuristic (Veach 1997, §9.2.4).
    #[default]
    Combined,
    /// Light sampling alone. Misses what only a Dirac lobe can see.
    LightSampling,
    /// BSDF sampling alone. Misses lights without extent.
    BsdfSampling,
}

/// The settings of the path integrator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSettings {
    /// Another seed gives another picture of the same mean.
    pub seed: u64,
    /// Bounces. 0: only emission seen directly; 1: direct light; and so on.
    pub max_depth: u32,
    /// Light samples at each vertex of a path; at least 1 is taken.
    pub light_samples: u32,
    /// The pixel filter.
    pub filter: Filter,
    /// Bounces after which Russian roulette may end a path.
    pub roulette_depth: u32,
    /// Which strategies find direct light.
    pub direct_light: DirectLight,
    /// Whether paths learn beforehand where light comes from. It changes the noise, not the mean.
    pub guiding: bool,
    /// Samples a pixel that the picture is to have: the more, the longer paths learn beforehand.
    pub planned_samples: u32,
}

impl Default for PathSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            max_depth: 16,
            light_samples: 1,
            filter: Filter::default(),
            roulette_depth: 3,
            direct_light: DirectLight::Combined,
            guiding: true,
            planned_samples: 64,
        }
    }
}
