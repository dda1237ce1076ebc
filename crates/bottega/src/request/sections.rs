//! The sections of a request: plain structs with defaults.

use std::{collections::BTreeMap, path::PathBuf};

use bottega_farm::{Channel, VERIFY_MAX, ZoneLimits};
use bottega_render::AgentSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    InvalidField,
    choices::{
        AdaptationChoice, AuctionChoice, BUILTIN, BalanceChoice, ColorSpace, Compression, GuideChoice, GuideUse,
        ImportanceChoice, IntegratorChoice, OptimizationChoice, OracleChoice, OracleQuestion, PixelFilter, PngEncoding,
        ProjectionChoice, StereoChoice, ToneCurve,
    },
    device_choice::AUTO,
    limits::*,
    ranged::Ranged,
};
use crate::frames::Frames;

/// Declares sections: structs that are JSON objects, with all members optional. After `=>` stands the range of values that
/// are allowed, ends included: it is checked by [`Request::validate`](super::Request::validate), and part of the schema.
macro_rules! sections {
    ($($(#[$attribute:meta])* $name:ident {
        $($(#[$field_attribute:meta])* $field:ident: $type:ty = $default:expr $(=> $min:literal ..= $max:expr)?,)*
    })*) => {
        $(
            $(#[$attribute])*
            #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
            #[serde(deny_unknown_fields, default)]
            pub struct $name {
                $(
                    $(#[$field_attribute])*
                    $(#[schemars(range(min = $min, max = $max))])?
                    pub $field: $type,
                )*
            }

            impl $name {
                /// Checks the ranges of all numbers.
                ///
                /// - `section`: the name of this section in a request.
                pub(super) fn validate_ranges(&self, section: &str) -> Result<(), InvalidField> {
                    // A section without ranges uses nothing of this.
                    let _ = section;
                    $($(self.$field.check(section, stringify!($field), $min..=$max)?;)?)*
                    Ok(())
                }
            }

            impl Default for $name {
                fn default() -> Self {
                    Self { $($field: $default,)* }
                }
            }
        )*
    };
}

/// The scene file, and options for reading it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneOptions {
    /// The scene: glTF (.glb, .gltf), USD (.usd, .usda, .usdc, .usdz), Mitsuba 3 (.xml), pbrt-v4 (.pbrt), a mesh (.obj,
    /// .ply), or what another engine reads.
    pub file: PathBuf,
    /// True to refuse a scene with unsupported features; false to render substitutes for them.
    #[serde(default)]
    pub strict: bool,
    /// True to let the scene read files outside of its folder.
    #[serde(default)]
    pub allow_outside: bool,
    /// Further folders below which the scene may read files.
    #[serde(default)]
    pub asset_roots: Vec<PathBuf>,
    /// True to let the camera see through the backs of single-sided materials in glTF scenes, as viewers do.
    #[serde(default)]
    pub cull_backfaces: bool,
    /// Parameters of a Mitsuba scene (its `<default>`s), by name.
    #[serde(default)]
    pub defines: BTreeMap<String, String>,
    /// The time in seconds at which the animations of a glTF or USD scene are shown; none: the scene as its file
    /// describes it.
    #[serde(default)]
    pub time: Option<f32>,
    /// The span of time that the picture shows, relative to `scene.time`; none: that of the file, which for glTF and USD is
    /// one moment. What moves during it is blurred.
    #[serde(default)]
    pub shutter: Option<ShutterTimes>,
    /// The animation to show, by name or by number from 0; none: all of them.
    #[serde(default)]
    pub animation: Option<String>,
    /// The material variant of a glTF file, by name or by number from 0; of a USD stage variants of prims, as in
    /// `/Car{color=red}`.
    #[serde(default)]
    pub variant: Option<String>,
    /// Number of times that subdivision surfaces of a USD stage are refined, from 0 (their polygons) to 6; none: 2 for meshes
    /// that name their `subdivisionScheme`, and 0 for others. A mesh that would have more than 4 million faces is refined less,
    /// with a warning.
    #[serde(default)]
    pub subdivision: Option<u8>,
    /// Number of times that the longest edge of a mesh that a texture displaces is halved, from 0 to 12; none: until edges are
    /// as long as a texel, or as the file says, with at most a million triangles per mesh. With a number, a mesh has at most 4
    /// million.
    #[serde(default)]
    pub displacement: Option<u8>,
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
            shutter: None,
            animation: None,
            variant: None,
            subdivision: None,
            displacement: None,
        }
    }
}

/// The span of time that a picture shows: how long a camera's shutter is open.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShutterTimes {
    /// The time at which the shutter opens, in seconds, or in the unit of the scene file.
    pub open: f64,
    /// The time at which it is closed; equal to `open`: nothing is blurred.
    pub close: f64,
    /// The share of the time that it takes to open, and again to close, from 0 (at once) to 0.5.
    #[serde(default)]
    pub ramp: f64,
}

/// The source of the environment light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum EnvironmentLight {
    /// An image of the whole sphere: .hdr, .exr or .png.
    File(PathBuf),
    /// The same radiance from all directions: red, green, blue.
    Radiance([f32; 3]),
    /// The neutral sky that scenes without light get by default.
    Sky,
}

