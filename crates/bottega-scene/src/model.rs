//! The scene and its shapes.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Affine3A, DVec3, Quat, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::facing_curves::FacingCurves;
use crate::grid::Grid;
use crate::image::Image;
use crate::light::{Environment, Light};
use crate::material::Material;
use crate::medium::{Medium, MediumId, Variation};
use crate::motion::{MeshKey, Shutter, SphereKey, TransformKey};
use crate::shared_list::SharedList;
use crate::texture::Mapping;
use crate::visibility::Visibility;

/// Triangles that share a material. Per-vertex arrays have the length of `positions`, or are empty if absent. Importers
/// drop texture coordinates and tangents that no texture of the material uses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The name in the file; may be empty.
    pub name: String,
    /// Vertex positions, object space.
    pub positions: Vec<Vec3>,
    /// Vertex normals of unit length, object space. Empty: flat shading.
    pub normals: Vec<Vec3>,
    /// Vertex tangents: xyz is the tangent, w = ±1 the sign of the bitangent (glTF). Empty: derived from `uvs`.
    pub tangents: Vec<Vec4>,
    /// Texture coordinates: up to two sets.
    pub uvs: [Vec<Vec2>; 2],
    /// Vertex colours, linear RGBA; RGB multiplies the base colour of layered materials, alpha the opacity.
    pub colors: Vec<Vec4>,
    /// Vertex indices, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Curves, if the triangles are only the hull around them; `None`: the triangles are the surface.
    pub curves: Option<Box<FacingCurves>>,
    /// Keys of vertices that move; empty: they stand still. Tangents stay as they are.
    pub motion: Vec<MeshKey>,
}

/// A mesh placed in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Index into [`Scene::materials`] of a material in place of the mesh's own; `None`: that of the mesh.
    pub material: Option<u32>,
    /// Object space to world space. Never singular, and never mirroring: its determinant is above 0, so
    /// counter-clockwise triangles stay counter-clockwise. ([`Mesh::mirrored`] makes the mesh for a mirrored instance.)
    pub world_from_object: Affine3A,
    /// Kinds of ray for which the instance exists.
    pub visibility: Visibility,
    /// Keys of [`Self::world_from_object`], if the instance moves. No key is singular or mirrors.
    pub motion: Vec<TransformKey>,
}

impl Instance {
    /// Returns an instance with the material of its mesh, which stands still and exists for every kind of ray.
    pub fn new(mesh: u32, world_from_object: Affine3A) -> Self {
        Self { mesh, material: None, world_from_object, visibility: Visibility::ALL, motion: Vec::new() }
    }
}

/// An analytic sphere in world space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sphere {
    /// Centre, world space.
    #[serde(with = "crate::numbers")]
    pub center: Vec3,
    /// Radius, above 0, in scene units.
    pub radius: f32,
    /// Rotation of the sphere's texture coordinates: object space, where +y is the pole, to world space.
    #[serde(with = "crate::numbers")]
    pub world_from_object: Quat,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Kinds of ray for which the sphere exists.
    #[serde(default)]
    pub visibility: Visibility,
    /// Keys of centre, radius and rotation, if the sphere moves. Between them all change linearly.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub motion: Vec<SphereKey>,
}

/// A complete scene: everything that a picture shows, and its cameras, without the settings of a render.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Meshes, in object space; instances place them.
    pub meshes: SharedList<Mesh>,
    /// Meshes as placed in the world.
    pub instances: Vec<Instance>,
    /// Spheres that are not triangulated, in world space.
    pub spheres: Vec<Sphere>,
    /// Materials. Not empty if the scene has a mesh or sphere.
    pub materials: Vec<Material>,
    /// Participating media, referred to by materials and cameras.
    pub media: Vec<Medium>,
    /// Pictures that textures and the environment refer to.
    pub images: SharedList<Image>,
    /// Texture coordinates by world position, referred to by [`TextureMap::uv_set`](crate::TextureMap::uv_set).
    pub mappings: Vec<Mapping>,
    /// Lights without extent. Emissive surfaces are not among them.
    pub lights: Vec<Light>,
    /// Radiance along rays that leave the scene; `None`: black.
    pub environment: Option<Environment>,
    /// Cameras, at least one after import: a scene file without a camera gets one that frames the scene.
    pub cameras: Vec<Camera>,
    /// The span of time that pictures show. Motion outside of it is not seen.
    pub shutter: Shutter,
    /// Origin of the scene in the world space of its file. 0, except for scenes far from their origin, which are moved
    /// so that their camera is near 0.
    pub origin: DVec3,
    /// BLAKE3 of all bytes read and of the options chosen, hexadecimal.
    pub digest: String,
}

