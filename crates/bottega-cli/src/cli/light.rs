//! Options of light transport: photons, lighting agents, path guiding.

use bottega::request::{
    FINAL_RAYS_MAX, GATHER_MAX, GuideChoice, GuideOptions, GuideUse, LIGHTING_AGENTS_MAX, LightingAgentOptions,
    ORACLE_MEMORY_MAX, OracleChoice, OracleQuestion, PHOTONS_MAX, PhotonOptions,
};
use clap::Args;

use super::{
    choice::choice,
    scene::{change, set},
    values::{parse_oracle_error, parse_share},
};

#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Photon mapping")]
pub(crate) struct PhotonArgs {
    /// Photons that leave the lights; with --progressive in each pass. More of them show sharper caustics and finer changes
    /// of light, and take memory: some 20 bytes for each place where one arrives. Default: 500,000, progressive 100,000.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(PHOTONS_MAX)))]
    photons: Option<u32>,
    /// Photons from which the light at a point is estimated: fewer are sharper, more are smoother. Default: 60.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=i64::from(GATHER_MAX)))]
    photon_gather: Option<u32>,
    /// How far such photons may lie, as a share of the radius of what the camera sees, or of the scene where that is not much
    /// wider. Default: 0.1.
    #[arg(long, value_name = "R", value_parser = parse_share)]
    photon_radius: Option<f32>,
    /// Rays of each sample that gather indirect light, their ends lit by photons. 0 takes the photons at the point itself:
    /// fast, and blotched. Default: 4.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=i64::from(FINAL_RAYS_MAX)))]
    final_rays: Option<u32>,
    /// Take indirect light on matte surfaces from places near by where its error is at most this share: 0.1 careful, 0.4
    /// coarse. Fast at many samples a pixel. Default: gather it again for each sample.
    #[arg(long, value_name = "E", value_parser = parse_share, conflicts_with = "progressive")]
    irradiance_cache: Option<f32>,
    /// Whether photons for caustics are sent where agents that the camera casts look out for them, or to all mirrors and glass
    /// alike. For lighting agents, too. Default: true.
    #[arg(long, value_name = "BOOL")]
    photon_lookouts: Option<bool>,
    /// Trace shadow rays only where photons that went on behind lit surfaces have not settled what is lit and what is not.
    #[arg(long)]
    shadow_photons: bool,
    /// Whether gathering rays go where indirect photons came from: less noise for a little more time. Default: true, but false
    /// with --irradiance-cache, which gathers at few places.
    #[arg(long, value_name = "BOOL")]
    gather_directions: Option<bool>,
    /// Keep direct and indirect photons in maps of their own and count them wherever a gathering ray ends, instead of computing
    /// the irradiance at some places beforehand: slower, and more memory.
    #[arg(long)]
    separate_maps: bool,
    /// Leave out all indirect light but that over mirrors and through glass alone: direct light, shadows and caustics. For
    /// lighting agents, too.
    #[arg(long)]
    no_indirect: bool,
    /// Photons of its own for each sample, looked for within a radius that shrinks: with more and more samples the picture
    /// becomes that of path tracing, caustics that paths do not find among it.
    #[arg(long, conflicts_with = "final_rays")]
    progressive: bool,
}

impl PhotonArgs {
    pub(super) fn apply(&self, photons: &mut PhotonOptions) {
        set(&mut photons.count, self.photons);
        set(&mut photons.gather, self.photon_gather);
        set(&mut photons.radius, self.photon_radius);
        set(&mut photons.final_rays, self.final_rays);
        set(&mut photons.irradiance_cache, self.irradiance_cache);
        change(&mut photons.lookouts, self.photon_lookouts);
        photons.shadow_photons |= self.shadow_photons;
        set(&mut photons.gather_directions, self.gather_directions);
        photons.separate_maps |= self.separate_maps;
        photons.indirect &= !self.no_indirect;
        photons.progressive |= self.progressive;
    }
}

#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Lighting agents")]
pub(crate) struct LightingAgentArgs {
    /// Lighting agents that the lights cast; their clones behind what they meet come on top. Default: 50,000.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=i64::from(LIGHTING_AGENTS_MAX)))]
    lighting_agents: Option<u32>,
    /// By which rules lighting agents answer. Default: error.
    #[arg(long, value_name = "RULES", value_parser = choice::<OracleChoice>())]
    oracle: Option<OracleChoice>,
    /// What lighting agents are asked: which shadow rays must be traced, where indirect light may be interpolated, and whether paths go
    /// on where it may not. What they are not asked is computed everywhere. Default: shadows,irradiance,radiance.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = choice::<OracleQuestion>())]
    oracle_decides: Option<Vec<OracleQuestion>>,
    /// Keep the proximity network, and let the median of an agent and its neighbors answer which shadow rays must be traced.
    #[arg(long)]
    oracle_network: bool,
    /// Greatest relative error of indirect light that is interpolated, with --oracle error. Default: 0.1.
    #[arg(long, value_name = "SHARE", value_parser = parse_oracle_error)]
    oracle_error: Option<f64>,
    /// Megabytes that lighting agents may take, with --oracle error. Where they are too few, more is computed while the picture
    /// is painted. Default: 4.
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(0..=ORACLE_MEMORY_MAX))]
    oracle_memory: Option<u64>,
}

impl LightingAgentArgs {
    pub(super) fn apply(&self, agents: &mut LightingAgentOptions) {
        change(&mut agents.cast, self.lighting_agents);
        change(&mut agents.oracle, self.oracle);
        change(&mut agents.decides, self.oracle_decides.clone());
        agents.network |= self.oracle_network;
        change(&mut agents.error, self.oracle_error);
        change(&mut agents.memory_mb, self.oracle_memory);
    }
}

#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Quality")]
pub(crate) struct GuideArgs {
    /// What paths learn of the light before the first sample. It changes the noise, and not what the picture shows. GPUs paint
    /// the same without.
    #[arg(long, value_name = "GUIDE", value_parser = choice::<GuideChoice>())]
    guide: Option<GuideChoice>,
    /// What lighting agents are asked for; default: all of it.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = choice::<GuideUse>())]
    ala: Vec<GuideUse>,
    /// The same as --guide none.
    #[arg(long, conflicts_with_all = ["guide", "ala"])]
    no_guiding: bool,
}

impl GuideArgs {
    pub(super) fn apply(&self, guide: &mut GuideOptions) {
        set(&mut guide.by, self.guide);
        if !self.ala.is_empty() {
            guide.uses.clone_from(&self.ala);
        }
        if self.no_guiding {
            *guide = GuideOptions { by: Some(GuideChoice::None), uses: Vec::new() };
        }
    }
}
