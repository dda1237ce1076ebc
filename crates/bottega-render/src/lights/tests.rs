//! Tests of light sampling against uniform choice of a light.

use std::{sync, time::Instant};

use bottega_kernels::Ray;
use bottega_scene::{Environment, Image, ImageId, Light as SceneLight, Material, Mesh, Sides, SpotFalloff, TextureMap};
use glam::Vec2;

use super::{far::FarLight, *};
use crate::{
    color::luminance,
    prepare::{PrepareOptions, PreparedScene},
    sampler::PixelSampler,
    sampling::uniform_sphere,
};

/// Pseudo-random numbers.
fn numbers(key: u32) -> impl FnMut() -> f32 {
    let sampler = PixelSampler::new(77, key, 0, 0);
    let mut i = 0;
    move || {
        i += 1;
        sampler.hashed(i)
    }
}

fn prepare(scene: Scene) -> PreparedScene {
    let options = PrepareOptions { threads: 1, compensate_environment: false };
    PreparedScene::new(sync::Arc::new(scene), &options).unwrap()
}

fn name(kind: LightKind) -> SceneLight {
    SceneLight::new("", kind)
}

/// Adds a mesh with its own material.
fn add(scene: &mut Scene, mut mesh: Mesh, material: Material) {
    mesh.material = scene.push_material(material);
    scene.push_surface(mesh);
}

fn rectangle(corner: Vec3, x: Vec3, y: Vec3) -> Mesh {
    Mesh {
        positions: vec![corner, corner + x, corner + x + y, corner + y],
        triangles: vec![[0, 1, 2], [2, 3, 0]],
        uvs: [vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], vec![]],
        ..Mesh::default()
    }
}

/// Lights of all kinds around the origin.
fn of_all_kinds(count: u32) -> Scene {
    let mut scene = Scene::default();
    let mut next = numbers(1);
    scene.images.push(Image::from_linear_rgb(
        "spots",
        32,
        32,
        (0..1024).map(|i| if i % 37 < 3 { [5.0, 2.0, 1.0] } else { [0.02; 3] }).collect(),
    ));
    for i in 0..count {
        let place = uniform_sphere([next(), next()]) * (0.5 + 4.0 * next());
        let radiance = Vec3::new(next(), next(), next()) * 10.0_f32.powf(2.0 * next());
        let (x, y) = crate::sampling::orthonormal_basis(uniform_sphere([next(), next()]));
        let size = 0.05 + 0.5 * next();
        let emission_sides = [Sides::Front, Sides::Back, Sides::Both][i as usize % 3];
        let material = Material { emission_sides, ..Material::emitter(radiance) };
        match i % 6 {
            0 => scene.lights.push(name(LightKind::Point { position: place, intensity: radiance * 0.1 })),
            1 => scene.lights.push(name(LightKind::Spot {
                position: place,
                direction: x,
                intensity: radiance,
                cos_inner: 0.7,
                cos_outer: 0.3,
                falloff: SpotFalloff::SmoothCosine,
            })),
            2 => {
                let index = scene.push_material(material);
                scene.push_sphere(place, 0.3 * size, index);
            }
            3 => {
                let mesh = Mesh {
                    positions: vec![place, place + x * size, place + (x + y) * size],
                    triangles: vec![[0, 1, 2]],
                    ..Mesh::default()
                };
                add(&mut scene, mesh, material);
            }
            4 => add(&mut scene, rectangle(place, x * size, y * (0.3 * size)), material),
            _ => {
                let mut textured = material;
                textured.emission.texture = Some(TextureMap::new(ImageId(0)));
                let mut mesh = rectangle(place, x * size, y * size);
                // No longer a rectangle: two triangles with a texture each
                mesh.positions[2] += x * (0.2 * size * (i % 4) as f32);
                add(&mut scene, mesh, textured);
            }
        }
    }
    scene
}

fn receivers() -> impl Iterator<Item = Receiver> {
    let mut next = numbers(2);
    (0..12).map(move |i| {
        let n = if i % 3 == 0 { Vec3::ZERO } else { uniform_sphere([next(), next()]) };
        Receiver { p: uniform_sphere([next(), next()]) * 2.0 * next(), n }
    })
}

/// Returns the contribution of a light sample to the illuminance at a receiver.
fn illuminance(receiver: &Receiver, sample: &LightSample) -> f64 {
    let cosine = if receiver.n == Vec3::ZERO { 1.0 } else { receiver.n.dot(sample.wi).max(0.0) };
    f64::from(luminance(sample.radiance) * cosine / sample.pdf.per_sr())
}

/// Returns the mean of independent values, and the variance of that mean.
fn moments(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut count, mut mean, mut squares) = (0.0, 0.0, 0.0);
    for value in values {
        count += 1.0;
        let from_mean = value - mean;
        mean += from_mean / count;
        squares += from_mean * (value - mean);
    }
    (mean, squares / (count * (count - 1.0)))
}

