//! Surfaces of a scene, with precomputed data of instances and materials.

use std::sync::Arc;

use bottega_scene::{AlphaMode, Material, MediumId, Mesh, Scene, Spectrum, Sphere, Surface, Visibility};
use glam::{Affine3A, Mat3, Vec3};

use crate::{
    bsdf::{Bsdf, SurfacePoint, scattering},
    lights::{NO_LIGHT, Profile},
    motion::SceneMotion,
};

/// A scene with precomputed data of its instances and materials.
pub struct Surfaces {
    scene: Arc<Scene>,
    /// Data of the scene's instances, by index.
    pub(crate) instances: Vec<PreparedInstance>,
    /// Data of the scene's materials, by index.
    pub(crate) materials: Vec<PreparedMaterial>,
    /// `true`: some surface is invisible to the camera from behind.
    culls_backs: bool,
    /// `true`: some mesh is the hull of curves.
    has_curves: bool,
    /// `true`: some surface is not there for some kind of ray.
    has_visibility: bool,
    /// Motion while the shutter is open.
    motion: SceneMotion,
}

impl Surfaces {
    /// Precomputes the data of a scene; the lights are set later. Takes the scene as it is when the shutter opens.
    pub(crate) fn new(scene: Arc<Scene>) -> Self {
        let (scene, motion) = SceneMotion::of(scene);
        let materials = scene.materials.iter().map(|material| prepare_material(&scene, material)).collect();
        let instances = scene.instances.iter().map(|instance| prepare_instance(&instance.world_from_object)).collect();
        let culls_backs = used_materials(&scene).any(|material| scene.materials[material].culls_back);
        let has_curves = scene.instances.iter().any(|it| scene.meshes[it.mesh as usize].curves.is_some());
        let has_visibility = visibilities(&scene).any(|visibility| visibility != Visibility::ALL);
        Self { scene, instances, materials, culls_backs, has_curves, has_visibility, motion }
    }

    /// Returns the scene as it was imported; of what moves, as it is when the shutter opens.
    #[inline(always)]
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Returns true if some surface is invisible to the camera from behind.
    pub(crate) fn culls_backs(&self) -> bool {
        self.culls_backs
    }

    /// Returns true if some mesh is the hull of curves, so that hits must be filtered.
    pub(crate) fn has_curves(&self) -> bool {
        self.has_curves
    }

    /// Returns true if some surface is not there for some kind of ray, so that hits must be filtered.
    #[inline(always)]
    pub(crate) fn has_visibility(&self) -> bool {
        self.has_visibility
    }

    /// Returns what moves while the shutter is open.
    #[inline(always)]
    pub(crate) fn motion(&self) -> &SceneMotion {
        &self.motion
    }

    /// Returns the transformation of an instance to world space at a time.
    #[inline(always)]
    pub(crate) fn world_from_object(&self, instance: u32, time: f32) -> Affine3A {
        match self.motion.instance(instance) {
            Some(moving) => moving.at(time),
            None => self.scene.instances[instance as usize].world_from_object,
        }
    }

    /// Returns the corners of a triangle in object space at a time.
    pub(crate) fn corners(&self, instance: u32, triangle: u32, time: f32) -> [Vec3; 3] {
        let index = self.scene.instances[instance as usize].mesh;
        let mesh = &self.scene.meshes[index as usize];
        let triangle = mesh.triangles[triangle as usize];
        match self.motion.corners(&self.scene, index, triangle, time) {
            Some([positions, _]) => positions,
            None => triangle.map(|vertex| mesh.positions[vertex as usize]),
        }
    }

    /// Returns a sphere at a time, if it moves; else `None`.
    #[inline(always)]
    pub(crate) fn moved_sphere(&self, index: u32, time: f32) -> Option<Sphere> {
        self.motion.sphere(&self.scene, index, time)
    }

    /// Returns true if a surface moves, by its instance or by the vertices of its mesh.
    #[inline(always)]
    pub(crate) fn is_moving(&self, instance: u32) -> bool {
        self.motion.moves()
            && (self.motion.instance(instance).is_some()
                || self.motion.moves_mesh(self.scene.instances[instance as usize].mesh))
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.instances) + size_of_val(&*self.materials)
    }

    /// Returns the data of an instance.
    #[inline(always)]
    pub(crate) fn instance(&self, index: u32) -> &PreparedInstance {
        &self.instances[index as usize]
    }

    /// Returns the mesh of an instance.
    #[inline(always)]
    pub(crate) fn mesh(&self, instance: u32) -> &Mesh {
        &self.scene.meshes[self.scene.instances[instance as usize].mesh as usize]
    }

    /// Returns the material of an instance.
    #[inline(always)]
    pub(crate) fn material_of(&self, instance: u32) -> u32 {
        self.scene.material_of(&self.scene.instances[instance as usize])
    }

    /// Returns a material with its data.
    #[inline(always)]
    pub(crate) fn material(&self, index: u32) -> (&Material, &PreparedMaterial) {
        (&self.scene.materials[index as usize], &self.materials[index as usize])
    }
}

