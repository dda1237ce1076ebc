//! The preparation of a scene for rendering.

use std::{
    ops::Deref,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicU64, Ordering},
    },
};

use bottega_hra::DataId;
use bottega_kernels::{Accel, BuildOptions, InstanceGeometry, MeshGeometry, SphereGeometry};
use bottega_scene::{Instance, MediumId, Mesh, Scene, Sphere, Visibility};

use crate::{
    error::RenderError,
    identities::Identities,
    lights::Lights,
    media::{
        Homogeneous, PreparedMedium,
        varying::{Majorants, Varying},
    },
    motion::SceneMotion,
    settings::View,
    surfaces::{Surfaces, used_materials, visibilities},
};

/// The options for preparing a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PrepareOptions {
    /// Number of threads for building; 0: all of the machine. The result does not depend on it.
    pub threads: usize,
    /// `true`: leaves to BSDF sampling those parts of the environment that it samples well enough (MIS compensation),
    /// which is correct only with [`DirectLight::Combined`](crate::DirectLight::Combined); `false`: light sampling
    /// covers the whole environment.
    pub compensate_environment: bool,
}

impl Default for PrepareOptions {
    fn default() -> Self {
        Self { threads: 1, compensate_environment: true }
    }
}

/// A scene with its acceleration structure and light tables. Immutable and shared by all who render it. The camera of a
/// picture is in its [`View`], and data learnt before a picture in a [`Prepass`](crate::prepass::Prepass).
pub struct PreparedScene {
    surfaces: Surfaces,
    accel: Arc<Accel>,
    /// Majorants of the media that vary in space; `None` for the others.
    majorants: Vec<Option<Majorants>>,
    lights: Lights,
    has_opacity: bool,
    has_boundaries: bool,
    has_panes: bool,
    needs_volume: bool,
    tells_bounces_apart: bool,
    threads: usize,
    id: DataId,
    /// Memory on a device in bytes, once a device has reported it.
    device_bytes: AtomicU64,
    /// Cryptomatte identities, once they are wanted.
    identities: OnceLock<Identities>,
}

impl PreparedScene {
    /// Validates a scene, and builds its acceleration structure, its light tables and everything else that rendering
    /// needs.
    ///
    /// # Errors
    /// The same as [`build_accel`].
    pub fn new(scene: Arc<Scene>, options: &PrepareOptions) -> Result<Self, RenderError> {
        let accel = build_accel(&scene, options)?;
        Ok(Self::with_accel(scene, accel, options))
    }

    /// Prepares a scene whose acceleration structure exists. The scene is not validated again: [`Scene::validate`] must
    /// accept it.
    ///
    /// - `accel`: result of [`build_accel`] for the same scene, or for one of the same shapes.
    pub fn with_accel(scene: Arc<Scene>, accel: impl Into<Arc<Accel>>, options: &PrepareOptions) -> Self {
        let mut surfaces = Surfaces::new(scene);
        let scene = Arc::clone(surfaces.scene());
        let lights = Lights::new(&mut surfaces, options.compensate_environment);
        let materials = &surfaces.materials;
        let has_opacity = surfaces.culls_backs()
            || surfaces.has_curves()
            || surfaces.has_visibility()
            || used_materials(&scene).any(|material| materials[material].has_opacity);
        let parts_media = |material: usize| {
            materials[material].is_null && materials[material].media[0] != materials[material].media[1]
        };
        let has_boundaries = used_materials(&scene).any(parts_media);
        let has_panes = used_materials(&scene).any(|material| materials[material].is_pane);
        let has_volume =
            |medium: &Option<MediumId>| medium.is_some_and(|medium| !scene.media[medium.0 as usize].is_clear());
        let needs_volume = has_boundaries
            || used_materials(&scene).any(|material| materials[material].has_subsurface)
            || scene.cameras.iter().any(|camera| camera.medium.is_some())
            || used_materials(&scene).any(|material| materials[material].media.iter().any(has_volume));
        let lights_of = scene.lights.iter().map(|light| light.visibility);
        let environment = scene.environment.iter().map(|environment| environment.visibility);
        let all = visibilities(&scene).chain(lights_of).chain(environment);
        let tells_bounces_apart = all.into_iter().any(Visibility::tells_bounces_apart);
        let majorants = scene.media.iter().map(|medium| Some(Majorants::new(medium, medium.variation.as_deref()?)));
        let majorants = majorants.collect();
        static NEXT_ID: AtomicU64 = AtomicU64::new(0);
        let id = DataId(NEXT_ID.fetch_add(1, Ordering::Relaxed));
        Self {
            surfaces,
            accel: accel.into(),
            majorants,
            lights,
            has_opacity,
            has_boundaries,
            has_panes,
            needs_volume,
            tells_bounces_apart,
            threads: options.threads,
            id,
            device_bytes: AtomicU64::new(0),
            identities: OnceLock::new(),
        }
    }

