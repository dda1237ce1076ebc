//! The rays of a scene by kind.

use bottega_kernels::{Accel, Hit, Ray};
use glam::Vec3;

use crate::{random::Random, scenes::BenchScene};

/// The kinds of rays that light transport casts.
pub(crate) struct RaySets {
    /// Rays from the camera, row by row, in 8 × 8 blocks.
    pub(crate) primary: Vec<Ray>,
    /// Rays from the hits of the primary rays, cosine distributed.
    pub(crate) diffuse: Vec<Ray>,
    /// Rays from the hits of the diffuse rays.
    pub(crate) bounce: Vec<Ray>,
    /// Rays from the hits of the primary rays to a light.
    pub(crate) shadow: Vec<Ray>,
}

impl RaySets {
    /// Generates `side` × `side` primary rays, and the further rays from their hits.
    pub(crate) fn new(accel: &Accel, scene: &BenchScene, side: u32) -> Self {
        let mut random = Random::new(7);
        // Far above the rounding of a hit point, so that no kernel hits the same surface again; far below the size of a triangle.
        let clearance = 3e-5 * (accel.bounds().max.abs().max(accel.bounds().min.abs())).max_element();
        let primary: Vec<Ray> = scene.camera_rays(side);
        let diffuse_from = |rays: &[Ray], random: &mut Random| {
            let next = |ray: &Ray| {
                let (p, n) = surface(accel, scene, ray)?;
                let direction = random.cosine(n);
                Some(Ray::new(p + n * clearance, direction))
            };
            rays.iter().filter_map(next).collect::<Vec<_>>()
        };
        let diffuse = diffuse_from(&primary, &mut random);
        let bounce = diffuse_from(&diffuse, &mut random);
        let shadow = primary.iter().filter_map(|ray| {
            let (p, n) = surface(accel, scene, ray)?;
            let target = scene.light(random.unit(), random.unit());
            let origin = p + n * clearance.copysign(n.dot(target - p));
            Some(Ray { origin, t_min: 0.0, direction: target - origin, t_max: 0.999 })
        });
        let shadow = shadow.collect();
        Self { primary, diffuse, bounce, shadow }
    }
}

/// Returns the hit point, and the normal on the side of the ray.
fn surface(accel: &Accel, scene: &BenchScene, ray: &Ray) -> Option<(Vec3, Vec3)> {
    let hit = Some(accel.intersect(ray)).filter(Hit::is_some)?;
    let [a, b, c] = scene.triangles[hit.primitive as usize].map(|i| scene.positions[i as usize]);
    let n = (b - a).cross(c - a).try_normalize()?;
    let n = if n.dot(ray.direction) > 0.0 { -n } else { n };
    Some((a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v, n))
}
