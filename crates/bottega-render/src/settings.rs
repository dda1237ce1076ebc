//! The settings of a picture.

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

/// The strategies that find direct light. All have the same mean; that is what the others are for: to test it.
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

/// The use of lighting agents on a path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct AgentUse {
    /// Whether a light is seen, as far as they know: fewer shadow rays.
    pub shadows: bool,
    /// Which lights matter.
    pub lights: bool,
    /// What a path is worth: whether it ends, goes on, or goes on as several.
    pub roulette: bool,
}

impl AgentUse {
    /// All that they can tell.
    pub const ALL: Self = Self { shadows: true, lights: true, roulette: true };

    /// Whether anything is asked.
    pub fn any(self) -> bool {
        self.shadows || self.lights || self.roulette
    }
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
    /// The greatest value that a channel of a sample may have. A brighter sample is darkened to it, and keeps its colour; infinity: none
    /// is.
    pub sample_max: f32,
    /// Bounces after which Russian roulette may end a path.
    pub roulette_depth: u32,
    /// Which strategies find direct light.
    pub direct_light: DirectLight,
    /// Whether paths learn beforehand where light comes from. It changes the noise, not the mean.
    pub guiding: bool,
    /// What lighting agents, who learn beforehand as well, are asked for beside that. It changes the noise, not the mean.
    pub agents: AgentUse,
    /// Samples a pixel that the picture is to have: the more, the longer paths learn beforehand.
    pub planned_samples: u32,
    /// Photon mapping in place of path tracing.
    pub photons: Option<PhotonSettings>,
}

/// The settings of photon mapping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonSettings {
    /// Photons that leave the lights, in each pass of a progressive picture. Without any there is direct light alone.
    pub count: u32,
    /// The nearest photons from which light is estimated; [`NEAREST_MAX`](crate::photon::NEAREST_MAX) at most.
    pub gather: u32,
    /// How far photons may lie, as a share of the radius of what is seen (of the scene, unless that is much wider); those of a
    /// progressive picture a fifth of it in the first pass, and less in each later one.
    pub radius: f32,
    /// The radius of the first pass of a progressive picture in scene units, where it is not to be by the share.
    pub first_radius: Option<f32>,
    /// Rays of the final gathering in each sample, whose ends are lit by the map. 0: what the camera sees is lit by it.
    pub final_rays: u32,
    /// Surfaces that a photon may come to.
    pub bounces: u32,
    /// How near photons count more.
    pub filter: PhotonFilter,
    /// Greatest error with which indirect light on matte surfaces is taken from places near by instead of gathered anew, as
    /// a share (Ward's a): 0.1 careful, 0.4 coarse, 0 never.
    pub irradiance_cache: f32,
    /// Whether photons for caustics are sent where agents that the camera casts look out for them, or to all mirrors and glass alike. It
    /// changes the noise, not the mean.
    pub lookouts: bool,
    /// Whether photons that go on behind what is lit decide where shadow rays are needed.
    pub shadow_photons: bool,
    /// Whether gathering rays go where indirect photons came from, as far as that tells more than chance. It changes the noise, not the mean.
    pub gather_directions: bool,
    /// Whether photons that come straight from the lights and those that were scattered are kept in maps of their own, from which light
    /// is estimated wherever it is asked for; else the irradiance is computed beforehand at places all over the surfaces.
    pub separate_maps: bool,
    /// Whether there is indirect light, but for that over mirrors and through glass alone.
    pub indirect: bool,
    /// Whether each sample has photons of its own, and finds them within a radius that shrinks, so that with more and more
    /// samples the picture becomes that of the path tracer.
    pub progressive: bool,
    /// Autonomous Lighting Agents in place of all photons but those of caustics.
    pub agents: Option<AgentSettings>,
}

/// The settings of Autonomous Lighting Agents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AgentSettings {
    /// Agents cast from all lights together. Their clones behind what they meet come on top.
    pub cast: u32,
    /// Who answers while the picture is painted.
    pub oracle: Oracle,
    /// Whether it is asked which shadow rays are to be traced; else all are.
    pub decides_shadows: bool,
    /// Whether it is asked where indirect light may be interpolated; else it is gathered everywhere.
    pub decides_irradiance: bool,
    /// With [`Oracle::Error`]: whether glossy surfaces ask it what light comes to them from where; else they send rays to all sides.
    pub decides_radiance: bool,
    /// Whether it is asked if a path goes on that has come to where indirect light is not known well enough.
    pub decides_halting: bool,
    /// Whether the proximity network stays, and the median of an agent and its neighbors answers which shadow rays are to be traced.
    pub asks_network: bool,
    /// With [`Oracle::Error`]: greatest relative error of indirect light that is interpolated.
    pub error: f32,
    /// With [`Oracle::Error`]: bytes that all the agents may take. Where they are too few, more is computed while the picture is
    /// painted.
    pub memory_bytes: u64,
}

impl AgentSettings {
    /// How far from where they were measured values are taken, as a share of the distance to other things (Ward's a).
    pub(crate) fn tolerance(&self) -> f32 {
        0.3
    }

    /// Whether agents send scouts to what no light shines at straight: the paper has none.
    pub(crate) fn has_scouts(&self) -> bool {
        self.oracle == Oracle::Error && self.decides_irradiance
    }

    /// How many agents are kept.
    pub(crate) fn agents_max(&self) -> usize {
        /// What an agent takes where it is found by place.
        const AGENT_BYTES: u64 = 26;
        match self.oracle {
            Oracle::Paper => usize::MAX,
            // Half of the memory is for the light.
            Oracle::Error => usize::try_from(self.memory_bytes / (2 * AGENT_BYTES)).unwrap_or(usize::MAX),
        }
    }
}

/// By which rules agents answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Oracle {
    /// By the error that is to be expected.
    #[default]
    Error,
    /// Those of Herubel, Biri and Deverly 2009, *Autonomous Lighting Agents in Photon Mapping*.
    Paper,
}

impl Default for AgentSettings {
    fn default() -> Self {
        Self {
            cast: 50_000,
            oracle: Oracle::default(),
            decides_shadows: true,
            decides_irradiance: true,
            decides_radiance: true,
            decides_halting: false,
            asks_network: false,
            error: 0.1,
            memory_bytes: 4 << 20,
        }
    }
}

/// The weight of a photon at its distance d from the middle of a disc of radius r.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PhotonFilter {
    /// 2 (1 − d²/r²).
    #[default]
    Epanechnikov,
    /// Falls linearly to 1/11 of its peak (Jensen 2001, §7.2.3, k = 1.1).
    Cone,
}

impl Default for PhotonSettings {
    fn default() -> Self {
        Self {
            count: 500_000,
            gather: 60,
            radius: 0.1,
            first_radius: None,
            final_rays: 4,
            bounces: 16,
            filter: PhotonFilter::Epanechnikov,
            irradiance_cache: 0.0,
            lookouts: true,
            shadow_photons: false,
            gather_directions: true,
            separate_maps: false,
            indirect: true,
            progressive: false,
            agents: None,
        }
    }
}

impl Default for PathSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            max_depth: 16,
            light_samples: 1,
            filter: Filter::default(),
            sample_max: f32::INFINITY,
            roulette_depth: 3,
            direct_light: DirectLight::Combined,
            guiding: true,
            agents: AgentUse::ALL,
            planned_samples: 64,
            photons: None,
        }
    }
}
