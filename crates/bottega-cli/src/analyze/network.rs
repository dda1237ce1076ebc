//! The proximity network of lighting agents: `bottega analyze --network`.

use bottega::analysis::AnalyzedScene;
use bottega_image::{Canvas, ColorMap};
use bottega_render::{
    AgentSettings, PathSettings, PhotonSettings,
    ala::{Dot, network_dots},
};

use super::draw::PictureFolder;
use crate::{cli::AnalyzeArgs, error::CliError};

/// Agents that are drawn if the command does not say how many: few enough to tell their links apart.
const AGENTS: u32 = 2_500;

/// Draws the agents and their links at what the camera sees, and adds the file.
pub(super) fn draw(args: &AnalyzeArgs, subject: &AnalyzedScene, drawn: &mut PictureFolder<'_>) -> Result<(), CliError> {
    let cast = args.lighting_agents.unwrap_or(AGENTS);
    let agents = AgentSettings { cast, ..AgentSettings::default() };
    let bounces = subject.settings.tunables.max_depth;
    let photons = PhotonSettings { count: args.photons, bounces, agents: Some(agents), ..PhotonSettings::default() };
    let settings = PathSettings { max_depth: bounces, photons: Some(photons), ..PathSettings::default() };
    let loaded = &subject.subject;
    let dots = network_dots(&loaded.prepared, &loaded.prepass, &loaded.view, &settings)?;
    let value = |dot: &Dot| match dot {
        Dot::Nothing => f32::NAN,
        Dot::Free => 0.0,
        Dot::Sample(answer) => *answer,
    };
    let values: Vec<f32> = dots.iter().map(value).collect();
    let canvas = Canvas::heat_map(loaded.view.width, loaded.view.height, &values, 1.0, ColorMap::Viridis);
    let meaning = format!(
        "{cast} lighting agents and their links, by what they answer: bright lit, dim shaded, between: trace a shadow ray"
    );
    drawn.put("network", &canvas, &meaning)
}
