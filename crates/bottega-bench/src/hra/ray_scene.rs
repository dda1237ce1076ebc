//! The two scenes of the paper's kind, and what light does in them.

use std::sync::Arc;

use bottega_kernels::{Hit, Ray};
use bottega_render::{PrepareOptions, PreparedScene};
use glam::Vec3;

use crate::{
    error::Error,
    scenes::{self, BenchScene},
};

/// Longest path: the paper's maximum of bounces.
pub(super) const BOUNCES_MAX: u32 = 5;
/// Side of the picture.
pub(super) const SIDE: u32 = 512;

/// A scene of grey surfaces and one light.
pub(super) struct RayScene {
    /// As the paper calls it.
    pub(super) name: &'static str,
    /// What it stands for.
    pub(super) kind: &'static str,
    pub(super) prepared: Arc<PreparedScene>,
    geometry: BenchScene,
    camera: Vec<Ray>,
    /// Share of light that a surface gives back: the probability that a path goes on.
    albedo: f32,
}

/// Where a path is.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathState {
    pub(super) pixel: u32,
    /// Which of the paths of that pixel.
    sample: u32,
    bounce: u32,
}

/// What follows from a hit.
pub(super) struct PathStep {
    /// Towards the light, with what it gives where nothing is in between.
    pub(super) shadow: Option<(Ray, f32)>,
    /// Where the path goes on.
    pub(super) next: Option<(PathState, Ray)>,
}

impl RayScene {
    /// Interreflection: a hall of a million triangles that gives back most of the light.
    pub(super) fn a() -> Result<Self, Error> {
        Self::new("A", "interreflection", scenes::hall(), 0.8)
    }

    /// Direct light: an object in the open, of which most paths end after a bounce.
    pub(super) fn b() -> Result<Self, Error> {
        Self::new("B", "direct light", scenes::stadium(), 0.2)
    }

    fn new(name: &'static str, kind: &'static str, geometry: BenchScene, albedo: f32) -> Result<Self, Error> {
        let scene = Arc::new(geometry.scene(albedo));
        let prepared = Arc::new(PreparedScene::new(scene, &PrepareOptions::default())?);
        Ok(Self { name, kind, prepared, camera: geometry.camera_rays(SIDE), geometry, albedo })
    }

    /// The `n`-th path of the picture and its first ray: all pixels once, then all of them again.
    pub(super) fn path(&self, n: u64) -> (PathState, Ray) {
        let pixels = self.camera.len() as u64;
        let (sample, pixel) = ((n / pixels) as u32, (n % pixels) as u32);
        (PathState { pixel, sample, bounce: 0 }, self.camera[pixel as usize])
    }

    /// What a path does where its ray hit; nothing where it hit nothing.
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

    /// A ray to a point of the light, which is dark behind; lengths along it are shares of the way.
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

/// Numbers of a path at a bounce, that look like chance.
struct Numbers(u64);

impl Numbers {
    fn of(path: PathState) -> Self {
        Self(u64::from(path.pixel) << 32 | u64::from(path.sample) << 8 | u64::from(path.bounce))
    }

    /// In [0, 1). The finalizer of SplitMix64 (Steele et al. 2014).
    fn get(&self, which: u64) -> f32 {
        let mut x = self.0.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(which.wrapping_mul(0xd1b5_4a32_d192_ed03));
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 40) as f32 / (1 << 24) as f32
    }
}

/// A direction about `normal`, as often as its cosine is large.
fn cosine(normal: Vec3, u: f32, v: f32) -> Vec3 {
    let (sin, cos) = (std::f32::consts::TAU * u).sin_cos();
    let (x, y) = normal.any_orthonormal_pair();
    let radius = v.sqrt();
    (x * (radius * cos) + y * (radius * sin) + normal * (1.0 - v).max(0.0).sqrt()).normalize_or(normal)
}
