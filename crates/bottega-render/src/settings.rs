//! Settings of a picture: view, path tracing, photon mapping, lighting agents.

use std::sync::Arc;

use bottega_scene::{Camera, Scene};

use crate::{error::RenderError, filter::Filter};

/// A camera and a size: the view that a picture shows. It travels beside the prepared scene, which knows no cameras but
/// those of its file.
#[derive(Clone, Debug)]
pub struct View {
    /// The camera. It may differ from the scene's cameras in position, lens and angle; its medium and
    /// [`hides_emitters`](Camera::hides_emitters) must equal those of one of the scene's.
    pub camera: Arc<Camera>,
    /// Width of the whole picture in pixels.
    pub width: u32,
    /// Height of the whole picture in pixels.
    pub height: u32,
}

impl View {
    /// Returns the view of a camera of the scene.
    ///
    /// - `index`: index into [`Scene::cameras`].
    /// - `width`, `height`: size of the whole picture in pixels.
    ///
    /// # Errors
    /// [`RenderError::NoCamera`].
    pub fn of_scene(scene: &Scene, index: usize, width: u32, height: u32) -> Result<Self, RenderError> {
        let count = scene.cameras.len();
        let camera = scene.cameras.get(index).ok_or(RenderError::NoCamera { index, count })?;
        Ok(Self { camera: Arc::new(camera.clone()), width, height })
    }

    /// Returns the view of the same camera in another size, in pixels.
    #[must_use]
    pub fn sized(&self, width: u32, height: u32) -> Self {
        Self { camera: Arc::clone(&self.camera), width, height }
    }

    /// Returns the number of pixels of the whole picture.
    pub(crate) fn pixel_count(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }
}

impl PartialEq for View {
    /// The units of work of one picture share their camera, so that its address decides for most of them.
    fn eq(&self, other: &Self) -> bool {
        let has_same_camera = Arc::ptr_eq(&self.camera, &other.camera) || self.camera == other.camera;
        has_same_camera && (self.width, self.height) == (other.width, other.height)
    }
}

/// The strategies that find direct light. All have the same mean where none of them misses light, so the single ones
/// serve to test the combination.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DirectLight {
    /// Light sampling and BSDF sampling, combined by the power heuristic (Veach 1997, §9.2.4).
    #[default]
    Combined,
    /// Light sampling alone. Misses light that is visible only through Dirac lobes.
    LightSampling,
    /// BSDF sampling alone. Misses lights without extent.
    BsdfSampling,
}

/// The uses of what lighting agents learn, in path tracing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct AgentUse {
    /// `true`: the agents' knowledge of visibility saves shadow rays.
    pub shadows: bool,
    /// `true`: the agents guide the choice of lights.
    pub lights: bool,
    /// `true`: the agents estimate a path's contribution for Russian roulette and splitting.
    pub roulette: bool,
}

impl AgentUse {
    /// All uses enabled.
    pub const ALL: Self = Self { shadows: true, lights: true, roulette: true };

    /// Returns true if any use is enabled.
    pub fn any(self) -> bool {
        self.shadows || self.lights || self.roulette
    }
}

/// The settings of a picture's light transport: path tracing, or photon mapping if [`Self::photons`] is set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSettings {
    /// Seed of the random numbers; the mean does not depend on it.
    pub seed: u64,
    /// Largest number of bounces. 0: only directly visible emission; 1: direct light; and so on.
    pub max_depth: u32,
    /// Number of light samples per path vertex; at least 1 is taken.
    pub light_samples: u32,
    /// Reconstruction filter of the pixels.
    pub filter: Filter,
    /// Largest value of a sample's channels. Brighter samples are scaled down to it, which keeps their colour; infinity:
    /// no limit.
    pub sample_max: f32,
    /// Number of bounces before Russian roulette starts.
    pub roulette_depth: u32,
    /// The strategies for direct light.
    pub direct_light: DirectLight,
    /// `true`: paths learn in a prepass where light comes from. Changes the noise, not the mean.
    pub guiding: bool,
    /// Uses of lighting agents, which also learn in a prepass. Changes the noise, not the mean.
    pub agents: AgentUse,
    /// Number of samples per pixel planned for the picture; the prepass learns longer for more samples.
    pub planned_samples: u32,
    /// `true`: all paths have the middle of the shutter's time, so that nothing is blurred; motion vectors still span all
    /// of it.
    pub instant_shutter: bool,
    /// Photon mapping instead of path tracing, if set.
    pub photons: Option<PhotonSettings>,
    /// `true`: a trial decides for each zone of the picture whether paths or [`Self::photons`] render it; `false`: photons
    /// render all of it, if they are set.
    pub tries_photons: bool,
    /// Digest of the rules that choose between paths and photons: other rules choose other zones.
    pub technique_rules: u64,
}

