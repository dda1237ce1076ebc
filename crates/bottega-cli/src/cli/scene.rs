//! Options of the scene, its camera and its light, shared by several commands.

use std::path::PathBuf;

use bottega::request::{
    AGENTS_MAX, BalanceChoice, EnvironmentLight, EnvironmentOptions, ImportanceChoice, Request, SIDE_MAX, SceneOptions,
};
use bottega_farm::Channel;
use clap::{Args, ValueHint};

use super::{
    choice::choice,
    values::{
        Size, parse_channel, parse_complexity, parse_define, parse_distance, parse_environment, parse_factor,
        parse_number, parse_similarity, parse_size, parse_time,
    },
};

/// Options for reading the scene file.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Scene file")]
pub(crate) struct ImportArgs {
    /// Refuse the scene when something in it is not supported, instead of painting a substitute.
    #[arg(long)]
    strict: bool,
    /// Let the scene read files outside of its own folder.
    #[arg(long)]
    allow_outside: bool,
    /// Let the scene read files below this folder too, by whatever path or symbolic link it leads there; may be repeated.
    #[arg(long = "asset-root", value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    asset_roots: Vec<PathBuf>,
    /// Let the camera see through the backs of a glTF scene's materials that are not double-sided, as viewers do.
    #[arg(long)]
    cull_backfaces: bool,
    /// Set a parameter of a Mitsuba scene (its `<default>`s, used as `$NAME`).
    #[arg(short = 'D', long = "define", value_name = "NAME=VALUE", value_parser = parse_define)]
    defines: Vec<(String, String)>,
    /// Show the animations of a glTF scene at this time; default: the scene as its file describes it.
    #[arg(long, value_name = "SECONDS", value_parser = parse_time, allow_negative_numbers = true)]
    at: Option<f32>,
    /// The animation to show, by name or by number from 0; default: all, the first one where several move the same.
    #[arg(long, value_name = "NAME")]
    animation: Option<String>,
    /// Which of a glTF file's variants of materials to show, by name or by number from 0.
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
}

impl ImportArgs {
    /// Applies the import options to a request's scene.
    pub(crate) fn apply(&self, scene: &mut SceneOptions) {
        scene.strict |= self.strict;
        scene.allow_outside |= self.allow_outside;
        scene.asset_roots.extend(self.asset_roots.iter().cloned());
        scene.cull_backfaces |= self.cull_backfaces;
        scene.defines.extend(self.defines.iter().cloned());
        set(&mut scene.time, self.at);
        set(&mut scene.animation, self.animation.clone());
        set(&mut scene.variant, self.variant.clone());
    }
}

