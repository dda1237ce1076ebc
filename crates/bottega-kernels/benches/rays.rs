//! Rays per second of this crate beside Embree 4, where it is installed, and `obvhs`, the fastest other BVH library in Rust.
//!
//! `cargo bench -p bottega-kernels --features embree --bench rays -- [--side N] [--reps N] [--scene NAME] [--builds N] [--obvhs]
//! [MESH.obj|MESH.ply|FOLDER ...]`
//!
//! With `BOTTEGA_SCENES` set, a real mesh and a real interior are measured, too. `obvhs` chooses its vector instructions
//! when it is compiled: give it a chance with `RUSTFLAGS="-C target-cpu=x86-64-v3"`. Ours are chosen at run time.
#![allow(clippy::print_stdout)]

mod files;

use bottega_kernels::bench::embree::{Embree, Setting};
use bottega_kernels::bench::{
    BenchScene, BottegaKernel, RayKernel, RaySets, Row, hall, interior, measure, noisy_sphere, stadium, table,
};
use bottega_kernels::{BuildOptions, Precision, Ray};
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

struct Options {
    side: u32,
    repetitions: usize,
    builds: usize,
    obvhs: bool,
    scene: Option<String>,
    paths: Vec<String>,
}

impl Options {
    fn parse() -> Self {
        let mut options = Self { side: 512, repetitions: 7, builds: 0, obvhs: false, scene: None, paths: Vec::new() };
        let mut args = std::env::args().skip(1);
        while let Some(arg) = args.next() {
            let mut value = || args.next().expect("a value after an option");
            match arg.as_str() {
                "--side" => options.side = value().parse().expect("a number"),
                "--reps" => options.repetitions = value().parse().expect("a number"),
                "--builds" => options.builds = value().parse().expect("a number"),
                "--scene" => options.scene = Some(value()),
                "--obvhs" => options.obvhs = true,
                "--bench" => {}
                path => options.paths.push(path.to_owned()),
            }
        }
        options
    }

    fn scenes(&self) -> Vec<BenchScene> {
        let wanted = |name: &str| self.scene.as_deref().is_none_or(|want| name.contains(want));
        let mut scenes = Vec::new();
        type Maker = fn() -> BenchScene;
        let built_in: [(&str, Maker); 4] =
            [("noisy sphere", noisy_sphere), ("interior", interior), ("pot in stadium", stadium), ("hall", hall)];
        scenes.extend(built_in.iter().filter(|(name, _)| wanted(name)).map(|(_, make)| make()));
        match std::env::var("BOTTEGA_SCENES") {
            Ok(folder) => {
                let real = ["meshes/wyrm.ply", "staircase2/pbrt/models"].map(|name| format!("{folder}/{name}"));
                let read = |path: &String| files::read(path).unwrap_or_else(|error| panic!("{path}: {error}"));
                scenes.extend(real.iter().filter(|path| wanted(path)).map(read));
            }
            Err(_) => println!("BOTTEGA_SCENES is not set: NO REAL MESH is measured"),
        }
        scenes
            .extend(self.paths.iter().map(|path| files::read(path).unwrap_or_else(|error| panic!("{path}: {error}"))));
        scenes
    }
}

fn own(scene: &BenchScene, precision: Precision, optimize: bool, threads: usize) -> BottegaKernel {
    let name = match (precision, optimize) {
        (Precision::Fast, true) => "bottega fast",
        (Precision::Robust, true) => "bottega robust",
        (Precision::Fast, false) => "bottega fast, quick",
        (Precision::Robust, false) => "bottega robust, quick",
    };
    let options = BuildOptions { threads, precision, optimize, ..BuildOptions::default() };
    BottegaKernel::build(name, scene, &options).expect("the scene is sound")
}

fn find<'a>(rows: &'a [Row], name: &str) -> Option<&'a Row> {
    rows.iter().find(|row| row.name == name)
}

/// Rate of `own` over the best of `peers`, for each kind of ray.
fn ratio(rows: &[Row], own: &str, peers: &[&str]) -> Option<[f64; 4]> {
    let own = find(rows, own)?;
    let peers: Option<Vec<&Row>> = peers.iter().map(|name| find(rows, name)).collect();
    let peers = peers?;
    Some(std::array::from_fn(|kind| own.mrays[kind] / peers.iter().map(|row| row.mrays[kind]).fold(0.0, f64::max)))
}