/// The greatest absolute coordinate of a position. Squares of distances still fit into an `f32`.
pub const COORDINATE_MAX: f32 = 1e18;

/// Returns true if a mesh with these bounds can be placed with this transformation: it is invertible, does not mirror,
/// and keeps all coordinates within [`COORDINATE_MAX`].
pub(crate) fn is_placeable(bounds: (Vec3, Vec3), world_from_object: &Affine3A) -> bool {
    let determinant = world_from_object.matrix3.determinant();
    let (min, max) = transformed_bounds(bounds, world_from_object);
    determinant.is_normal()
        && determinant > 0.0
        && world_from_object.inverse().is_finite()
        && min.min_element() >= -COORDINATE_MAX
        && max.max_element() <= COORDINATE_MAX
}

/// A cache of mesh bounds, each computed once: there may be many instances of a large mesh.
#[derive(Debug, Default)]
pub(crate) struct MeshBounds(BTreeMap<u32, (Vec3, Vec3)>);

impl MeshBounds {
    /// Returns true if a mesh of the scene can be placed with this transformation; see [`is_placeable`].
    pub(crate) fn is_placeable(&mut self, scene: &Scene, mesh: u32, world_from_object: &Affine3A) -> bool {
        let bounds = *self.0.entry(mesh).or_insert_with(|| scene.meshes[mesh as usize].bounds());
        is_placeable(bounds, world_from_object)
    }
}

/// Iterates over the eight corners of a box.
pub(crate) fn corners((min, max): (Vec3, Vec3)) -> impl Iterator<Item = Vec3> {
    (0..8u32).map(move |index| Vec3::select(glam::BVec3::new(index & 1 == 0, index & 2 == 0, index & 4 == 0), min, max))
}

/// Returns the bounds of a transformed box.
fn transformed_bounds(bounds: (Vec3, Vec3), world_from_object: &Affine3A) -> (Vec3, Vec3) {
    corners(bounds).map(|corner| world_from_object.transform_point3(corner)).fold(EMPTY, grow)
}

const EMPTY: (Vec3, Vec3) = (Vec3::INFINITY, Vec3::NEG_INFINITY);

fn grow((min, max): (Vec3, Vec3), point: Vec3) -> (Vec3, Vec3) {
    (min.min(point), max.max(point))
}

fn bytes_of<T>(list: &[T]) -> usize {
    size_of_val(list)
}

impl Mesh {
    /// Returns the same triangles, each with its own colour; `None` if the number of colours differs from that of
    /// triangles.
    pub(crate) fn with_triangle_colors(&self, colors: &[Vec4]) -> Option<Self> {
        let colors_by_vertex = || colors.iter().flat_map(|&color| [color; 3]).collect();
        (colors.len() == self.triangles.len()).then(|| Self { colors: colors_by_vertex(), ..self.unshared() })
    }

    /// Returns the same triangles without shared vertices.
    pub(crate) fn unshared(&self) -> Self {
        fn spread<T: Copy>(values: &[T], triangles: &[[u32; 3]]) -> Vec<T> {
            if values.is_empty() {
                return Vec::new();
            }
            triangles.iter().flatten().map(|&vertex| values[vertex as usize]).collect()
        }
        let triangles = &self.triangles;
        Self {
            name: self.name.clone(),
            positions: spread(&self.positions, triangles),
            normals: spread(&self.normals, triangles),
            tangents: spread(&self.tangents, triangles),
            uvs: [spread(&self.uvs[0], triangles), spread(&self.uvs[1], triangles)],
            colors: spread(&self.colors, triangles),
            triangles: (0..triangles.len() as u32).map(|index| [3 * index, 3 * index + 1, 3 * index + 2]).collect(),
            material: self.material,
            curves: self.curves.clone(),
            motion: (self.motion.iter())
                .map(|key| MeshKey {
                    time: key.time,
                    positions: spread(&key.positions, triangles),
                    normals: spread(&key.normals, triangles),
                })
                .collect(),
        }
    }