/// Returns the illuminance by the choice under test, and by uniform choice of a light.
fn both_ways(prepared: &PreparedScene, receiver: &Receiver, count: u32) -> [(f64, f64); 2] {
    let lights = prepared.lights();
    let chosen = moments((0..count).map(|i| {
        let mut next = numbers(1000 + i);
        let u = [next(), next(), next(), next()];
        lights.sample(prepared, receiver, u).map_or(0.0, |sample| illuminance(receiver, &sample))
    }));
    let light_count = lights.lights.len() as u32;
    let uniform = moments((0..count).map(|i| {
        let mut next = numbers(9_000_000 + i);
        let light = ((next() * light_count as f32) as u32).min(light_count - 1);
        let sample = lights.sample_place(prepared, light, receiver.p, [next(), next()]);
        sample.map_or(0.0, |sample| illuminance(receiver, &sample) * f64::from(light_count))
    }));
    [chosen, uniform]
}

#[test]
fn the_tree_finds_as_much_light_as_uniform_choice_with_less_noise() {
    for light_count in [2, 5, 40, 700] {
        let prepared = prepare(of_all_kinds(light_count));
        let (mut by_tree, mut by_chance) = (0.0, 0.0);
        for receiver in receivers() {
            let [(found, variance), (expected, other)] = both_ways(&prepared, &receiver, 20_000);
            let z = (found - expected) / (variance + other).sqrt().max(1e-9);
            // 48 tests: 4.5 standard errors happen by chance once in three thousand runs.
            assert!(z.abs() < 4.5, "{light_count} lights, {receiver:?}: {found} {expected}, z = {z}");
            by_tree += variance / expected.powi(2).max(1e-12);
            by_chance += other / expected.powi(2).max(1e-12);
        }
        eprintln!("{light_count} lights: variance {:.2} of uniform choice", by_tree / by_chance);
        assert!(light_count < 40 || by_tree < 0.5 * by_chance, "{by_tree} {by_chance}");
    }
}

#[test]
fn all_lights_are_chosen_as_often_as_stated() {
    let mut scene = of_all_kinds(60);
    scene.environment = Some(Environment::uniform(Vec3::splat(0.1)));
    scene.lights.push(name(LightKind::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE, angle: 0.4 }));
    let prepared = prepare(scene);
    let lights = prepared.lights();
    for receiver in receivers() {
        // The remaining probability leads to groups of lights that all turn out to be dark
        let near: f32 = (0..lights.lights.len() as u32).map(|light| lights.pmf(&receiver, light)).sum();
        let far_share = lights.far_share(&receiver);
        assert!((0.7..1.0001).contains(&(near + far_share)), "{receiver:?} {near} {far_share}");
        let (mut far, mut chosen) = (0, 0);
        for i in 0..4000 {
            let u = (i as f32 + 0.5) / 4000.0;
            if u < far_share {
                far += 1;
            } else if let Some((light, pmf)) = lights.tree.sample(&receiver, (u - far_share) / (1.0 - far_share)) {
                assert!((pmf * (1.0 - far_share) / lights.pmf(&receiver, light) - 1.0).abs() < 1e-6);
                chosen += 1;
            }
        }
        assert!((chosen as f32 / 4000.0 - near).abs() < 0.01, "{chosen} {near}");
        assert!((far as f32 / 4000.0 - far_share).abs() < 1e-3);
    }
}

#[test]
fn a_path_that_hits_a_light_gets_the_density_of_its_sample() {
    let prepared = prepare(of_all_kinds(120));
    let lights = prepared.lights();
    let (mut met, mut same) = (0, 0);
    for receiver in receivers() {
        for i in 0..800 {
            let mut next = numbers(5000 + i);
            let u = [next(), next(), next(), next()];
            let Some(sample) = lights.sample(&prepared, &receiver, u).filter(|sample| !sample.is_delta) else {
                continue;
            };
            let hit = prepared.accel().intersect(&Ray::new(receiver.p, sample.wi));
            // Another light may hide it
            if hit.is_none() || (hit.t - sample.distance).abs() > 1e-3 * sample.distance {
                continue;
            }
            met += 1;
            let p = receiver.p + sample.wi * hit.t;
            let again = lights.hit_pdf(&prepared, &hit, &receiver, p);
            // Rounding moves a few points beyond the border of their part
            same += u32::from((again / sample.pdf - 1.0).abs() < 0.02);
        }
    }
    assert!(met > 1500 && f64::from(same) > 0.995 * f64::from(met), "{same} of {met}");
}