    /// Returns the Cryptomatte identities of the scene's parts; the first call computes them.
    pub(crate) fn identities(&self) -> &Identities {
        self.identities.get_or_init(|| Identities::new(self.scene()))
    }

    /// Returns the acceleration structure, which finds the hits of rays.
    #[inline(always)]
    pub fn accel(&self) -> &Accel {
        &self.accel
    }

    /// Returns the acceleration structure for another scene of the same shapes; see [`Self::with_accel`].
    pub fn shared_accel(&self) -> Arc<Accel> {
        Arc::clone(&self.accel)
    }

    /// Returns the scene as it was imported, shared; of what moves, as it is when the shutter opens.
    pub fn shared_scene(&self) -> Arc<Scene> {
        Arc::clone(self.surfaces.scene())
    }

    /// Returns the id of the scene as data that may reside on a device; unique within the process.
    pub fn data_id(&self) -> DataId {
        self.id
    }

    /// Returns the scene's memory in bytes, on the device where it is largest; 0 until a device has reported it.
    pub fn device_bytes(&self) -> u64 {
        self.device_bytes.load(Ordering::Relaxed)
    }

    /// Records the scene's memory on a device, in bytes. The greatest value is kept.
    pub fn note_device_bytes(&self, bytes: u64) {
        self.device_bytes.fetch_max(bytes, Ordering::Relaxed);
    }

    /// Returns true if some surface may let rays pass, so that hits must be filtered.
    #[inline(always)]
    pub fn has_opacity(&self) -> bool {
        self.has_opacity
    }

    /// Returns true if something moves while the shutter is open, so that every path has a time.
    #[inline(always)]
    pub fn moves(&self) -> bool {
        self.motion().moves()
    }

    /// Returns true if the scene needs volume integration: a medium scatters or emits, or is not bounded by refracting
    /// surfaces, or light is scattered below a surface.
    #[inline(always)]
    pub(crate) fn needs_volume(&self) -> bool {
        self.needs_volume
    }

    /// Returns true if some surface or light exists for rays after one kind of event and not after another, so that
    /// paths must know the kind of their last event.
    #[inline(always)]
    pub(crate) fn tells_bounces_apart(&self) -> bool {
        self.tells_bounces_apart
    }

    /// Returns true if there is something that photon mapping does not support: media that scatter, emit, or are not bounded
    /// by refracting surfaces, surfaces or lights that are there after one kind of event and not after another, and motion.
    pub fn has_media(&self) -> bool {
        self.needs_volume || self.tells_bounces_apart || self.moves()
    }

    /// Returns true if light sampling must look behind some surfaces: boundaries of media without a surface, and panes.
    pub(crate) fn has_boundaries(&self) -> bool {
        self.has_boundaries || self.has_panes
    }

    /// Returns true if there are panes, which transmit light straight through without counting as a bounce.
    #[inline(always)]
    pub(crate) fn has_panes(&self) -> bool {
        self.has_panes
    }

    /// Returns `true` if there may be light that paths from the camera cannot find: that of lights without extent over
    /// mirrors and through glass.
    pub fn hides_light(&self) -> bool {
        let scene = self.scene();
        !scene.lights.is_empty() && scene.materials.iter().any(|material| material.surface.has_mirror())
    }

