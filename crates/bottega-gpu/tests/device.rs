//! Rays on a real device, or on Mesa's llvmpipe. Skipped with a message if there is neither.

use std::process::Command;
use std::sync::Arc;

use bottega_gpu::{AdapterKind, GpuError, GpuOptions, GpuRays, adapters};
use bottega_hra::{Hra, HraConfig, Primitive, PrimitiveSet, RayQuery, RayWork, Resource, VirtualCpu, Work, WorkUnit};
use bottega_kernels::{Accel, BuildOptions, Hit, InstanceGeometry, MeshGeometry, Ray, SphereGeometry};
use glam::{Affine3A, DVec3, Quat, Vec3};

/// Returns options for the adapter that `BOTTEGA_GPU` names, or llvmpipe, or any; `None` if there is no adapter.
fn options() -> Option<GpuOptions> {
    if let Ok(name) = std::env::var("BOTTEGA_GPU") {
        return Some(GpuOptions { adapter: Some(name), ..GpuOptions::default() });
    }
    let there = adapters();
    let software = there.iter().find(|adapter| adapter.name.contains("llvmpipe"));
    let chosen = software.or(there.first()).map(|adapter| adapter.name.clone());
    if chosen.is_none() {
        eprintln!("skipped: no Vulkan adapter; install a driver, or Mesa's llvmpipe");
    }
    chosen.map(|adapter| GpuOptions { adapter: Some(adapter), ..GpuOptions::default() })
}

/// Numbers in [0, 1) that are the same each time.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }
    fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }
    fn point(&mut self, size: f32) -> Vec3 {
        Vec3::new(self.within(-size, size), self.within(-size, size), self.within(-size, size))
    }
}

/// A closed ball of triangles with bumps.
struct Ball {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Ball {
    fn new(rows: u32, bump: f32) -> Self {
        let columns = 2 * rows;
        let mut numbers = Numbers(rows.into());
        let mut positions = Vec::new();
        for row in 0..=rows {
            for column in 0..columns {
                let theta = std::f32::consts::PI * row as f32 / rows as f32;
                let phi = std::f32::consts::TAU * column as f32 / columns as f32;
                let radius = 1.0 + bump * numbers.next();
                positions.push(Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()) * radius);
            }
        }
        let at = |row: u32, column: u32| row * columns + column % columns;
        let quads = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let triangles = quads.flat_map(|(row, column)| {
            let [a, b, c, d] = [at(row, column), at(row + 1, column), at(row + 1, column + 1), at(row, column + 1)];
            [[a, b, c], [a, c, d]]
        });
        let triangles = triangles.collect();
        Self { positions, triangles }
    }

    fn mesh(&self) -> MeshGeometry<'_> {
        MeshGeometry { positions: &self.positions, triangles: &self.triangles }
    }
}

/// Balls in several places, one of them mirrored and stretched, and spheres.
fn instances() -> Vec<InstanceGeometry> {
    let turn = Quat::from_rotation_y(0.7);
    [
        Affine3A::from_translation(Vec3::new(-2.0, 0.0, 0.0)),
        Affine3A::from_scale_rotation_translation(Vec3::new(-0.5, 1.5, 0.8), turn, Vec3::new(2.0, 0.3, 1.0)),
        Affine3A::from_scale_rotation_translation(Vec3::splat(0.01), turn, Vec3::new(0.0, 2.0, 0.0)),
    ]
    .into_iter()
    .map(|world_from_object| InstanceGeometry { mesh: 0, world_from_object })
    .collect()
}

fn spheres() -> Vec<SphereGeometry> {
    vec![
        SphereGeometry { center: Vec3::new(0.0, -1.5, 0.5), radius: 1.0 },
        SphereGeometry { center: Vec3::new(0.3, 1.0, -2.0), radius: 0.02 },
        SphereGeometry { center: Vec3::new(0.0, -14.0, 0.0), radius: 10.0 },
    ]
}

