//! The trees of `obvhs`, the fastest other BVH library in Rust, as a reference. It selects its vector instructions at compile
//! time.

use std::time::{Duration, Instant};

use bottega_kernels::Ray;
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris},
    ray::RayHit,
    rt_triangle::RtTriangle,
    triangle::Triangle,
};

use super::kernel::RayKernel;
use crate::scenes::BenchScene;

/// The prefix of its kernels' names.
pub(super) const PREFIX: &str = "obvhs";

/// A binary or a wide tree.
enum ObvhsTree {
    Binary(Bvh2),
    Wide(CwBvh),
}

/// A tree of `obvhs` over a scene, with its triangles in the order of the leaves.
pub(super) struct ObvhsKernel {
    name: String,
    tree: ObvhsTree,
    triangles: Vec<RtTriangle>,
    build_time: Duration,
}

impl ObvhsKernel {
    /// Builds binary trees and wide, compressed ones, with the fast and the slow preset.
    pub(super) fn all(scene: &BenchScene) -> Vec<Self> {
        let presets = [("medium", BvhBuildParams::medium_build()), ("very_slow", BvhBuildParams::very_slow_build())];
        let kernels = presets.into_iter().flat_map(|(preset, params)| {
            [("bvh2", false), ("cwbvh", true)]
                .map(|(kind, wide)| Self::build(format!("{PREFIX} {kind} {preset}"), scene, params, wide))
        });
        kernels.collect()
    }

    fn build(name: String, scene: &BenchScene, params: BvhBuildParams, wide: bool) -> Self {
        let corner = |i: u32| scene.positions[i as usize].into();
        let triangles: Vec<Triangle> =
            scene.triangles.iter().map(|t| Triangle { v0: corner(t[0]), v1: corner(t[1]), v2: corner(t[2]) }).collect();
        let start = Instant::now();
        let mut core = Duration::ZERO;
        let (tree, order) = if wide {
            let bvh = build_cwbvh_from_tris(&triangles, params, &mut core);
            let order = bvh.primitive_indices.clone();
            (ObvhsTree::Wide(bvh), order)
        } else {
            let bvh = build_bvh2_from_tris(&triangles, params, &mut core);
            let order = bvh.primitive_indices.clone();
            (ObvhsTree::Binary(bvh), order)
        };
        let triangles = order.iter().map(|&i| RtTriangle::from(&triangles[i as usize])).collect();
        Self { name, tree, triangles, build_time: start.elapsed() }
    }
}

fn convert(ray: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max)
}

impl RayKernel for ObvhsKernel {
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
                ObvhsTree::Binary(bvh) => bvh.ray_traverse(ray, &mut hit, |ray, id| triangles[id].intersect(ray)),
                ObvhsTree::Wide(bvh) => bvh.ray_traverse(ray, &mut hit, |ray, id| triangles[id].intersect(ray)),
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
            ObvhsTree::Binary(bvh) => bvh.ray_traverse_miss(convert(ray), |ray, id| triangles[id].intersect(ray)),
            ObvhsTree::Wide(bvh) => bvh.ray_traverse_miss(convert(ray), |ray, id| triangles[id].intersect(ray)),
        };
        rays.len() - rays.iter().filter(misses).count()
    }

    fn build_time(&self) -> Duration {
        self.build_time
    }

    fn bytes(&self) -> usize {
        let nodes = match &self.tree {
            ObvhsTree::Binary(bvh) => size_of_val(&bvh.nodes[..]) + size_of_val(&bvh.primitive_indices[..]),
            ObvhsTree::Wide(bvh) => size_of_val(&bvh.nodes[..]) + size_of_val(&bvh.primitive_indices[..]),
        };
        nodes + size_of_val(&self.triangles[..])
    }
}
