//! Rays per second of this crate beside `obvhs`, the fastest other BVH library in Rust.
//!
//! `cargo bench -p bottega-kernels --bench rays -- [--side N] [--reps N] [--alone] [MESH.obj ...]`
//!
//! `obvhs` chooses its vector instructions when it is compiled: give it a chance with
//! `RUSTFLAGS="-C target-cpu=x86-64-v3"`. Ours are chosen at run time.
#![allow(clippy::print_stdout)]

use bottega_kernels::bench::{BenchScene, Own, RayKernel, RaySets, interior, measure, noisy_sphere, table};
use bottega_kernels::{BuildOptions, Precision, Ray};
use glam::Vec3;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use obvhs::{BvhBuildParams, triangle::Triangle};
use std::time::{Duration, Instant};

enum Tree {
    Binary(Bvh2),
    Wide(CwBvh),
}

struct Peer {
    name: String,
    tree: Tree,
    triangles: Vec<RtTriangle>,
    build_time: Duration,
}

impl Peer {
    fn build(name: &str, scene: &BenchScene, params: BvhBuildParams, wide: bool) -> Self {
        let corner = |i: u32| scene.positions[i as usize].into();
        let triangles: Vec<Triangle> =
            scene.triangles.iter().map(|t| Triangle { v0: corner(t[0]), v1: corner(t[1]), v2: corner(t[2]) }).collect();
        let start = Instant::now();
        let mut core = Duration::ZERO;
        let (tree, order) = if wide {
            let bvh = build_cwbvh_from_tris(&triangles, params, &mut core);
            let order = bvh.primitive_indices.clone();
            (Tree::Wide(bvh), order)
        } else {
            let bvh = build_bvh2_from_tris(&triangles, params, &mut core);
            let order = bvh.primitive_indices.clone();
            (Tree::Binary(bvh), order)
        };
        let triangles = order.iter().map(|&i| RtTriangle::from(&triangles[i as usize])).collect();
        Self { name: name.to_owned(), tree, triangles, build_time: start.elapsed() }
    }
}

fn convert(ray: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max)
}

impl RayKernel for Peer {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn closest(&self, rays: &[Ray]) -> (usize, f64) {
        let triangles = &self.triangles[..];
        let mut result = (0, 0.0);
        for ray in rays {
            let mut hit = RayHit::none();
            let ray = convert(ray);
            let found = match &self.tree {
                Tree::Binary(bvh) => bvh.ray_traverse(ray, &mut hit, |ray, id| triangles[id].intersect(ray)),
                Tree::Wide(bvh) => bvh.ray_traverse(ray, &mut hit, |ray, id| triangles[id].intersect(ray)),
            };
            if found {
                result = (result.0 + 1, result.1 + f64::from(hit.t));
            }
        }
        result
    }

    fn any(&self, rays: &[Ray]) -> usize {
        let triangles = &self.triangles[..];
        let misses = |ray: &&Ray| match &self.tree {
            Tree::Binary(bvh) => bvh.ray_traverse_miss(convert(ray), |ray, id| triangles[id].intersect(ray)),
            Tree::Wide(bvh) => bvh.ray_traverse_miss(convert(ray), |ray, id| triangles[id].intersect(ray)),
        };
        rays.len() - rays.iter().filter(misses).count()
    }

    fn build_time(&self) -> Duration {
        self.build_time
    }

    fn bytes(&self) -> usize {
        let nodes = match &self.tree {
            Tree::Binary(bvh) => size_of_val(&bvh.nodes[..]) + size_of_val(&bvh.primitive_indices[..]),
            Tree::Wide(bvh) => size_of_val(&bvh.nodes[..]) + size_of_val(&bvh.primitive_indices[..]),
        };
        nodes + size_of_val(&self.triangles[..])
    }
}

/// The triangles of a Wavefront OBJ file; polygons become fans.
fn read_obj(path: &str) -> std::io::Result<BenchScene> {
    let text = std::fs::read_to_string(path)?;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let mut next = || words.next().and_then(|w| w.parse().ok()).unwrap_or(0.0);
                positions.push(Vec3::new(next(), next(), next()));
            }
            Some("f") => {
                let index = |w: &str| {
                    let i: i64 = w.split('/').next().and_then(|w| w.parse().ok()).unwrap_or(1);
                    (if i < 0 { positions.len() as i64 + i } else { i - 1 }) as u32
                };
                let polygon: Vec<u32> = words.map(index).collect();
                triangles.extend((2..polygon.len()).map(|i| [polygon[0], polygon[i - 1], polygon[i]]));
            }
            _ => {}
        }
    }
    let name = std::path::Path::new(path).file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let mut scene = BenchScene::from_mesh(&name, positions, triangles);
    if name == "kitchen" {
        // The interior that comes with `obvhs`: look from inside, with the light under the ceiling.
        (scene.eye, scene.target) = (Vec3::new(3.0, 1.5, 1.4), Vec3::new(-3.9, 1.5, -1.7));
        scene.light = [Vec3::new(0.5, 2.2, -0.5), Vec3::X, Vec3::Z];
    }
    Ok(scene)
}

fn main() {
    let (mut side, mut repetitions, mut threads, mut alone) = (512, 7, 1, false);
    let mut scenes = vec![noisy_sphere(), interior()];
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut number = || args.next().and_then(|a| a.parse().ok()).expect("a number");
        match arg.as_str() {
            "--side" => side = number(),
            "--reps" => repetitions = number() as usize,
            "--threads" => threads = number() as usize,
            "--bench" => {}
            "--alone" => alone = true,
            path => scenes.push(read_obj(path).expect("an OBJ file")),
        }
    }
    let mut ratios = Vec::new();
    for scene in &scenes {
        let own = |name: &str, precision| {
            Own::build(name, scene, &BuildOptions { threads, precision, ..BuildOptions::default() })
                .expect("the scene is sound")
        };
        let (robust, fast) = (own("bottega robust", Precision::Robust), own("bottega fast", Precision::Fast));
        let rays = RaySets::new(robust.accel(), scene, side);
        let mut peers = Vec::new();
        for (preset, params) in
            [("medium", BvhBuildParams::medium_build()), ("very_slow", BvhBuildParams::very_slow_build())]
        {
            if alone {
                continue;
            }
            peers.push(Peer::build(&format!("obvhs bvh2 {preset}"), scene, params, false));
            peers.push(Peer::build(&format!("obvhs cwbvh {preset}"), scene, params, true));
        }
        let mut kernels: Vec<&dyn RayKernel> = vec![&robust, &fast];
        kernels.extend(peers.iter().map(|peer| peer as &dyn RayKernel));
        let rows = measure(scene, &rays, &kernels, repetitions);
        if alone {
            println!("{}", table(scene, &rows));
            continue;
        }
        let best = |kind: usize| rows[2..].iter().map(|row| row.mrays[kind]).fold(0.0, f64::max);
        let ratio: [f64; 4] = std::array::from_fn(|kind| rows[0].mrays[kind] / best(kind));
        println!("{}  robust / best peer: {ratio:.2?}\n", table(scene, &rows));
        ratios.push(ratio);
    }
    if alone {
        return;
    }
    let mean = |kind: usize| ratios.iter().map(|r| r[kind].ln()).sum::<f64>() / ratios.len() as f64;
    println!("geometric mean of robust / best peer: {:.2?}", [0, 1, 2, 3].map(|kind| mean(kind).exp()));
}