#[test]
fn two_triangles_that_make_a_rectangle_are_one_light() {
    let mut scene = Scene::default();
    add(&mut scene, rectangle(Vec3::new(1.0, 2.0, 3.0), Vec3::X * 2.0, Vec3::Z), Material::emitter(Vec3::ONE));
    // Almost a right angle, and two oblique triangles that share an edge
    add(&mut scene, rectangle(Vec3::ZERO, Vec3::X, Vec3::new(0.1, 1.0, 0.0)), Material::emitter(Vec3::ONE));
    let mut tilted = rectangle(Vec3::ZERO, Vec3::X, Vec3::Y);
    tilted.positions[3].z = 0.2;
    add(&mut scene, tilted, Material::emitter(Vec3::ONE));
    let prepared = prepare(scene);
    assert_eq!(prepared.lights().lights.len(), 1 + 2 + 2);
}

#[test]
fn a_light_behind_the_receiver_or_turned_away_is_never_chosen() {
    let mut scene = Scene::default();
    for (place, y) in [(Vec3::Y, Vec3::Z), (Vec3::Y * 2.0, -Vec3::Z), (Vec3::NEG_Y, -Vec3::Z)] {
        add(&mut scene, rectangle(place, Vec3::X * 0.1, y * 0.1), Material::emitter(Vec3::ONE));
    }
    let prepared = prepare(scene);
    let receiver = Receiver { p: Vec3::ZERO, n: Vec3::Y };
    let pmfs: Vec<f32> = (0..3).map(|light| prepared.lights().pmf(&receiver, light)).collect();
    assert_eq!(pmfs.iter().filter(|&&pmf| pmf > 0.0).count(), 1, "{pmfs:?}");
}

#[test]
fn distances_are_drawn_by_the_angle_that_a_light_sees() {
    let segment = Segment { origin: Vec3::new(-2.0, 1.0, 0.5), direction: Vec3::X, length: 5.0 };
    for (place, blur) in [(Vec3::ZERO, 0.0), (Vec3::new(-3.0, 0.0, 0.0), 0.1), (Vec3::new(1.0, 1.3, 0.5), 0.0)] {
        for length in [5.0, f32::INFINITY] {
            let arc = Arc::new(&Segment { length, ..segment }, place, blur);
            let mut mean = 0.0;
            for i in 0..4096 {
                let along = arc.sample((i as f32 + 0.5) / 4096.0);
                assert!(along >= 0.0 && along <= length * 1.001, "{along}");
                // ∫ e^(−t) dt over the segment.
                mean += f64::from((-along).exp() / arc.pdf(along)) / 4096.0;
            }
            let exact = 1.0 - f64::from((-length).exp());
            assert!((mean / exact - 1.0).abs() < 0.02, "{place} {length}: {mean} {exact}");
        }
    }
}

/// Returns the CPU time of this thread in nanoseconds, since the machine may be shared.
fn processor_time() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    stat.split_whitespace().next().and_then(|time| time.parse().ok()).unwrap_or(f64::NAN)
}

#[test]
#[ignore = "measures; run with --release --nocapture"]
fn time_and_noise_of_a_light_sample() {
    for light_count in [1_u32, 2, 10, 100, 1000, 10_000, 100_000] {
        let mut scene = Scene::default();
        let mut next = numbers(3);
        for _ in 0..light_count {
            let place = Vec3::new(next() - 0.5, next() * 0.2 + 0.2, next() - 0.5) * 20.0;
            let mesh = Mesh {
                positions: vec![place, place + Vec3::X * 0.05, place + Vec3::Z * 0.05],
                triangles: vec![[0, 1, 2]],
                ..Mesh::default()
            };
            add(
                &mut scene,
                mesh,
                Material { emission_sides: Sides::Both, ..Material::emitter(Vec3::splat(0.1 + next())) },
            );
        }
        let start = Instant::now();
        let prepared = prepare(scene);
        let built = start.elapsed().as_secs_f64();
        let receiver = |i: u32| {
            let mut next = numbers(i % 4096);
            Receiver { p: Vec3::new(next() - 0.5, 0.0, next() - 0.5) * 20.0, n: Vec3::Y }
        };
        let receivers: Vec<_> = (0..4096).map(receiver).collect();
        let count = 1_000_000_u32;
        let start = processor_time();
        let mut sum = 0.0;
        for i in 0..count {
            let u = [f64::from(i) * 0.618_033_988_749, f64::from(i) * 0.754_877_666, f64::from(i) * 0.569_840_29];
            let u = u.map(|u| u.fract() as f32);
            let receiver = &receivers[(i % 4096) as usize];
            if let Some(sample) = prepared.lights().sample(&prepared, receiver, [u[0], u[1], u[2], 0.0]) {
                sum += sample.pdf.per_sr();
            }
        }
        let nanoseconds = (processor_time() - start) / f64::from(count);
        let (mut tree, mut chance) = (0.0, 0.0);
        for receiver in receivers.iter().take(16) {
            let [(mean, variance), (_, other)] = both_ways(&prepared, receiver, 20_000);
            tree += variance / mean.powi(2);
            chance += other / mean.powi(2);
        }
        eprintln!(
            "{light_count} lights: {nanoseconds:.0} ns a sample, prepared in {built:.3} s, {} bytes a light; \
             error of uniform choice over that of the tree: {:.1} ({sum:.1e})",
            prepared.lights().memory_bytes() / light_count as usize,
            (chance / tree).sqrt()
        );
    }
}

