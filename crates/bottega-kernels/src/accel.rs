//! The acceleration structure: geometry in, hits out.

use crate::build::{self, BuiltTree, refit};
#[cfg(target_arch = "x86_64")]
use crate::traverse::avx2::{self, Avx2};
use crate::traverse::portable::Portable;
use crate::traverse::{self, Any, Closest, CountedQuery, Filtered, Query};
use crate::tree::SceneTrees;
use crate::{Aabb, BuildError, BuildOptions, Hit, InstanceGeometry, MeshGeometry, Precision, Ray, SphereGeometry};

/// The vector unit to use, detected once when a structure is built.
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
/// Meshes with one instance share one tree in world space; a mesh with several has a tree of its own, below the
/// instances. Takes 65 to 80 bytes per triangle; the meshes given to [`Accel::build`] are not kept.
#[derive(Debug)]
pub struct Accel {
    tree: SceneTrees,
    bounds: Aabb,
    triangles: usize,
    /// Mesh and triangle count of each instance; see [`refit::topology`].
    topology: Box<[(u32, u32)]>,
    precision: Precision,
    isa: Isa,
}

impl Accel {
    /// Builds the structure over all instances and spheres. Triangles without area and spheres of radius 0 are never
    /// hit; an empty scene is valid.
    ///
    /// # Errors
    /// A coordinate is not finite, an index is out of range, or the scene is too large; see [`BuildError`].
    pub fn build(
        meshes: &[MeshGeometry<'_>],
        instances: &[InstanceGeometry],
        spheres: &[SphereGeometry],
        options: &BuildOptions,
    ) -> Result<Self, BuildError> {
        let BuiltTree { tree, bounds, triangles } = build::build(meshes, instances, spheres, options)?;
        let topology = refit::topology(meshes, instances);
        Ok(Self { tree, bounds, triangles, topology, precision: options.precision, isa: Isa::detect() })
    }

    /// Refits the structure to moved geometry: other positions, transforms and spheres, with the same counts and
    /// triangle indices. The farther things move from where they were at the build, the slower rays get. Triangles
    /// without area and spheres of radius 0 at the build stay unhittable.
    ///
    /// An error leaves the structure unchanged.
    pub fn refit(
        &mut self,
        meshes: &[MeshGeometry<'_>],
        instances: &[InstanceGeometry],
        spheres: &[SphereGeometry],
    ) -> Result<(), BuildError> {
        self.bounds = refit::refit(&mut self.tree, &self.topology, meshes, instances, spheres, self.precision)?;
        Ok(())
    }

    /// Returns the closest hit. At equal distance, the lower instance wins, then the lower primitive.
    pub fn intersect(&self, ray: &Ray) -> Hit {
        self.query(ray, &mut Closest)
    }

    /// Returns true if the ray hits anything.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.query(ray, &mut Any).is_some()
    }

    /// Returns the closest hit that `accept` lets pass (an alpha test). It is called for candidates in no particular
    /// order, possibly including some that are not the closest, and must be a pure function of the candidate.
    pub fn intersect_filtered(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> Hit {
        self.query(ray, &mut Filtered::<_, false>(accept))
    }

    /// Returns true if there is a hit that `accept` lets pass; see [`Accel::intersect_filtered`].
    pub fn occluded_filtered(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> bool {
        self.query(ray, &mut Filtered::<_, true>(accept)).is_some()
    }

    /// Returns the closest hit; adds the number of nodes and leaves visited to `steps`.
    pub fn intersect_counted(&self, ray: &Ray, steps: &mut u32) -> Hit {
        self.query(ray, &mut CountedQuery::<false>(steps))
    }

    /// Returns true if the ray hits anything; adds the number of nodes and leaves visited to `steps`.
    pub fn occluded_counted(&self, ray: &Ray, steps: &mut u32) -> bool {
        self.query(ray, &mut CountedQuery::<true>(steps)).is_some()
    }

    /// Computes the closest hit of every ray. Panics if the lengths differ.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Hit]) {
        assert_eq!(rays.len(), hits.len(), "a hit for every ray");
        for (hit, ray) in hits.iter_mut().zip(rays) {
            *hit = self.intersect(ray);
        }
    }

    /// Computes for every ray whether it hits anything. Panics if the lengths differ.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "an answer for every ray");
        for (hit, ray) in occluded.iter_mut().zip(rays) {
            *hit = self.occluded(ray);
        }
    }

    /// Returns the box around everything that can be hit; empty for an empty scene.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Returns the memory of the structure, in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of::<Self>() + self.tree.memory_bytes() + size_of_val(&*self.topology)
    }

