//! Lookouts: agents of the camera that direct photons to visible caustics.

use std::sync::Arc;

use bottega_render::{PhotonSettings, photon::PhotonWork};
use bottega_scene::Scene;
use glam::Vec3;

use super::scenes::{Subject, add_quad, add_sphere, camera, glass, lamp, matte, prepare};

const SIZE: (u32, u32) = (32, 24);
/// Number of pictures whose caustics are compared.
const RUNS: u64 = 12;

/// Nine glass balls on a floor under a lamp. The camera sees the light below one of them, the others stand around it.
fn balls() -> Scene {
    let mut scene =
        Scene { cameras: vec![camera(Vec3::new(0.0, 1.0, 1.4), Vec3::new(0.0, 0.05, 0.0), 0.4)], ..Scene::default() };
    add_quad(&mut scene, Vec3::new(-1.3, 0.0, 1.3), Vec3::X * 2.6, Vec3::NEG_Z * 2.6, matte(Vec3::splat(0.6)));
    add_quad(&mut scene, Vec3::new(-0.2, 1.8, -0.2), Vec3::X * 0.4, Vec3::Z * 0.4, lamp(Vec3::splat(30.0)));
    for (x, z) in [-0.8, 0.0, 0.8].into_iter().flat_map(|x| [-0.8, 0.0, 0.8].map(|z| (x, z))) {
        add_sphere(&mut scene, Vec3::new(x, 0.3, z), 0.2, glass());
    }
    scene
}

/// The power of the caustics below the visible ball and below the others, by seed, and the share of the photons below the visible
/// one.
fn caustics(scene: &Subject, lookouts: bool) -> ([Vec<f64>; 2], f64) {
    let settings = PhotonSettings { count: 80_000, lookouts, ..PhotonSettings::default() };
    let (mut powers, mut near, mut all) = ([Vec::new(), Vec::new()], 0.0, 0.0);
    for seed in 0..RUNS {
        let view = scene.view(SIZE);
        let (scene, prepass) = (Arc::clone(&scene.scene), Arc::clone(&scene.prepass));
        let indices = 0..settings.count / 4;
        let work = PhotonWork { scene, prepass, settings, view, only_caustics: true, seed, indices };
        let mut power = [0.0; 2];
        for photon in work.perform().caustic {
            let is_far = photon.p.with_y(0.0).length() > 0.3;
            power[usize::from(is_far)] += f64::from(photon.mark().power().element_sum()) / f64::from(settings.count);
            near += f64::from(u8::from(!is_far));
            all += 1.0;
        }
        powers.iter_mut().zip(power).for_each(|(runs, power)| runs.push(power));
    }
    (powers, near / all)
}

fn mean_and_variance(runs: &[f64]) -> (f64, f64) {
    let count = runs.len() as f64;
    let mean = runs.iter().sum::<f64>() / count;
    (mean, runs.iter().map(|run| (run - mean).powi(2)).sum::<f64>() / (count - 1.0))
}

#[test]
fn photons_go_to_the_caustics_that_are_seen_and_the_others_stay_as_bright() {
    let scene = prepare(balls());
    let ((blind, few), (sent, many)) = (caustics(&scene, false), caustics(&scene, true));
    assert!(many > 1.3 * few, "{few} {many}");
    for (place, (blind, sent)) in blind.iter().zip(&sent).enumerate() {
        let ((a, of_blind), (b, of_sent)) = (mean_and_variance(blind), mean_and_variance(sent));
        let z = (a - b) / ((of_blind + of_sent) / RUNS as f64).sqrt();
        assert!(z.abs() < 4.0 && b > 0.0, "place {place}: {a} {b}, z {z}");
    }
}