    /// Returns the least and greatest coordinates of the positions, at all keys, object space. Infinite and inverted if there are
    /// none.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let pieces = self.positions.par_chunks(1 << 16).map(|piece| piece.iter().copied().fold(EMPTY, grow));
        let pieces: Vec<(Vec3, Vec3)> = pieces.collect();
        let moved = self.motion.iter().flat_map(|key| &key.positions).map(|&p| (p, p));
        pieces.into_iter().chain(moved).fold(EMPTY, |whole, (min, max)| grow(grow(whole, min), max))
    }

    /// Returns the memory of the mesh's vertices, triangles, curves and keys, in bytes.
    pub fn memory_bytes(&self) -> usize {
        bytes_of(&self.positions)
            + bytes_of(&self.normals)
            + bytes_of(&self.tangents)
            + self.uvs.iter().map(|uvs| bytes_of(uvs)).sum::<usize>()
            + bytes_of(&self.colors)
            + bytes_of(&self.triangles)
            + self.curves.as_ref().map_or(0, |curves| curves.memory_bytes())
            + self.motion.iter().map(|key| bytes_of(&key.positions) + bytes_of(&key.normals)).sum::<usize>()
    }

    /// Returns the mesh mirrored in the plane x = 0 of object space; front sides stay outside.
    pub fn mirrored(mut self) -> Self {
        self.positions.iter_mut().for_each(|p| p.x = -p.x);
        self.normals.iter_mut().for_each(|n| n.x = -n.x);
        for key in &mut self.motion {
            key.positions.iter_mut().chain(&mut key.normals).for_each(|v| v.x = -v.x);
        }
        // The bitangent is cross(n, t)·w; mirroring flips the sign of the cross product.
        self.tangents.iter_mut().for_each(|t| (t.x, t.w) = (-t.x, -t.w));
        self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        if let Some(curves) = &mut self.curves {
            let mirror = Vec3::new(-1.0, 1.0, 1.0);
            curves.map(|p| p * mirror, |t| t * mirror);
        }
        self
    }

    /// Returns the cross product of two edges of a triangle: its normal, with twice its area as length.
    pub(crate) fn cross(&self, triangle: [u32; 3]) -> Vec3 {
        let [a, b, c] = triangle.map(|vertex| self.positions[vertex as usize]);
        (b - a).cross(c - a)
    }
}

impl Scene {
    /// Adds a material. Returns its index into [`Self::materials`].
    pub fn push_material(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        self.materials.len() as u32 - 1
    }

    /// Adds a medium. Returns its index into [`Self::media`].
    pub fn push_medium(&mut self, medium: Medium) -> MediumId {
        self.media.push(medium);
        MediumId(self.media.len() as u32 - 1)
    }

    /// Adds a mesh without placing it; see [`push_instance`](Self::push_instance). Returns its index into
    /// [`Self::meshes`].
    pub fn push_mesh(&mut self, mesh: Mesh) -> u32 {
        self.meshes.push(mesh);
        self.meshes.len() as u32 - 1
    }

    /// Adds an instance of a mesh. For a mirroring transformation, adds a mirrored copy of the mesh, and places that.
    ///
    /// - `mesh`: index into [`Scene::meshes`].
    /// - `world_from_object`: object space to world space; must not be singular.
    ///
    /// # Panics
    ///
    /// If the transformation mirrors and there is no such mesh.
    pub fn push_instance(&mut self, mesh: u32, world_from_object: Affine3A) {
        let mirrors = world_from_object.matrix3.determinant() < 0.0;
        let instance = if mirrors {
            let mirrored = self.meshes[mesh as usize].clone().mirrored();
            let world_from_object = world_from_object * Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
            Instance::new(self.push_mesh(mirrored), world_from_object)
        } else {
            Instance::new(mesh, world_from_object)
        };
        self.instances.push(instance);
    }

    /// Adds a mesh whose object space is world space, and an instance of it.
    pub fn push_surface(&mut self, mesh: Mesh) {
        let mesh = self.push_mesh(mesh);
        self.push_instance(mesh, Affine3A::IDENTITY);
    }

    /// Adds an analytic sphere without rotation, which exists for every kind of ray.
    ///
    /// - `center`, `radius`: world space, in scene units.
    /// - `material`: index into [`Scene::materials`].
    pub fn push_sphere(&mut self, center: Vec3, radius: f32, material: u32) {
        let visibility = Visibility::ALL;
        let world_from_object = Quat::IDENTITY;
        self.spheres.push(Sphere { center, radius, world_from_object, material, visibility, motion: Vec::new() });
    }

