//! The geometry that an [`Accel`](crate::Accel) is built over, and how it is built.

use glam::{Affine3A, Vec3};

/// A triangle mesh in its own space.
#[derive(Clone, Copy, Debug)]
pub struct MeshGeometry<'a> {
    /// Vertices.
    pub positions: &'a [Vec3],
    /// Three indices into `positions` a triangle.
    pub triangles: &'a [[u32; 3]],
}

/// A sphere in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereGeometry {
    /// Middle.
    pub center: Vec3,
    /// Radius; 0 is allowed and never hit.
    pub radius: f32,
}

/// A mesh placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceGeometry {
    /// Index of the mesh.
    pub mesh: u32,
    /// Where it stands.
    pub world_from_object: Affine3A,
}

/// The precision of the tests along a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// Watertight: no ray slips between two triangles that share an edge or a vertex.
    #[default]
    Robust,
    /// Somewhat faster; about one ray in ten that is aimed exactly at an edge passes through.
    Fast,
}

/// The options of building an [`Accel`](crate::Accel).
#[derive(Clone, Debug)]
pub struct BuildOptions {
    /// Threads to build with; 0 for as many as the machine has. The result does not depend on it.
    pub threads: usize,
    /// How exact the tests along a ray are.
    pub precision: Precision,
    /// A mesh with several instances is copied into the world, as one with a single instance is, when all copies together
    /// have no more triangles than this: the detour through a tree of its own costs a ray more than this costs memory.
    pub flatten_triangles: usize,
    /// Whether to improve the tree after it is built: rays are up to 20 % faster in scenes of many separate objects, the build
    /// takes up to twice as long.
    pub optimize: bool,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { threads: 0, precision: Precision::Robust, flatten_triangles: 4096, optimize: true }
    }
}

/// Geometry that cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// An index beyond the vertices.
    #[error("mesh {mesh}: triangle {triangle} refers to vertex {vertex} of {vertices}")]
    IndexOutOfRange {
        /// Index of the mesh.
        mesh: usize,
        /// Index of the triangle.
        triangle: usize,
        /// The index found.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// NaN or an infinity among the positions.
    #[error("mesh {mesh}: vertex {vertex} is not finite")]
    PositionNotFinite {
        /// Index of the mesh.
        mesh: usize,
        /// Index of the vertex.
        vertex: usize,
    },
    /// An instance of a mesh that is not there.
    #[error("instance {instance} refers to mesh {mesh} of {meshes}")]
    NoSuchMesh {
        /// Index of the instance.
        instance: usize,
        /// The mesh asked for.
        mesh: u32,
        /// How many there are.
        meshes: usize,
    },
    /// NaN or an infinity in a transform, or a transform that moves a vertex beyond the range of `f32`.
    #[error("instance {instance}: its transform is not finite, or leads beyond the range of numbers")]
    TransformNotFinite {
        /// Index of the instance.
        instance: usize,
    },
    /// A sphere with NaN, an infinity or a negative radius.
    #[error("sphere {sphere}: center or radius is not finite, or the radius is negative")]
    BadSphere {
        /// Index of the sphere.
        sphere: usize,
    },
    /// A refit with other geometry than the structure was built over, or with an instance flattened to nothing.
    #[error("meshes, instances or spheres are others than those built: build again instead of refitting")]
    Changed,
    /// More than the indices can number.
    #[error("{count} {what} are more than the limit of {limit}")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
}
