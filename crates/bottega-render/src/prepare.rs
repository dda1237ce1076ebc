//! A scene made ready for painting.

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

use bottega_hra::DataId;
use bottega_kernels::{Accel, BuildOptions, InstanceGeometry, MeshGeometry, SphereGeometry};
use bottega_scene::{AlphaMode, Material, MediumId, Scene, Spectrum, Surface};
use glam::{Affine3A, Mat3};

use crate::{
    RenderError,
    bsdf::{Bsdf, SurfacePoint, scattering},
    lights::{Lights, NO_LIGHT},
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

/// A scene, its acceleration structure and its light tables. Immutable, and shared by all who paint it.
pub struct PreparedScene {
    scene: Arc<Scene>,
    accel: Accel,
    instances: Vec<PreparedInstance>,
    materials: Vec<PreparedMaterial>,
    lights: Lights,
    has_opacity: bool,
    id: DataId,
}

/// What is known of an instance beside the scene's own record.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedInstance {
    /// Turns normals, and vectors along them whose length is an area: det M · M⁻ᵀ of the linear part M.
    pub(crate) world_from_normal: Mat3,
    /// No vector gets longer than this times its length.
    pub(crate) scale: f32,
    /// Light index of its first triangle; [`NO_LIGHT`] where it does not shine.
    pub(crate) first_light: u32,
}

/// What is known of a material beside the scene's own record.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedMaterial {
    /// Whether a lookup depends on the footprint.
    pub(crate) is_textured: bool,
    /// Whether it depends on the directions of the texture coordinates.
    pub(crate) needs_tangents: bool,
    /// Whether rays may pass it as if it were not there.
    pub(crate) has_opacity: bool,
    /// Whether it is no more than the boundary of media.
    pub(crate) is_null: bool,
    /// Whether it emits light, other than by being unlit.
    pub(crate) shines: bool,
    /// Whether light may go through to the other side.
    pub(crate) transmits: bool,
    /// The scattering seen from the back and from the front, where it is the same everywhere on the surface.
    pub(crate) bsdfs: Option<[Bsdf; 2]>,
    /// Absorption before the front and behind it, per unit of distance; 0 for opaque things.
    pub(crate) absorption: [Spectrum; 2],
}

impl PreparedScene {
    /// Builds everything that painting needs.
    pub fn new(scene: Arc<Scene>, options: &PrepareOptions) -> Result<Self, RenderError> {
        scene.validate().map_err(|error| RenderError::UnsoundScene(Box::new(error)))?;
        let accel = build_accel(&scene, options)?;
        let materials: Vec<_> = scene.materials.iter().map(|material| prepare_material(&scene, material)).collect();
        let mut instances: Vec<_> =
            scene.instances.iter().map(|instance| prepare_instance(&instance.world_from_object)).collect();
        let bounds = accel.bounds();
        let radius = if bounds.is_empty() { 1.0 } else { 0.5 * (bounds.max - bounds.min).length() };
        let lights = Lights::new(&scene, radius, &materials, &mut instances, options.compensate_environment);
        let has_opacity = used_materials(&scene).any(|material| materials[material].has_opacity);
        static NEXT_ID: AtomicU64 = AtomicU64::new(0);
        let id = DataId(NEXT_ID.fetch_add(1, Ordering::Relaxed));
        Ok(Self { scene, accel, instances, materials, lights, has_opacity, id })
    }

    /// The scene as it was imported.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The acceleration structure.
    pub fn accel(&self) -> &Accel {
        &self.accel
    }

    /// Names it as data that may be resident in a resource; unique within the process.
    pub fn data_id(&self) -> DataId {
        self.id
    }

    /// Whether some surface may let rays pass, so that hits must be asked.
    pub fn has_opacity(&self) -> bool {
        self.has_opacity
    }

    /// Bytes that preparation added to the scene.
    pub fn memory_bytes(&self) -> usize {
        self.accel.memory_bytes()
            + self.lights.memory_bytes()
            + size_of_val(&*self.instances)
            + size_of_val(&*self.materials)
    }

    pub(crate) fn lights(&self) -> &Lights {
        &self.lights
    }

    pub(crate) fn instance(&self, index: u32) -> &PreparedInstance {
        &self.instances[index as usize]
    }

    pub(crate) fn material(&self, index: u32) -> (&Material, &PreparedMaterial) {
        (&self.scene.materials[index as usize], &self.materials[index as usize])
    }
}

fn build_accel(scene: &Scene, options: &PrepareOptions) -> Result<Accel, RenderError> {
    let meshes: Vec<_> = scene
        .meshes
        .iter()
        .map(|mesh| MeshGeometry { positions: &mesh.positions, triangles: &mesh.triangles })
        .collect();
    let instances: Vec<_> = scene
        .instances
        .iter()
        .map(|instance| InstanceGeometry { mesh: instance.mesh, world_from_object: instance.world_from_object })
        .collect();
    let spheres: Vec<_> =
        scene.spheres.iter().map(|sphere| SphereGeometry { center: sphere.center, radius: sphere.radius }).collect();
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
    let is_textured = !material.textures().is_empty();
    let is_null = material.surface == Surface::Null;
    let side = |front| scattering(scene, material, &SurfacePoint::plain(front));
    let absorption = |medium: Option<MediumId>| {
        medium.filter(|_| transmits).map_or(Spectrum::ZERO, |medium| scene.media[medium.0 as usize].absorption)
    };
    PreparedMaterial {
        bsdfs: (!is_textured && !material.is_blended()).then(|| [side(false), side(true)]),
        transmits,
        is_textured,
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
