//! The tree against brute force, and the properties that a renderer relies on.

mod support;

use bottega_kernels::*;
use glam::{Affine3A, DVec3, EulerRot, Quat, Vec3};
use support::{Random, leaks, rough_ball};

/// Everything that a scene is made of, to be tested one by one.
#[derive(Default)]
struct Soup {
    meshes: Vec<(Vec<Vec3>, Vec<[u32; 3]>)>,
    instances: Vec<InstanceGeometry>,
    spheres: Vec<SphereGeometry>,
}

impl Soup {
    fn build(&self, options: &BuildOptions) -> Accel {
        let meshes: Vec<_> =
            self.meshes.iter().map(|(positions, triangles)| MeshGeometry { positions, triangles }).collect();
        Accel::build(&meshes, &self.instances, &self.spheres, options).unwrap()
    }

    /// All hits in double precision, closest first, without those so near an edge that either answer is right.
    /// The flag is true if there were such hits.
    fn hits(&self, ray: &Ray) -> (Vec<Hit>, bool) {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let (mut hits, mut doubtful) = (Vec::new(), false);
        for (instance, place) in self.instances.iter().enumerate() {
            let (positions, triangles) = &self.meshes[place.mesh as usize];
            for (primitive, indices) in triangles.iter().enumerate() {
                let world = |i: u32| place.world_from_object.transform_point3(positions[i as usize]).as_dvec3();
                let [a, b, c] = indices.map(world);
                let (e, f) = (b - a, c - a);
                let h = d.cross(f);
                let det = e.dot(h);
                let s = o - a;
                let (u, q) = (s.dot(h) / det, s.cross(e));
                let (v, t) = (d.dot(q) / det, f.dot(q) / det);
                let edge = u.min(v).min(1.0 - u - v);
                let flat = e.cross(f).length() < 1e-12 || det.abs() < 1e-5 * e.cross(f).length() * d.length();
                if flat || (edge.abs() < 1e-4 && t > -1e-3) {
                    doubtful |= edge.is_nan() || edge >= -1e-4;
                } else if edge > 0.0 && t > f64::from(ray.t_min) && t <= f64::from(ray.t_max) {
                    let (t, u, v) = (t as f32, u as f32, v as f32);
                    hits.push(Hit { t, u, v, instance: instance as u32, primitive: primitive as u32 });
                }
            }
        }
        for (index, sphere) in self.spheres.iter().enumerate() {
            let oc: DVec3 = o - sphere.center.as_dvec3();
            let (a, b) = (d.length_squared(), oc.dot(d));
            let r = f64::from(sphere.radius);
            let discriminant = b * b - a * (oc.length_squared() - r * r);
            doubtful |= discriminant.abs() < 1e-4 * a * r * r;
            if discriminant > 0.0 {
                for t in [(-b - discriminant.sqrt()) / a, (-b + discriminant.sqrt()) / a] {
                    if t > f64::from(ray.t_min) && t <= f64::from(ray.t_max) {
                        let instance = Hit::SPHERE | index as u32;
                        hits.push(Hit { t: t as f32, u: 0.0, v: 0.0, instance, primitive: 0 });
                    }
                }
            }
        }
        hits.sort_by(|x, y| x.t.total_cmp(&y.t));
        (hits, doubtful)
    }

    /// Compares the tree with brute force along many rays; returns how many were decided.
    fn compare(&self, accel: &Accel, rays: impl Iterator<Item = Ray>) -> usize {
        let odd = |hit: &Hit| hit.primitive % 3 != 1;
        let mut decided = 0;
        for ray in rays {
            let (hits, doubtful) = self.hits(&ray);
            if doubtful {
                continue;
            }
            decided += 1;
            let close = |got: Hit, want: Option<&Hit>| match want {
                None => got.is_none(),
                // Another surface at the same place is as good.
                Some(want) => {
                    let near = |h: &&Hit| (h.t - got.t).abs() <= 2e-4 * (1.0 + want.t);
                    let same = |h: &Hit| h.instance == got.instance && h.primitive == got.primitive;
                    near(&want)
                        && hits
                            .iter()
                            .filter(near)
                            .any(|h| same(h) && (h.u - got.u).abs() < 2e-3 && (h.v - got.v).abs() < 2e-3)
                }
            };
            let (got, want) = (accel.intersect(&ray), hits.first());
            assert!(close(got, want), "{ray:?}: {got:?} instead of {want:?}");
            assert_eq!(accel.occluded(&ray), want.is_some());
            let (got, want) = (accel.intersect_filtered(&ray, odd), hits.iter().find(|h| odd(h)));
            assert!(close(got, want), "filtered {ray:?}: {got:?} instead of {want:?}");
            assert_eq!(accel.occluded_filtered(&ray, odd), want.is_some());
        }
        decided
    }
}

