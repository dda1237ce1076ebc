//! The plan of a picture: every choice made for it, from the request and the loaded scene.
//!
//! A plan holds values alone; `src/builtin.rs` makes the engine of it. The environment belongs to the scene, so it is chosen where
//! the scene is loaded: see [`loaded_scene`](crate::loaded_scene).

mod job;
mod part;

use std::{collections::BTreeMap, num::NonZeroU32, sync::Arc};

use bottega_engines::Urgency;
use bottega_farm::{Goal, JobSettings};
use bottega_render::{AgentUse, PathSettings};

pub use self::part::PicturePart;
pub(crate) use self::{
    job::{check_crop, crop, default_sample_limit, shared_settings},
    part::time_goal,
};
use crate::{
    agent_rules::AgentRules,
    devices::DeviceChoice,
    error::Error,
    loaded_scene::LoadedScene,
    method::Method,
    request::{IntegratorChoice, Request},
    settings::{asks_for_agents, directions, filter, guide_agents, max_depth},
    technique_choice::TechniqueChoice,
};

/// Largest number of samples per pixel for which the guide is planned if the final number is unknown.
const PLANNED_SAMPLES_MAX: u32 = 256;

/// Every choice made for a picture by the built-in engine.
pub struct Plan {
    /// The integrator, with its settings of photons.
    pub method: Method,
    /// The settings of paths: depth, pixel filter, guiding, and the samples per pixel that learning is planned for.
    pub paths: PathSettings,
    /// The rules that choose between paths and photons, with `--integrator auto`.
    pub technique: Option<Arc<TechniqueChoice>>,
    /// The settings of the job: film, layers, samples, goal, zones, agents and their rules.
    pub job: JobSettings,
    /// The devices that the request allows.
    pub devices: DeviceChoice,
    /// The most memory for scenes on each GPU, in bytes; `None`: nearly all free memory.
    pub gpu_memory: Option<u64>,
    /// Largest number of work units that wait for a processor or device; `None`: chosen by their speed.
    pub bin: Option<NonZeroU32>,
    /// The urgency of the picture among all pictures that this process renders.
    pub urgency: Urgency,
    /// Warnings about the rules, groups of lights and shadow catchers.
    pub notes: Vec<String>,
    /// Patterns of shadow catchers.
    pub shadow_catchers: Vec<String>,
    /// Groups of lights by name, with the patterns of their lights.
    pub light_groups: BTreeMap<String, Vec<String>>,
    /// True if the request asks for rays as work units of their own.
    pub wants_waves: bool,
    /// True if the request explicitly asks for lighting agents as guides.
    pub wants_agents: bool,
}

impl Plan {
    /// Makes all choices for a picture.
    ///
    /// - `part`: the part of the picture that this process renders.
    ///
    /// # Errors
    /// The crop does not lie within the picture, or a layer or a device cannot be used.
    pub fn of(
        request: &Request,
        scene: &LoadedScene,
        rules: AgentRules,
        part: &PicturePart<'_>,
    ) -> Result<Self, Error> {
        // Choose the integrator
        let max_depth = max_depth(request, scene);
        let method = Method::of(request, scene, max_depth);
        // Choose film, samples, goal and agents
        let settings = job::settings(request, scene, rules.experts, max_depth)?;
        let agents = part.agents().unwrap_or(settings.agents);
        let job = JobSettings { goal: part.goal(request), engine_choice: rules.choice, agents, ..settings };
        // Choose depth, filter and guiding of paths; paths that may meet shadow catchers have no guide
        let has_catchers = !request.film.shadow_catchers.is_empty();
        let paths = PathSettings {
            seed: request.seed,
            max_depth,
            light_samples: request.integrator.light_samples,
            filter: filter(request, scene),
            sample_max: scene.hints.sample_max.unwrap_or(f32::INFINITY),
            guiding: directions(&request.guide) && !has_catchers,
            agents: if has_catchers { AgentUse::default() } else { guide_agents(&request.guide) },
            planned_samples: planned_samples(&job),
            instant_shutter: request.view.instant_shutter,
            photons: method.photons,
            tries_photons: method.integrator == IntegratorChoice::Auto,
            technique_rules: rules.technique.as_ref().map_or(0, TechniqueChoice::digest),
            ..PathSettings::default()
        };
        // Choose devices
        let devices = DeviceChoice::of(&request.devices.names)
            .map_err(|allowed| Error::usage("these devices cannot be chosen", allowed.to_string()))?
            .exactly(request.devices.exact)?;
        Ok(Self {
            method,
            paths,
            technique: rules.technique.map(Arc::new),
            job,
            devices,
            gpu_memory: request.devices.memory_mb.map(|mib| u64::from(mib) << 20),
            bin: request.devices.bin.and_then(NonZeroU32::new),
            urgency: part.urgency(request),
            notes: rules.notes,
            shadow_catchers: request.film.shadow_catchers.clone(),
            light_groups: request.film.light_groups.clone(),
            wants_waves: request.integrator.wavefront,
            wants_agents: asks_for_agents(&request.guide),
        })
    }
}

/// Returns the samples per pixel for which learning is planned, as known before rendering.
fn planned_samples(job: &JobSettings) -> u32 {
    match job.goal {
        Goal::Samples => job.samples,
        Goal::Error(_) | Goal::Time(_) => job.samples.min(PLANNED_SAMPLES_MAX),
    }
}
