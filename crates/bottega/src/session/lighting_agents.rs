//! The work of lighting agents, for people, scripts and the picture's metadata.

use bottega_image::Metadata;
use bottega_render::ala::AgentReport;

use super::Reporter;
use crate::events::{Event, LightingAgents};

/// Tells what a swarm was like, what it cost and what it spared.
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