    /// Returns the number of triangles, counted once per instance.
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
    use glam::{Affine3A, Vec3};

    use super::*;
    use crate::SplitMix64;
    use proptest::prelude::*;

    impl Accel {
        /// The same tree, traversed without SIMD instructions.
        fn portable(self) -> Self {
            Self { isa: Isa::Portable, ..self }
        }
    }

    /// Asserts that both give bit-identical results for every query.
    fn assert_same(one: &Accel, other: &Accel, ray: &Ray) {
        let bits = |h: Hit| ([h.t, h.u, h.v].map(f32::to_bits), h.instance, h.primitive);
        let even = |hit: &Hit| hit.primitive.is_multiple_of(2) && hit.u < 0.6;
        let (mut steps, mut other_steps) = (0, 0);
        let counted = one.intersect_counted(ray, &mut steps);
        assert_eq!(bits(counted), bits(other.intersect_counted(ray, &mut other_steps)), "{ray:?}");
        assert_eq!(steps, other_steps);
        assert_eq!(bits(counted), bits(one.intersect(ray)));
        assert_eq!(one.occluded(ray), other.occluded(ray));
        let (closest, mut any, mut other_any) = (steps, 0, 0);
        assert_eq!(one.occluded_counted(ray, &mut any), one.occluded(ray));
        assert_eq!(other.occluded_counted(ray, &mut other_any), one.occluded(ray));
        assert!(any == other_any && (any <= closest || one.occluded(ray)), "a miss costs both kinds of ray the same");
        assert_eq!(one.occluded(ray), counted.is_some(), "{ray:?}");
        let filtered = one.intersect_filtered(ray, even);
        assert_eq!(bits(filtered), bits(other.intersect_filtered(ray, even)), "{ray:?}");
        assert_eq!(one.occluded_filtered(ray, even), filtered.is_some());
        assert_eq!(other.occluded_filtered(ray, even), filtered.is_some());
    }

    fn instance(mesh: u32, world_from_object: Affine3A) -> InstanceGeometry {
        InstanceGeometry { mesh, world_from_object }
    }

