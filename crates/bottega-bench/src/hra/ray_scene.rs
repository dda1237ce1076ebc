//! Two scenes like the paper's, and the light transport in them.

use std::sync::Arc;

use bottega_kernels::{Hit, Ray};
use bottega_render::{PrepareOptions, PreparedScene};
use glam::Vec3;

use crate::{
    error::Error,
    scenes::{self, BenchScene},
};

/// The maximum number of bounces, as in the paper.
pub(super) const BOUNCES_MAX: u32 = 5;
/// The side of the image, in pixels.
pub(super) const SIDE: u32 = 512;

/// A scene of grey surfaces and one light.
pub(super) struct RayScene {
    /// The scene's name in the paper.
    pub(super) name: &'static str,
    /// The kind of light transport that it stands for.
    pub(super) kind: &'static str,
    pub(super) prepared: Arc<PreparedScene>,
    geometry: BenchScene,
    camera: Vec<Ray>,
    /// The albedo of all surfaces, which is also the survival probability of a path.
    albedo: f32,
}

/// The state of a path.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathState {
    pub(super) pixel: u32,
    /// The index of the path within its pixel.
    sample: u32,
    bounce: u32,
}

/// The rays that follow from a hit.
pub(super) struct PathStep {
    /// The shadow ray, and the radiance that it adds if it is not blocked.
    pub(super) shadow: Option<(Ray, f32)>,
    /// The next ray of the path, if it continues.
    pub(super) next: Option<(PathState, Ray)>,
}

impl RayScene {
    /// Returns scene A, interreflection: a hall of a million triangles with a high albedo.
    pub(super) fn a() -> Result<Self, Error> {
        Self::new("A", "interreflection", scenes::hall(), 0.8)
    }

    /// Returns scene B, direct light: an object in the open, where most paths end after one bounce.
    pub(super) fn b() -> Result<Self, Error> {
        Self::new("B", "direct light", scenes::stadium(), 0.2)
    }

    fn new(name: &'static str, kind: &'static str, geometry: BenchScene, albedo: f32) -> Result<Self, Error> {
        let scene = Arc::new(geometry.scene(albedo));
        let prepared = Arc::new(PreparedScene::new(scene, &PrepareOptions::default())?);
        Ok(Self { name, kind, prepared, camera: geometry.camera_rays(SIDE), geometry, albedo })
    }

    /// Returns the `n`-th path of the image and its first ray; pixels are visited in turn, over and over.
    pub(super) fn path(&self, n: u64) -> (PathState, Ray) {
        let pixels = self.camera.len() as u64;
        let (sample, pixel) = ((n / pixels) as u32, (n % pixels) as u32);
        (PathState { pixel, sample, bounce: 0 }, self.camera[pixel as usize])
    }

    /// Continues a path at a hit; no rays after a miss.
    pub(super) fn step(&self, path: PathState, ray: &Ray, hit: &Hit) -> PathStep {
        if hit.is_none() {
            return PathStep { shadow: None, next: None };
        }
        let [a, b, c] = self.geometry.triangles[hit.primitive as usize].map(|i| self.geometry.positions[i as usize]);
        let normal = (b - a).cross(c - a).normalize_or(Vec3::Y);
        let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
        let scale = ray.origin.abs().max_element().max(1.0) + hit.t;
        let at = ray.at(hit.t) + normal * (1e-5 * scale);
        let numbers = Numbers::of(path);
        let shadow = self.towards_light(at, normal, &numbers);
        let goes_on = path.bounce + 1 < BOUNCES_MAX && numbers.get(2) < self.albedo;
        let next = goes_on.then(|| {
            let next = PathState { bounce: path.bounce + 1, ..path };
            (next, Ray::new(at, cosine(normal, numbers.get(3), numbers.get(4))))
        });
        PathStep { shadow, next }
    }

    /// Returns a ray to a point of the one-sided light; its parameter is 1 at that point.
    fn towards_light(&self, at: Vec3, normal: Vec3, numbers: &Numbers) -> Option<(Ray, f32)> {
        let to = self.geometry.light(numbers.get(0), numbers.get(1)) - at;
        let [_, u, v] = self.geometry.light;
        let area = u.cross(v);
        let (cos, light_cos) = (normal.dot(to), area.dot(to).abs());
        let squared = to.length_squared();
        let light = cos * light_cos * self.albedo / (std::f32::consts::PI * squared * squared);
        let is_lit = cos > 0.0 && light.is_finite() && squared > 0.0;
        is_lit.then(|| (Ray { t_max: 0.9999, ..Ray::new(at, to) }, light))
    }
}

/// The random numbers of a path at a bounce.
struct Numbers(u64);

impl Numbers {
    fn of(path: PathState) -> Self {
        Self(u64::from(path.pixel) << 32 | u64::from(path.sample) << 8 | u64::from(path.bounce))
    }

    /// Returns a number in [0, 1), by the finalizer of SplitMix64 (Steele et al. 2014).
    fn get(&self, which: u64) -> f32 {
        let mut x = self.0.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(which.wrapping_mul(0xd1b5_4a32_d192_ed03));
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 40) as f32 / (1 << 24) as f32
    }
}

/// Samples a direction around `normal` with density cos θ / π.
fn cosine(normal: Vec3, u: f32, v: f32) -> Vec3 {
    let (sin, cos) = (std::f32::consts::TAU * u).sin_cos();
    let (x, y) = normal.any_orthonormal_pair();
    let radius = v.sqrt();
    (x * (radius * cos) + y * (radius * sin) + normal * (1.0 - v).max(0.0).sqrt()).normalize_or(normal)
}
