//! A scene made ready for painting.

use std::{
    ops::Deref,
    sync::{
        Arc, PoisonError, RwLock,
        atomic::{AtomicU64, Ordering},
    },
};

use bottega_hra::DataId;
use bottega_kernels::{Accel, BuildOptions, InstanceGeometry, MeshGeometry, SphereGeometry};
use bottega_scene::{Camera, Instance, MediumId, Mesh, Scene, Sphere};

use crate::{
    RenderError, View,
    lights::Lights,
    media::{
        Filling, Homogeneous,
        varying::{Majorants, Varying},
    },
    surfaces::{Surfaces, used_materials},
};

/// The options of preparing a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PrepareOptions {
    /// Threads to build with; 0: as many as the machine has. The result does not depend on it.
    pub threads: usize,
    /// Leave to BSDF sampling those parts of the environment that light sampling finds no better. Without it the
    /// environment can be found by light sampling alone.
    pub compensate_environment: bool,
}

impl Default for PrepareOptions {
    fn default() -> Self {
        Self { threads: 1, compensate_environment: true }
    }
}

/// A scene, its acceleration structure and its light tables. Immutable, and shared by all who paint it; cameras may be added
/// ([`Self::add_camera`]), and none changes. What is found out of it before a picture is in a [`Prepass`](crate::Prepass).
pub struct PreparedScene {
    surfaces: Surfaces,
    /// Those of the scene, then those that were added.
    /// One that was taken away leaves its place: no number means two cameras.
    cameras: RwLock<Vec<Option<Arc<Camera>>>>,
    accel: Accel,
    /// Of the media that vary in space.
    majorants: Vec<Option<Majorants>>,
    lights: Lights,
    has_opacity: bool,
    has_boundaries: bool,
    has_panes: bool,
    needs_volume: bool,
    threads: usize,
    id: DataId,
    /// Bytes on a device, once one has said what it takes.
    device_bytes: AtomicU64,
}

impl PreparedScene {
    /// Builds everything that painting needs.
    pub fn new(scene: Arc<Scene>, options: &PrepareOptions) -> Result<Self, RenderError> {
        let accel = build_accel(&scene, options)?;
        Ok(Self::with_accel(scene, accel, options))
    }

    /// Builds everything else that painting needs.
    ///
    /// - `accel`: what [`build_accel`] made of the same scene.
    pub fn with_accel(scene: Arc<Scene>, accel: Accel, options: &PrepareOptions) -> Self {
        let mut surfaces = Surfaces::new(scene);
        let scene = Arc::clone(surfaces.scene());
        let lights = Lights::new(&scene, &surfaces.materials, &mut surfaces.instances, options.compensate_environment);
        let materials = &surfaces.materials;
        let has_opacity = surfaces.culls_backs()
            || surfaces.has_curves()
            || used_materials(&scene).any(|material| materials[material].has_opacity);
        let parts_media = |material: usize| {
            materials[material].is_null && materials[material].media[0] != materials[material].media[1]
        };
        let has_boundaries = used_materials(&scene).any(parts_media);
        let has_panes = used_materials(&scene).any(|material| materials[material].is_pane);
        let has_volume =
            |medium: &Option<MediumId>| medium.is_some_and(|medium| !scene.media[medium.0 as usize].is_clear());
        let needs_volume = has_boundaries
            || scene.cameras.iter().any(|camera| camera.medium.is_some())
            || used_materials(&scene).any(|material| materials[material].media.iter().any(has_volume));
        let majorants = scene.media.iter().map(|medium| Some(Majorants::new(medium, medium.variation.as_deref()?)));
        let majorants = majorants.collect();
        static NEXT_ID: AtomicU64 = AtomicU64::new(0);
        let id = DataId(NEXT_ID.fetch_add(1, Ordering::Relaxed));
        let cameras = RwLock::new(scene.cameras.iter().cloned().map(Arc::new).map(Some).collect());
        Self {
            surfaces,
            cameras,
            accel,
            majorants,
            lights,
            has_opacity,
            has_boundaries,
            has_panes,
            needs_volume,
            threads: options.threads,
            id,
            device_bytes: AtomicU64::new(0),
        }
    }

    /// The camera of a number: those of the scene have theirs, and those that were added follow.
    pub fn camera(&self, number: usize) -> Option<Arc<Camera>> {
        self.cameras.read().unwrap_or_else(PoisonError::into_inner).get(number).cloned().flatten()
    }

    /// Adds a camera: the same scene, seen otherwise, with nothing prepared anew. Returns its number.
    ///
    /// - `camera`: one of the scene's that stands elsewhere, or has another lens or angle; its medium and its view of emitters
    ///   must be those of one of the scene's.
    pub fn add_camera(&self, camera: Camera) -> usize {
        let mut cameras = self.cameras.write().unwrap_or_else(PoisonError::into_inner);
        cameras.push(Some(Arc::new(camera)));
        cameras.len() - 1
    }

    /// Takes a camera away that was added; those of the scene stay. Nobody may see by it any more.
    pub fn remove_camera(&self, number: usize) {
        let mut cameras = self.cameras.write().unwrap_or_else(PoisonError::into_inner);
        if let Some(added) = cameras.get_mut(number).filter(|_| number >= self.scene().cameras.len()) {
            *added = None;
        }
    }

