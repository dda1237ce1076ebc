//! A loaded scene with the camera and the picture size of a request.

mod edited;
mod projection;

use std::{sync::Arc, time::Instant};

use bottega_image::Rect;
use bottega_render::{PrepareOptions, PreparedScene, Prepass, View, build_accel, displace};
use bottega_scene::{
    Camera, Environment, LoadOptions, Loaded, Panorama, Projection, RenderHints, Scene, SceneFile, Shutter, Spectrum,
    StereoLayout, Warning,
};
use glam::{DVec3, Mat3};

use self::projection::put_lens;
use crate::{
    devices::threads,
    error::Error,
    request::{EnvironmentLight, Request, SceneOptions, ShutterTimes, ViewOptions, check_size},
};

/// Height in pixels of a picture for which neither request nor file gives a size.
const DEFAULT_HEIGHT: u32 = 720;

/// A scene ready for rendering.
pub struct LoadedScene {
    /// The scene with its acceleration structures.
    pub prepared: Arc<PreparedScene>,
    /// Results of prepasses over the scene, shared by its pictures.
    pub prepass: Arc<Prepass>,
    /// The camera of the picture, and its size in pixels.
    pub view: View,
    /// Index of the camera in the file; the request may give it another pose or lens.
    pub camera: usize,
    /// The cameras of the file, unchanged.
    cameras: Vec<Camera>,
    /// Warnings about unsupported features of the file.
    pub warnings: Vec<Warning>,
    /// Render hints of the file. The crop is removed if the request sets the size of the picture.
    pub hints: RenderHints,
    /// The files that the scene refers to.
    pub files: Vec<SceneFile>,
    /// The time when loading ended: file read and acceleration structures built.
    pub loaded: Instant,
}

impl LoadedScene {
    /// Reads and prepares the scene file of a request. Returns the prepared scene.
    ///
    /// # Errors
    /// The scene cannot be read or prepared, has no such camera, the lens or pose of the request does not suit the camera, or the
    /// picture is too large.
    pub fn load(request: &Request) -> Result<Self, Error> {
        Self::of(load(request)?, request)
    }

    /// Prepares a scene in memory, with the camera, size and environment of a request. Returns the prepared scene.
    ///
    /// # Errors
    /// The scene is invalid, cannot be prepared, or has no camera or not the requested one; the lens or pose of the request does
    /// not suit the camera, or the picture is too large.
    pub fn of_scene(scene: impl Into<Loaded>, request: &Request) -> Result<Self, Error> {
        let mut loaded = scene.into();
        loaded.scene.validate()?;
        if loaded.scene.cameras.is_empty() {
            return Err(no_camera());
        }
        turn_environment(&mut loaded.scene, request);
        Self::of(loaded, request)
    }

    fn of(loaded: Loaded, request: &Request) -> Result<Self, Error> {
        let Loaded { mut scene, mut warnings, mut hints, files, .. } = loaded;
        displace_meshes(&mut scene, request, &mut warnings);
        let cameras = scene.cameras.clone();
        let (camera, aimed) = aimed(&cameras, scene.origin, &request.view)?;
        let [width, height] = size(request, &hints, &aimed)?;
        // The scene is checked with the camera as the picture uses it
        scene.cameras[camera] = aimed.clone();
        hints.crop = hints.crop.filter(|_| request.film.size.is_none());
        let options = PrepareOptions { threads: threads(request), ..PrepareOptions::default() };
        let accel = build_accel(&scene, &options)?;
        let loaded = Instant::now();
        let prepared = Arc::new(PreparedScene::with_accel(Arc::new(scene), accel, &options));
        let view = View { camera: Arc::new(aimed), width, height };
        Ok(Self { prepared, prepass: Arc::default(), view, camera, cameras, warnings, hints, files, loaded })
    }

