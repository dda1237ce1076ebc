//! Requests: descriptions of pictures as plain data, made by every interface and read by sessions.

mod choices;
mod device_choice;
mod field;
mod json;
mod limits;
mod ranged;
mod schema;
mod sections;
mod set;
mod validate;

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::validate::{SizeError, TAG_FORM, check_sides, check_size, is_tag};
pub use self::{
    choices::{
        AdaptationChoice, AuctionChoice, BUILTIN, BalanceChoice, ColorSpace, Compression, GuideChoice, GuideUse,
        ImportanceChoice, IntegratorChoice, OptimizationChoice, OracleChoice, OracleQuestion, PixelFilter, PngEncoding,
        ProjectionChoice, StereoChoice, ToneCurve, WordChoice,
    },
    device_choice::{AUTO, DeviceChoice, DeviceNamesError},
    field::InvalidField,
    json::{REQUEST_BYTES_MAX, RequestError},
    limits::*,
    schema::RequestField,
    sections::{
        BandChoice, CameraPose, DeviceOptions, EngineOptions, EnvironmentLight, EnvironmentOptions, FarmOptions,
        FilmOptions, FrameOptions, GoalOptions, GuideOptions, IntegratorOptions, LightingAgentOptions, OutputOptions,
        PhotonOptions, RulesSource, RulesText, SceneOptions, ShutterTimes, ViewOptions, WorkOptions,
    },
};

/// The version of the request format. Requests of a newer version are refused.
pub const REQUEST_VERSION: u32 = 1;

/// The description of a picture: plain data with documented defaults.
///
/// Equal requests give the same picture, on every machine and through every interface. Missing fields have their defaults.
/// Settings of how a program reports its work (progress, previews, traces) are not part of a request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Request")]
pub struct Request {
    /// The version of the request format.
    #[serde(default = "version")]
    pub version: u32,
    /// The scene file, and options for reading it.
    pub scene: SceneOptions,
    /// The environment light.
    #[serde(default)]
    pub environment: EnvironmentOptions,
    /// The camera and its pose.
    #[serde(default)]
    pub view: ViewOptions,
    /// Size, crop, pixel filter and layers of the picture.
    #[serde(default)]
    pub film: FilmOptions,
    /// The goal at which the picture is finished.
    #[serde(default)]
    pub goal: GoalOptions,
    /// The integrator.
    #[serde(default)]
    pub integrator: IntegratorOptions,
    /// Settings of photon mapping.
    #[serde(default)]
    pub photons: PhotonOptions,
    /// Settings of Autonomous Lighting Agents.
    #[serde(default)]
    pub lighting_agents: LightingAgentOptions,
    /// Path guiding: knowledge of the light, learned before the first sample.
    #[serde(default)]
    pub guide: GuideOptions,
    /// The engine: the built-in one or external renderers.
    #[serde(default)]
    pub engine: EngineOptions,
    /// Sharing the work among agents.
    #[serde(default)]
    pub work: WorkOptions,
    /// The processors and devices of this machine that render.
    #[serde(default)]
    pub devices: DeviceOptions,
    /// Seed of the random numbers: the same seed gives the same picture, bit for bit; another one gives other noise.
    #[serde(default)]
    pub seed: u64,
    /// The frames of an animation; none: one picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<FrameOptions>,
    /// The output file.
    #[serde(default)]
    pub output: OutputOptions,
    /// Settings of the job on a farm.
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
}