/// Rays of all kinds: into the scene, within bounds, of odd lengths, along axes.
fn rays(count: usize, seed: u64) -> Vec<Ray> {
    let mut numbers = Numbers(seed);
    (0..count)
        .map(|index| {
            let origin = numbers.point(5.0);
            let direction = match index % 5 {
                0 => Vec3::X * numbers.within(-2.0, 2.0),
                1 => (numbers.point(2.0) - origin) * 1e-6,
                2 => (numbers.point(2.0) - origin) * 1e6,
                _ => numbers.point(2.5) - origin,
            };
            let (t_min, t_max) = match index % 3 {
                0 => (0.0, f32::INFINITY),
                1 => (0.1 / direction.length(), 4.0 / direction.length()),
                _ => (-1.0, f32::INFINITY),
            };
            Ray { origin, t_min, direction, t_max }
        })
        .collect()
}

/// The closest hit in double precision, shape by shape; `t` alone.
fn brute_force(ray: &Ray, mesh: &MeshGeometry<'_>) -> Option<f64> {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let mut best = f64::from(ray.t_max);
    let mut found = None;
    let mut consider = |t: f64| {
        if t > f64::from(ray.t_min.max(0.0)) && t <= best {
            best = t;
            found = Some(t);
        }
    };
    for instance in instances() {
        let world = |vertex: u32| -> DVec3 {
            instance.world_from_object.transform_point3(mesh.positions[vertex as usize]).as_dvec3()
        };
        for &[a, b, c] in mesh.triangles {
            let (p, e1, e2) = (world(a), world(b) - world(a), world(c) - world(a));
            let q = d.cross(e2);
            let determinant = e1.dot(q);
            let s = o - p;
            let (u, r) = (s.dot(q) / determinant, s.cross(e1));
            let v = d.dot(r) / determinant;
            if determinant != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
                consider(e2.dot(r) / determinant);
            }
        }
    }
    for sphere in spheres() {
        let (f, r) = (o - sphere.center.as_dvec3(), f64::from(sphere.radius));
        let (a, b, c) = (d.length_squared(), f.dot(d), f.length_squared() - r * r);
        let discriminant = b * b - a * c;
        if discriminant >= 0.0 {
            consider((-b - discriminant.sqrt()) / a);
            consider((-b + discriminant.sqrt()) / a);
        }
    }
    found
}

/// Compares with the correct hits: at most one ray in ten thousand may hit where the other misses or lies elsewhere.
fn check_hits(hits: &[Hit], right: impl Fn(usize) -> Option<f64>) {
    let differs = |hit: &Hit, right: Option<f64>| match (hit.is_some(), right) {
        (true, Some(t)) => (f64::from(hit.t) - t).abs() > 1e-4 * t.abs(),
        (hit, right) => hit != right.is_some(),
    };
    let wrong: Vec<_> = (0..hits.len()).filter(|&index| differs(&hits[index], right(index))).collect();
    let examples: Vec<_> = wrong.iter().take(5).map(|&index| (index, hits[index], right(index))).collect();
    assert!(wrong.len() * 10_000 <= hits.len(), "{} of {} are wrong: {examples:?}", wrong.len(), hits.len());
}

#[test]
fn hits_are_those_of_a_loop_over_all_shapes() {
    let Some(options) = options() else { return };
    let ball = Ball::new(10, 0.2);
    let mut gpu = GpuRays::from_geometry(&[ball.mesh()], &instances(), &spheres(), &options).unwrap();
    let rays = rays(10_000, 1);
    let right: Vec<_> = rays.iter().map(|ray| brute_force(ray, &ball.mesh())).collect();
    let found = right.iter().flatten().count();
    assert!(found > 2_000 && found < 9_000, "{found} hits: the scene tests nothing");
    let hits = gpu.intersect(&rays).unwrap();
    check_hits(&hits, |index| right[index]);
    let occluded = gpu.occluded(&rays).unwrap();
    let wrong = (0..rays.len()).filter(|&index| occluded[index] != right[index].is_some()).count();
    assert!(wrong <= 1, "{wrong} shadow rays are wrong");
    for (hit, ray) in hits.iter().zip(&rays).filter(|(hit, _)| hit.is_some() && hit.sphere().is_none()) {
        let [p0, p1, p2] = ball.triangles[hit.primitive as usize].map(|vertex| {
            instances()[hit.instance as usize].world_from_object.transform_point3(ball.positions[vertex as usize])
        });
        let point = (1.0 - hit.u - hit.v) * p0 + hit.u * p1 + hit.v * p2;
        let distance = (point - ray.at(hit.t)).length();
        assert!(distance < 1e-4, "u and v of {hit:?} name a point {distance} away");
    }
}