/// The settings of photon mapping: photons, final gathering, caches and lighting agents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonSettings {
    /// Number of photons emitted, in each pass for a progressive picture. 0: direct light only.
    pub count: u32,
    /// Number of nearest photons in an estimate; at most [`NEAREST_MAX`](crate::photon::NEAREST_MAX).
    pub gather: u32,
    /// Largest distance of photons in an estimate, as a fraction of the scene's radius, or of the radius of its visible
    /// part where the scene is much wider. Progressive pictures start with a fifth of it, which shrinks from pass to
    /// pass.
    pub radius: f32,
    /// Radius of the first pass of a progressive picture, in scene units; `None`: derived from [`Self::radius`].
    pub first_radius: Option<f32>,
    /// Number of final gather rays per sample. 0: the photon map lights visible surfaces directly.
    pub final_rays: u32,
    /// Largest number of surfaces that a photon visits.
    pub bounces: u32,
    /// Weights of photons by distance.
    pub filter: PhotonFilter,
    /// Largest relative error at which indirect light on matte surfaces is interpolated instead of gathered again (Ward's
    /// a): 0.1 careful, 0.4 coarse, 0 never.
    pub irradiance_cache: f32,
    /// `true`: caustic photons are aimed where agents cast from the camera detect caustics; `false`: at all specular
    /// surfaces equally. Changes the noise, not the mean.
    pub lookouts: bool,
    /// `true`: shadow photons, which continue behind lit surfaces, decide where shadow rays are traced.
    pub shadow_photons: bool,
    /// `true`: final gather rays follow the directions of indirect photons, where these are informative. Changes the
    /// noise, not the mean.
    pub gather_directions: bool,
    /// `true`: direct and indirect photons are kept in separate maps and estimated at each lookup; `false`: irradiance is
    /// precomputed at points on all surfaces.
    pub separate_maps: bool,
    /// `true`: includes indirect light; `false`: only direct light and light over specular surfaces.
    pub indirect: bool,
    /// `true`: each sample has its own photons, gathered within a shrinking radius, so that the picture converges to that
    /// of the path tracer.
    pub progressive: bool,
    /// Autonomous Lighting Agents instead of all photons but those of caustics, if set.
    pub agents: Option<AgentSettings>,
}

/// The settings of Autonomous Lighting Agents: their number, their rules, and what they decide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AgentSettings {
    /// Number of agents cast from all lights together, not counting their clones behind surfaces.
    pub cast: u32,
    /// The rules by which agents answer during rendering.
    pub oracle: Oracle,
    /// `true`: agents decide which shadow rays are traced; `false`: all are.
    pub decides_shadows: bool,
    /// `true`: agents decide where indirect light is interpolated; `false`: it is gathered everywhere.
    pub decides_irradiance: bool,
    /// With [`Oracle::Error`], `true`: glossy surfaces ask agents for incident light by direction; `false`: they trace
    /// rays in all directions.
    pub decides_radiance: bool,
    /// `true`: the proximity network is kept, and the median over an agent and its neighbours decides which shadow rays
    /// are traced.
    pub asks_network: bool,
    /// With [`Oracle::Error`]: largest relative error of interpolated indirect light.
    pub error: f32,
    /// With [`Oracle::Error`]: memory budget of all agents, in bytes. With too little, more is computed during rendering.
    pub memory_bytes: u64,
}

impl AgentSettings {
    /// Returns the largest distance of interpolation from a measured value, as a fraction of the distance to other
    /// surfaces (Ward's a).
    pub(crate) fn tolerance(&self) -> f32 {
        0.3
    }

    /// Returns true if agents send scouts to surfaces without direct light. The paper has none.
    pub(crate) fn has_scouts(&self) -> bool {
        self.oracle == Oracle::Error && self.decides_irradiance
    }

    /// Returns the largest number of agents kept.
    pub(crate) fn agents_max(&self) -> usize {
        /// Memory of an agent in the spatial index, in bytes.
        const AGENT_BYTES: u64 = 26;
        match self.oracle {
            Oracle::Paper => usize::MAX,
            // Half of the memory is for the light
            Oracle::Error => usize::try_from(self.memory_bytes / (2 * AGENT_BYTES)).unwrap_or(usize::MAX),
        }
    }
}

/// The rules by which lighting agents answer, or decline to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Oracle {
    /// Agents answer where the expected error of the answer is small.
    #[default]
    Error,
    /// The rules of Herubel, Biri and Deverly 2009, *Autonomous Lighting Agents in Photon Mapping*.
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
            asks_network: false,
            error: 0.1,
            memory_bytes: 4 << 20,
        }
    }
}

/// The weight of a photon at distance d from the centre of a disc of radius r.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PhotonFilter {
    /// The weight 2 (1 − d²/r²).
    #[default]
    Epanechnikov,
    /// A weight that falls linearly to 1/11 of its peak (Jensen 2001, §7.2.3, k = 1.1).
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
            instant_shutter: false,
            photons: None,
            tries_photons: false,
            technique_rules: 0,
        }
    }
}
