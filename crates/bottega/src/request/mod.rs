//! Requests: descriptions of pictures as plain data, made by every interface and read by sessions.

mod choices;
mod device_choice;
mod field;
mod json;
mod limits;
mod sections;
mod set;
mod validate;

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::validate::{TAG_FORM, check_sides, check_size, is_tag};
pub use self::{
    choices::{
        AdaptationChoice, AuctionChoice, BUILTIN, BalanceChoice, GuideChoice, GuideUse, ImportanceChoice,
        IntegratorChoice, OptimizationChoice, OracleChoice, OracleQuestion, PixelFilter, PngEncoding, ToneCurve,
        WordChoice,
    },
    device_choice::{AUTO, DeviceChoice},
    field::InvalidField,
    json::{REQUEST_BYTES_MAX, RequestError},
    limits::*,
    sections::{
        BandChoice, CameraPose, DeviceOptions, EngineOptions, EnvironmentLight, EnvironmentOptions, FarmOptions,
        FilmOptions, FrameOptions, GoalOptions, GuideOptions, IntegratorOptions, LightingAgentOptions, OutputOptions,
        PhotonOptions, RulesSource, RulesText, SceneOptions, ViewOptions, WorkOptions,
    },
};

/// The version of the request format. Requests of a newer version are refused.
pub const REQUEST_VERSION: u32 = 1;

/// A picture asked for: plain data with documented defaults.
///
/// Two requests that are equal give the same picture, whoever paints it and whatever door they came through. What is left
/// out has its default. How a program tells of the work (progress, previews, traces) is no part of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Request")]
pub struct Request {
    /// The version of this vocabulary.
    #[serde(default = "version")]
    pub version: u32,
    /// Which scene file, and how it is read.
    pub scene: SceneOptions,
    /// Light from all around.
    #[serde(default)]
    pub environment: EnvironmentOptions,
    /// The camera.
    #[serde(default)]
    pub view: ViewOptions,
    /// Size, part, filter and layers of the picture.
    #[serde(default)]
    pub film: FilmOptions,
    /// When the picture is good enough.
    #[serde(default)]
    pub goal: GoalOptions,
    /// How light is followed.
    #[serde(default)]
    pub integrator: IntegratorOptions,
    /// Photon mapping.
    #[serde(default)]
    pub photons: PhotonOptions,
    /// Autonomous Lighting Agents.
    #[serde(default)]
    pub lighting_agents: LightingAgentOptions,
    /// What paths learn of the light before the first sample.
    #[serde(default)]
    pub guide: GuideOptions,
    /// Who paints: our own engine or other renderers.
    #[serde(default)]
    pub engine: EngineOptions,
    /// How the work is shared out among agents.
    #[serde(default)]
    pub work: WorkOptions,
    /// The processors and devices of this machine that paint.
    #[serde(default)]
    pub devices: DeviceOptions,
    /// The seed: another one gives other noise, the same one the same picture, bit for bit.
    #[serde(default)]
    pub seed: u64,
    /// The frames of an animation; none: one picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<FrameOptions>,
    /// The file that the picture is written to.
    #[serde(default)]
    pub output: OutputOptions,
    /// What a farm is told of the job.
    #[serde(default)]
    pub farm: FarmOptions,
}

fn version() -> u32 {
    REQUEST_VERSION
}

impl Request {
    /// Makes a request for a scene file, with defaults in all other fields.
    pub fn new(scene: impl Into<PathBuf>) -> Self {
        Self {
            version: REQUEST_VERSION,
            scene: SceneOptions::new(scene),
            environment: EnvironmentOptions::default(),
            view: ViewOptions::default(),
            film: FilmOptions::default(),
            goal: GoalOptions::default(),
            integrator: IntegratorOptions::default(),
            photons: PhotonOptions::default(),
            lighting_agents: LightingAgentOptions::default(),
            guide: GuideOptions::default(),
            engine: EngineOptions::default(),
            work: WorkOptions::default(),
            devices: DeviceOptions::default(),
            seed: 0,
            frames: None,
            output: OutputOptions::default(),
            farm: FarmOptions::default(),
        }
    }

    /// Returns the JSON Schema of requests, for editors and other programs.
    pub fn schema() -> schemars::Schema {
        schemars::schema_for!(Self)
    }
}
