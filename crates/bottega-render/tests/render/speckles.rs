//! A surface that does not see itself: no dark specks on things from a thousandth of a unit to a million in size, at the origin
//! and far from it, and no light through closed walls.

use bottega_render::{DirectLight, PathSettings};
use bottega_scene::{Environment, Scene};
use glam::Vec3;

use crate::render::scenes::{add_mesh, camera, color, matte, paint, prepare};

type Shape = (&'static str, Vec<Vec3>, Vec<[u32; 3]>);

/// A cube of twelve triangles, with corners at ±½.
fn cube() -> Shape {
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) - 0.5;
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    ("cube", (0..8).map(corner).collect(), triangles)
}

/// A ball of flat triangles, with diameter 1: rings from pole to pole.
fn ball() -> Shape {
    const RINGS: u32 = 16;
    const SIDES: u32 = 32;
    let mut positions = vec![Vec3::Y * 0.5];
    for ring in 1..RINGS {
        let (s, c) = (std::f32::consts::PI * ring as f32 / RINGS as f32).sin_cos();
        positions.extend((0..SIDES).map(|side| {
            let (z, x) = (std::f32::consts::TAU * side as f32 / SIDES as f32).sin_cos();
            Vec3::new(x * s, c, z * s) * 0.5
        }));
    }
    positions.push(Vec3::NEG_Y * 0.5);
    let at = |ring: u32, side: u32| 1 + (ring - 1) * SIDES + side % SIDES;
    let last = positions.len() as u32 - 1;
    let mut triangles = Vec::new();
    for side in 0..SIDES {
        triangles.push([0, at(1, side + 1), at(1, side)]);
        triangles.push([last, at(RINGS - 1, side), at(RINGS - 1, side + 1)]);
        for ring in 1..RINGS - 1 {
            let [a, b, c, d] = [at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    ("ball", positions, triangles)
}

/// Calls `check` with the darkest and the brightest pixel of each shape at each size. `places`: distances from the origin, in
/// sizes of the shape. The shape is matte, of albedo ½, under a sky of
/// radiance 1, seen from `eye` (in sizes, from its middle).
fn pictures(eye: Vec3, places: &[f32], check: impl Fn(&str, f32, f32)) {
    let settings = PathSettings { max_depth: 5, direct_light: DirectLight::BsdfSampling, ..PathSettings::default() };
    for (name, positions, triangles) in [cube(), ball()] {
        for size in [1e-3f32, 1.0, 1e3, 1e6] {
            for &away in places {
                let place = Vec3::new(0.6, 0.4, -0.7) * (size * away);
                let mut scene = Scene {
                    cameras: vec![camera(place + eye * size, place, 0.6)],
                    environment: Some(Environment::uniform(Vec3::ONE)),
                    ..Scene::default()
                };
                let positions = positions.iter().map(|p| *p * size + place).collect();
                add_mesh(&mut scene, positions, triangles.clone(), matte(Vec3::splat(0.5)));
                let tile = paint(&prepare(scene), (32, 32), 16, settings);
                let values = tile.rect().pixels().map(|(x, y)| color(&tile, x, y).x);
                let (darkest, brightest) =
                    values.fold((f32::INFINITY, 0f32), |(low, high), value| (low.min(value), high.max(value)));
                check(&format!("{name}, size {size:e}, {away:e} sizes away"), darkest, brightest);
            }
        }
    }
}

#[test]
fn convex_things_show_no_specks() {
    // A path that does not hit the shape again carries exactly ½; one that does carries ¼ or less, and would take 1/64 from its pixel.
    pictures(Vec3::new(1.7, 1.1, 1.4), &[0.0, 1e3], |what, darkest, brightest| {
        assert!((darkest - 0.5).abs() < 1e-3, "{what}: the darkest pixel is {darkest}");
        assert!((brightest - 1.0).abs() < 1e-3, "{what}: the sky is {brightest}");
    });
}

#[test]
fn no_light_comes_through_closed_walls() {
    // Only near the origin: far from it, a point that is rounded to the edge of two walls may lie behind the second.
    pictures(Vec3::new(0.11, -0.17, 0.23), &[0.0], |what, _, brightest| {
        assert_eq!(brightest, 0.0, "{what}: the brightest pixel");
    });
}
