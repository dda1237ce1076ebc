//! The scene and its shapes.

use glam::{Affine3A, Vec2, Vec3, Vec4};

use crate::{Camera, Environment, Image, Light, Material};

/// Triangles that share a material. Per-vertex arrays have the length of `positions`, or are empty where absent.
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
}

/// A mesh placed in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Object space to world space; never singular.
    pub world_from_object: Affine3A,
}

/// An analytic sphere in world space.
#[derive(Clone, Debug, PartialEq)]
pub struct Sphere {
    /// Centre, world space.
    pub center: Vec3,
    /// Radius, above 0.
    pub radius: f32,
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
    /// Pictures that textures and the environment refer to.
    pub images: Vec<Image>,
    /// Lights without extent.
    pub lights: Vec<Light>,
    /// What is seen where there is no surface; `None`: black.
    pub environment: Option<Environment>,
    /// At least one after import: a framing camera is made where the file has none.
    pub cameras: Vec<Camera>,
    /// BLAKE3 of all the bytes that were read, hexadecimal.
    pub digest: String,
}
