//! The sections of a request: plain structs with defaults.

use std::{collections::BTreeMap, path::PathBuf};

use bottega_farm::{Channel, ZoneLimits};
use bottega_render::AgentSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    choices::{
        AdaptationChoice, AuctionChoice, BUILTIN, BalanceChoice, GuideChoice, GuideUse, ImportanceChoice,
        IntegratorChoice, OptimizationChoice, OracleChoice, OracleQuestion, PixelFilter, PngEncoding, ToneCurve,
    },
    device_choice::AUTO,
    limits::PRIORITY,
};
use crate::frames::Frames;

/// Declares sections: structs that are JSON objects, with all members optional.
macro_rules! sections {
    ($($(#[$attribute:meta])* $name:ident { $($(#[$field_attribute:meta])* $field:ident: $type:ty = $default:expr,)* })*) => {
        $(
            $(#[$attribute])*
            #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
            #[serde(deny_unknown_fields, default)]
            pub struct $name {
                $($(#[$field_attribute])* pub $field: $type,)*
            }

            impl Default for $name {
                fn default() -> Self {
                    Self { $($field: $default,)* }
                }
            }
        )*
    };
}

/// The scene file, and how it is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneOptions {
    /// The scene: glTF (.glb, .gltf), Mitsuba 3 (.xml), pbrt-v4 (.pbrt), a mesh (.obj, .ply), or what another engine reads.
    pub file: PathBuf,
    /// Whether the scene is refused when something in it is not supported, instead of painting a substitute.
    #[serde(default)]
    pub strict: bool,
    /// Whether the scene may read files outside of its own folder.
    #[serde(default)]
    pub allow_outside: bool,
    /// Folders below which the scene may read files, too.
    #[serde(default)]
    pub asset_roots: Vec<PathBuf>,
    /// Whether the camera sees through the backs of a glTF scene's materials that are not double-sided.
    #[serde(default)]
    pub cull_backfaces: bool,
    /// Parameters of a Mitsuba scene (its `<default>`s), by name.
    #[serde(default)]
    pub defines: BTreeMap<String, String>,
    /// The time in seconds at which a glTF scene's animations are shown; none: the scene as its file describes it.
    #[serde(default)]
    pub time: Option<f32>,
    /// The animation to show, by name or by number from 0; none: all of them.
    #[serde(default)]
    pub animation: Option<String>,
    /// Which of a glTF file's variants of materials to show, by name or by number from 0.
    #[serde(default)]
    pub variant: Option<String>,
}

impl SceneOptions {
    /// Makes the options for a scene file, with defaults in all other fields.
    pub fn new(file: impl Into<PathBuf>) -> Self {
        Self {
            file: file.into(),
            strict: false,
            allow_outside: false,
            asset_roots: Vec::new(),
            cull_backfaces: false,
            defines: BTreeMap::new(),
            time: None,
            animation: None,
            variant: None,
        }
    }
}

/// The light from all around.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum EnvironmentLight {
    /// A picture of the whole sphere: .hdr, .exr or .png.
    File(PathBuf),
    /// The same radiance from everywhere: red, green and blue.
    Radiance([f32; 3]),
    /// The neutral sky that a scene without any light gets by itself.
    Sky,
}

/// The place of a camera, in the coordinates of the scene file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraPose {
    /// Where it stands.
    pub eye: [f64; 3],
    /// At what it looks.
    pub target: [f64; 3],
    /// The direction of the picture's upper edge; none: +y.
    #[serde(default = "upward")]
    pub up: [f64; 3],
    /// The full angle between the upper and the lower edge, in degrees; none: as the camera has it.
    #[serde(default)]
    pub fov: Option<f32>,
}

fn upward() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

/// The width of the bands in which neighboring zones are blended. With optimization off there are none: zones agree to the last bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BandChoice {
    /// There are none: zones meet at an edge.
    Off,
    /// The expert rules say it, edge by edge.
    Rules,
    /// So many pixels beyond each edge of each zone.
    Pixels(u32),
}

/// Rules of agents.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RulesSource {
    /// A file of FCL text, or the name of rules that come with the program, such as `paper`: the MAGarRO paper's own set.
    File(PathBuf),
    /// The text itself.
    Text(RulesText),
}

/// A text of rules, and what people call it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RulesText {
    /// What people call it: the file that it was read from.
    pub name: PathBuf,
    /// FCL.
    pub text: String,
}

/// The frames of an animation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrameOptions {
    /// Which frames.
    pub list: Frames,
    /// Frames a second: frame N shows the scene at N / `fps` seconds.
    #[serde(default = "fps")]
    pub fps: f32,
}

/// Default number of frames per second.
const FPS: f32 = 24.0;

fn fps() -> f32 {
    FPS
}

impl FrameOptions {
    /// Makes the options for a list of frames, at 24 frames per second.
    pub fn new(list: Frames) -> Self {
        Self { list, fps: FPS }
    }
}