/// Groups of neighbouring lights, of which every third is visible.
fn is_seen(light: u32) -> bool {
    (light / 8).is_multiple_of(3)
}

/// Returns light samples of a place from which some lights are visible.
fn requested(prepared: &PreparedScene, receiver: &Receiver, count: u32) -> Vec<RequestedLight> {
    let one = |i: u32| {
        let mut next = numbers(20_000 + i);
        let sample = prepared.lights().sample(prepared, receiver, [next(), next(), next(), next()])?;
        let found = illuminance(receiver, &sample) as f32;
        Some(RequestedLight { light: sample.light, found, is_seen: found > 0.0 && is_seen(sample.light) })
    };
    (0..count).filter_map(one).collect()
}

#[test]
fn a_learnt_choice_draws_by_its_probabilities_and_finds_visible_lights() {
    let mut scene = of_all_kinds(90);
    scene.environment = Some(Environment::uniform(Vec3::splat(0.1)));
    let prepared = prepare(scene);
    let lights = prepared.lights();
    let count = lights.lights.len() as u32;
    let (mut learnt, mut by_choice, mut by_tree) = (0, 0.0, 0.0);
    for receiver in receivers() {
        let Some(choice) = lights.learn(&requested(&prepared, &receiver, 2000)) else { continue };
        assert_eq!(Choice::from_numbers(&choice.to_numbers()), Some(choice));
        learnt += 1;
        // Each light is drawn with its stated probability, light from infinity with the remaining one
        let sum: f32 = (0..count).map(|light| lights.pmf_by(&receiver, &choice, light)).sum();
        assert!(sum < 1.0001, "{sum}");
        let (mut drawn, mut far) = (vec![0.0_f64; count as usize], 0.0);
        let draws = 40_000;
        let seen = |sample: &LightSample| if is_seen(sample.light) { illuminance(&receiver, sample) } else { 0.0 };
        let (mut found, mut expected) = (Vec::new(), Vec::new());
        for i in 0..draws {
            let mut next = numbers(100_000 + i);
            let u = [next(), next(), next(), next()];
            let sample = lights.sample_by(&prepared, &receiver, &choice, u);
            if let Some(sample) = sample {
                match drawn.get_mut(sample.light as usize) {
                    Some(times) => {
                        *times += 1.0 / f64::from(draws);
                        let pmf = lights.pmf_by(&receiver, &choice, sample.light);
                        assert!((pmf / sample.pmf - 1.0).abs() < 1e-5);
                    }
                    None => {
                        far += 1.0 / f64::from(draws);
                        let pdf = lights.far_pdf(&receiver, Some(&choice), FarLight::Environment, sample.wi);
                        assert!((pdf / sample.pdf - 1.0).abs() < 1e-3, "{pdf:?} {:?}", sample.pdf);
                    }
                }
            }
            found.push(sample.as_ref().map_or(0.0, seen));
            expected.push(lights.sample(&prepared, &receiver, u).as_ref().map_or(0.0, seen));
        }
        for (light, &times) in (0..).zip(&drawn) {
            let pmf = f64::from(lights.pmf_by(&receiver, &choice, light));
            // (A sample of a dark light is `None`.)
            let error = 5.0 * (pmf / f64::from(draws)).sqrt() + 1e-4;
            assert!(times < pmf + error, "{light}: {times} {pmf}");
        }
        let share = f64::from(lights.far_share(&receiver));
        assert!(choice.seen(NO_LIGHT) < 0.1 || far > 0.2 * share, "{far} {share}");
        let [(found, variance), (expected, other)] = [found, expected].map(|all| moments(all.into_iter()));
        let z = (found - expected) / (variance + other).sqrt().max(1e-9);
        assert!(z.abs() < 4.5, "{receiver:?}: {found} {expected}, z = {z}");
        by_choice += variance / expected.powi(2).max(1e-12);
        by_tree += other / expected.powi(2).max(1e-12);
    }
    eprintln!("variance {:.2} of the tree's", by_choice / by_tree);
    assert!(learnt > 6 && by_choice < 0.8 * by_tree, "{learnt} {by_choice} {by_tree}");
}