#[test]
fn hits_agree_with_the_kernels_of_the_processor() {
    let Some(options) = options() else { return };
    let ball = Ball::new(120, 0.1);
    let accel = Accel::build(&[ball.mesh()], &instances(), &spheres(), &BuildOptions::default()).unwrap();
    let mut gpu = GpuRays::from_geometry(&[ball.mesh()], &instances(), &spheres(), &options).unwrap();
    let rays = rays(60_000, 2);
    let hits = gpu.intersect(&rays).unwrap();
    let right: Vec<_> = rays.iter().map(|ray| accel.intersect(ray)).collect();
    check_hits(&hits, |index| right[index].is_some().then_some(right[index].t.into()));
    let same = |hit: &Hit, right: &Hit| (hit.instance, hit.primitive) == (right.instance, right.primitive);
    let elsewhere = hits.iter().zip(&right).filter(|(hit, right)| !same(hit, right)).count();
    assert!(elsewhere * 1_000 <= rays.len(), "{elsewhere} hits name another shape");
}

#[test]
fn batches_of_any_length_are_cut_into_tiles() {
    let Some(options) = options() else { return };
    let ball = Ball::new(6, 0.1);
    let rays = rays(1_000, 3);
    let mut whole = GpuRays::from_geometry(&[ball.mesh()], &instances(), &spheres(), &options).unwrap();
    let all = whole.intersect(&rays).unwrap();
    let tiles = GpuOptions { tile_rays: 77, ..options };
    let mut cut = GpuRays::from_geometry(&[ball.mesh()], &instances(), &spheres(), &tiles).unwrap();
    for count in [0, 1, 63, 64, 65, 77, 78, 1_000] {
        assert_eq!(cut.intersect(&rays[..count]).unwrap(), all[..count]);
        let occluded: Vec<_> = all[..count].iter().map(Hit::is_some).collect();
        assert_eq!(cut.occluded(&rays[..count]).unwrap(), occluded);
    }
}

#[test]
fn an_empty_scene_is_never_hit() {
    let Some(options) = options() else { return };
    let mut gpu = GpuRays::from_geometry(&[], &[], &[], &options).unwrap();
    let rays = rays(100, 4);
    assert!(gpu.intersect(&rays).unwrap().iter().all(Hit::is_none));
    assert!(gpu.occluded(&rays).unwrap().iter().all(|&occluded| !occluded));
}

#[test]
fn odd_rays_hit_nothing_and_break_nothing() {
    let Some(options) = options() else { return };
    let sphere = [SphereGeometry { center: Vec3::ZERO, radius: 1.0 }];
    let mut gpu = GpuRays::from_geometry(&[], &[], &sphere, &options).unwrap();
    let good = Ray::new(Vec3::new(0.0, 0.0, -3.0), Vec3::Z);
    let odd = [
        Ray { direction: Vec3::ZERO, ..good },
        Ray { direction: Vec3::NAN, ..good },
        Ray { origin: Vec3::INFINITY, ..good },
        Ray { t_min: 5.0, t_max: 1.0, ..good },
        Ray { t_min: f32::NAN, t_max: f32::NAN, ..good },
        Ray { t_max: 1.9, ..good },
    ];
    assert!(gpu.intersect(&odd).unwrap().iter().all(Hit::is_none));
    let hits = gpu.intersect(&[good, Ray { t_min: 2.5, ..good }, Ray { direction: Vec3::Z * 1e-20, ..good }]).unwrap();
    let expected = [2.0, 4.0, 2e20];
    for (hit, expected) in hits.iter().zip(expected) {
        assert!((hit.t - expected).abs() < 1e-5 * expected && hit.sphere() == Some(0), "{hit:?}, not {expected}");
    }
}