sections! {
    /// Light from all around.
    EnvironmentOptions {
        /// Where it comes from; none: what the scene file says.
        light: Option<EnvironmentLight> = None,
        /// Degrees by which it is turned about the vertical axis.
        rotate: f32 = 0.0,
        /// A factor of its radiance.
        strength: f32 = 1.0,
    }

    /// The camera.
    ViewOptions {
        /// The camera, by name or by number from 0; none: the file's first.
        camera: Option<String> = None,
        /// Where it stands and at what it looks; none: as the file says. Its lens stays the file's.
        pose: Option<CameraPose> = None,
        /// Radius of the lens in scene units: what is not at the focus distance blurs; 0: all is sharp.
        lens_radius: Option<f32> = None,
        /// Distance from the camera at which things are sharp, in scene units.
        focus_distance: Option<f32> = None,
    }

    /// Size, part, filter and layers of the picture.
    FilmOptions {
        /// Width and height in pixels; none: what the scene file asks for, or 720 high and as wide as the camera says.
        size: Option<[u32; 2]> = None,
        /// The part that is painted: x0, y0, x1, y1; each pixel is the same as in the whole. None: what the scene file asks for.
        crop: Option<[u32; 4]> = None,
        /// How samples are spread over a pixel; none: what the scene file asks for, or `blackman-harris`.
        filter: Option<PixelFilter> = None,
        /// Layers beside the color, by name; `all` alone: all of them. None: as the engine has it, our own has none.
        layers: Option<Vec<String>> = None,
        /// Whether Open Image Denoise removes what noise is left.
        denoise: bool = false,
    }

    /// When the picture is good enough. At most one of error and time is given.
    GoalOptions {
        /// Samples a pixel; with an error or a time the most that a pixel gets. None: what the scene file asks for, or 64.
        samples: Option<u32> = None,
        /// The relative error at which each cell of 32 x 32 pixels has samples enough.
        error: Option<f64> = None,
        /// Seconds from start to written file.
        time: Option<f64> = None,
    }

    /// How light is followed.
    IntegratorOptions {
        /// The method; none: the one that finds the light that the scene file's own integrator finds, or `path`.
        method: Option<IntegratorChoice> = None,
        /// Bounces of light: 0 only what shines itself, 1 direct light, and so on; none: what the scene file asks for, or 16.
        max_depth: Option<u32> = None,
        /// Light samples at each bounce.
        light_samples: u32 = 1,
        /// Whether rays are units of work of their own, which any device may follow, and shading is another: the way of the HRA
        /// paper. Without it a unit is samples of a block of pixels. The picture has the same bits.
        wavefront: bool = false,
    }

    /// Photon mapping.
    PhotonOptions {
        /// Photons that leave the lights; with `progressive` in each pass. None: 500,000, progressive 100,000.
        count: Option<u32> = None,
        /// Photons from which the light at a point is estimated; none: 60.
        gather: Option<u32> = None,
        /// How far such photons may lie, as a share of the radius of what the camera sees; none: 0.1.
        radius: Option<f32> = None,
        /// Rays of each sample that gather indirect light; 0 takes the photons at the point itself. None: 4.
        final_rays: Option<u32> = None,
        /// Greatest error of indirect light on matte surfaces that is taken from places near by; none: gathered anew.
        irradiance_cache: Option<f32> = None,
        /// Whether photons for caustics are sent where agents that the camera casts look out for them; else to all mirrors and
        /// glass alike. For lighting agents, too.
        lookouts: bool = true,
        /// Whether shadow rays are traced only where photons behind lit surfaces have not settled what is lit.
        shadow_photons: bool = false,
        /// Whether gathering rays go where indirect photons came from; none: unless indirect light is taken from places near
        /// by.
        gather_directions: Option<bool> = None,
        /// Whether direct and indirect photons are kept in maps of their own, and counted wherever a gathering ray ends.
        separate_maps: bool = false,
        /// Whether there is indirect light, but for that over mirrors and through glass alone; for lighting agents, too.
        indirect: bool = true,
        /// Whether each sample has photons of its own, within a radius that shrinks.
        progressive: bool = false,
    }

    /// Autonomous Lighting Agents.
    LightingAgentOptions {
        /// Agents that the lights cast; their clones come on top.
        cast: u32 = AgentSettings::default().cast,
        /// By which rules they answer.
        oracle: OracleChoice = OracleChoice::Error,
        /// What they are asked; the rest is computed everywhere.
        decides: Vec<OracleQuestion> = vec![OracleQuestion::Shadows, OracleQuestion::Irradiance, OracleQuestion::Radiance],
        /// Whether the median of an agent and its neighbors in the network answers which shadow rays must be traced.
        network: bool = false,
        /// Greatest relative error of indirect light that is interpolated, with the oracle `error`.
        error: f64 = 0.1,
        /// Megabytes that they may take, with the oracle `error`.
        memory_mb: u64 = AgentSettings::default().memory_bytes >> 20,
    }

    /// What paths learn of the light before the first sample. It changes the noise, not what the picture shows.
    GuideOptions {
        /// How; none: `ala`, without a word where it is of no use.
        by: Option<GuideChoice> = None,
        /// What lighting agents are used for, with `ala`; none of them: all.
        uses: Vec<GuideUse> = Vec::new(),
    }

    /// Who paints: our own engine or other renderers.
    EngineOptions {
        /// `builtin`, the name of another renderer, or both: the one named first takes simple zones.
        names: Vec<String> = vec![BUILTIN.to_owned()],
        /// Rules for which of two engines suits a zone; none: those that come with the program.
        rules: Option<RulesSource> = None,
        /// Parameters of the engine's own, by name.
        options: BTreeMap<String, String> = BTreeMap::new(),
        /// Folders with more manifests of engines.
        manifests: Vec<PathBuf> = Vec::new(),
        /// Whether scripts run that are in the scene.
        trust: bool = false,
        /// Which frame, for engines that know of frames; none: the one that the scene is at.
        frame: Option<i32> = None,
    }

    /// How the work is shared out among agents.
    WorkOptions {
        /// Render Agents; none: one for every two processors.
        agents: Option<u16> = None,
        /// How the picture is cut: 0 not at all, 1 by importance, 2 joined, 3 balanced.
        level: u8 = 3,
        /// Which measure makes the importance map.
        importance: ImportanceChoice = ImportanceChoice::Predicted,
        /// What the measure knows of a place; none: everything.
        #[schemars(with = "Option<Vec<String>>")]
        channels: Option<Vec<Channel>> = None,
        /// About so many zones; none: by `zone_max_complexity`, or else by the number of agents.
        zones: Option<u32> = None,
        /// The least width and height of a zone, in pixels.
        zone_min_size: u32 = ZoneLimits::default().side_min,
        /// Level 1 cuts zones that are more complex than this share of the picture's complexity; none: than one part in `zones`.
        zone_max_complexity: Option<f64> = None,
        /// Level 2 joins neighbors whose complexities a pixel differ by at most this share of the greater one.
        zone_similarity: f64 = ZoneLimits::default().similarity,
        /// What zones of level 3 have in common.
        zone_balance: BalanceChoice = BalanceChoice::Time,
        /// How the winners of an auction are found.
        auction: AuctionChoice = AuctionChoice::FinishingTime,
        /// How agents learn their speed.
        adaptation: AdaptationChoice = AdaptationChoice::Ratio,
        /// How far expert rules may trade quality for time, zone by zone.
        optimization: OptimizationChoice = OptimizationChoice::Off,
        /// The expert rules, which agents carry in turn; none: those that come with the program or the engine.
        rules: Vec<RulesSource> = Vec::new(),
        /// How wide the bands are in which neighboring zones are blended.
        bands: BandChoice = BandChoice::Rules,
    }

    /// The processors and devices of this machine that paint. Another machine has its own.
    DeviceOptions {
        /// Processors; none: all.
        threads: Option<u16> = None,
        /// `auto` alone (the processors, and the best GPU if there is one), or `cpu` and parts of GPUs' names.
        names: Vec<String> = vec![AUTO.to_owned()],
        /// Whether every pixel is the same to the last bit, whoever paints it: by processors alone.
        exact: bool = false,
        /// Memory that scenes may take on each GPU, in MiB; none: nearly all that it has.
        memory_mb: Option<u32> = None,
    }

    /// The file that the picture is written to.
    OutputOptions {
        /// .exr (linear light, all values) or .png (tone-mapped); none: no file, the picture is a value.
        file: Option<PathBuf> = None,
        /// Stops by which a PNG is brightened (+) or darkened (-).
        exposure: f32 = 0.0,
        /// How a PNG's highlights are brought into range.
        tonemap: ToneCurve = ToneCurve::Agx,
        /// How a PNG's values are stored.
        encoding: PngEncoding = PngEncoding::Srgb,
        /// Whether a PNG has alpha where the scene file does not ask for it.
        alpha: bool = false,
        /// Whether an EXR file has 16-bit values.
        half: bool = false,
        /// Whether an EXR file is written in tiles.
        tiled: bool = false,
    }

    /// What a farm is told of the job.
    FarmOptions {
        /// How urgent the picture is: jobs have machines in proportion to their priorities.
        priority: u32 = PRIORITY,
        /// So many different machines must have painted the same before a zone counts; none: each is trusted.
        verify: Option<u32> = None,
        /// Whether agents of other platforms may paint zones, with engines of their own (FIPA). The picture then depends on who
        /// painted it.
        strangers: bool = false,
        /// Tags that a machine must have to paint it (`bottega join --tag`); the one who asks paints in any case.
        require: Vec<String> = Vec::new(),
    }
}
