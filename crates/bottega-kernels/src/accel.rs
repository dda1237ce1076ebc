//! Geometry in, hits out.

use crate::build::{self, Built};
#[cfg(target_arch = "x86_64")]
use crate::traverse::avx2::{self, Avx2};
use crate::traverse::portable::Portable;
use crate::traverse::{self, Any, Closest, Counted, Filtered, Query};
use crate::tree::Tree;
use crate::{Aabb, Hit, Ray};
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

/// How exact the tests along a ray are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// Watertight: no ray slips between two triangles that share an edge or a vertex.
    #[default]
    Robust,
    /// Somewhat faster; about one ray in ten that is aimed exactly at an edge passes through.
    Fast,
}

/// How an [`Accel`] is built.
#[derive(Clone, Debug, Default)]
pub struct BuildOptions {
    /// Threads to build with; 0 for as many as the machine has. The result does not depend on it.
    pub threads: usize,
    /// How exact the tests along a ray are.
    pub precision: Precision,
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

/// The vector unit to use, found once when a structure is built.
#[derive(Clone, Copy, Debug)]
enum Isa {
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    Portable,
}

impl Isa {
    fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = Avx2::detect() {
            return Self::Avx2(avx2);
        }
        Self::Portable
    }
}

/// The acceleration structure over a scene: an 8-wide bounding volume hierarchy.
///
/// Meshes with one instance lie in one tree in world space; a mesh with several has a tree of its own, under the
/// instances. Some 65 to 80 bytes a triangle; the meshes given to [`Accel::build`] are not kept.
#[derive(Debug)]
pub struct Accel {
    tree: Tree,
    bounds: Aabb,
    triangles: usize,
    precision: Precision,
    isa: Isa,
}

impl Accel {
    /// Builds the structure over all instances and spheres. Triangles without area and spheres of radius 0 are never
    /// hit; an empty scene is fine.
    pub fn build(
        meshes: &[MeshGeometry<'_>],
        instances: &[InstanceGeometry],
        spheres: &[SphereGeometry],
        options: &BuildOptions,
    ) -> Result<Self, BuildError> {
        let Built { tree, bounds, triangles } = build::build(meshes, instances, spheres, options)?;
        Ok(Self { tree, bounds, triangles, precision: options.precision, isa: Isa::detect() })
    }

    /// The closest hit. Of two at the same distance, that with the lower instance, then the lower primitive.
    pub fn intersect(&self, ray: &Ray) -> Hit {
        self.query(ray, &mut Closest)
    }

    /// Whether anything is hit.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.query(ray, &mut Any).is_some()
    }

    /// The closest hit that `accept` lets pass (an alpha test). It is asked for candidates in no particular order, perhaps
    /// for some that are not the closest, and must be a pure function of the candidate.
    pub fn intersect_filtered(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> Hit {
        self.query(ray, &mut Filtered::<_, false>(accept))
    }

    /// Whether there is a hit that `accept` lets pass: see [`Accel::intersect_filtered`].
    pub fn occluded_filtered(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> bool {
        self.query(ray, &mut Filtered::<_, true>(accept)).is_some()
    }

    /// The closest hit; adds the number of nodes and leaves visited to `steps`.
    pub fn intersect_counted(&self, ray: &Ray, steps: &mut u32) -> Hit {
        self.query(ray, &mut Counted(steps))
    }

    /// The closest hit of every ray. Panics when the lengths differ.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Hit]) {
        assert_eq!(rays.len(), hits.len(), "a hit for every ray");
        for (hit, ray) in hits.iter_mut().zip(rays) {
            *hit = self.intersect(ray);
        }
    }

    /// Whether each ray hits anything. Panics when the lengths differ.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "an answer for every ray");
        for (hit, ray) in occluded.iter_mut().zip(rays) {
            *hit = self.occluded(ray);
        }
    }

    /// The box around everything that can be hit; empty for an empty scene.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        size_of::<Self>() + self.tree.memory_bytes()
    }

    /// Triangles, counted once for every instance.
    pub fn triangle_count(&self) -> usize {
        self.triangles
    }

    #[inline(always)]
    fn query<Q: Query>(&self, ray: &Ray, query: &mut Q) -> Hit {
        match (self.isa, self.precision) {
            #[cfg(target_arch = "x86_64")]
            (Isa::Avx2(unit), Precision::Robust) => avx2::run::<Q, true>(unit, &self.tree, ray, query),
            #[cfg(target_arch = "x86_64")]
            (Isa::Avx2(unit), Precision::Fast) => avx2::run::<Q, false>(unit, &self.tree, ray, query),
            (Isa::Portable, Precision::Robust) => traverse::run::<_, Q, true>(Portable, &self.tree, ray, query),
            (Isa::Portable, Precision::Fast) => traverse::run::<_, Q, false>(Portable, &self.tree, ray, query),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_through_a_triangle_tells_where() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let mesh = MeshGeometry { positions: &positions, triangles: &[[0, 1, 2]] };
        let instance = InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY };
        let sphere = SphereGeometry { center: Vec3::Z * 3.0, radius: 1.0 };
        let accel = Accel::build(&[mesh], &[instance], &[sphere], &BuildOptions::default()).unwrap();
        let hit = accel.intersect(&Ray::new(Vec3::new(0.25, 0.5, -1.0), Vec3::Z * 2.0));
        assert_eq!(hit, Hit { t: 0.5, u: 0.25, v: 0.5, instance: 0, primitive: 0 });
        let hit = accel.intersect(&Ray::new(Vec3::new(0.0, 0.0, 1.0), Vec3::Z));
        assert_eq!((hit.t, hit.sphere()), (1.0, Some(0)));
        assert!(accel.intersect(&Ray::new(Vec3::new(9.0, 0.0, 1.0), Vec3::Z)).is_none());
    }
}
