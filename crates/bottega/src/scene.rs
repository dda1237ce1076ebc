//! Scene, camera and size, as the options say.

use std::{path::Path, sync::Arc, time::Instant};

use bottega_image::Rect;
use bottega_render::{PrepareOptions, PreparedScene, View, build_accel};
use bottega_scene::{Environment, Loaded, Panorama, Projection, RenderHints, Scene, SceneFile, Spectrum, Warning};
use glam::Mat3;

use crate::{
    cli::{EnvironmentArg, SceneArgs, Size},
    devices::processors,
    error::CliError,
};

/// Height of a picture of which only the shape is known.
const DEFAULT_HEIGHT: u32 = 720;

/// A scene ready to be painted.
pub(crate) struct Subject {
    pub(crate) prepared: Arc<PreparedScene>,
    pub(crate) view: View,
    pub(crate) warnings: Vec<Warning>,
    /// What the file asks for. Its part of the picture is left out where the user says how large the picture is.
    pub(crate) hints: RenderHints,
    /// Files that the scene refers to.
    pub(crate) files: Vec<SceneFile>,
    /// When loading ended: the file was read and its acceleration structures were built.
    pub(crate) loaded: Instant,
}

impl Subject {
    pub(crate) fn load(args: &SceneArgs) -> Result<Self, CliError> {
        let Loaded { mut scene, warnings, mut hints, files, .. } = load(args)?;
        let camera = camera_index(&scene, args.camera.as_deref())?;
        let lens = &mut scene.cameras[camera];
        lens.lens_radius = args.lens_radius.unwrap_or(lens.lens_radius);
        lens.focus_distance = args.focus_distance.unwrap_or(lens.focus_distance);
        let size = args.size.or_else(|| hinted_size(&hints)).unwrap_or_else(|| default_size(&scene, camera));
        hints.crop = hints.crop.filter(|_| args.size.is_none());
        let options = PrepareOptions { threads: threads(args), ..PrepareOptions::default() };
        let accel = build_accel(&scene, &options)?;
        let loaded = Instant::now();
        let prepared = Arc::new(PreparedScene::with_accel(Arc::new(scene), accel, &options));
        Ok(Self {
            prepared,
            view: View { camera, width: size.width, height: size.height },
            warnings,
            hints,
            files,
            loaded,
        })
    }

    pub(crate) fn scene(&self) -> &Scene {
        self.prepared.scene()
    }

    /// All pixels of the picture.
    pub(crate) fn frame(&self) -> Rect {
        Rect::of_size(self.view.width, self.view.height)
    }
}

/// Processors that the options allow.
pub(crate) fn threads(args: &SceneArgs) -> usize {
    args.threads.map_or_else(processors, usize::from)
}

/// Agents for so many processors, where the user did not say.
pub(crate) fn agents(asked: Option<u16>, threads: usize) -> usize {
    asked.map_or(threads.div_ceil(2), usize::from)
}

/// The name of a file as people write it.
pub(crate) fn shown(path: &Path) -> String {
    path.display().to_string()
}

fn load(args: &SceneArgs) -> Result<Loaded, CliError> {
    let world_from_environment = Mat3::from_rotation_y(args.env_rotate.to_radians());
    let mut options = args.file.options();
    match &args.env {
        Some(EnvironmentArg::Picture(path)) => {
            options.environment = Some(path.clone());
            options.environment_rotation = args.env_rotate.to_radians();
            options.environment_intensity = args.env_strength;
        }
        Some(EnvironmentArg::Constant(_) | EnvironmentArg::Sky) => options.add_sky = false,
        None => {}
    }
    let mut loaded = bottega_scene::load(&args.file.scene, &options)?;
    let scene = &mut loaded.scene;
    if args.env == Some(EnvironmentArg::Sky) {
        scene.add_sky();
    }
    match &args.env {
        Some(EnvironmentArg::Constant(radiance)) => {
            let factor = Spectrum::from_array(*radiance) * args.env_strength;
            scene.environment = Some(Environment::uniform(factor));
        }
        None | Some(EnvironmentArg::Sky) => {
            if let Some(environment) = &mut scene.environment {
                environment.factor *= args.env_strength;
                environment.world_from_environment = world_from_environment * environment.world_from_environment;
            }
        }
        Some(EnvironmentArg::Picture(_)) => {}
    }
    Ok(loaded)
}

fn camera_index(scene: &Scene, asked: Option<&str>) -> Result<usize, CliError> {
    let Some(asked) = asked else { return Ok(0) };
    let by_name = scene.cameras.iter().position(|camera| camera.name == asked);
    let by_number = asked.parse().ok().filter(|&index: &usize| index < scene.cameras.len());
    by_name.or(by_number).ok_or_else(|| {
        let names: Vec<String> =
            scene.cameras.iter().enumerate().map(|(index, camera)| format!("{index} {:?}", camera.name)).collect();
        CliError::usage(format!("there is no camera `{asked}`"), format!("the scene has: {}", names.join(", ")))
    })
}

/// The size that the file asks for, if it is one that can be painted.
fn hinted_size(hints: &RenderHints) -> Option<Size> {
    hints.resolution.and_then(|[width, height]| Size::new(width, height).ok())
}

fn default_size(scene: &Scene, camera: usize) -> Size {
    let camera = &scene.cameras[camera];
    let aspect =
        camera.aspect.filter(|aspect| aspect.is_finite() && *aspect > 0.0).unwrap_or(match camera.projection {
            Projection::Perspective { .. } => 16.0 / 9.0,
            Projection::Orthographic { .. } | Projection::Panorama(Panorama::EqualArea) => 1.0,
            Projection::Panorama(Panorama::Equirectangular) => 2.0,
        });
    let width = (DEFAULT_HEIGHT as f32 * aspect.clamp(0.05, 20.0)).round() as u32;
    Size { width: width.max(1), height: DEFAULT_HEIGHT }
}