    #[test]
    fn a_ray_through_a_triangle_tells_where() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let mesh = MeshGeometry { positions: &positions, triangles: &[[0, 1, 2]] };
        let sphere = SphereGeometry { center: Vec3::Z * 3.0, radius: 1.0 };
        let instances = [instance(0, Affine3A::IDENTITY)];
        for precision in [Precision::Robust, Precision::Fast] {
            let options = BuildOptions { precision, ..BuildOptions::default() };
            let accel = Accel::build(&[mesh], &instances, &[sphere], &options).unwrap();
            let hit = accel.intersect(&Ray::new(Vec3::new(0.25, 0.5, -1.0), Vec3::Z * 2.0));
            assert_eq!(hit, Hit { t: 0.5, u: 0.25, v: 0.5, instance: 0, primitive: 0 });
            let hit = accel.intersect(&Ray::new(Vec3::new(0.0, 0.0, 1.0), Vec3::Z));
            assert_eq!((hit.t, hit.sphere()), (1.0, Some(0)));
            assert!(accel.intersect(&Ray::new(Vec3::new(9.0, 0.0, 1.0), Vec3::Z)).is_none());
            let short = Ray { t_max: 0.49, ..Ray::new(Vec3::new(0.25, 0.5, -1.0), Vec3::Z * 2.0) };
            assert!(accel.intersect(&short).is_none() && !accel.occluded(&short));
            let late = Ray { t_min: 0.51, t_max: 0.9, ..short };
            assert!(accel.intersect(&late).is_none() && !accel.occluded(&late));
        }
    }

    /// Triangles at random places of a cube of side 2, small ones and long, thin ones.
    fn clutter(random: &mut SplitMix64, count: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let mut point = |size: f32| Vec3::from_array([(); 3].map(|()| size * (2.0 * random.unit_f32() - 1.0)));
        let triangle = |i: u32| {
            let (at, length) = (point(1.0), if i.is_multiple_of(2) { 0.5 } else { 0.01 });
            [at, at + point(length), at + point(0.01)]
        };
        let positions = (0..count).flat_map(triangle).collect();
        (positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
    }

    #[test]
    fn every_vector_unit_gives_the_same_bits_in_large_meshes() {
        let mut random = SplitMix64::new(3);
        let (positions, triangles) = clutter(&mut random, 60_000);
        let mesh = MeshGeometry { positions: &positions, triangles: &triangles };
        let mut next = || Vec3::from_array([(); 3].map(|()| 2.0 * random.unit_f32() - 1.0));
        for precision in [Precision::Robust, Precision::Fast] {
            let options = BuildOptions { precision, ..BuildOptions::default() };
            let build = || Accel::build(&[mesh], &[instance(0, Affine3A::IDENTITY)], &[], &options).unwrap();
            let (own, portable) = (build(), build().portable());
            let mut hits = 0;
            for _ in 0..2400 {
                let ray = Ray::new(next(), next());
                hits += u32::from(own.occluded(&ray));
                assert_same(&own, &portable, &ray);
                assert_same(&own, &portable, &Ray { t_max: next().x.abs(), ..ray });
            }
            assert!((600..2300).contains(&hits), "{hits} of 2400 rays hit something");
        }
    }

    /// Coordinates, often integers and −0, which tend to expose errors.
    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![4 => -2.0f32..2.0, 2 => (-2i32..=2).prop_map(|i| i as f32), 1 => Just(-0.0f32), 1 => -1e4f32..1e4]
    }

    fn vector() -> impl Strategy<Value = Vec3> {
        (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        #[test]
        fn every_vector_unit_gives_the_same_bits(
            positions in prop::collection::vec(vector(), 3..60),
            picks in prop::collection::vec((any::<u32>(), any::<u32>(), any::<u32>()), 0..120),
            rays in prop::collection::vec((vector(), vector(), 0usize..60), 1..20),
            moves in prop::collection::vec((vector(), 0.1f32..3.0), 1..3),
            sphere in (vector(), 0.0f32..2.0),
            robust in any::<bool>(),
        ) {
            let n = positions.len() as u32;
            let triangles: Vec<[u32; 3]> = picks.iter().map(|p| [p.0 % n, p.1 % n, p.2 % n]).collect();
            let mesh = MeshGeometry { positions: &positions, triangles: &triangles };
            let instances: Vec<_> = moves
                .iter()
                .map(|&(by, size)| instance(0, Affine3A::from_scale_rotation_translation(
                    Vec3::new(size, 1.0, -size), glam::Quat::from_rotation_y(size), by)))
                .collect();
            let precision = if robust { Precision::Robust } else { Precision::Fast };
            let options = BuildOptions { precision, threads: 1, flatten_triangles: 0, ..BuildOptions::default() };
            let spheres = [SphereGeometry { center: sphere.0, radius: sphere.1 }];
            let build = || Accel::build(&[mesh], &instances, &spheres, &options).unwrap();
            let (own, portable) = (build(), build().portable());
            for (origin, direction, target) in rays {
                assert_same(&own, &portable, &Ray::new(origin, direction));
                let corner = positions[target % positions.len()];
                assert_same(&own, &portable, &Ray { t_max: 1.5, ..Ray::new(origin, corner - origin) });
            }
        }
    }
}
