//! Rays a second: standard scenes, standard rays, and a fair clock.
//!
//! Kernels are timed interleaved, one repetition of each in turn, and medians are reported: on a busy machine only
//! ratios of the same run mean anything. Anything that implements [`RayKernel`] can take part, so that a benchmark may
//! bring other people's libraries, which this crate does not know.

#[cfg(feature = "embree")]
pub mod embree;
mod leaks;
mod random;
mod ray_kernel;
mod scenes;

pub use leaks::{Leaks, leaks};
pub use random::Random;
pub use ray_kernel::RayKernel;
pub use scenes::{BenchScene, hall, interior, noisy_sphere, stadium};

use crate::{Accel, BuildError, BuildOptions, Hit, InstanceGeometry, Precision, Ray};
use glam::{Affine3A, Vec3};
use std::fmt::Write as _;
use std::time::{Duration, Instant};

/// This crate's own kernel.
pub struct BottegaKernel {
    name: String,
    accel: Accel,
    build_time: Duration,
}

impl BottegaKernel {
    /// Builds over a scene.
    pub fn build(name: &str, scene: &BenchScene, options: &BuildOptions) -> Result<Self, BuildError> {
        let instance = InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY };
        let start = Instant::now();
        let accel = Accel::build(&[scene.geometry()], &[instance], &[], options)?;
        Ok(Self { name: name.to_owned(), accel, build_time: start.elapsed() })
    }

    /// The structure that was built.
    pub fn accel(&self) -> &Accel {
        &self.accel
    }
}

impl RayKernel for BottegaKernel {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn closest(&self, rays: &[Ray]) -> (usize, f64) {
        rays.iter().fold((0, 0.0), |(count, sum), ray| {
            let hit = self.accel.intersect(ray);
            if hit.is_some() { (count + 1, sum + f64::from(hit.t)) } else { (count, sum) }
        })
    }

    fn any(&self, rays: &[Ray]) -> usize {
        rays.iter().filter(|ray| self.accel.occluded(ray)).count()
    }

    fn steps(&self, rays: &[Ray]) -> Option<f64> {
        let mut steps = 0u64;
        for ray in rays {
            let mut count = 0;
            self.accel.intersect_counted(ray, &mut count);
            steps += u64::from(count);
        }
        Some(steps as f64 / rays.len().max(1) as f64)
    }

    fn build_time(&self) -> Duration {
        self.build_time
    }

    fn bytes(&self) -> usize {
        self.accel.memory_bytes()
    }
}

/// The kinds of rays that light transport casts.
pub struct RaySets {
    /// From a camera, row by row, in 8 × 8 blocks.
    pub primary: Vec<Ray>,
    /// From the hits of the primary rays, cosine distributed.
    pub diffuse: Vec<Ray>,
    /// From the hits of the diffuse rays.
    pub bounce: Vec<Ray>,
    /// From the hits of the primary rays to a light.
    pub shadow: Vec<Ray>,
}