    /// Removes all media. Returns true if there were any.
    pub(crate) fn leave_out_media(&mut self) -> bool {
        for material in &mut self.materials {
            (material.interior, material.exterior) = (None, None);
        }
        for camera in &mut self.cameras {
            camera.medium = None;
        }
        let had_media = !self.media.is_empty();
        self.media.clear();
        had_media
    }

    /// Returns the least and greatest coordinates of all surfaces, at all keys, world space; both 0 if there are none. The box of an
    /// instance encloses its mesh's transformed box, so it may be larger than needed.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let bounds: Vec<(Vec3, Vec3)> = self.meshes.shared().par_iter().map(|mesh| mesh.bounds()).collect();
        let instances =
            self.instances.iter().filter(|instance| !self.meshes[instance.mesh as usize].positions.is_empty());
        let boxes = instances
            .flat_map(|instance| {
                let keys = instance.motion.iter().map(|key| &key.transform);
                let poses = std::iter::once(&instance.world_from_object).chain(keys);
                poses.map(|pose| transformed_bounds(bounds[instance.mesh as usize], pose))
            })
            .chain(self.spheres.iter().flat_map(|sphere| {
                let keys = sphere.motion.iter().map(|key| (key.center, key.radius));
                let poses = std::iter::once((sphere.center, sphere.radius)).chain(keys);
                poses.map(|(center, radius)| (center - radius, center + radius))
            }));
        let (min, max) = boxes.fold(EMPTY, |whole, (min, max)| grow(grow(whole, min), max));
        if min.cmple(max).all() { (min, max) } else { (Vec3::ZERO, Vec3::ZERO) }
    }

    /// Returns the index of an instance's material: its own, or that of its mesh.
    ///
    /// # Panics
    ///
    /// If the instance has no material of its own, and there is no such mesh.
    #[inline(always)]
    pub fn material_of(&self, instance: &Instance) -> u32 {
        instance.material.unwrap_or_else(|| self.meshes[instance.mesh as usize].material)
    }

    /// Returns the number of triangles of all instances: a mesh counts once for each of its instances.
    ///
    /// # Panics
    ///
    /// If an instance places a mesh that does not exist.
    pub fn triangle_count(&self) -> u64 {
        self.instances.iter().map(|instance| self.meshes[instance.mesh as usize].triangles.len() as u64).sum()
    }

    /// Returns the memory of meshes, instances, spheres, pictures, grids and measured materials, in bytes.
    pub fn memory_bytes(&self) -> usize {
        let mut measured = Vec::new();
        self.materials.iter().for_each(|material| material.add_measured(&mut measured));
        measured.sort_by_key(|tables| Arc::as_ptr(tables));
        measured.dedup_by(|a, b| Arc::ptr_eq(a, b));
        let grids = self.media.iter().filter_map(|medium| medium.variation.as_deref()).flat_map(Variation::grids);
        self.meshes.iter().map(Mesh::memory_bytes).sum::<usize>()
            + self.images.iter().map(Image::memory_bytes).sum::<usize>()
            + grids.map(Grid::memory_bytes).sum::<usize>()
            + measured.iter().map(|tables| tables.memory_bytes()).sum::<usize>()
            + bytes_of(&self.instances)
            + bytes_of(&self.spheres)
    }

    /// Returns true if some part has keys; it moves only if the shutter is open long enough.
    pub fn has_motion(&self) -> bool {
        self.instances.iter().any(|it| !it.motion.is_empty())
            || self.spheres.iter().any(|it| !it.motion.is_empty())
            || self.meshes.iter().any(|it| !it.motion.is_empty())
            || self.lights.iter().any(|it| !it.motion.is_empty())
            || self.cameras.iter().any(|it| !it.motion.is_empty())
    }

    /// Returns true if the scene has a light, an environment that is not black, or an emissive surface that is placed.
    ///
    /// # Panics
    ///
    /// If an instance or a sphere refers to a mesh or material that does not exist.
    pub fn has_light(&self) -> bool {
        let emits = |material: u32| self.materials[material as usize].is_emissive();
        self.environment.as_ref().is_some_and(|environment| environment.factor.max_element() > 0.0)
            || !self.lights.is_empty()
            || self.instances.iter().any(|instance| emits(self.material_of(instance)))
            || self.spheres.iter().any(|sphere| emits(sphere.material))
    }
}
