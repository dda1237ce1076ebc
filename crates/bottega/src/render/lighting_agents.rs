//! What lighting agents did, for people, scripts and the picture's metadata.

use bottega_image::Metadata;
use bottega_render::ala::AgentReport;
use bottega_web::wire::Event;

use crate::reporter::{Reporter, duration};

/// Tells what a swarm was like, what it cost and what it spared.
pub(super) fn tell(swarm: &AgentReport, reporter: &Reporter, metadata: &mut Metadata) {
    let [geometry, proximity, penumbra, irradiance] = swarm.sensors;
    reporter.say(&format!(
        "lighting agents: {} cast, {} stored ({} clones), {:.1} MB; cast in {}, {penumbra} penumbra, {irradiance} irradiance, \
         {geometry} geometry and {proximity} proximity sensors in {}",
        swarm.cast,
        swarm.agents,
        swarm.clones,
        swarm.map_bytes as f64 / 1e6,
        duration(swarm.casting),
        duration(swarm.sensing),
    ));
    let tally = &swarm.tally;
    reporter.say(&format!(
        "shadow rays: {} traced, {} spared ({:.1} % traced); indirect light: {} times gathered, {} times interpolated",
        tally.shadow_traced,
        tally.shadow_spared,
        100.0 * share(tally.shadow_traced, tally.shadow_spared),
        tally.irradiance_computed,
        tally.irradiance_interpolated,
    ));
    let event = bottega_web::wire::LightingAgents {
        cast: swarm.cast,
        agents: swarm.agents,
        clones: swarm.clones,
        sensors: swarm.sensors,
        links: swarm.links,
        answers: swarm.answers,
        object_distance: swarm.object_distance,
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

/// The share of the first in both.
fn share(part: u64, rest: u64) -> f64 {
    part as f64 / (part + rest).max(1) as f64
}