/// Precomputed data of an instance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedInstance {
    /// Transformation of normals and area vectors: det M · M⁻ᵀ of the linear part M.
    pub(crate) world_from_normal: Mat3,
    /// Upper bound of the factor by which the instance lengthens vectors.
    pub(crate) scale: f32,
    /// Index of the instance's first triangle among the emitting ones; [`NO_LIGHT`] if it does not emit.
    pub(crate) first_light: u32,
}

/// Precomputed data of a material.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedMaterial {
    /// `true`: the material has textures, so that lookups depend on the footprint, or is hair, which depends on the place across a
    /// fibre.
    pub(crate) is_textured: bool,
    /// Number of textures looked up for the material.
    pub(crate) texture_count: u8,
    /// `true`: the material depends on the directions of the texture coordinates.
    pub(crate) needs_tangents: bool,
    /// `true`: rays may pass it as if it were absent.
    pub(crate) has_opacity: bool,
    /// `true`: the material is only a boundary of media, without a surface.
    pub(crate) is_null: bool,
    /// `true`: light that crosses it straight is not deflected and counts no bounce.
    pub(crate) is_pane: bool,
    /// `true`: the material separates two media, so transmitted light changes the medium.
    pub(crate) parts_media: bool,
    /// `true`: the material emits light, other than as an unlit surface.
    pub(crate) shines: bool,
    /// Directions into which the material emits.
    pub(crate) profile: Profile,
    /// `true`: light may be transmitted to the other side.
    pub(crate) transmits: bool,
    /// `true`: light is scattered below the surface.
    pub(crate) has_subsurface: bool,
    /// BSDFs seen from the back and from the front, if they are the same everywhere on the surface, and refer to no tables.
    pub(crate) bsdfs: Option<[Bsdf<'static>; 2]>,
    /// Media before the front and behind it, if the material separates media.
    pub(crate) media: [Option<MediumId>; 2],
    /// Absorption before the front and behind it, per unit of distance; 0 for opaque materials.
    pub(crate) absorption: [Spectrum; 2],
}

/// Precomputes the data of an instance with this transformation.
pub(crate) fn prepare_instance(world_from_object: &Affine3A) -> PreparedInstance {
    let linear = Mat3::from(world_from_object.matrix3);
    // det M · M⁻ᵀ without a division, accurate for nearly singular matrices, too
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
    let is_textured = texture_count > 0 || material.has_hair();
    let is_null = material.surface == Surface::Null;
    let side = |front| scattering(scene, material, &SurfacePoint::plain(front)).without_tables();
    let absorption = |medium: Option<MediumId>| {
        medium.filter(|_| transmits).map_or(Spectrum::ZERO, |medium| scene.media[medium.0 as usize].absorption)
    };
    PreparedMaterial {
        bsdfs: if is_textured || material.is_blended() { None } else { side(false).zip(side(true)).map(Into::into) },
        transmits,
        has_subsurface: material.has_subsurface(),
        media: if parts_media { [material.exterior, material.interior] } else { [None; 2] },
        parts_media,
        is_pane: material.is_seen_through(),
        is_textured,
        texture_count,
        is_null,
        needs_tangents: material.needs_tangents(),
        has_opacity: is_null || material.alpha_mode != AlphaMode::Opaque,
        shines: material.emission.factor.max_element() > 0.0,
        profile: Profile::new(&material.emission_profile),
        absorption: [material.exterior, material.interior].map(absorption),
    }
}

/// Iterates over the visibilities of instances and spheres.
pub(crate) fn visibilities(scene: &Scene) -> impl Iterator<Item = Visibility> {
    let instances = scene.instances.iter().map(|instance| instance.visibility);
    instances.chain(scene.spheres.iter().map(|sphere| sphere.visibility))
}

/// Iterates over the materials of instances and spheres, by index; may repeat.
pub(crate) fn used_materials(scene: &Scene) -> impl Iterator<Item = usize> {
    let meshes = scene.instances.iter().map(|instance| scene.material_of(instance) as usize);
    meshes.chain(scene.spheres.iter().map(|sphere| sphere.material as usize))
}
