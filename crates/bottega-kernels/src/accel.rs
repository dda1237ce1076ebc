//! The acceleration structure: geometry in, hits out.

use crate::build::{self, BuiltTree, refit};
#[cfg(target_arch = "x86_64")]
use crate::traverse::avx2::{self, Avx2};
use crate::traverse::portable::Portable;
use crate::traverse::{self, AnyHit, ClosestHit, CountedQuery, FilteredHit, Query};
use crate::tree::SceneTrees;
use crate::{
    Aabb, BuildError, BuildOptions, Hit, InstanceGeometry, MeshGeometry, MotionGeometry, Precision, Ray, SphereGeometry,
};

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
        Self::build_moving(meshes, instances, spheres, &MotionGeometry::default(), options)
    }

    /// Builds the structure of a scene of which parts move; see [`Accel::build`]. Queries at a time from 0 to 1 find the
    /// geometry as it is then; those without a time find it at time 0.
    ///
    /// # Errors
    /// The same as [`Accel::build`], and [`BuildError::BadMotion`].
    pub fn build_moving(
        meshes: &[MeshGeometry<'_>],
        instances: &[InstanceGeometry],
        spheres: &[SphereGeometry],
        motion: &MotionGeometry<'_>,
        options: &BuildOptions,
    ) -> Result<Self, BuildError> {
        let BuiltTree { tree, bounds, triangles } = build::build(meshes, instances, spheres, motion, options)?;
        let topology = refit::topology(meshes, instances);
        Ok(Self { tree, bounds, triangles, topology, precision: options.precision, isa: Isa::detect() })
    }

    /// Refits the structure to moved geometry: other positions, transforms and spheres, with the same counts and
    /// triangle indices. Rays get slower the farther shapes move from their places at the build. Triangles
    /// without area and spheres of radius 0 at the build stay unhittable.
    ///
    /// # Errors
    /// Those of [`Accel::build`]; or [`BuildError::Changed`]: counts differ from the build, an instance is flattened to
    /// nothing, or the structure has moving parts. An error leaves the structure unchanged.
    pub fn refit(
        &mut self,
        meshes: &[MeshGeometry<'_>],
        instances: &[InstanceGeometry],
        spheres: &[SphereGeometry],
    ) -> Result<(), BuildError> {
        self.bounds = refit::refit(&mut self.tree, &self.topology, meshes, instances, spheres, self.precision)?;
        Ok(())
    }

    /// Returns the closest hit, or [`Hit::NONE`]. At equal distance, the lower instance wins, then the lower primitive.
    pub fn intersect(&self, ray: &Ray) -> Hit {
        self.query(ray, 0.0, &mut ClosestHit)
    }

    /// Returns true if the ray hits anything.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.query(ray, 0.0, &mut AnyHit).is_some()
    }

    /// Returns the closest hit for which `accept` returns true (an alpha test), or [`Hit::NONE`]. `accept` is called
    /// for candidates in no particular order, possibly including some that are not the closest, and must be a pure
    /// function of the candidate.
    pub fn intersect_filtered(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> Hit {
        self.intersect_filtered_at(ray, 0.0, accept)
    }

    /// Returns true if there is a hit for which `accept` returns true; see [`Accel::intersect_filtered`].
    pub fn occluded_filtered(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> bool {
        self.occluded_filtered_at(ray, 0.0, accept)
    }

    /// Returns the closest hit at a time from 0 to 1, or [`Hit::NONE`].
    pub fn intersect_at(&self, ray: &Ray, time: f32) -> Hit {
        self.query(ray, time, &mut ClosestHit)
    }

    /// Returns true if the ray hits anything at a time from 0 to 1.
    pub fn occluded_at(&self, ray: &Ray, time: f32) -> bool {
        self.query(ray, time, &mut AnyHit).is_some()
    }

    /// Returns the closest hit at a time from 0 to 1 for which `accept` returns true, or [`Hit::NONE`]; see
    /// [`Accel::intersect_filtered`].
    pub fn intersect_filtered_at(&self, ray: &Ray, time: f32, accept: impl Fn(&Hit) -> bool) -> Hit {
        self.query(ray, time, &mut FilteredHit::<_, false>(accept))
    }

    /// Returns true if there is a hit at a time from 0 to 1 for which `accept` returns true; see
    /// [`Accel::intersect_filtered`].
    pub fn occluded_filtered_at(&self, ray: &Ray, time: f32, accept: impl Fn(&Hit) -> bool) -> bool {
        self.query(ray, time, &mut FilteredHit::<_, true>(accept)).is_some()
    }

    /// Returns the closest hit, or [`Hit::NONE`]; adds the number of nodes and leaves visited to `steps`.
    pub fn intersect_counted(&self, ray: &Ray, steps: &mut u32) -> Hit {
        self.query(ray, 0.0, &mut CountedQuery::<false>(steps))
    }

    /// Returns true if the ray hits anything; adds the number of nodes and leaves visited to `steps`.
    pub fn occluded_counted(&self, ray: &Ray, steps: &mut u32) -> bool {
        self.query(ray, 0.0, &mut CountedQuery::<true>(steps)).is_some()
    }

    /// Writes the closest hit of every ray to `hits`, [`Hit::NONE`] for rays that hit nothing.
    ///
    /// # Panics
    /// The lengths of `rays` and `hits` differ.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Hit]) {
        assert_eq!(rays.len(), hits.len(), "a hit for every ray");
        for (hit, ray) in hits.iter_mut().zip(rays) {
            *hit = self.intersect(ray);
        }
    }

    /// Writes true to `occluded` for every ray that hits anything, and false for every other.
    ///
    /// # Panics
    /// The lengths of `rays` and `occluded` differ.
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
    fn query<Q: Query>(&self, ray: &Ray, time: f32, query: &mut Q) -> Hit {
        match (self.isa, self.precision) {
            #[cfg(target_arch = "x86_64")]
            (Isa::Avx2(unit), Precision::Robust) => avx2::run::<Q, true>(unit, &self.tree, ray, time, query),
            #[cfg(target_arch = "x86_64")]
            (Isa::Avx2(unit), Precision::Fast) => avx2::run::<Q, false>(unit, &self.tree, ray, time, query),
            (Isa::Portable, Precision::Robust) => traverse::run::<_, Q, true>(Portable, &self.tree, ray, time, query),
            (Isa::Portable, Precision::Fast) => traverse::run::<_, Q, false>(Portable, &self.tree, ray, time, query),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Affine3A, Vec3};

    use super::*;
    use crate::{KeySpan, MeshKeyGeometry, MovingTransform, SphereKeyGeometry, SplitMix64};
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
    fn a_ray_finds_its_place_on_a_triangle() {
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

    /// Keys of vertices, their triangles, moving transformations, and spheres at the first and last time.
    type MovingShapes = (Vec<Vec<Vec3>>, Vec<[u32; 3]>, [MovingTransform; 2], [[SphereGeometry; 2]; 2]);

    /// Makes geometry that moves at random.
    fn moving_shapes(random: &mut SplitMix64) -> MovingShapes {
        let (positions, triangles) = clutter(random, 2000);
        let mut point = |size: f32| Vec3::from_array([(); 3].map(|()| size * (2.0 * random.unit_f32() - 1.0)));
        let waved = |positions: &[Vec3], point: &mut dyn FnMut(f32) -> Vec3| {
            positions
                .chunks(3)
                .flat_map(|corners| {
                    let by = point(0.3);
                    corners.iter().map(move |&p| p + by).collect::<Vec<_>>()
                })
                .collect::<Vec<Vec3>>()
        };
        let second = waved(&positions, &mut point);
        let third = waved(&second, &mut point);
        let mut pose = || {
            let axis = point(1.0).normalize_or(Vec3::X);
            let turn = glam::Quat::from_axis_angle(axis, 2.0 * point(1.0).x);
            Affine3A::from_scale_rotation_translation(Vec3::splat(0.7) + point(0.3), turn, point(1.5))
        };
        let moving = [(); 2].map(|()| MovingTransform::new(&[(-0.2, pose()), (0.4, pose()), (1.0, pose())]).unwrap());
        let mut sphere = || SphereGeometry { center: point(2.0), radius: 0.2 + point(0.1).x.abs() };
        let spheres = [(); 2].map(|()| [sphere(), sphere()]);
        (vec![positions, second, third], triangles, moving, spheres)
    }

    #[test]
    fn moving_geometry_is_hit_where_it_is_at_the_time() {
        let mut random = SplitMix64::new(11);
        let (keys, triangles, moving, spheres) = moving_shapes(&mut random);
        let still = MeshGeometry { positions: &keys[0], triangles: &triangles };
        let times = [0.0, 0.3, 1.0];
        let mesh_keys = keys.iter().zip(times).map(|(positions, time)| MeshKeyGeometry { time, positions }).collect();
        // A still mesh that moves, a waving mesh that stands, and a waving one that moves
        let instances = [(0, Affine3A::IDENTITY), (1, moving[1].at(0.5)), (1, Affine3A::IDENTITY)];
        let instances = instances.map(|(mesh, map)| instance(mesh, map));
        let sphere_keys = |ends: [SphereGeometry; 2]| {
            [0.0, 1.0].iter().zip(ends).map(|(&time, sphere)| SphereKeyGeometry { time, sphere }).collect()
        };
        let motion = MotionGeometry {
            instances: vec![(0, moving[0].clone()), (2, moving[1].clone())],
            meshes: vec![(1, mesh_keys)],
            spheres: vec![(0, sphere_keys(spheres[0])), (1, sphere_keys(spheres[1]))],
        };
        for precision in [Precision::Robust, Precision::Fast] {
            let options = BuildOptions { precision, threads: 1, ..BuildOptions::default() };
            let firsts = spheres.map(|ends| ends[0]);
            let build = || Accel::build_moving(&[still, still], &instances, &firsts, &motion, &options).unwrap();
            let (own, portable) = (build(), build().portable());
            let (mut hits, mut others) = (0, 0);
            for time in [0.0, 0.1, 0.3, 0.55, 0.9, 1.0] {
                // The same geometry, built as it is at that time
                let KeySpan { key, share } = KeySpan::find(&times, time);
                let posed: Vec<Vec3> =
                    keys[key].iter().zip(&keys[key + 1]).map(|(&a, &b)| a * (1.0 - share) + b * share).collect();
                let waving = MeshGeometry { positions: &posed, triangles: &triangles };
                let mut at = instances;
                (at[0].world_from_object, at[2].world_from_object) = (moving[0].at(time), moving[1].at(time));
                let balls = spheres.map(|[a, b]| SphereGeometry {
                    center: a.center * (1.0 - time) + b.center * time,
                    radius: a.radius * (1.0 - time) + b.radius * time,
                });
                let then = Accel::build(&[still, waving], &at, &balls, &options).unwrap();
                let inside = own.bounds();
                let bounds = then.bounds();
                assert!(inside.min.cmple(bounds.min).all() && inside.max.cmpge(bounds.max).all());
                for _ in 0..400 {
                    let mut next = || Vec3::from_array([(); 3].map(|()| 2.0 * random.unit_f32() - 1.0));
                    let (from, to) = (next() * 3.0, next());
                    let ray = Ray::new(from, to - from);
                    let (found, expected) = (own.intersect_at(&ray, time), then.intersect(&ray));
                    assert_eq!(found, portable.intersect_at(&ray, time));
                    assert_eq!(found.is_some(), own.occluded_at(&ray, time));
                    assert_eq!(found, own.intersect_filtered_at(&ray, time, |_| true));
                    hits += u32::from(found.is_some());
                    let is_near = (found.t - expected.t).abs() < 1e-4 * (1.0 + expected.t) || found.t == expected.t;
                    // Rays along an edge may hit either side of it
                    others += u32::from(
                        (found.instance, found.primitive) != (expected.instance, expected.primitive) || !is_near,
                    );
                }
            }
            assert!(hits > 300 && others < 4, "{hits} {others}");
        }
    }

    #[test]
    fn motion_that_cannot_be_followed_is_refused() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let mesh = MeshGeometry { positions: &positions, triangles: &[[0, 1, 2]] };
        let sphere = SphereGeometry { center: Vec3::ZERO, radius: 1.0 };
        let build = |motion: MotionGeometry<'_>| {
            let instances = [instance(0, Affine3A::IDENTITY)];
            Accel::build_moving(&[mesh], &instances, &[sphere], &motion, &BuildOptions::default()).map(drop)
        };
        let key = |time: f32, positions: &'static [Vec3]| MeshKeyGeometry { time, positions };
        static TWO: [Vec3; 2] = [Vec3::ZERO, Vec3::X];
        static THREE: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let meshes =
            |keys: Vec<MeshKeyGeometry<'static>>| MotionGeometry { meshes: vec![(0, keys)], ..Default::default() };
        assert!(build(meshes(vec![key(0.0, &THREE), key(1.0, &THREE)])).is_ok());
        assert!(build(meshes(vec![key(0.0, &THREE)])).is_err());
        assert!(build(meshes(vec![key(0.0, &THREE), key(0.0, &THREE)])).is_err());
        assert!(build(meshes(vec![key(0.0, &THREE), key(1.0, &TWO)])).is_err());
        let still = MovingTransform::new(&[(0.0, Affine3A::IDENTITY)]).unwrap();
        let skew = glam::Mat3::from_cols(Vec3::X, Vec3::new(1.0, 1e-8, 0.0), Vec3::Z);
        let flat = MovingTransform::new(&[(0.0, Affine3A::from_mat3(skew))]).unwrap();
        let instances = |list| MotionGeometry { instances: list, ..Default::default() };
        assert!(build(instances(vec![(0, still.clone())])).is_ok());
        assert!(build(instances(vec![(1, still.clone())])).is_err());
        assert!(build(instances(vec![(0, still.clone()), (0, still)])).is_err());
        assert!(build(instances(vec![(0, flat)])).is_err());
        let bad = SphereKeyGeometry { time: 1.0, sphere: SphereGeometry { radius: f32::NAN, ..sphere } };
        let keys = vec![SphereKeyGeometry { time: 0.0, sphere }, bad];
        assert!(build(MotionGeometry { spheres: vec![(0, keys)], ..Default::default() }).is_err());
        let mut accel = Accel::build_moving(
            &[mesh],
            &[instance(0, Affine3A::IDENTITY)],
            &[],
            &meshes(vec![key(0.0, &THREE), key(1.0, &THREE)]),
            &BuildOptions::default(),
        )
        .unwrap();
        assert_eq!(accel.refit(&[mesh], &[instance(0, Affine3A::IDENTITY)], &[]), Err(BuildError::Changed));
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