fn median(mut times: Vec<Duration>) -> f64 {
    times.sort();
    times[times.len() / 2].as_secs_f64()
}

/// Build times beside Embree's, interleaved.
fn builds(scene: &BenchScene, embree: &Embree, repetitions: usize) {
    for threads in [1, 2] {
        let mut times: [Vec<Duration>; 4] = Default::default();
        for _ in 0..repetitions {
            times[0].push(own(scene, Precision::Robust, true, threads).build_time());
            times[1].push(own(scene, Precision::Robust, false, threads).build_time());
            for (slot, setting) in [(2, Setting::Medium), (3, Setting::High)] {
                times[slot].push(embree.build(scene, setting, threads).expect("Embree builds").build_time());
            }
        }
        let [full, quick, medium, high] = times.map(median);
        println!(
            "  build, {threads} threads: bottega {:.1} ms, quick {:.1} ms, Embree medium {:.1} ms, high {:.1} ms; \
             bottega / high {:.2}, quick / medium {:.2}",
            full * 1e3,
            quick * 1e3,
            medium * 1e3,
            high * 1e3,
            full / high,
            quick / medium
        );
    }
}

fn main() {
    let options = Options::parse();
    let embree = Embree::find().inspect_err(|error| println!("NOT BESIDE EMBREE: {error}")).ok();
    let mut ratios = [Vec::new(), Vec::new(), Vec::new()];
    for scene in &options.scenes() {
        let (robust, fast) = (own(scene, Precision::Robust, true, 1), own(scene, Precision::Fast, true, 1));
        let rays = RaySets::new(robust.accel(), scene, options.side);
        let mut kernels: Vec<Box<dyn RayKernel>> = vec![Box::new(robust), Box::new(fast)];
        for setting in Setting::ALL {
            if let Some(embree) = &embree {
                kernels.push(Box::new(embree.build(scene, setting, 1).expect("Embree builds")));
            }
        }
        for (preset, params) in
            [("medium", BvhBuildParams::medium_build()), ("very_slow", BvhBuildParams::very_slow_build())]
        {
            if options.obvhs {
                kernels.push(Box::new(Peer::build(&format!("obvhs bvh2 {preset}"), scene, params, false)));
                kernels.push(Box::new(Peer::build(&format!("obvhs cwbvh {preset}"), scene, params, true)));
            }
        }
        let kernels: Vec<&dyn RayKernel> = kernels.iter().map(AsRef::as_ref).collect();
        let rows = measure(scene, &rays, &kernels, options.repetitions);
        println!("{}", table(scene, &rows));
        let obvhs: Vec<&str> =
            rows.iter().map(|row| row.name.as_str()).filter(|name| name.starts_with("obvhs")).collect();
        let pairs: [(&str, &str, &[&str]); 3] = [
            ("fast / best of Embree medium, high", "bottega fast", &["Embree medium", "Embree high"]),
            ("robust / Embree robust", "bottega robust", &["Embree robust"]),
            ("robust / best obvhs", "bottega robust", &obvhs),
        ];
        for ((name, own, peers), ratios) in pairs.into_iter().zip(&mut ratios) {
            if let Some(ratio) = ratio(&rows, own, peers).filter(|_| !peers.is_empty()) {
                println!("  {name}: {ratio:.2?}");
                ratios.push((name, ratio));
            }
        }
        if let (Some(embree), true) = (&embree, options.builds > 0) {
            builds(scene, embree, options.builds);
        }
        println!();
    }
    for ratios in ratios.iter().filter(|ratios| !ratios.is_empty()) {
        let mean = |kind: usize| (ratios.iter().map(|r| r.1[kind].ln()).sum::<f64>() / ratios.len() as f64).exp();
        let each = [0, 1, 2, 3].map(mean);
        let all = (each.iter().map(|x| x.ln()).sum::<f64>() / 4.0).exp();
        println!("geometric mean of {}: {each:.2?}, all {all:.3}", ratios[0].0);
    }
}
