//! The options of Autonomous Lighting Agents.

use bottega_render::{AgentSettings, Oracle, PhotonSettings};
use clap::{Args, ValueEnum};

#[derive(Clone, Debug, Args)]
pub(crate) struct LightingAgentArgs {
    /// Lighting agents that the lights cast; their clones behind what they meet come on top.
    #[arg(long, value_name = "N", default_value_t = AgentSettings::default().cast, value_parser = clap::value_parser!(u32).range(0..=10_000_000), help_heading = "Lighting agents")]
    pub(crate) lighting_agents: u32,
    /// By which rules lighting agents answer.
    #[arg(long, value_enum, default_value_t = OracleArg::Error, help_heading = "Lighting agents")]
    pub(crate) oracle: OracleArg,
    /// What lighting agents are asked: which shadow rays must be traced, and where indirect light may be interpolated. What
    /// they are not asked is computed everywhere.
    #[arg(
        long,
        value_enum,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "shadows,irradiance,radiance",
        help_heading = "Lighting agents"
    )]
    pub(crate) oracle_decides: Vec<QuestionArg>,
    /// Greatest relative error of indirect light that is interpolated, with --oracle error.
    #[arg(long, value_name = "SHARE", default_value_t = 0.1, value_parser = parse_error, help_heading = "Lighting agents")]
    pub(crate) oracle_error: f64,
    /// Megabytes that lighting agents may take, with --oracle error. Where they are too few, more is computed while the picture is
    /// painted.
    #[arg(long, value_name = "MB", default_value_t = AgentSettings::default().memory_bytes >> 20, value_parser = clap::value_parser!(u64).range(0..=1 << 20), help_heading = "Lighting agents")]
    pub(crate) oracle_memory: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum OracleArg {
    /// By the error that is to be expected: they look around more where it is great, and answer where it is small.
    Error,
    /// Those of Herubel, Biri and Deverly 2009.
    Paper,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum QuestionArg {
    /// Which shadow rays must be traced.
    Shadows,
    /// Where indirect light may be interpolated.
    Irradiance,
    /// What light comes from where to surfaces that are not matte, with --oracle error.
    Radiance,
}

fn parse_error(text: &str) -> Result<f64, String> {
    let error: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.001..=1.0).contains(&error) { Ok(error) } else { Err("from 0.001 to 1".to_owned()) }
}

impl LightingAgentArgs {
    /// - `photons`: of the caustics; what else photons may do is left to the agents.
    pub(crate) fn settings(&self, photons: PhotonSettings) -> PhotonSettings {
        let agents = AgentSettings {
            cast: self.lighting_agents,
            oracle: match self.oracle {
                OracleArg::Error => Oracle::Error,
                OracleArg::Paper => Oracle::Paper,
            },
            error: self.oracle_error as f32,
            memory_bytes: self.oracle_memory << 20,
            decides_shadows: self.oracle_decides.contains(&QuestionArg::Shadows),
            decides_irradiance: self.oracle_decides.contains(&QuestionArg::Irradiance),
            decides_radiance: self.oracle_decides.contains(&QuestionArg::Radiance),
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
