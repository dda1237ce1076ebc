//! Rays from inside closed meshes, which must all hit something.

use bottega_kernels::{Accel, BuildError, BuildOptions, InstanceGeometry, MeshGeometry, Ray};
use glam::{Affine3A, Quat, Vec3};
use rayon::prelude::*;

use super::{Random, rough_ball};

/// The leaks of rays in one mesh.
#[derive(Clone, Debug)]
pub(crate) struct Leaks {
    /// Shape, size and place of the mesh.
    pub(crate) mesh: String,
    /// Rays cast.
    pub(crate) rays: u64,
    /// Rays that hit nothing.
    pub(crate) leaks: u64,
}

/// Rays that share a stream of random numbers.
const BATCH: u64 = 1 << 16;

/// Casts some `rays` in all, with all threads: half of them in random directions, a quarter exactly at vertices, a quarter at points
/// of edges; in a rough ball of 69,168 triangles and a box of 12, at sizes from 10⁻³ to 10⁶, at the origin and ten thousand
/// times its size away, flattened into the world and as a turned instance with a tree of its own.
pub(crate) fn leaks(rays: u64) -> Result<Vec<Leaks>, BuildError> {
    let shapes = [("ball", rough_ball()), ("box", box_of_twelve())];
    let mut out = Vec::new();
    for (name, (positions, triangles)) in &shapes {
        for size in [1e-3f32, 1.0, 1e3, 1e6] {
            for away in [0.0, 1e4] {
                for copies in [1, 2] {
                    let place = size * away * Vec3::new(0.6, 0.4, -0.7);
                    let positions: Vec<Vec3> = positions.iter().map(|&p| p * size + place).collect();
                    let (count, leaks) = cast(&positions, triangles, place, size, copies, rays / 32)?;
                    let tree = if copies == 1 { "flattened" } else { "instance" };
                    let mesh = format!("{name}, size {size:e}, {away:e} sizes away, {tree}");
                    out.push(Leaks { mesh, rays: count, leaks });
                }
            }
        }
    }
    Ok(out)
}

fn cast(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    center: Vec3,
    size: f32,
    copies: u32,
    rays: u64,
) -> Result<(u64, u64), BuildError> {
    let mesh = MeshGeometry { positions, triangles };
    let turn = Affine3A::from_quat(Quat::from_rotation_y(0.7));
    let place = |copy: u32| match copies {
        1 => Affine3A::IDENTITY,
        // Beside the first, so that neither hides the other.
        _ => {
            Affine3A::from_translation(center + Vec3::X * 8.0 * size * copy as f32)
                * turn
                * Affine3A::from_translation(-center)
        }
    };
    let places: Vec<Affine3A> = (0..copies).map(place).collect();
    let instances: Vec<_> =
        places.iter().map(|&world_from_object| InstanceGeometry { mesh: 0, world_from_object }).collect();
    let options = BuildOptions { flatten_triangles: 0, ..BuildOptions::default() };
    let accel = Accel::build(&[mesh], &instances, &[], &options)?;
    let batches = rays.div_ceil(BATCH);
    let leaks = (0..batches).into_par_iter().map(|batch| {
        let mut random = Random::new(batch + 1);
        let mut leaks = 0;
        for ray in 0..BATCH {
            let mut near = || random.between(-0.3, 0.3);
            let inside = center + Vec3::new(near(), near(), near()) * size;
            let [a, b, _] = triangles[(random.unit() * triangles.len() as f32) as usize % triangles.len()];
            let [a, b] = [a, b].map(|i| positions[i as usize]);
            let (origin, target) = match ray % 4 {
                0 => (inside, a),
                1 => (inside, a + (b - a) * random.unit()),
                _ => (inside, inside + random.direction() * size),
            };
            let [origin, target] = [origin, target].map(|p| places[0].transform_point3(p));
            leaks += u64::from(!accel.occluded(&Ray::new(origin, target - origin)));
        }
        leaks
    });
    Ok((batches * BATCH, leaks.sum()))
}

fn box_of_twelve() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0;
    let quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    ((0..8).map(corner).collect(), triangles)
}