/// A ground that is a part of a huge sphere, where single precision leaves some 10⁻⁷ of the radius.
#[test]
fn hits_on_a_huge_sphere_lie_on_its_surface() {
    let Some(options) = options() else { return };
    let ground = SphereGeometry { center: Vec3::new(0.0, -1_000.0, 0.0), radius: 996.0 };
    let mut gpu = GpuRays::from_geometry(&[], &[], &[ground], &options).unwrap();
    let rays = rays(5_000, 5);
    let hits = gpu.intersect(&rays).unwrap();
    assert!(hits.iter().filter(|hit| hit.is_some()).count() > 1_000);
    for (hit, ray) in hits.iter().zip(&rays).filter(|(hit, _)| hit.is_some()) {
        let point = ray.origin.as_dvec3() + f64::from(hit.t) * ray.direction.as_dvec3();
        let off = (point - ground.center.as_dvec3()).length() - f64::from(ground.radius);
        assert!(off.abs() < 2e-7 * f64::from(ground.radius), "{hit:?} of {ray:?} is {off} off the surface");
    }
}

/// A batch for either resource.
#[derive(Clone)]
struct Batch {
    accel: Arc<Accel>,
    rays: Arc<Vec<Ray>>,
    query: Primitive,
}

#[derive(Debug, PartialEq)]
enum Answer {
    Hits(Vec<Hit>),
    Occlusion(Vec<bool>),
}

impl Work for Batch {
    type Output = Answer;
    fn primitive(&self) -> Primitive {
        self.query
    }
    fn size(&self) -> u64 {
        self.rays.len() as u64
    }
    fn backup(&self) -> Option<Self> {
        Some(self.clone())
    }
}

impl RayWork for Batch {
    fn query(&self) -> Option<RayQuery<'_>> {
        match self.query {
            Primitive::Intersect => Some(RayQuery::Intersect(&self.rays)),
            Primitive::Occluded => Some(RayQuery::Occluded(&self.rays)),
            _ => None,
        }
    }
    fn hits(self, hits: Vec<Hit>) -> Answer {
        Answer::Hits(hits)
    }
    fn occlusion(self, occluded: Vec<bool>) -> Answer {
        Answer::Occlusion(occluded)
    }
}

fn on_the_processor(batch: Batch) -> Answer {
    if batch.query == Primitive::Occluded {
        let occluded = batch.rays.iter().map(|ray| batch.accel.occluded(ray)).collect();
        return batch.occlusion(occluded);
    }
    let hits = batch.rays.iter().map(|ray| batch.accel.intersect(ray)).collect();
    batch.hits(hits)
}

#[test]
fn an_allocator_with_a_processor_and_a_gpu_gets_everything_right() {
    let Some(options) = options() else { return };
    let ball = Ball::new(40, 0.1);
    let accel = Accel::build(&[ball.mesh()], &instances(), &spheres(), &BuildOptions::default()).unwrap();
    let accel = Arc::new(accel);
    let gpu = GpuRays::from_geometry(&[ball.mesh()], &instances(), &spheres(), &options).unwrap();
    let cpu = VirtualCpu::new("cpu", PrimitiveSet::ALL, on_the_processor);
    let hra = Hra::new(HraConfig::default(), vec![Box::new(gpu) as Box<dyn Resource<Batch>>, Box::new(cpu)]);
    let client = hra.client();
    let batches: Vec<_> = (0..80)
        .map(|n| {
            let query = if n % 4 == 0 { Primitive::Occluded } else { Primitive::Intersect };
            Batch { accel: Arc::clone(&accel), rays: Arc::new(rays(500, 100 + n)), query }
        })
        .collect();
    client.submit_group(batches.iter().cloned().zip(0..).map(|(batch, n)| WorkUnit::new(batch, n)).collect()).unwrap();
    let (mut hits, mut right, mut answers, mut wrong_shadows) = (Vec::new(), Vec::new(), 0, 0);
    while let Some(completed) = client.take() {
        answers += 1;
        match (completed.output.unwrap(), on_the_processor(batches[completed.ticket as usize].clone())) {
            (Answer::Hits(these), Answer::Hits(those)) => {
                hits.extend(these);
                right.extend(those);
            }
            (Answer::Occlusion(these), Answer::Occlusion(those)) => {
                assert_eq!(these.len(), those.len());
                wrong_shadows += these.iter().zip(&those).filter(|(this, that)| this != that).count();
            }
            (these, _) => panic!("an answer to another question: {these:?}"),
        }
    }
    assert_eq!(answers, batches.len());
    assert_eq!(hits.len(), 60 * 500);
    check_hits(&hits, |index| right[index].is_some().then_some(right[index].t.into()));
    assert!(wrong_shadows <= 1, "{wrong_shadows} shadow rays are wrong");
    let report = hra.report();
    let units: Vec<_> = report.resources.iter().map(|resource| (resource.units, resource.failures)).collect();
    assert!(units.iter().all(|&(units, failures)| units > 0 && failures == 0), "units and failures: {units:?}");
}

