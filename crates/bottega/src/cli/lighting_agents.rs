//! The options of Autonomous Lighting Agents.

use bottega_render::{AgentSettings, Oracle, PhotonSettings};
use clap::{Args, ValueEnum};

#[derive(Clone, Debug, Args)]
pub(crate) struct LightingAgentArgs {
    /// Lighting agents that the lights cast; their clones behind what they meet come on top.
    #[arg(long, value_name = "N", default_value_t = AgentSettings::default().cast, value_parser = clap::value_parser!(u32).range(0..=10_000_000), help_heading = "Lighting agents")]
    pub(crate) lighting_agents: u32,
    /// By which rules lighting agents answer.
    #[arg(long, value_enum, default_value_t = OracleArg::Paper, help_heading = "Lighting agents")]
    pub(crate) oracle: OracleArg,
    /// What lighting agents are asked: which shadow rays must be traced, and where indirect light may be interpolated. What
    /// they are not asked is computed everywhere.
    #[arg(
        long,
        value_enum,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "shadows,irradiance",
        help_heading = "Lighting agents"
    )]
    pub(crate) oracle_decides: Vec<QuestionArg>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum OracleArg {
    /// Those of Herubel, Biri and Deverly 2009.
    Paper,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum QuestionArg {
    /// Which shadow rays must be traced.
    Shadows,
    /// Where indirect light may be interpolated.
    Irradiance,
}

impl LightingAgentArgs {
    /// - `photons`: of the caustics; what else photons may do is left to the agents.
    pub(crate) fn settings(&self, photons: PhotonSettings) -> PhotonSettings {
        let OracleArg::Paper = self.oracle;
        let agents = AgentSettings {
            cast: self.lighting_agents,
            oracle: Oracle::Paper,
            decides_shadows: self.oracle_decides.contains(&QuestionArg::Shadows),
            decides_irradiance: self.oracle_decides.contains(&QuestionArg::Irradiance),
        };
        PhotonSettings {
            agents: Some(agents),
            irradiance_cache: 0.0,
            shadow_photons: false,
            progressive: false,
            ..photons
        }
    }
}