    /// An error for a number that no camera has.
    pub(crate) fn no_camera(&self, index: usize) -> RenderError {
        RenderError::NoCamera { index, count: self.cameras.read().unwrap_or_else(PoisonError::into_inner).len() }
    }

    /// The acceleration structure.
    #[inline(always)]
    pub fn accel(&self) -> &Accel {
        &self.accel
    }

    /// Names it as data that may be resident in a resource; unique within the process.
    pub fn data_id(&self) -> DataId {
        self.id
    }

    /// Bytes that it takes on the device where it takes most; 0 until one has told.
    pub fn device_bytes(&self) -> u64 {
        self.device_bytes.load(Ordering::Relaxed)
    }

    /// A device tells how many bytes the scene takes there.
    pub fn note_device_bytes(&self, bytes: u64) {
        self.device_bytes.fetch_max(bytes, Ordering::Relaxed);
    }

    /// Whether some surface may let rays pass, so that hits must be asked.
    #[inline(always)]
    pub fn has_opacity(&self) -> bool {
        self.has_opacity
    }

    /// Whether something is more than surfaces: a medium that scatters or emits, or one that does not begin and end where
    /// light is refracted.
    #[inline(always)]
    pub(crate) fn needs_volume(&self) -> bool {
        self.needs_volume
    }

    /// Whether light goes through media that photons know nothing of: those that scatter, emit, or do not begin and end where
    /// it is refracted.
    pub fn has_media(&self) -> bool {
        self.needs_volume
    }

    /// Whether there are surfaces behind which lights are sought: those that do nothing but part media, and panes.
    pub(crate) fn has_boundaries(&self) -> bool {
        self.has_boundaries || self.has_panes
    }

    /// Whether there are panes: what goes straight through them is no bounce.
    #[inline(always)]
    pub(crate) fn has_panes(&self) -> bool {
        self.has_panes
    }

    /// Bytes that preparation added to the scene.
    pub fn memory_bytes(&self) -> usize {
        self.accel.memory_bytes()
            + self.lights.memory_bytes()
            + self.surfaces.memory_bytes()
            + self.majorants.iter().flatten().map(Majorants::memory_bytes).sum::<usize>()
    }

    #[inline(always)]
    pub(crate) fn lights(&self) -> &Lights {
        &self.lights
    }

    /// What fills space.
    pub(crate) fn medium(&self, id: MediumId) -> Filling<'_> {
        let medium = &self.scene().media[id.0 as usize];
        match (&medium.variation, &self.majorants[id.0 as usize]) {
            (Some(variation), Some(majorants)) => Filling::Varying(Varying::new(medium, variation, majorants)),
            _ => Filling::Homogeneous(Homogeneous::new(medium)),
        }
    }

    /// Does something on as many threads as are meant for what is made once.
    pub(crate) fn on_threads<T: Send>(&self, make: impl FnOnce() -> T + Send) -> T {
        match rayon::ThreadPoolBuilder::new().num_threads(self.threads).build() {
            Ok(pool) => pool.install(make),
            Err(_) => make(),
        }
    }

    /// Whether paths of a view learn beforehand: it has pixels and samples enough, and no media take part.
    pub fn can_learn(&self, view: View, planned_samples: u32) -> bool {
        /// A picture of fewer pixels gives too few paths to learn from: with a poor guide its noise would grow.
        const PIXELS_MIN: u64 = 128 * 128;
        /// Of fewer samples learning takes more than it saves (`bench/runs/2026-11-25-negative-light.txt`).
        const SAMPLES_MIN: u64 = 1 << 19;
        let pixels = u64::from(view.width) * u64::from(view.height);
        let is_large = pixels >= PIXELS_MIN && pixels * u64::from(planned_samples) >= SAMPLES_MIN;
        is_large && !self.needs_volume && !self.has_panes
    }
}

impl Deref for PreparedScene {
    type Target = Surfaces;

    #[inline(always)]
    fn deref(&self) -> &Surfaces {
        &self.surfaces
    }
}

/// The shapes of a scene as those take them who build trees over them; numbered as in the scene.
#[derive(Debug)]
pub struct SceneGeometry<'a> {
    /// Of [`Scene::meshes`].
    pub meshes: Vec<MeshGeometry<'a>>,
    /// Of [`Scene::instances`].
    pub instances: Vec<InstanceGeometry>,
    /// Of [`Scene::spheres`].
    pub spheres: Vec<SphereGeometry>,
}

impl<'a> SceneGeometry<'a> {
    /// All shapes of `scene`.
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

/// Checks a scene and builds its acceleration structures: the long part of preparing one of many triangles.
pub fn build_accel(scene: &Scene, options: &PrepareOptions) -> Result<Accel, RenderError> {
    scene.validate().map_err(|error| RenderError::UnsoundScene(Box::new(error)))?;
    let SceneGeometry { meshes, instances, spheres } = SceneGeometry::of(scene);
    let build = BuildOptions { threads: options.threads, ..BuildOptions::default() };
    Ok(Accel::build(&meshes, &instances, &spheres, &build)?)
}