/// Options of camera, size and light, shared by `render` and `analyze`.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneArgs {
    #[command(flatten)]
    pub(crate) import: ImportArgs,
    /// Size of the picture in pixels; default: what the scene file asks for, or 720 high and as wide as the camera says.
    #[arg(long, value_name = "WxH", value_parser = parse_size, help_heading = "Picture")]
    size: Option<Size>,
    /// The camera, by name or by number from 0; default: the file's first.
    #[arg(long, value_name = "NAME", help_heading = "Picture")]
    camera: Option<String>,
    /// Radius of the lens in scene units: what is not at the focus distance blurs; 0: all is sharp.
    #[arg(long, value_name = "RADIUS", value_parser = parse_factor, help_heading = "Picture")]
    lens_radius: Option<f32>,
    /// Distance from the camera at which things are sharp, in scene units.
    #[arg(long, value_name = "DISTANCE", value_parser = parse_distance, help_heading = "Picture")]
    focus_distance: Option<f32>,
    /// Light from all around: an .hdr, .exr or .png picture of the whole sphere, one radiance as R,G,B, or `sky`, the
    /// neutral one that a scene without any light gets by itself.
    #[arg(long, value_name = "FILE|R,G,B|sky", value_parser = parse_environment, help_heading = "Light")]
    env: Option<EnvironmentLight>,
    /// Turn the environment about the vertical axis.
    #[arg(long, value_name = "DEGREES", value_parser = parse_number, allow_negative_numbers = true, help_heading = "Light")]
    env_rotate: Option<f32>,
    /// Multiply the environment's light.
    #[arg(long, value_name = "FACTOR", value_parser = parse_factor, help_heading = "Light")]
    env_strength: Option<f32>,
    /// Processors to use; default: all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(AGENTS_MAX)), help_heading = "Work")]
    pub(crate) threads: Option<u16>,
    /// How the picture is cut: 0 not at all, 1 by importance, 2 joined, 3 balanced. Default: 3.
    #[arg(long, value_name = "LEVEL", value_parser = clap::value_parser!(u8).range(0..=3), help_heading = "Work")]
    level: Option<u8>,
    /// Which measure makes the importance map. Default: predicted.
    #[arg(long, value_name = "MEASURE", value_parser = choice::<ImportanceChoice>(), help_heading = "Work")]
    importance: Option<ImportanceChoice>,
    /// What the measure knows of a place; default: everything. What is left out counts everywhere as its mean, and tells
    /// no places apart. For `predicted`: steps,shadow,material; for `visual`: recursion,depth,indirect,texture,noise,
    /// saliency.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse_channel, help_heading = "Work")]
    channels: Option<Vec<Channel>>,
    /// The least width and height of a zone. Default: 8.
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=i64::from(SIDE_MAX)), help_heading = "Work")]
    zone_min_size: Option<u32>,
    /// Level 1 cuts zones that are more complex than this share of the whole picture, such as 0.01; default: than one part in as
    /// many as zones are wanted.
    #[arg(long, value_name = "SHARE", value_parser = parse_complexity, help_heading = "Work")]
    zone_max_complexity: Option<f64>,
    /// Level 2 joins neighbors whose complexities a pixel differ by at most this share of the greater one. Default: 0.15.
    #[arg(long, value_name = "SHARE", value_parser = parse_similarity, help_heading = "Work")]
    zone_similarity: Option<f64>,
    /// What zones of level 3 have in common. Default: time.
    #[arg(long, value_name = "WHAT", value_parser = choice::<BalanceChoice>(), help_heading = "Work")]
    zone_balance: Option<BalanceChoice>,
    /// Print one JSON object a line instead of text for people.
    #[arg(long, help_heading = "Output")]
    pub(crate) json: bool,
}

impl SceneArgs {
    /// Applies the options to a request.
    pub(crate) fn apply(&self, request: &mut Request) {
        self.import.apply(&mut request.scene);
        set(&mut request.film.size, self.size.map(|Size { width, height }| [width, height]));
        let view = &mut request.view;
        set(&mut view.camera, self.camera.clone());
        set(&mut view.lens_radius, self.lens_radius);
        set(&mut view.focus_distance, self.focus_distance);
        let EnvironmentOptions { light, rotate, strength } = &mut request.environment;
        set(light, self.env.clone());
        change(rotate, self.env_rotate);
        change(strength, self.env_strength);
        set(&mut request.devices.threads, self.threads);
        change(&mut request.work.level, self.level);
        change(&mut request.work.importance, self.importance);
        set(&mut request.work.channels, self.channels.clone());
        change(&mut request.work.zone_min_size, self.zone_min_size);
        set(&mut request.work.zone_max_complexity, self.zone_max_complexity);
        change(&mut request.work.zone_similarity, self.zone_similarity);
        change(&mut request.work.zone_balance, self.zone_balance);
    }
}

/// Sets an optional field if the option is given.
pub(super) fn set<T>(field: &mut Option<T>, given: Option<T>) {
    if given.is_some() {
        *field = given;
    }
}

/// Sets a field if the option is given.
pub(super) fn change<T>(field: &mut T, given: Option<T>) {
    if let Some(given) = given {
        *field = given;
    }
}
