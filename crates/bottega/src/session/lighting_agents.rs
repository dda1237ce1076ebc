//! The statistics of lighting agents, as an event and as metadata of the picture.

use bottega_image::Metadata;
use bottega_render::ala::AgentReport;

use super::Reporter;
use crate::events::{Event, LightingAgents};

/// Reports the statistics of lighting agents as an event, and stores them in the metadata as `lighting_agents_NAME`.
pub(super) fn tell(swarm: &AgentReport, reporter: &Reporter, metadata: &mut Metadata) {
    let tally = &swarm.tally;
    let event = LightingAgents {
        cast: swarm.cast,
        agents: swarm.agents,
        clones: swarm.clones,
        sensors: swarm.sensors,
        links: swarm.links,
        answers: swarm.answers,
        object_distance: swarm.object_distance,
        caustics_seen: swarm.caustics_seen,
        map_bytes: swarm.map_bytes,
        casting_seconds: swarm.casting.as_secs_f64(),
        sensing_seconds: swarm.sensing.as_secs_f64(),
        shadow_rays_traced: tally.shadow_traced,
        shadow_rays_spared: tally.shadow_spared,
        irradiance_computed: tally.irradiance_computed,
        irradiance_interpolated: tally.irradiance_interpolated,
    };
    if let Ok(serde_json::Value::Object(figures)) = serde_json::to_value(event) {
        for (name, value) in figures {
            metadata.set(&format!("lighting_agents_{name}"), value.to_string());
        }
    }
    reporter.tell(Event::LightingAgents(event));
}
