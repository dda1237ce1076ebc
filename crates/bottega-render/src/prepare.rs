//! A scene made ready for painting.

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

use bottega_hra::DataId;
use bottega_kernels::{Accel, BuildOptions, InstanceGeometry, MeshGeometry, SphereGeometry};
use bottega_scene::{AlphaMode, Instance, Material, MediumId, Mesh, Scene, Spectrum, Sphere, Surface};
use glam::{Affine3A, Mat3};

use crate::{
    RenderError, View,
    bsdf::{Bsdf, SurfacePoint, scattering},
    lights::{Lights, NO_LIGHT},
    media::{
        Filling, Homogeneous,
        varying::{Majorants, Varying},
    },
};

/// How a scene is prepared.
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

/// A scene, its acceleration structure and its light tables. Immutable, and shared by all who paint it. What is found out
/// of it before a picture is in a [`Prepass`](crate::Prepass).
pub struct PreparedScene {
    scene: Arc<Scene>,
    accel: Accel,
    instances: Vec<PreparedInstance>,
    materials: Vec<PreparedMaterial>,
    /// Of the media that vary in space.
    majorants: Vec<Option<Majorants>>,
    lights: Lights,
    /// Whether the camera sees through some surface from behind.
    culls_backs: bool,
    has_opacity: bool,
    has_boundaries: bool,
    has_panes: bool,
    needs_volume: bool,
    threads: usize,
    id: DataId,
}

/// What is known of an instance beside the scene's own record.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedInstance {
    /// Turns normals, and vectors along them whose length is an area: det M · M⁻ᵀ of the linear part M.
    pub(crate) world_from_normal: Mat3,
    /// No vector gets longer than this times its length.
    pub(crate) scale: f32,
    /// Place of its first triangle among those that shine; [`NO_LIGHT`] where it does not.
    pub(crate) first_light: u32,
}

/// What is known of a material beside the scene's own record.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedMaterial {
    /// Whether a lookup depends on the footprint.
    pub(crate) is_textured: bool,
    /// Textures that are looked up for it.
    pub(crate) texture_count: u8,
    /// Whether it depends on the directions of the texture coordinates.
    pub(crate) needs_tangents: bool,
    /// Whether rays may pass it as if it were not there.
    pub(crate) has_opacity: bool,
    /// Whether it is no more than the boundary of media.
    pub(crate) is_null: bool,
    /// Whether light that goes straight through it goes on as if nothing was there.
    pub(crate) is_pane: bool,
    /// Whether light that goes through it comes into another medium.
    pub(crate) parts_media: bool,
    /// Whether it emits light, other than by being unlit.
    pub(crate) shines: bool,
    /// Whether light may go through to the other side.
    pub(crate) transmits: bool,
    /// The scattering seen from the back and from the front, where it is the same everywhere on the surface.
    pub(crate) bsdfs: Option<[Bsdf; 2]>,
    /// What fills the space before the front and behind it, where light may go through to it.
    pub(crate) media: [Option<MediumId>; 2],
    /// Absorption before the front and behind it, per unit of distance; 0 for opaque things.
    pub(crate) absorption: [Spectrum; 2],
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
        let materials: Vec<_> = scene.materials.iter().map(|material| prepare_material(&scene, material)).collect();
        let mut instances: Vec<_> =
            scene.instances.iter().map(|instance| prepare_instance(&instance.world_from_object)).collect();
        let lights = Lights::new(&scene, &materials, &mut instances, options.compensate_environment);
        let culls_backs = used_materials(&scene).any(|material| scene.materials[material].culls_back);
        let has_opacity = culls_backs || used_materials(&scene).any(|material| materials[material].has_opacity);
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
        Self {
            scene,
            accel,
            instances,
            materials,
            majorants,
            lights,
            culls_backs,
            has_opacity,
            has_boundaries,
            has_panes,
            needs_volume,
            threads: options.threads,
            id,
        }
    }

    /// The scene as it was imported.
    #[inline(always)]
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
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

    /// Whether the camera sees through some surface from behind.
    pub(crate) fn culls_backs(&self) -> bool {
        self.culls_backs
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
            + size_of_val(&*self.instances)
            + size_of_val(&*self.materials)
            + self.majorants.iter().flatten().map(Majorants::memory_bytes).sum::<usize>()
    }

    #[inline(always)]
    pub(crate) fn lights(&self) -> &Lights {
        &self.lights
    }

    /// What fills space.
    pub(crate) fn medium(&self, id: MediumId) -> Filling<'_> {
        let medium = &self.scene.media[id.0 as usize];
        match (&medium.variation, &self.majorants[id.0 as usize]) {
            (Some(variation), Some(majorants)) => Filling::Varying(Varying::new(medium, variation, majorants)),
            _ => Filling::Homogeneous(Homogeneous::new(medium)),
        }
    }

    /// Threads that may be used for what is made once.
    pub(crate) fn threads(&self) -> usize {
        self.threads
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

    #[inline(always)]
    pub(crate) fn instance(&self, index: u32) -> &PreparedInstance {
        &self.instances[index as usize]
    }

    #[inline(always)]
    pub(crate) fn mesh(&self, instance: u32) -> &Mesh {
        &self.scene.meshes[self.scene.instances[instance as usize].mesh as usize]
    }

    #[inline(always)]
    pub(crate) fn material(&self, index: u32) -> (&Material, &PreparedMaterial) {
        (&self.scene.materials[index as usize], &self.materials[index as usize])
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

fn prepare_instance(world_from_object: &Affine3A) -> PreparedInstance {
    let linear = Mat3::from(world_from_object.matrix3);
    // det M · M⁻ᵀ without a division: good for matrices that are nearly singular, too.
    let world_from_normal = Mat3::from_cols(
        linear.y_axis.cross(linear.z_axis),
        linear.z_axis.cross(linear.x_axis),
        linear.x_axis.cross(linear.y_axis),
    );
    let scale = linear.x_axis.length() + linear.y_axis.length() + linear.z_axis.length();
    PreparedInstance { world_from_normal, scale, first_light: NO_LIGHT }
}

fn prepare_material(scene: &Scene, material: &Material) -> PreparedMaterial {
    let transmits = material.transmits();
    let parts_media = material.parts_media();
    let texture_count = material.textures().len().min(usize::from(u8::MAX)) as u8;
    let is_textured = texture_count > 0;
    let is_null = material.surface == Surface::Null;
    let side = |front| scattering(scene, material, &SurfacePoint::plain(front));
    let absorption = |medium: Option<MediumId>| {
        medium.filter(|_| transmits).map_or(Spectrum::ZERO, |medium| scene.media[medium.0 as usize].absorption)
    };
    PreparedMaterial {
        bsdfs: (!is_textured && !material.is_blended()).then(|| [side(false), side(true)]),
        transmits,
        media: if parts_media { [material.exterior, material.interior] } else { [None; 2] },
        parts_media,
        is_pane: material.is_seen_through(),
        is_textured,
        texture_count,
        is_null,
        needs_tangents: material.needs_tangents(),
        has_opacity: is_null || material.alpha_mode != AlphaMode::Opaque,
        shines: material.emission.factor.max_element() > 0.0,
        absorption: [material.exterior, material.interior].map(absorption),
    }
}

fn used_materials(scene: &Scene) -> impl Iterator<Item = usize> {
    let meshes = scene.instances.iter().map(|instance| scene.meshes[instance.mesh as usize].material as usize);
    meshes.chain(scene.spheres.iter().map(|sphere| sphere.material as usize))
}