    /// Returns the scene with the camera and size of a request that differs in its view alone. Nothing is read or prepared again.
    ///
    /// # Errors
    /// The scene has no such camera, the lens or pose does not suit it, or the picture is too large.
    pub fn seen_as(self, request: &Request) -> Result<Self, Error> {
        let (camera, aimed) = aimed(&self.cameras, self.scene().origin, &request.view)?;
        let [width, height] = size(request, &self.hints, &aimed)?;
        let view = View { camera: Arc::new(aimed), width, height };
        let mut hints = self.hints;
        hints.crop = hints.crop.filter(|_| request.film.size.is_none());
        Ok(Self { view, camera, prepass: Arc::default(), hints, ..self })
    }

    /// Returns the camera of the picture.
    pub fn camera(&self) -> &Camera {
        &self.view.camera
    }

    /// Returns the cameras of the file, unchanged.
    pub fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// Returns the scene, as it was prepared.
    pub fn scene(&self) -> &Scene {
        self.prepared.scene()
    }

    /// Returns the rectangle of all pixels of the picture.
    pub fn frame(&self) -> Rect {
        Rect::of_size(self.view.width, self.view.height)
    }
}

impl SceneOptions {
    /// Returns the options for reading the scene file.
    pub fn load_options(&self) -> LoadOptions {
        LoadOptions {
            strict: self.strict,
            allow_outside: self.allow_outside,
            asset_roots: self.asset_roots.clone(),
            cull_backfaces: self.cull_backfaces,
            defines: self.defines.clone().into_iter().collect(),
            at: self.time,
            shutter: self.shutter.map(|ShutterTimes { open, close, ramp }| Shutter { open, close, ramp }),
            animation: self.animation.clone(),
            variant: self.variant.clone(),
            subdivision: self.subdivision,
            displacement: self.displacement,
            ..LoadOptions::default()
        }
    }
}

/// Displaces the meshes whose materials ask for it, with warnings about what stays.
fn displace_meshes(scene: &mut Scene, request: &Request, warnings: &mut Vec<Warning>) {
    let memory = LoadOptions::default().max_memory_bytes.saturating_sub(scene.memory_bytes());
    let notes = displace(scene, request.scene.displacement, memory);
    warnings.extend(notes.into_iter().map(|message| Warning { place: String::new(), message, is_unsupported: true }));
}