/// The pose of a camera, in the coordinates of the scene file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraPose {
    /// Position of the camera.
    pub eye: [f64; 3],
    /// Point that the camera looks at.
    pub target: [f64; 3],
    /// Up direction of the picture; none: +y.
    #[serde(default = "upward")]
    pub up: [f64; 3],
    /// Full vertical field of view, in degrees; none: that of the camera.
    #[serde(default)]
    pub fov: Option<f32>,
}

fn upward() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

/// The width of the interpolation bands between zones. With optimization off there are none: zones agree to the last bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BandChoice {
    /// No bands: zones meet at an edge.
    Off,
    /// The expert rules choose the width of each edge.
    Rules,
    /// This number of pixels beyond each edge of each zone.
    Pixels(u32),
}

/// A source of expert rules.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RulesSource {
    /// An FCL file, or the name of built-in rules, such as `paper`: the rule set of the MAGarRO paper.
    File(PathBuf),
    /// The rules as text.
    Text(RulesText),
}

/// Rules as text, with a name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RulesText {
    /// Name for messages: the file that the text was read from.
    pub name: PathBuf,
    /// The text in FCL.
    pub text: String,
}

/// The frames of an animation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrameOptions {
    /// The list of frames.
    pub list: Frames,
    /// Frames per second: frame N shows the scene at N / `fps` seconds.
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
    /// The environment light.
    EnvironmentOptions {
        /// The source of the light; none: that of the scene file.
        light: Option<EnvironmentLight> = None,
        /// Rotation of the environment light about the vertical axis, in degrees.
        rotate: f32 = 0.0,
        /// Factor of the environment light's radiance.
        strength: f32 = 1.0,
    }

    /// The camera and its pose.
    ViewOptions {
        /// The camera, by name or by number from 0; none: the file's first.
        camera: Option<String> = None,
        /// The pose; none: that of the file. The lens stays that of the file.
        pose: Option<CameraPose> = None,
        /// Radius of the lens, in scene units; 0: everything is sharp.
        lens_radius: Option<f32> = None,
        /// Focus distance, in scene units.
        focus_distance: Option<f32> = None,
        /// Number of blades of the aperture, which highlights out of focus show as corners; 0: it is round. None: that of the
        /// file.
        blades: Option<u32> = None,
        /// Rotation of the aperture's blades, counterclockwise, in degrees.
        blade_rotation: f32 = 0.0,
        /// Height over width of the aperture; 2 for the narrow highlights of anamorphic lenses. None: that of the file.
        aperture_ratio: Option<f32> = None,
        /// The projection; none: that of the file.
        projection: Option<ProjectionChoice> = None,
        /// Full angle of the circle of a fisheye, in degrees, up to 360.
        fisheye_fov: f32 = 180.0,
        /// Pictures for two eyes in one picture, each of half its size, or that of one of them; none: one eye.
        stereo: Option<StereoChoice> = None,
        /// Distance between the two eyes, in scene units.
        eye_distance: f32 = 0.0625,
        /// Distance at which the pictures of the two eyes agree, in scene units; none: the eyes look in parallel.
        convergence: Option<f32> = None,
        /// Share of the shutter's time for which each row is exposed; the rows are exposed one after another, from the upper
        /// edge down. None: all rows at the same time.
        rolling_shutter: Option<f32> = None,
        /// True to show everything as it is in the middle of the shutter's time, so that nothing is blurred. The layer `motion`
        /// still has the movement over all of the shutter's time, to blur the picture in compositing.
        instant_shutter: bool = false,
    }

    /// Size, crop, pixel filter and layers of the picture.
    FilmOptions {
        /// Width and height in pixels; none: those of the scene file, or 720 high with the aspect ratio of the camera.
        size: Option<[u32; 2]> = None,
        /// The rendered part: x0, y0, x1, y1; its pixels are the same as in the whole picture. None: that of the scene file.
        crop: Option<[u32; 4]> = None,
        /// The pixel filter; none: that of the scene file, or `blackman-harris`.
        filter: Option<PixelFilter> = None,
        /// Layers in addition to the color, by name; `all` alone: all of them. None: the engine's default; the built-in engine
        /// makes none.
        layers: Option<Vec<String>> = None,
        /// Groups of lights whose light is kept apart, by name: each is a layer `light_NAME` of the light that comes from
        /// the lights that one of its patterns matches. A pattern is the name of a light, or of the object, mesh or material
        /// of a surface that glows, or `environment`; `*` stands for any characters, `?` for one.
        light_groups: BTreeMap<String, Vec<String>> = BTreeMap::new(),
        /// Shadow catchers: objects that stand for those of a photographed plate, by patterns as for light groups, of the name of
        /// an object, mesh or material. The picture does not show them, nor the sky. Its layer `shadow-catcher` has the share of
        /// their light that the other objects leave to them, and its alpha grows by what they lack.
        shadow_catchers: Vec<String> = Vec::new(),
        /// True to denoise the picture with Intel's Open Image Denoise, which must be installed; `BOTTEGA_OIDN` names its file or
        /// folder. The EXR file then has the layers albedo, normal and noisy.
        denoise: bool = false,
    }

    /// The goal at which the picture is finished. At most one of error and time is given.
    GoalOptions {
        /// Samples per pixel; with an error or a time the maximum per pixel. None: what the scene file asks for, or 64.
        samples: Option<u32> = None => 1..=SAMPLES_MAX,
        /// The estimated relative error at which a cell of 32 x 32 pixels stops, such as 0.05; the maximum of samples is then 4096
        /// if none is given.
        error: Option<f64> = None => 1e-6..=10.0,
        /// Time limit in seconds, from the start to the written file.
        time: Option<f64> = None => 0.1..=1e7,
    }

    /// The integrator.
    IntegratorOptions {
        /// The integrator; none: one that finds the same light as the scene file's integrator, or `path`.
        method: Option<IntegratorChoice> = None,
        /// Maximum number of bounces: 0 emission only, 1 direct light, and so on; none: what the scene file asks for, or 16.
        max_depth: Option<u32> = None => 0..=DEPTH_MAX,
        /// Rules that choose between paths and photons, with `auto`; none: the built-in ones.
        rules: Option<RulesSource> = None,
        /// Light samples per bounce.
        light_samples: u32 = 1 => 1..=LIGHT_SAMPLES_MAX,
        /// True to make rays and shading separate work units, so that any device can trace the rays, as in the HRA paper.
        /// False: a unit is samples of a block of pixels. The picture has the same bits.
        wavefront: bool = false,
    }

    /// Settings of photon mapping.
    PhotonOptions {
        /// Number of photons emitted; with `progressive` per pass. None: 500,000, progressive 100,000.
        count: Option<u32> = None => 1..=PHOTONS_MAX,
        /// Number of photons in a density estimate; none: 60.
        gather: Option<u32> = None => 2..=GATHER_MAX,
        /// Largest distance of these photons, as a share of the radius of the visible scene; none: 0.1.
        radius: Option<f32> = None,
        /// Final gather rays per sample; 0: use the photons at the point itself. None: 4.
        final_rays: Option<u32> = None => 0..=FINAL_RAYS_MAX,
        /// Largest error at which indirect light on matte surfaces is interpolated from nearby points; none: always gather.
        irradiance_cache: Option<f32> = None,
        /// True to send caustic photons where lookouts, agents cast from the camera, find them useful; false: to all mirrors
        /// and glass alike. Also for lighting agents.
        lookouts: bool = true,
        /// True to trace shadow rays only where shadow photons have not decided the visibility of the light.
        shadow_photons: bool = false,
        /// True to send gather rays in the directions that indirect photons came from; none: true unless indirect light is
        /// interpolated.
        gather_directions: Option<bool> = None,
        /// True to keep direct and indirect photons in separate maps, used wherever a gather ray ends.
        separate_maps: bool = false,
        /// True for indirect light; false keeps only that over mirrors and through glass. Also for lighting agents.
        indirect: bool = true,
        /// True to use progressive photon mapping: each pass has its own photons, in a radius that shrinks.
        progressive: bool = false,
    }

    /// Settings of Autonomous Lighting Agents.
    LightingAgentOptions {
        /// Number of agents cast from the lights, without their clones.
        cast: u32 = AgentSettings::default().cast => 0..=LIGHTING_AGENTS_MAX,
        /// The rules by which the agents answer.
        oracle: OracleChoice = OracleChoice::Error,
        /// The questions that the agents answer; everything else is computed.
        decides: Vec<OracleQuestion> = vec![OracleQuestion::Shadows, OracleQuestion::Irradiance, OracleQuestion::Radiance],
        /// True if the median of an agent and its neighbors in the network decides which shadow rays are traced.
        network: bool = false,
        /// Largest relative error of interpolated indirect light, with the oracle `error`.
        error: f64 = 0.1 => 0.001..=1.0,
        /// Memory limit of the agents in MiB, with the oracle `error`.
        memory_mb: u64 = AgentSettings::default().memory_bytes >> 20 => 0..=ORACLE_MEMORY_MAX,
    }

    /// Path guiding: knowledge of the light, learned before the first sample. It changes the noise, not the expected picture.
    GuideOptions {
        /// The kind of guide; none: `ala`, without a warning where it has no effect.
        by: Option<GuideChoice> = None,
        /// The uses of lighting agents, with `ala`; empty: all.
        uses: Vec<GuideUse> = Vec::new(),
    }

    /// The engine: the built-in one or external renderers.
    EngineOptions {
        /// `builtin`, the name of an external renderer, or both: the first one renders the simple zones.
        names: Vec<String> = vec![BUILTIN.to_owned()],
        /// Rules that choose the engine of a zone; none: the built-in ones.
        rules: Option<RulesSource> = None,
        /// Parameters of the external engine, by name.
        options: BTreeMap<String, String> = BTreeMap::new(),
        /// Further folders with manifests of engines.
        manifests: Vec<PathBuf> = Vec::new(),
        /// True to run scripts contained in the scene; only for scenes from people you trust.
        trust: bool = false,
        /// Number of the frame, for engines with frames; none: the scene's current frame.
        frame: Option<i32> = None,
    }

    /// Sharing the work among agents.
    WorkOptions {
        /// Number of Render Agents; none: one per two processors.
        agents: Option<u16> = None => 1..=AGENTS_MAX,
        /// Level of division into zones: 0 none, 1 by importance, 2 joined, 3 balanced.
        level: u8 = 3 => 0..=3,
        /// The measure of the importance map.
        importance: ImportanceChoice = ImportanceChoice::Predicted,
        /// The channels that the measure uses; none: all.
        #[schemars(with = "Option<Vec<String>>")]
        channels: Option<Vec<Channel>> = None,
        /// Approximate number of zones; none: by `zone_max_complexity`, or else by the number of agents.
        zones: Option<u32> = None => 1..=ZONES_MAX,
        /// Smallest width and height of a zone, in pixels.
        zone_min_size: u32 = ZoneLimits::default().side_min => 1..=SIDE_MAX,
        /// Level 1 divides zones with more than this share of the picture's complexity; none: one part in `zones`.
        zone_max_complexity: Option<f64> = None => 1e-6..=1.0,
        /// Level 2 joins neighbors whose complexities per pixel differ by at most this share of the greater one.
        zone_similarity: f64 = ZoneLimits::default().similarity => 0.0..=1.0,
        /// The quantity that level 3 balances.
        zone_balance: BalanceChoice = BalanceChoice::Time,
        /// The rule that decides auctions.
        auction: AuctionChoice = AuctionChoice::FinishingTime,
        /// The rule by which agents adapt V_cp.
        adaptation: AdaptationChoice = AdaptationChoice::Ratio,
        /// Number of zones that an agent works on at once: the next begins while the last pixels of one are painted. 1, as in the
        /// MAGarRO paper: only idle agents bid.
        prefetch: u32 = 2 => 1..=PREFETCH_MAX,
        /// True to cut zones near the end of the job, and to give idle agents the late zones of slow ones. Only agents on
        /// different machines share the tail.
        share_tail: bool = true,
        /// Degree to which expert rules may trade quality for time, zone by zone.
        optimization: OptimizationChoice = OptimizationChoice::Off,
        /// The expert rules, which agents carry in turn; none: those built in or of the engine.
        rules: Vec<RulesSource> = Vec::new(),
        /// Width of the interpolation bands between zones.
        bands: BandChoice = BandChoice::Rules,
    }

    /// The processors and devices of this machine that render. Other machines have their own.
    DeviceOptions {
        /// Number of CPU threads; none: all processors.
        threads: Option<u16> = None => 1..=AGENTS_MAX,
        /// `auto` alone (the processors, and the best GPU if there is one), or `cpu` and parts of GPUs' names.
        names: Vec<String> = vec![AUTO.to_owned()],
        /// True to make pixels bit-identical on every machine: only processors render.
        exact: bool = false,
        /// Memory limit for scenes on each GPU, in MiB; none: nearly all free memory.
        memory_mb: Option<u32> = None => 1..=u32::MAX,
        /// Largest number of work units that wait for a processor or device; none: as many as are done in a twentieth of a second.
        bin: Option<u32> = None => 1..=BIN_MAX,
    }

    /// The output file.
    OutputOptions {
        /// The file: .exr (linear light, all layers) or .png (tone-mapped); none: no file.
        file: Option<PathBuf> = None,
        /// Exposure of a PNG in stops: positive is brighter.
        exposure: f32 = 0.0 => -40.0..=40.0,
        /// Tone curve of a PNG.
        tonemap: ToneCurve = ToneCurve::Agx,
        /// Encoding of PNG values.
        encoding: PngEncoding = PngEncoding::Srgb,
        /// True to write alpha to a PNG even if the scene file does not ask for it.
        alpha: bool = false,
        /// True to write 16-bit values to an EXR file.
        half: bool = false,
        /// True to write an EXR file in tiles.
        tiled: bool = false,
        /// Compression of an EXR file.
        compression: Compression = Compression::Zip,
        /// True to write the color and each layer as parts of their own into an EXR file, so that programs read only the
        /// parts that they need.
        parts: bool = false,
        /// Color space of an EXR file: the primaries of the color, and of layers of light and reflectance. PNG files are sRGB.
        colorspace: ColorSpace = ColorSpace::Rec709,
    }

    /// Settings of the job on a farm.
    FarmOptions {
        /// Priority of the job: jobs get machines in proportion to it.
        priority: u32 = PRIORITY => 1..=PRIORITY_MAX,
        /// Number of different machines that must agree on a zone before it counts; none: each machine is trusted.
        verify: Option<u32> = None => 1..=VERIFY_MAX,
        /// True to let agents of other platforms (FIPA) paint zones with their own engines. The picture then depends on the
        /// agents.
        strangers: bool = false,
        /// Tags that a machine must have (`bottega join --tag`); the submitting process always takes part.
        require: Vec<String> = Vec::new(),
    }
}
