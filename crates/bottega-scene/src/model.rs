//! The scene and its shapes.

use std::collections::BTreeMap;

use glam::{Affine3A, DVec3, Quat, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use crate::{Camera, Environment, FacingCurves, Grid, Image, Light, Mapping, Material, Medium, MediumId, Variation};

/// Triangles that share a material. Per-vertex arrays have the length of `positions`, or are empty where absent.
/// Importers leave out texture coordinates and tangents that no texture of the material asks for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The name in the file; may be empty.
    pub name: String,
    /// Object space.
    pub positions: Vec<Vec3>,
    /// Unit length, object space. Empty: flat shading.
    pub normals: Vec<Vec3>,
    /// xyz the tangent, w = ±1 the sign of the bitangent (glTF). Empty: derived from `uvs`.
    pub tangents: Vec<Vec4>,
    /// Texture coordinates of up to two sets.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA, multiplies the base colour.
    pub colors: Vec<Vec4>,
    /// Vertex indices, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Curves, of which the triangles are but the hull.
    pub curves: Option<Box<FacingCurves>>,
}

/// A mesh placed in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Object space to world space; never singular, and never mirroring: its determinant is above 0, so that
    /// counter-clockwise stays counter-clockwise. (A mirrored mesh is a mesh of its own: [`Mesh::mirrored`].)
    pub world_from_object: Affine3A,
}

/// An analytic sphere in world space.
#[derive(Clone, Debug, PartialEq)]
pub struct Sphere {
    /// Centre, world space.
    pub center: Vec3,
    /// Radius, above 0.
    pub radius: f32,
    /// Turns its texture coordinates: object space, where +y is the pole, to world space.
    pub world_from_object: Quat,
    /// Index into [`Scene::materials`].
    pub material: u32,
}

/// Everything that is needed to paint a picture but the settings.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Shapes that instances place.
    pub meshes: Vec<Mesh>,
    /// Placed meshes.
    pub instances: Vec<Instance>,
    /// Analytic spheres.
    pub spheres: Vec<Sphere>,
    /// Never empty when a mesh or sphere exists.
    pub materials: Vec<Material>,
    /// What fills space here and there.
    pub media: Vec<Medium>,
    /// Pictures that textures and the environment refer to.
    pub images: Vec<Image>,
    /// Texture coordinates by a place in the world, which textures refer to.
    pub mappings: Vec<Mapping>,
    /// Lights without extent.
    pub lights: Vec<Light>,
    /// What is seen where there is no surface; `None`: black.
    pub environment: Option<Environment>,
    /// At least one after import: a framing camera is made where the file has none.
    pub cameras: Vec<Camera>,
    /// Where the origin of the scene lies in the world of its file: 0, but for scenes far away from theirs, which are computed
    /// around their camera.
    pub origin: DVec3,
    /// BLAKE3 of all the bytes that were read and of what was chosen among them, hexadecimal.
    pub digest: String,
}

/// The greatest coordinate of a position, in either direction. Squares of distances then still fit into an `f32`.
pub const COORDINATE_MAX: f32 = 1e18;

/// Whether a mesh with these bounds can be placed so: the transformation can be inverted and leaves all in reach.
pub(crate) fn is_placeable(bounds: (Vec3, Vec3), world_from_object: &Affine3A) -> bool {
    let determinant = world_from_object.matrix3.determinant();
    let (min, max) = transformed_bounds(bounds, world_from_object);
    determinant.is_normal()
        && determinant > 0.0
        && world_from_object.inverse().is_finite()
        && min.min_element() >= -COORDINATE_MAX
        && max.max_element() <= COORDINATE_MAX
}

/// Boxes of meshes, each looked for once: instances may be many, and their meshes large.
#[derive(Debug, Default)]
pub(crate) struct MeshBounds(BTreeMap<u32, (Vec3, Vec3)>);

impl MeshBounds {
    /// Whether a mesh of the scene can be placed so; see [`is_placeable`].
    pub(crate) fn is_placeable(&mut self, scene: &Scene, mesh: u32, world_from_object: &Affine3A) -> bool {
        let bounds = *self.0.entry(mesh).or_insert_with(|| scene.meshes[mesh as usize].bounds());
        is_placeable(bounds, world_from_object)
    }
}

/// The corners of a box.
pub(crate) fn corners((min, max): (Vec3, Vec3)) -> impl Iterator<Item = Vec3> {
    (0..8u32).map(move |index| Vec3::select(glam::BVec3::new(index & 1 == 0, index & 2 == 0, index & 4 == 0), min, max))
}