#[test]
fn a_software_adapter_is_used_only_when_asked_for_by_name() {
    let there = adapters();
    if there.is_empty() {
        eprintln!("skipped: no Vulkan adapter");
        return;
    }
    match GpuRays::from_geometry(&[], &[], &[], &GpuOptions::default()) {
        Ok(gpu) => assert_ne!(gpu.adapter().kind, AdapterKind::Software),
        Err(GpuError::SoftwareOnly(names)) => {
            assert!(there.iter().all(|adapter| adapter.kind == AdapterKind::Software));
            assert_eq!(names.len(), there.len());
        }
        Err(error) => panic!("{error}"),
    }
    let wanted = GpuOptions { adapter: Some("no such device".into()), ..GpuOptions::default() };
    let outcome = GpuRays::from_geometry(&[], &[], &[], &wanted);
    assert!(matches!(outcome, Err(GpuError::UnknownAdapter { found, .. }) if found.len() == there.len()));
}

/// Run with `cargo test -p bottega-gpu --release --test tests -- --ignored --nocapture rays_a_second`.
#[test]
#[ignore = "measures, proves nothing"]
fn rays_a_second() {
    let Some(options) = options() else { return };
    let ball = Ball::new(130, 0.1);
    let start = std::time::Instant::now();
    let mut gpu = GpuRays::from_geometry(&[ball.mesh()], &instances(), &[], &options).unwrap();
    eprintln!("{}: {} triangles there in {:?}", gpu.adapter().name, 3 * ball.triangles.len(), start.elapsed());
    for count in [1_000, 16_000, 256_000] {
        let rays = rays(count, 9);
        let best = |mut run: Box<dyn FnMut() + '_>| {
            let time = |_| {
                let start = std::time::Instant::now();
                run();
                start.elapsed()
            };
            count as f64 / (0..5).map(time).min().unwrap().as_secs_f64() / 1e6
        };
        let intersect = best(Box::new(|| drop(gpu.intersect(&rays).unwrap())));
        let occluded = best(Box::new(|| drop(gpu.occluded(&rays).unwrap())));
        eprintln!("{count} rays: {intersect:.2} M closest hits a second, {occluded:.2} M shadow rays a second");
    }
}

#[test]
#[ignore = "run by `without_a_driver_there_is_an_error_and_no_panic` in a process of its own"]
fn expects_no_driver() {
    assert_eq!(adapters(), []);
    let outcome = GpuRays::from_geometry(&[], &[], &[], &GpuOptions::default());
    assert!(matches!(outcome, Err(GpuError::NoAdapter)));
}

#[test]
fn without_a_driver_there_is_an_error_and_no_panic() {
    // The loader reads its drivers from these, once a process.
    let child = Command::new(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", "device::expects_no_driver"])
        .env("VK_DRIVER_FILES", "/nonexistent/driver.json")
        .env("VK_ICD_FILENAMES", "/nonexistent/driver.json")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&child.stdout);
    assert!(child.status.success() && said.contains("1 passed"), "{said}");
}