fn random_mesh(random: &mut Random, count: usize, size: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut positions = Vec::new();
    for _ in 0..count {
        let mut point = |r: f32| Vec3::new(random.between(-r, r), random.between(-r, r), random.between(-r, r));
        let center = point(1.0);
        positions.extend([center + point(size), center + point(size), center + point(size)]);
    }
    (positions, (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

fn random_place(random: &mut Random, mesh: u32) -> InstanceGeometry {
    let mut next = || random.between(-2.0, 2.0);
    let rotation = Quat::from_euler(EulerRot::XYZ, next(), next(), next());
    let scale = Vec3::new(0.5 + 0.2 * next(), -0.6 + 0.1 * next(), 0.7 + 0.2 * next());
    let by = Vec3::new(next(), next(), next());
    InstanceGeometry { mesh, world_from_object: Affine3A::from_scale_rotation_translation(scale, rotation, by) }
}

fn random_rays(seed: u64, count: usize) -> impl Iterator<Item = Ray> {
    let mut random = Random::new(seed);
    (0..count).map(move |i| {
        let mut next = |r: f32| random.between(-r, r);
        let origin = Vec3::new(next(3.0), next(3.0), next(3.0));
        let direction = match i % 8 {
            0 => [Vec3::X, Vec3::NEG_Y, Vec3::Z][i / 8 % 3],
            1 => Vec3::new(next(1.0), 0.0, next(1.0)),
            _ => (Vec3::new(next(1.0), next(1.0), next(1.0)) - origin * 0.5) * 0.7,
        };
        let t_max = if i % 3 == 0 { 3.0 + next(3.0) } else { f32::INFINITY };
        Ray { origin, t_min: if i % 5 == 0 { 0.8 } else { 0.0 }, direction, t_max }
    })
}

const PRECISIONS: [Precision; 2] = [Precision::Robust, Precision::Fast];

#[test]
fn random_soups_agree_with_brute_force() {
    let mut random = Random::new(1);
    for (count, size) in [(1, 0.5), (3, 1.0), (9, 0.5), (60, 0.3), (500, 0.1), (400, 1.5)] {
        let mut soup = Soup::default();
        soup.meshes.push(random_mesh(&mut random, count, size));
        soup.instances.push(InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY });
        for precision in PRECISIONS {
            let accel = soup.build(&BuildOptions { precision, ..BuildOptions::default() });
            assert!(soup.compare(&accel, random_rays(count as u64, 1500)) > 1000);
            assert_eq!(accel.triangle_count(), count);
        }
    }
}

#[test]
fn instances_and_spheres_agree_with_brute_force() {
    let mut random = Random::new(2);
    let mut soup = Soup::default();
    for (mesh, uses) in [(0, 1), (1, 5), (2, 7)] {
        soup.meshes.push(random_mesh(&mut random, 40, 0.3));
        soup.instances.extend((0..uses).map(|_| random_place(&mut random, mesh)));
    }
    // One squeezed flat, which has no inverse.
    let mut flat = random_place(&mut random, 1);
    flat.world_from_object.matrix3.y_axis = flat.world_from_object.matrix3.x_axis;
    soup.instances.push(flat);
    for _ in 0..20 {
        let mut next = || random.between(-2.0, 2.0);
        soup.spheres.push(SphereGeometry { center: Vec3::new(next(), next(), next()), radius: next().abs() * 0.2 });
    }
    for precision in PRECISIONS {
        for flatten_triangles in [0, 4096] {
            let accel = soup.build(&BuildOptions { precision, flatten_triangles, ..BuildOptions::default() });
            assert!(soup.compare(&accel, random_rays(5, 3000)) > 1500);
        }
    }
}

#[test]
fn the_tree_does_not_depend_on_threads() {
    let (positions, triangles) = rough_ball();
    let mesh = MeshGeometry { positions: &positions, triangles: &triangles };
    let instances = [InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY }];
    let build = |threads| {
        let options = BuildOptions { threads, ..BuildOptions::default() };
        Accel::build(&[mesh], &instances, &[], &options).unwrap()
    };
    let (one, three, all) = (build(1), build(3), build(0));
    let mut random = Random::new(4);
    for ray in (0..4096).map(|_| Ray::new(Vec3::new(0.3, 0.2, 0.4), random.direction())) {
        let mut steps = [0; 3];
        let hit = one.intersect_counted(&ray, &mut steps[0]);
        assert_eq!(hit, three.intersect_counted(&ray, &mut steps[1]));
        assert_eq!(hit, all.intersect_counted(&ray, &mut steps[2]));
        assert!(steps[0] == steps[1] && steps[0] == steps[2] && steps[0] > 1);
    }
    assert_eq!(one.memory_bytes(), three.memory_bytes());
    assert!(one.memory_bytes() < 100 * one.triangle_count());
}

#[test]
fn nothing_leaks_through_edges_and_vertices_of_a_closed_mesh() {
    let (ball, triangles) = rough_ball();
    for shift in [Vec3::ZERO, Vec3::new(5000.0, 3000.0, -7000.0)] {
        let positions: Vec<Vec3> = ball.iter().map(|&p| p + shift).collect();
        let mesh = MeshGeometry { positions: &positions, triangles: &triangles };
        // Once flattened, and once with a tree of its own.
        for copies in [1, 2] {
            let place = |i: u32| InstanceGeometry {
                mesh: 0,
                world_from_object: Affine3A::from_translation(Vec3::X * 4.0 * i as f32),
            };
            let instances: Vec<_> = (0..copies).map(place).collect();
            let accel = Accel::build(&[mesh], &instances, &[], &BuildOptions::default()).unwrap();
            let (mut rays, mut leaks) = (0, 0);
            let mut random = Random::new(9);
            for indices in triangles.iter().step_by(if copies == 1 { 1 } else { 5 }) {
                let [a, b, _] = indices.map(|i| positions[i as usize]);
                let mut near = || random.between(-0.3, 0.3);
                let origin = shift + Vec3::new(near(), near(), near());
                for target in [a, (a + b) * 0.5, a + (b - a) * 0.1] {
                    rays += 1;
                    leaks += u32::from(!accel.occluded(&Ray::new(origin, target - origin)));
                }
            }
            assert!(rays > 40_000 && leaks == 0, "{leaks} of {rays} rays leaked, shift {shift}, {copies} copies");
        }
    }
}

#[test]
fn long_edges_and_axis_aligned_rays_do_not_leak() {
    // A cube of twelve triangles, at several sizes and places; rays in and along the coordinate planes.
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0;
    let quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    for size in [1e-3, 1.0, 1e5] {
        for center in [Vec3::ZERO, Vec3::new(1.0, -2.0, 0.5) * size, Vec3::new(977.0, 0.0, -431.0) * size] {
            let positions: Vec<Vec3> = (0..8).map(|i| center + corner(i) * size).collect();
            let mesh = MeshGeometry { positions: &positions, triangles: &triangles };
            let instances = [InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY }];
            let accel = Accel::build(&[mesh], &instances, &[], &BuildOptions::default()).unwrap();
            for i in -4i32..=4 {
                for j in -4i32..=4 {
                    let grid = |k: usize| {
                        let (a, b) = (i as f32 / 4.0, j as f32 / 4.0);
                        [Vec3::new(1.0, a, b), Vec3::new(a, -1.0, b), Vec3::new(a, b, 1.0)][k]
                    };
                    for k in 0..3 {
                        let target = center + grid(k) * size;
                        for origin in [center, center + Vec3::new(0.25, 0.5, -0.125) * size] {
                            let direction = target - origin;
                            assert!(accel.occluded(&Ray::new(origin, direction)), "{origin} to {target}");
                            let hit = accel.intersect(&Ray::new(origin, direction));
                            assert!((hit.t - 1.0).abs() < 1e-3, "{hit:?}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn at_equal_distance_the_lower_number_is_hit() {
    let (positions, triangles) = (vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]; 50]);
    let mesh = MeshGeometry { positions: &positions, triangles: &triangles };
    let place = |_| InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY };
    for copies in 1..4 {
        for flatten_triangles in [0, 1000] {
            for precision in PRECISIONS {
                let instances: Vec<_> = (0..copies).map(place).collect();
                let options = BuildOptions { precision, flatten_triangles, ..BuildOptions::default() };
                let accel = Accel::build(&[mesh], &instances, &[], &options).unwrap();
                let ray = Ray::new(Vec3::new(0.2, 0.3, 1.0), Vec3::NEG_Z);
                let hit = accel.intersect(&ray);
                assert_eq!((hit.instance, hit.primitive), (0, 0));
                let later = accel.intersect_filtered(&ray, |h| h.primitive >= 7);
                assert_eq!((later.instance, later.primitive), (0, 7));
            }
        }
    }
}

#[test]
fn bad_geometry_is_refused_and_odd_geometry_is_not() {
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let mesh = |triangles| MeshGeometry { positions: &positions, triangles };
    let place = |world_from_object| InstanceGeometry { mesh: 0, world_from_object };
    fn build(
        mesh: MeshGeometry<'_>,
        instances: &[InstanceGeometry],
        spheres: &[SphereGeometry],
    ) -> Result<Accel, BuildError> {
        Accel::build(&[mesh], instances, spheres, &BuildOptions::default())
    }
    let identity = [place(Affine3A::IDENTITY)];
    let good = mesh(&[[0, 1, 2]]);
    let error = build(mesh(&[[0, 1, 2], [0, 1, 3]]), &identity, &[]).unwrap_err();
    assert_eq!(error, BuildError::IndexOutOfRange { mesh: 0, triangle: 1, vertex: 3, vertices: 3 });
    for bad in [f32::NAN, f32::INFINITY] {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::new(0.0, bad, 0.0)];
        let error = build(MeshGeometry { positions: &positions, triangles: &[] }, &identity, &[]).unwrap_err();
        assert_eq!(error, BuildError::PositionNotFinite { mesh: 0, vertex: 2 });
        let error = build(good, &[place(Affine3A::from_scale(Vec3::splat(bad)))], &[]).unwrap_err();
        assert_eq!(error, BuildError::TransformNotFinite { instance: 0 });
        let error = build(good, &identity, &[SphereGeometry { center: Vec3::ZERO, radius: bad }]).unwrap_err();
        assert_eq!(error, BuildError::BadSphere { sphere: 0 });
    }
    let huge = [Vec3::ZERO, Vec3::X * 1e30, Vec3::Y * 1e30];
    let huge = MeshGeometry { positions: &huge, triangles: &[[0, 1, 2]] };
    let error = build(huge, &[place(Affine3A::from_scale(Vec3::splat(1e30)))], &[]).unwrap_err();
    assert_eq!(error, BuildError::TransformNotFinite { instance: 0 });
    let error = build(good, &[InstanceGeometry { mesh: 1, ..identity[0] }], &[]).unwrap_err();
    assert_eq!(error, BuildError::NoSuchMesh { instance: 0, mesh: 1, meshes: 1 });

    let ray = Ray::new(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z);
    let empty = Accel::build(&[], &[], &[], &BuildOptions::default()).unwrap();
    assert!(empty.intersect(&ray).is_none() && !empty.occluded(&ray) && empty.bounds().is_empty());
    let flat = build(mesh(&[[0, 1, 1], [0, 0, 0], [2, 2, 1]]), &identity, &[]).unwrap();
    assert!(flat.intersect(&ray).is_none());
    let accel = build(good, &identity, &[]).unwrap();
    assert!(accel.intersect(&ray).is_some());
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for k in 0..3 {
            let (mut origin, mut direction) = (ray.origin, ray.direction);
            origin[k] = bad;
            direction[k] = bad;
            assert!(accel.intersect(&Ray { origin, ..ray }).is_none());
            assert!(!accel.occluded(&Ray { direction, ..ray }));
        }
        assert!(bad > 0.0 || accel.intersect(&Ray { t_max: bad, ..ray }).is_none());
    }
    assert!(accel.intersect(&Ray { direction: Vec3::ZERO, ..ray }).is_none());
}

#[test]
fn an_absurdly_nested_scene_is_built_and_traversed() {
    // Each triangle half the size of the last, all from one corner: the heuristic peels off one at a time.
    let mut positions = Vec::new();
    for i in 0..3000 {
        let size = 0.99f32.powi(i) * 1e6;
        positions.extend([Vec3::new(-size, 0.0, size * 1e-3), Vec3::X * size, Vec3::new(0.0, size, size * 1e-3)]);
    }
    let triangles: Vec<[u32; 3]> = (0..3000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = MeshGeometry { positions: &positions, triangles: &triangles };
    let instances = [InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY }];
    let accel = Accel::build(&[mesh], &instances, &[], &BuildOptions::default()).unwrap();
    let hit = accel.intersect(&Ray::new(Vec3::new(1e-9, 1e-9, -10.0), Vec3::Z));
    assert!(hit.is_some());
    let all = vec![[0u32, 1, 2]; 2000];
    let accel =
        Accel::build(&[MeshGeometry { triangles: &all, ..mesh }], &instances, &[], &BuildOptions::default()).unwrap();
    assert_eq!(accel.intersect(&Ray::new(Vec3::new(1.0, 1.0, -1e4), Vec3::Z)).primitive, 0);
}

#[test]
fn a_refitted_tree_gives_the_hits_of_a_new_one() {
    let mut random = Random::new(21);
    let mut soup = Soup::default();
    for (mesh, uses) in [(0, 1), (1, 4), (2, 2)] {
        soup.meshes.push(random_mesh(&mut random, 60, 0.3));
        soup.instances.extend((0..uses).map(|_| random_place(&mut random, mesh)));
    }
    for _ in 0..12 {
        let mut next = || random.between(-2.0, 2.0);
        soup.spheres
            .push(SphereGeometry { center: Vec3::new(next(), next(), next()), radius: 0.1 + 0.1 * next().abs() });
    }
    let mut moved = Soup { instances: soup.instances.clone(), ..Soup::default() };
    for (positions, triangles) in &soup.meshes {
        let swirl = |p: &Vec3| Quat::from_rotation_y(1.3 * p.y) * *p * (1.2 + 0.3 * p.x);
        moved.meshes.push((positions.iter().map(swirl).collect(), triangles.clone()));
    }
    for instance in &mut moved.instances {
        *instance = random_place(&mut random, instance.mesh);
    }
    moved.spheres.extend(soup.spheres.iter().map(|s| SphereGeometry { center: -s.center, radius: 2.0 * s.radius }));
    fn geometry(soup: &Soup) -> Vec<MeshGeometry<'_>> {
        soup.meshes.iter().map(|(positions, triangles)| MeshGeometry { positions, triangles }).collect()
    }
    for precision in PRECISIONS {
        for flatten_triangles in [0, 4096] {
            let options = BuildOptions { precision, flatten_triangles, ..BuildOptions::default() };
            let (mut accel, new) = (soup.build(&options), moved.build(&options));
            accel.refit(&geometry(&moved), &moved.instances, &moved.spheres).unwrap();
            // As many as a build decides against brute force, and hit for hit what the new tree gives.
            assert!(moved.compare(&accel, random_rays(8, 2000)) > 1000);
            let mut hits = 0;
            for ray in random_rays(9, 4000) {
                let (a, b) = (accel.intersect(&ray), new.intersect(&ray));
                assert_eq!((a.instance, a.primitive, accel.occluded(&ray)), (b.instance, b.primitive, b.is_some()));
                assert!(a.is_none() || (a.t - b.t).abs() <= 1e-5 * (1.0 + b.t));
                hits += u32::from(a.is_some());
            }
            assert!(hits > 1000);
            let center = |b: Aabb| (b.center() - new.bounds().center()).length();
            assert!(center(accel.bounds()) < 0.3, "{:?} {:?}", accel.bounds(), new.bounds());
            // And back: the tree as it was.
            accel.refit(&geometry(&soup), &soup.instances, &soup.spheres).unwrap();
            assert!(soup.compare(&accel, random_rays(10, 1000)) > 400);
            let error = accel.refit(&geometry(&soup)[..2], &soup.instances[..5], &soup.spheres).unwrap_err();
            assert_eq!(error, BuildError::Changed);
            let error = accel.refit(&geometry(&soup), &soup.instances, &soup.spheres[1..]).unwrap_err();
            assert_eq!(error, BuildError::Changed);
        }
    }
}

#[test]
fn a_refitted_mesh_does_not_leak() {
    let (ball, triangles) = rough_ball();
    let mesh = |positions| MeshGeometry { positions, triangles: &triangles };
    let instances = [InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY }];
    let mut accel = Accel::build(&[mesh(&ball)], &instances, &[], &BuildOptions::default()).unwrap();
    let positions: Vec<Vec3> = ball.iter().map(|p| *p * Vec3::new(1.5, 0.4, 1.0) + p.y * 0.2).collect();
    accel.refit(&[mesh(&positions)], &instances, &[]).unwrap();
    for indices in triangles.iter().step_by(3) {
        let [a, b, _] = indices.map(|i| positions[i as usize]);
        for target in [a, (a + b) * 0.5] {
            assert!(accel.occluded(&Ray::new(Vec3::ZERO, target)), "leak towards {target}");
        }
    }
}

#[test]
fn ten_million_rays_stay_inside() {
    for row in leaks(10_000_000).unwrap() {
        assert!(row.rays >= 300_000 && row.leaks == 0, "{row:?}");
    }
}