impl RaySets {
    /// Makes `side` × `side` primary rays and what follows from them.
    pub fn new(accel: &Accel, scene: &BenchScene, side: u32) -> Self {
        let mut random = Random::new(7);
        // Far above the rounding of a hit point, so that no kernel meets the same surface again; far below a triangle.
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

/// Hit point and normal on the side of the ray.
fn surface(accel: &Accel, scene: &BenchScene, ray: &Ray) -> Option<(Vec3, Vec3)> {
    let hit = Some(accel.intersect(ray)).filter(Hit::is_some)?;
    let [a, b, c] = scene.triangles[hit.primitive as usize].map(|i| scene.positions[i as usize]);
    let n = (b - a).cross(c - a).try_normalize()?;
    let n = if n.dot(ray.direction) > 0.0 { -n } else { n };
    Some((a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v, n))
}

/// Figures of one kernel on one scene.
#[derive(Clone, Debug)]
pub struct Row {
    /// Kernel.
    pub name: String,
    /// Millions of rays a second: primary, diffuse, second bounce, shadow.
    pub mrays: [f64; 4],
    /// Hits found, for each kind of ray.
    pub hits: [usize; 4],
    /// How long the build took.
    pub build_time: Duration,
    /// Bytes a triangle, all in.
    pub bytes_per_triangle: f64,
    /// Nodes and leaves that an average diffuse ray visits.
    pub steps: Option<f64>,
}

/// Names of the columns of [`Row::mrays`].
pub const KINDS: [&str; 4] = ["primary", "diffuse", "bounce 2", "shadow"];

/// Rays that one kernel traces before the next has its turn: a millisecond or so.
const CHUNK: usize = 1 << 13;

/// Time that this thread has had of a processor, where the system tells; else the time of day. Other work on the machine then
/// disturbs by what it leaves in caches, not by its share of the processor.
fn clock() -> f64 {
    #[cfg(target_os = "linux")]
    {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
    }
    #[cfg(not(target_os = "linux"))]
    {
        static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
        START.get_or_init(Instant::now).elapsed().as_secs_f64()
    }
}

/// Times all kernels on all kinds of rays. They take turns chunk by chunk, and of each chunk's repetitions the median counts, so
/// that a burst of other work on the machine falls on all alike.
pub fn measure(scene: &BenchScene, rays: &RaySets, kernels: &[&dyn RayKernel], repetitions: usize) -> Vec<Row> {
    let sets = [&rays.primary, &rays.diffuse, &rays.bounce, &rays.shadow];
    let mut times = vec![[0.0; 4]; kernels.len()];
    let mut hits = vec![[0; 4]; kernels.len()];
    for (kind, set) in sets.iter().enumerate() {
        for chunk in set.chunks(CHUNK) {
            let mut turns = vec![Vec::with_capacity(repetitions); kernels.len()];
            let mut found = vec![0; kernels.len()];
            for turn in 0..repetitions * kernels.len() {
                let i = turn % kernels.len();
                let start = clock();
                found[i] = if kind == 3 { kernels[i].any(chunk) } else { kernels[i].closest(chunk).0 };
                turns[i].push(clock() - start);
            }
            for (i, turns) in turns.iter_mut().enumerate() {
                times[i][kind] += median(turns);
                hits[i][kind] += found[i];
            }
        }
    }
    let row = |(i, kernel): (usize, &&dyn RayKernel)| Row {
        name: kernel.name(),
        mrays: std::array::from_fn(|kind| sets[kind].len() as f64 / times[i][kind] / 1e6),
        hits: hits[i],
        build_time: kernel.build_time(),
        bytes_per_triangle: kernel.bytes() as f64 / scene.triangles.len().max(1) as f64,
        steps: kernel.steps(&rays.diffuse),
    };
    kernels.iter().enumerate().map(row).collect()
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// A table of figures as text.
pub fn table(scene: &BenchScene, rows: &[Row]) -> String {
    let mut out = format!("{} ({} triangles), Mrays/s\n", scene.name, scene.triangles.len());
    let _ = writeln!(
        out,
        "  {:<22} {:>8} {:>8} {:>8} {:>8}  {:>9} {:>6} {:>6}  hits",
        "kernel", KINDS[0], KINDS[1], KINDS[2], KINDS[3], "build", "B/tri", "steps"
    );
    for row in rows {
        let [a, b, c, d] = row.mrays;
        let steps = row.steps.map_or_else(String::new, |steps| format!("{steps:.2}"));
        let build = row.build_time.as_secs_f64() * 1e3;
        let _ = writeln!(
            out,
            "  {:<22} {a:>8.2} {b:>8.2} {c:>8.2} {d:>8.2}  {build:>6.1} ms {:>6.1} {steps:>6}  {:?}",
            row.name, row.bytes_per_triangle, row.hits
        );
    }
    out
}

/// The ray rates that [`run`] measured.
pub struct RayRates {
    /// Each scene with a row a kernel.
    pub scenes: Vec<(BenchScene, Vec<Row>)>,
    /// Why Embree is not among the kernels, if it is not, and what to do about it.
    pub without_embree: Option<String>,
}

/// The benchmark on built-in scenes, robust and fast, beside Embree where it is found (feature `embree`): what `bench rays` of the
/// command line shows. `side` × `side` primary rays a scene.
pub fn run(scenes: Vec<BenchScene>, side: u32, repetitions: usize, threads: usize) -> Result<RayRates, BuildError> {
    #[cfg(feature = "embree")]
    let embree = embree::Embree::find();
    #[cfg(not(feature = "embree"))]
    let embree = Err::<(), _>("built without the feature `embree`".to_owned());
    let mut report = RayRates { scenes: Vec::new(), without_embree: embree.as_ref().err().cloned() };
    for scene in scenes {
        let build = |name, precision| {
            BottegaKernel::build(name, &scene, &BuildOptions { threads, precision, ..BuildOptions::default() })
        };
        let (robust, fast) = (build("robust", Precision::Robust)?, build("fast", Precision::Fast)?);
        let rays = RaySets::new(&robust.accel, &scene, side);
        #[cfg_attr(not(feature = "embree"), expect(unused_mut, reason = "only Embree is added"))]
        let mut kernels: Vec<Box<dyn RayKernel>> = vec![Box::new(robust), Box::new(fast)];
        #[cfg(feature = "embree")]
        if let Ok(embree) = &embree {
            for setting in embree::Setting::ALL {
                match embree.build(&scene, setting, threads) {
                    Ok(peer) => kernels.push(Box::new(peer)),
                    Err(error) => report.without_embree = Some(error),
                }
            }
        }
        let kernels: Vec<&dyn RayKernel> = kernels.iter().map(AsRef::as_ref).collect();
        let rows = measure(&scene, &rays, &kernels, repetitions);
        report.scenes.push((scene, rows));
    }
    Ok(report)
}

/// The scenes that come with the program: a rough ball, a furnished room, a pot in a stadium, a hall of a million triangles.
pub fn built_in_scenes() -> Vec<BenchScene> {
    vec![noisy_sphere(), interior(), stadium(), hall()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_precisions_see_the_same_scenes() {
        for (scene, rows) in run(vec![noisy_sphere(), interior()], 24, 1, 1).unwrap().scenes {
            let [robust, fast, ..] = &rows[..] else { panic!("two rows at least") };
            for kind in 0..4 {
                let difference = robust.hits[kind].abs_diff(fast.hits[kind]);
                assert!(difference <= 2 && (kind == 3 || robust.hits[kind] > 300), "{}", table(&scene, &rows));
                assert!(robust.mrays[kind] > 0.0);
            }
            assert!(robust.bytes_per_triangle < 100.0, "{}", table(&scene, &rows));
        }
    }
}
