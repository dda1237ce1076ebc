//! Options of the scene, its camera and its light, shared by several commands.

use std::path::PathBuf;

use bottega::{
    Error,
    request::{EnvironmentLight, EnvironmentOptions, ProjectionChoice, Request, SceneOptions, ShutterTimes},
};
use clap::{Args, ValueHint};

use super::{
    choice::choice,
    fields::help,
    values::{Size, parse_define, parse_environment, parse_shutter, parse_size},
};
use crate::error::CliError;

/// Options for reading the scene file.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Scene file")]
pub(crate) struct ImportArgs {
    #[arg(long, help = help("scene.strict"))]
    strict: bool,
    #[arg(long, help = help("scene.allow_outside"))]
    allow_outside: bool,
    #[arg(long = "asset-root", value_name = "FOLDER", value_hint = ValueHint::DirPath, help = help("scene.asset_roots"))]
    asset_roots: Vec<PathBuf>,
    #[arg(long, help = help("scene.cull_backfaces"))]
    cull_backfaces: bool,
    #[arg(short = 'D', long = "define", value_name = "NAME=VALUE", value_parser = parse_define, help = help("scene.defines"))]
    defines: Vec<(String, String)>,
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, help = help("scene.time"))]
    at: Option<f32>,
    /// The span of time that the picture shows, in seconds from --at on; what moves is blurred. RAMP, from 0 to 0.5, is the share
    /// of it that the shutter takes to open, and to close.
    #[arg(long, value_name = "OPEN:CLOSE[:RAMP]", allow_hyphen_values = true, value_parser = parse_shutter)]
    shutter: Option<ShutterTimes>,
    #[arg(long, value_name = "NAME", help = help("scene.animation"))]
    animation: Option<String>,
    #[arg(long, value_name = "NAME", help = help("scene.variant"))]
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
        set(&mut scene.shutter, self.shutter);
        set(&mut scene.animation, self.animation.clone());
        set(&mut scene.variant, self.variant.clone());
    }
}

/// Options of camera, size and light, shared by `render` and `analyze`.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneArgs {
    #[command(flatten)]
    pub(crate) import: ImportArgs,
    #[arg(long, value_name = "WxH", value_parser = parse_size, help_heading = "Picture", help = help("film.size"))]
    size: Option<Size>,
    #[arg(long, value_name = "NAME", help_heading = "Picture", help = help("view.camera"))]
    camera: Option<String>,
    #[arg(long, value_name = "RADIUS", help_heading = "Picture", help = help("view.lens_radius"))]
    lens_radius: Option<f32>,
    #[arg(long, value_name = "DISTANCE", help_heading = "Picture", help = help("view.focus_distance"))]
    focus_distance: Option<f32>,
    #[arg(long, value_name = "WORD", value_parser = choice::<ProjectionChoice>(), help_heading = "Picture", help = help("view.projection"))]
    projection: Option<ProjectionChoice>,
    /// The environment light: an .hdr, .exr or .png picture of the whole sphere, one radiance as R,G,B, or `sky`, the neutral
    /// one that scenes without light get by default.
    #[arg(long, value_name = "FILE|R,G,B|sky", value_parser = parse_environment, help_heading = "Light")]
    env: Option<EnvironmentLight>,
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, help_heading = "Light", help = help("environment.rotate"))]
    env_rotate: Option<f32>,
    #[arg(long, value_name = "FACTOR", help_heading = "Light", help = help("environment.strength"))]
    env_strength: Option<f32>,
    #[arg(long, value_name = "N", help_heading = "Work", help = help("devices.threads"))]
    pub(crate) threads: Option<u16>,
    /// Set a field of the request, such as film.size=640,480 or photons.count=100000; may be repeated. All fields are in
    /// docs/reference/request.md and in `bottega request schema`.
    #[arg(long = "set", value_name = "FIELD=VALUE", value_parser = parse_define, help_heading = "Request")]
    fields: Vec<(String, String)>,
    /// Print one JSON object per line instead of text for people.
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
        set(&mut view.projection, self.projection);
        let EnvironmentOptions { light, rotate, strength } = &mut request.environment;
        set(light, self.env.clone());
        change(rotate, self.env_rotate);
        change(strength, self.env_strength);
        set(&mut request.devices.threads, self.threads);
    }

    /// Applies `--set` to a request.
    ///
    /// # Errors
    /// There is no such field, or the value is not allowed there.
    pub(crate) fn set_fields(&self, request: Request) -> Result<Request, CliError> {
        let with = |request: Request, (field, value): &(String, String)| {
            let origin = format!("--set {field}={value}");
            request.with(field, value).map_err(|source| Error::Request { origin, source })
        };
        Ok(self.fields.iter().try_fold(request, with)?)
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
