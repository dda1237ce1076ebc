//! Scene, camera and size, as a request says.

use std::{sync::Arc, time::Instant};

use bottega_image::Rect;
use bottega_render::{PrepareOptions, PreparedScene, Prepass, View, build_accel};
use bottega_scene::{
    Environment, LoadOptions, Loaded, Metadata, Panorama, Projection, RenderHints, Scene, SceneFile, Spectrum, Warning,
};
use glam::Mat3;

use crate::{
    devices::threads,
    error::Error,
    request::{EnvironmentLight, Request, SceneOptions, check_size},
};

/// Height of a picture of which only the shape is known.
const DEFAULT_HEIGHT: u32 = 720;

/// A scene ready to be painted.
pub struct LoadedScene {
    /// The scene with its acceleration structures.
    pub prepared: Arc<PreparedScene>,
    /// What is found out of it before pictures.
    pub prepass: Arc<Prepass>,
    /// Camera and size.
    pub view: View,
    /// What of the file is not as its author meant it.
    pub warnings: Vec<Warning>,
    /// What the file asks for. Its part of the picture is left out where the request says how large the picture is.
    pub hints: RenderHints,
    /// Files that the scene refers to.
    pub files: Vec<SceneFile>,
    /// When loading ended: the file was read and its acceleration structures were built.
    pub loaded: Instant,
}

impl LoadedScene {
    /// Reads the scene file of a request.
    ///
    /// # Errors
    /// The scene cannot be read, or has no such camera.
    pub fn load(request: &Request) -> Result<Self, Error> {
        Self::of(load(request)?, request)
    }

    /// A scene that was made in memory, with what a request says of camera, size and environment.
    ///
    /// # Errors
    /// The scene has no such camera, or cannot be painted.
    pub fn of_scene(scene: Scene, request: &Request) -> Result<Self, Error> {
        let mut scene = scene;
        scene.validate()?;
        if scene.cameras.is_empty() {
            return Err(Error::usage("the scene has no camera", "put one into it"));
        }
        turn_environment(&mut scene, request);
        let (warnings, metadata, hints) = (Vec::new(), Metadata::default(), RenderHints::default());
        Self::of(Loaded { scene, warnings, metadata, hints, files: Vec::new() }, request)
    }

    fn of(loaded: Loaded, request: &Request) -> Result<Self, Error> {
        let Loaded { mut scene, warnings, mut hints, files, .. } = loaded;
        let view = &request.view;
        let camera = camera_index(&scene, view.camera.as_deref())?;
        let lens = &mut scene.cameras[camera];
        lens.lens_radius = view.lens_radius.unwrap_or(lens.lens_radius);
        lens.focus_distance = view.focus_distance.unwrap_or(lens.focus_distance);
        let asked = request.film.size;
        let [width, height] = asked.or_else(|| hinted_size(&hints)).unwrap_or_else(|| default_size(&scene, camera));
        hints.crop = hints.crop.filter(|_| asked.is_none());
        let options = PrepareOptions { threads: threads(request), ..PrepareOptions::default() };
        let accel = build_accel(&scene, &options)?;
        let loaded = Instant::now();
        let prepared = Arc::new(PreparedScene::with_accel(Arc::new(scene), accel, &options));
        let view = View { camera, width, height };
        Ok(Self { prepared, prepass: Arc::default(), view, warnings, hints, files, loaded })
    }

    /// The scene as it was read.
    pub fn scene(&self) -> &Scene {
        self.prepared.scene()
    }

    /// All pixels of the picture.
    pub fn frame(&self) -> Rect {
        Rect::of_size(self.view.width, self.view.height)
    }
}

impl SceneOptions {
    /// How the file is read.
    pub fn load_options(&self) -> LoadOptions {
        LoadOptions {
            strict: self.strict,
            allow_outside: self.allow_outside,
            asset_roots: self.asset_roots.clone(),
            cull_backfaces: self.cull_backfaces,
            defines: self.defines.clone().into_iter().collect(),
            at: self.time,
            animation: self.animation.clone(),
            variant: self.variant.clone(),
            ..LoadOptions::default()
        }
    }
}

fn load(request: &Request) -> Result<Loaded, Error> {
    let environment = &request.environment;
    let mut options = request.scene.load_options();
    match &environment.light {
        Some(EnvironmentLight::File(path)) => {
            options.environment = Some(path.clone());
            options.environment_rotation = environment.rotate.to_radians();
            options.environment_intensity = environment.strength;
        }
        Some(EnvironmentLight::Radiance(_) | EnvironmentLight::Sky) => options.add_sky = false,
        None => {}
    }
    let mut loaded = bottega_scene::load(&request.scene.file, &options)?;
    if !matches!(environment.light, Some(EnvironmentLight::File(_))) {
        turn_environment(&mut loaded.scene, request);
    }
    Ok(loaded)
}

/// Has the scene lit from all around as the request says, where that is by no picture.
fn turn_environment(scene: &mut Scene, request: &Request) {
    let asked = &request.environment;
    match &asked.light {
        Some(EnvironmentLight::Radiance(radiance)) => {
            scene.environment = Some(Environment::uniform(Spectrum::from_array(*radiance) * asked.strength));
            return;
        }
        Some(EnvironmentLight::Sky) => scene.add_sky(),
        Some(EnvironmentLight::File(_)) | None => {}
    }
    if let Some(environment) = &mut scene.environment {
        let world_from_environment = Mat3::from_rotation_y(asked.rotate.to_radians());
        environment.factor *= asked.strength;
        environment.world_from_environment = world_from_environment * environment.world_from_environment;
    }
}

fn camera_index(scene: &Scene, asked: Option<&str>) -> Result<usize, Error> {
    let Some(asked) = asked else { return Ok(0) };
    let by_name = scene.cameras.iter().position(|camera| camera.name == asked);
    let by_number = asked.parse().ok().filter(|&index: &usize| index < scene.cameras.len());
    by_name.or(by_number).ok_or_else(|| {
        let names: Vec<String> =
            scene.cameras.iter().enumerate().map(|(index, camera)| format!("{index} {:?}", camera.name)).collect();
        Error::usage(format!("there is no camera `{asked}`"), format!("the scene has: {}", names.join(", ")))
    })
}

/// The size that the file asks for, if it is one that can be painted.
fn hinted_size(hints: &RenderHints) -> Option<[u32; 2]> {
    hints.resolution.filter(|&[width, height]| check_size(width, height).is_ok())
}

fn default_size(scene: &Scene, camera: usize) -> [u32; 2] {
    let camera = &scene.cameras[camera];
    let aspect =
        camera.aspect.filter(|aspect| aspect.is_finite() && *aspect > 0.0).unwrap_or(match camera.projection {
            Projection::Perspective { .. } => 16.0 / 9.0,
            Projection::Orthographic { .. } | Projection::Panorama(Panorama::EqualArea) => 1.0,
            Projection::Panorama(Panorama::Equirectangular) => 2.0,
        });
    let width = (DEFAULT_HEIGHT as f32 * aspect.clamp(0.05, 20.0)).round() as u32;
    [width.max(1), DEFAULT_HEIGHT]
}
