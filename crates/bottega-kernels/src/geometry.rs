//! Input and options of an [`Accel`](crate::Accel).

use glam::{Affine3A, Vec3};

/// A triangle mesh in its own space.
#[derive(Clone, Copy, Debug)]
pub struct MeshGeometry<'a> {
    /// Vertex positions, in object space.
    pub positions: &'a [Vec3],
    /// Three indices into `positions` per triangle.
    pub triangles: &'a [[u32; 3]],
}

/// A sphere in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereGeometry {
    /// Center, in world space.
    pub center: Vec3,
    /// Radius, in world units; a sphere of radius 0 is allowed and never hit.
    pub radius: f32,
}

/// A mesh placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceGeometry {
    /// Index of the mesh.
    pub mesh: u32,
    /// Object space to world space.
    pub world_from_object: Affine3A,
}

/// The precision of the ray tests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// Watertight: no ray passes between two triangles that share an edge or a vertex.
    #[default]
    Robust,
    /// Slightly faster; about one in ten rays aimed exactly at an edge passes through.
    Fast,
}

/// Options of building an [`Accel`](crate::Accel).
#[derive(Clone, Debug)]
pub struct BuildOptions {
    /// Number of threads; 0: all. The result does not depend on it.
    pub threads: usize,
    /// Precision of the ray tests.
    pub precision: Precision,
    /// A mesh with several instances is copied into world space, like one with a single instance, if all copies
    /// together have at most this many triangles: for small meshes the detour through a tree of their own costs more
    /// time than the copies cost memory.
    pub flatten_triangles: usize,
    /// `true`: improve the tree after the build. Rays are up to 20 % faster in scenes of many separate objects, and the
    /// build takes up to twice as long.
    pub optimize: bool,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { threads: 0, precision: Precision::Robust, flatten_triangles: 4096, optimize: true }
    }
}

/// An error about geometry that cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// A vertex index is out of range.
    #[error("mesh {mesh}: triangle {triangle} refers to vertex {vertex} of {vertices}")]
    IndexOutOfRange {
        /// Index of the mesh.
        mesh: usize,
        /// Index of the triangle.
        triangle: usize,
        /// The vertex index.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A position is NaN or infinite.
    #[error("mesh {mesh}: vertex {vertex} is not finite")]
    PositionNotFinite {
        /// Index of the mesh.
        mesh: usize,
        /// Index of the vertex.
        vertex: usize,
    },
    /// An instance refers to a mesh that does not exist.
    #[error("instance {instance} refers to mesh {mesh} of {meshes}")]
    NoSuchMesh {
        /// Index of the instance.
        instance: usize,
        /// Index of the missing mesh.
        mesh: u32,
        /// Number of meshes.
        meshes: usize,
    },
    /// A transform is NaN or infinite, or moves a vertex beyond the range of `f32`.
    #[error("instance {instance}: its transform is not finite, or leads beyond the range of numbers")]
    TransformNotFinite {
        /// Index of the instance.
        instance: usize,
    },
    /// A sphere is NaN or infinite, or has a negative radius.
    #[error("sphere {sphere}: center or radius is not finite, or the radius is negative")]
    BadSphere {
        /// Index of the sphere.
        sphere: usize,
    },
    /// A moving part has invalid keys.
    #[error("{what} {index} moves, but {problem}")]
    BadMotion {
        /// Kind of part, such as "mesh".
        what: &'static str,
        /// Its index.
        index: usize,
        /// Reason for the refusal, as a clause.
        problem: &'static str,
    },
    /// A refit has other counts or triangles than the build or flattens an instance, or the structure has moving parts.
    #[error("meshes, instances or spheres differ from those of the build: build again instead of refitting")]
    Changed,
    /// There are more elements than indices can number.
    #[error("{count} {what} are more than the limit of {limit}")]
    TooMany {
        /// Kind of element, such as "triangles".
        what: &'static str,
        /// Number of elements.
        count: usize,
        /// Maximal number of elements.
        limit: usize,
    },
}