/// The bounds of a transformed box.
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
    /// The same triangles, each of its own colour; `None`: there are not as many colours.
    pub(crate) fn with_triangle_colors(&self, colors: &[Vec4]) -> Option<Self> {
        let colors_by_vertex = || colors.iter().flat_map(|&color| [color; 3]).collect();
        (colors.len() == self.triangles.len()).then(|| Self { colors: colors_by_vertex(), ..self.unshared() })
    }

    /// The same triangles without shared vertices.
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
        }
    }

    /// Least and greatest coordinates of the positions, object space. Infinite and inverted without positions.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let pieces = self.positions.par_chunks(1 << 16).map(|piece| piece.iter().copied().fold(EMPTY, grow));
        let pieces: Vec<(Vec3, Vec3)> = pieces.collect();
        pieces.into_iter().fold(EMPTY, |whole, (min, max)| grow(grow(whole, min), max))
    }

    /// Bytes that its vertices and triangles take.
    pub fn memory_bytes(&self) -> usize {
        bytes_of(&self.positions)
            + bytes_of(&self.normals)
            + bytes_of(&self.tangents)
            + self.uvs.iter().map(|uvs| bytes_of(uvs)).sum::<usize>()
            + bytes_of(&self.colors)
            + bytes_of(&self.triangles)
            + self.curves.as_ref().map_or(0, |curves| curves.memory_bytes())
    }

    /// The mesh mirrored in the plane x = 0, front sides still outside.
    pub fn mirrored(mut self) -> Self {
        self.positions.iter_mut().for_each(|p| p.x = -p.x);
        self.normals.iter_mut().for_each(|n| n.x = -n.x);
        // The bitangent is cross(n, t)·w, and mirroring turns the sign of the cross product.
        self.tangents.iter_mut().for_each(|t| (t.x, t.w) = (-t.x, -t.w));
        self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        if let Some(curves) = &mut self.curves {
            let mirror = Vec3::new(-1.0, 1.0, 1.0);
            curves.map(|p| p * mirror, |t| t * mirror);
        }
        self
    }

    /// The vector product of two edges of a triangle: its normal, with twice its area as length.
    pub(crate) fn cross(&self, triangle: [u32; 3]) -> Vec3 {
        let [a, b, c] = triangle.map(|vertex| self.positions[vertex as usize]);
        (b - a).cross(c - a)
    }
}

impl Scene {
    /// Adds a material.
    pub fn push_material(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        self.materials.len() as u32 - 1
    }

    /// Adds a medium.
    pub fn push_medium(&mut self, medium: Medium) -> MediumId {
        self.media.push(medium);
        MediumId(self.media.len() as u32 - 1)
    }

    /// Adds a mesh without showing it; see [`push_instance`](Self::push_instance).
    pub fn push_mesh(&mut self, mesh: Mesh) -> u32 {
        self.meshes.push(mesh);
        self.meshes.len() as u32 - 1
    }

    /// Shows a mesh. A transformation that mirrors is given a mirrored copy of the mesh.
    /// Panics when there is no such mesh.
    pub fn push_instance(&mut self, mesh: u32, world_from_object: Affine3A) {
        let mirrors = world_from_object.matrix3.determinant() < 0.0;
        let instance = if mirrors {
            let mirrored = self.meshes[mesh as usize].clone().mirrored();
            let world_from_object = world_from_object * Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
            Instance { mesh: self.push_mesh(mirrored), world_from_object }
        } else {
            Instance { mesh, world_from_object }
        };
        self.instances.push(instance);
    }

    /// Adds a mesh whose object space is world space, and shows it.
    pub fn push_surface(&mut self, mesh: Mesh) {
        let mesh = self.push_mesh(mesh);
        self.push_instance(mesh, Affine3A::IDENTITY);
    }

    /// Adds an analytic sphere.
    pub fn push_sphere(&mut self, center: Vec3, radius: f32, material: u32) {
        self.spheres.push(Sphere { center, radius, world_from_object: Quat::IDENTITY, material });
    }

    /// Takes all media away. Returns whether there were any.
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

    /// Least and greatest coordinates of all surfaces, world space; both 0 where there are none. The box of an instance
    /// is that of its mesh's turned box, so it may be larger than needed.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let bounds: Vec<(Vec3, Vec3)> = self.meshes.par_iter().map(Mesh::bounds).collect();
        let instances =
            self.instances.iter().filter(|instance| !self.meshes[instance.mesh as usize].positions.is_empty());
        let boxes = instances
            .map(|instance| transformed_bounds(bounds[instance.mesh as usize], &instance.world_from_object))
            .chain(self.spheres.iter().map(|sphere| (sphere.center - sphere.radius, sphere.center + sphere.radius)));
        let (min, max) = boxes.fold(EMPTY, |whole, (min, max)| grow(grow(whole, min), max));
        if min.cmple(max).all() { (min, max) } else { (Vec3::ZERO, Vec3::ZERO) }
    }

    /// Triangles of all instances.
    pub fn triangle_count(&self) -> u64 {
        self.instances.iter().map(|instance| self.meshes[instance.mesh as usize].triangles.len() as u64).sum()
    }

    /// Bytes that meshes, instances, spheres and pictures take.
    pub fn memory_bytes(&self) -> usize {
        let grids = self.media.iter().filter_map(|medium| medium.variation.as_deref()).flat_map(Variation::grids);
        self.meshes.iter().map(Mesh::memory_bytes).sum::<usize>()
            + self.images.iter().map(Image::memory_bytes).sum::<usize>()
            + grids.map(Grid::memory_bytes).sum::<usize>()
            + bytes_of(&self.instances)
            + bytes_of(&self.spheres)
    }

    /// Whether anything shines: an emissive surface, a light, or an environment.
    pub fn has_light(&self) -> bool {
        let emits = |material: u32| self.materials[material as usize].is_emissive();
        self.environment.as_ref().is_some_and(|environment| environment.factor.max_element() > 0.0)
            || !self.lights.is_empty()
            || self.instances.iter().any(|instance| emits(self.meshes[instance.mesh as usize].material))
            || self.spheres.iter().any(|sphere| emits(sphere.material))
    }
}