fn no_camera() -> Error {
    Error::usage("the scene has no camera", "add one to it")
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

/// Sets the environment light of a scene from the request, unless it is an image file.
fn turn_environment(scene: &mut Scene, request: &Request) {
    let options = &request.environment;
    match &options.light {
        Some(EnvironmentLight::Radiance(radiance)) => {
            scene.environment = Some(Environment::uniform(Spectrum::from_array(*radiance) * options.strength));
            return;
        }
        Some(EnvironmentLight::Sky) => scene.add_sky(),
        Some(EnvironmentLight::File(_)) | None => {}
    }
    if let Some(environment) = &mut scene.environment {
        let world_from_environment = Mat3::from_rotation_y(options.rotate.to_radians());
        environment.factor *= options.strength;
        environment.world_from_environment = world_from_environment * environment.world_from_environment;
    }
}

/// Returns the index of the requested camera, and the camera with the requested lens and pose.
///
/// - `origin`: origin of the scene, in the coordinates of the file.
fn aimed(cameras: &[Camera], origin: DVec3, view: &ViewOptions) -> Result<(usize, Camera), Error> {
    let number = check_view(view, cameras.iter().map(|camera| (&*camera.name, has_angle(camera))))?;
    let mut camera = cameras[number].clone();
    put_lens(view, &mut camera)?;
    let Some(pose) = view.pose else { return Ok((number, camera)) };
    camera.world_from_camera = pose.looking(origin.to_array()).ok_or_else(|| {
        let problem = "`view.pose` has no direction: at the scale of the scene, `eye` and `target` are the same point";
        Error::usage(problem, "move them apart")
    })?;
    camera.motion.clear();
    if let (Some(fov), Projection::Perspective { vertical_fov }) = (pose.fov, &mut camera.projection) {
        *vertical_fov = fov.to_radians();
    }
    Ok((number, camera))
}

fn has_angle(camera: &Camera) -> bool {
    // The angle of a camera with lenses is that of its lenses
    matches!(camera.projection, Projection::Perspective { .. }) && camera.lenses.is_none()
}

/// Returns the index of the camera of a view, after checking that the view suits it.
///
/// - `cameras`: name of each camera, and true if it has a field of view (perspective).
///
/// # Errors
/// There is no such camera, or the view sets a field of view for a camera without perspective.
pub(crate) fn check_view<'a>(
    view: &ViewOptions,
    cameras: impl Iterator<Item = (&'a str, bool)>,
) -> Result<usize, Error> {
    let cameras: Vec<(&str, bool)> = cameras.collect();
    let number = camera_index(&cameras, view.camera.as_deref())?;
    let (name, has_angle) = cameras[number];
    match view.pose.and_then(|pose| pose.fov) {
        Some(fov) if !has_angle => {
            let problem = format!("`view.pose.fov` is {fov}, but the camera {number} {name:?} has no field of view");
            Err(Error::usage(problem, "leave it out, or choose a camera with perspective"))
        }
        _ => Ok(number),
    }
}

fn camera_index(cameras: &[(&str, bool)], wanted: Option<&str>) -> Result<usize, Error> {
    let Some(wanted) = wanted else { return Ok(0) };
    let by_name = cameras.iter().position(|(name, _)| *name == wanted);
    let by_number = wanted.parse().ok().filter(|&index: &usize| index < cameras.len());
    by_name.or(by_number).ok_or_else(|| {
        let names: Vec<String> =
            cameras.iter().enumerate().map(|(index, (name, _))| format!("{index} {name:?}")).collect();
        Error::usage(format!("there is no camera `{wanted}`"), format!("the scene has: {}", names.join(", ")))
    })
}

/// Returns the size of the picture in pixels: from the request, else from the file, else from the camera's aspect ratio.
///
/// # Errors
/// The picture, or its crop, is too large.
fn size(request: &Request, hints: &RenderHints, camera: &Camera) -> Result<[u32; 2], Error> {
    let given = request.film.size.or(hints.resolution);
    let Some([width, height]) = given else { return Ok(default_size(camera)) };
    let hinted = |[x, y, width, height]: [u32; 4]| [x, y, x.saturating_add(width), y.saturating_add(height)];
    let crop = request.film.crop.or_else(|| hints.crop.filter(|_| request.film.size.is_none()).map(hinted));
    check_size([width, height], crop).map_err(|allowed| {
        let whose = if request.film.size.is_none() { "the scene file asks for" } else { "the request asks for" };
        Error::usage(
            format!("{whose} a picture of {width}x{height} pixels: {allowed}"),
            "give another size (`--size`), or a part of the picture (`--crop`)",
        )
    })?;
    Ok([width, height])
}

fn default_size(camera: &Camera) -> [u32; 2] {
    let aspect =
        camera.aspect.filter(|aspect| aspect.is_finite() && *aspect > 0.0).unwrap_or(match camera.projection {
            Projection::Perspective { .. } => 16.0 / 9.0,
            Projection::Orthographic { .. }
            | Projection::Fisheye { .. }
            | Projection::Panorama(Panorama::EqualArea) => 1.0,
            Projection::Panorama(Panorama::Equirectangular) => 2.0,
            Projection::Panorama(Panorama::Cube) => 6.0,
        });
    let aspect = match camera.stereo.map(|stereo| stereo.layout) {
        None | Some(StereoLayout::Left | StereoLayout::Right) => aspect,
        Some(StereoLayout::SideBySide) => 2.0 * aspect,
        Some(StereoLayout::TopBottom) => 0.5 * aspect,
    };
    let width = (DEFAULT_HEIGHT as f32 * aspect.clamp(0.05, 20.0)).round() as u32;
    [width.max(1), DEFAULT_HEIGHT]
}