    /// Returns the memory of the prepared data without the scene, in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.accel.memory_bytes()
            + self.lights.memory_bytes()
            + self.surfaces.memory_bytes()
            + self.majorants.iter().flatten().map(Majorants::memory_bytes).sum::<usize>()
    }

    /// Returns the scene's lights.
    #[inline(always)]
    pub(crate) fn lights(&self) -> &Lights {
        &self.lights
    }

    /// Returns a medium, prepared for rendering.
    pub(crate) fn medium(&self, id: MediumId) -> PreparedMedium<'_> {
        let medium = &self.scene().media[id.0 as usize];
        match (&medium.variation, &self.majorants[id.0 as usize]) {
            (Some(variation), Some(majorants)) => PreparedMedium::Varying(Varying::new(medium, variation, majorants)),
            _ => PreparedMedium::Homogeneous(Homogeneous::new(medium)),
        }
    }

    /// Runs `make` in a pool with the configured number of threads.
    pub(crate) fn on_threads<T: Send>(&self, make: impl FnOnce() -> T + Send) -> T {
        match rayon::ThreadPoolBuilder::new().num_threads(self.threads).build() {
            Ok(pool) => pool.install(make),
            Err(_) => make(),
        }
    }

    /// Returns true if paths of a view can learn in a prepass: it has enough pixels and samples, no media, no panes, no
    /// motion, and no part that is visible to some kinds of rays only.
    ///
    /// - `planned_samples`: samples per pixel planned for the picture.
    pub fn can_learn(&self, view: &View, planned_samples: u32) -> bool {
        /// Smallest number of pixels: fewer give too few paths to learn from, and a poor guide adds noise.
        const PIXELS_MIN: u64 = 128 * 128;
        /// Smallest number of samples: below, learning costs more than it saves
        /// (`bench/runs/2026-11-25-negative-light.txt`).
        const SAMPLES_MIN: u64 = 1 << 19;
        let pixels = view.pixel_count();
        let is_large = pixels >= PIXELS_MIN && pixels * u64::from(planned_samples) >= SAMPLES_MIN;
        is_large && !self.needs_volume && !self.has_panes && !self.tells_bounces_apart && !self.moves()
    }
}

impl Deref for PreparedScene {
    type Target = Surfaces;

    #[inline(always)]
    fn deref(&self) -> &Surfaces {
        &self.surfaces
    }
}

/// The shapes of a scene as the input of tree builders; numbered as in the scene.
#[derive(Debug)]
pub struct SceneGeometry<'a> {
    /// Shapes of [`Scene::meshes`].
    pub meshes: Vec<MeshGeometry<'a>>,
    /// Shapes of [`Scene::instances`].
    pub instances: Vec<InstanceGeometry>,
    /// Shapes of [`Scene::spheres`].
    pub spheres: Vec<SphereGeometry>,
}

impl<'a> SceneGeometry<'a> {
    /// Returns the shapes of `scene` in the form of the BVH builder: meshes, instances and spheres.
    pub fn of(scene: &'a Scene) -> Self {
        let mesh = |mesh: &'a Mesh| MeshGeometry { positions: &mesh.positions, triangles: &mesh.triangles };
        let instance = |it: &Instance| InstanceGeometry { mesh: it.mesh, world_from_object: it.world_from_object };
        let sphere = |it: &Sphere| SphereGeometry { center: it.center, radius: it.radius };
        Self {
            meshes: scene.meshes.iter().map(mesh).collect(),
            instances: scene.instances.iter().map(instance).collect(),
            spheres: scene.spheres.iter().map(sphere).collect(),
        }
    }
}

/// Validates a scene and builds its acceleration structure, which takes most of the preparation of large scenes.
///
/// # Errors
/// [`RenderError::UnsoundScene`], [`RenderError::Accel`].
pub fn build_accel(scene: &Scene, options: &PrepareOptions) -> Result<Accel, RenderError> {
    scene.validate().map_err(|error| RenderError::UnsoundScene(Box::new(error)))?;
    let build = BuildOptions { threads: options.threads, ..BuildOptions::default() };
    if scene.has_motion() {
        let (opened, motion) = SceneMotion::of(Arc::new(scene.clone()));
        let SceneGeometry { meshes, instances, spheres } = SceneGeometry::of(&opened);
        return Ok(Accel::build_moving(&meshes, &instances, &spheres, &motion.geometry(&opened), &build)?);
    }
    let SceneGeometry { meshes, instances, spheres } = SceneGeometry::of(scene);
    Ok(Accel::build(&meshes, &instances, &spheres, &build)?)
}
