//! The path loop above the allocator: traces paths by requesting hits and occlusion of their rays.

use std::{
    collections::BTreeMap,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread,
};

use bottega_hra::{Hra, HraClient, WorkUnit};
use bottega_kernels::{Hit, Ray};
use bottega_render::{RenderOutput, RenderWork};

use super::ray_scene::{PathState, PathStep, RayScene, SIDE};
use crate::error::Error;

/// The number of batches in flight per loop. There is one loop per processor, which either traces rays or generates them; more
/// batches evict each other from the cache.
const BATCHES_UNDER_WAY: usize = 1;
/// The number of batches in flight per GPU, to cover its latency.
const BATCHES_OF_A_GPU: usize = 6;
/// The unit of light in a pixel's integer sum: integer sums do not depend on their order.
pub(super) const LIGHT_UNITS: f32 = (1 << 20) as f32;

/// The result of a walk.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct WalkResult {
    /// The number of rays of all kinds.
    pub(super) rays: u64,
    /// The light per pixel, in units of 1 / [`LIGHT_UNITS`].
    pub(super) film: Vec<u64>,
}

impl WalkResult {
    fn new() -> Self {
        Self { rays: 0, film: vec![0; (SIDE * SIDE) as usize] }
    }

    fn merge(&mut self, other: &Self) {
        self.rays += other.rays;
        self.film.iter_mut().zip(&other.film).for_each(|(sum, light)| *sum += light);
    }

    /// Returns the mean light per pixel.
    pub(super) fn light(&self) -> f64 {
        self.film.iter().map(|&light| light as f64).sum::<f64>() / f64::from(LIGHT_UNITS) / self.film.len() as f64
    }
}

/// The executor of primitives.
pub(super) enum Caller<'a> {
    /// The calling thread itself.
    Direct,
    /// The resources of an allocator, and the number of GPUs among them.
    Allocator(&'a Hra<RenderWork>, usize),
}

/// Traces `paths` paths in batches of `batch`, with this many concurrent loops.
pub(super) fn walk(
    scene: &RayScene,
    caller: &Caller<'_>,
    paths: u64,
    batch: u32,
    loops: usize,
) -> Result<WalkResult, Error> {
    let next = AtomicU64::new(0);
    let source = PathSource { scene, paths, batch: u64::from(batch), next: &next };
    thread::scope(|scope| {
        let start = |_| {
            let client = match caller {
                Caller::Direct => None,
                Caller::Allocator(hra, gpus) => Some((hra.client(), BATCHES_UNDER_WAY + gpus * BATCHES_OF_A_GPU)),
            };
            scope.spawn(move || match client {
                None => in_place(source),
                Some((client, batches)) => by_allocator(source, &client, batches),
            })
        };
        let loops: Vec<_> = (0..loops).map(start).collect();
        let mut found = WalkResult::new();
        for one in loops {
            let one = one.join().map_err(|_| Error::Panic { thread: "a loop" })?;
            found.merge(&one?);
        }
        Ok(found)
    })
}

/// The source of batches.
#[derive(Clone, Copy)]
struct PathSource<'a> {
    scene: &'a RayScene,
    paths: u64,
    batch: u64,
    next: &'a AtomicU64,
}

impl<'a> PathSource<'a> {
    fn batch(&self) -> Option<PathBatch<'a>> {
        let first = self.next.fetch_add(self.batch, Ordering::Relaxed);
        let end = (first + self.batch).min(self.paths);
        let (paths, rays): (_, Vec<_>) = (first..end).map(|n| self.scene.path(n)).unzip();
        let rays = Arc::new(rays);
        (first < end).then_some(PathBatch { scene: self.scene, paths, rays, next: Vec::new(), shadows: Vec::new() })
    }
}

/// A batch of paths that are traced together.
struct PathBatch<'a> {
    scene: &'a RayScene,
    paths: Vec<PathState>,
    /// The current ray of each path.
    rays: Arc<Vec<Ray>>,
    next: Vec<(PathState, Ray)>,
    /// For each shadow ray its pixel, and the light that it adds if it is not blocked.
    shadows: Vec<(u32, f32)>,
}

impl PathBatch<'_> {
    /// Returns the first request.
    fn ask(&mut self) -> RenderWork {
        // The rays are needed again with their hits.
        RenderWork::Rays { scene: Arc::clone(&self.scene.prepared), rays: Arc::clone(&self.rays) }
    }

    /// Takes an answer; returns the next request, unless the batch is finished.
    fn go_on(&mut self, answer: RenderOutput, found: &mut WalkResult) -> Result<Option<RenderWork>, Error> {
        match answer {
            RenderOutput::Hits(hits) => Ok(self.hits(&hits, found)),
            RenderOutput::Occlusion(occluded) => {
                found.rays += occluded.len() as u64;
                for ((pixel, light), _) in self.shadows.drain(..).zip(occluded).filter(|(_, occluded)| !occluded) {
                    found.film[pixel as usize] += (light * LIGHT_UNITS) as u64;
                }
                Ok(self.bounce())
            }
            _ => Err(Error::WrongAnswer),
        }
    }

    fn hits(&mut self, hits: &[Hit], found: &mut WalkResult) -> Option<RenderWork> {
        found.rays += hits.len() as u64;
        let mut rays = Vec::with_capacity(hits.len());
        for ((path, ray), hit) in self.paths.iter().zip(self.rays.iter()).zip(hits) {
            let PathStep { shadow, next } = self.scene.step(*path, ray, hit);
            if let Some((ray, light)) = shadow {
                rays.push(ray);
                self.shadows.push((path.pixel, light));
            }
            self.next.extend(next);
        }
        if rays.is_empty() {
            return self.bounce();
        }
        Some(RenderWork::Occlusion { scene: Arc::clone(&self.scene.prepared), rays: Arc::new(rays) })
    }

    fn bounce(&mut self) -> Option<RenderWork> {
        let (paths, rays): (_, Vec<_>) = self.next.drain(..).unzip();
        (self.paths, self.rays) = (paths, Arc::new(rays));
        (!self.rays.is_empty()).then(|| self.ask())
    }
}

fn in_place(source: PathSource<'_>) -> Result<WalkResult, Error> {
    let mut found = WalkResult::new();
    while let Some(mut batch) = source.batch() {
        let mut work = Some(batch.ask());
        while let Some(queries) = work {
            work = batch.go_on(queries.perform(), &mut found)?;
        }
    }
    Ok(found)
}

fn by_allocator<'a>(
    source: PathSource<'a>,
    client: &HraClient<RenderWork>,
    batches: usize,
) -> Result<WalkResult, Error> {
    let mut found = WalkResult::new();
    let mut under_way = BTreeMap::new();
    let mut number = 0;
    let mut begin = |under_way: &mut BTreeMap<u64, PathBatch<'a>>| {
        let Some(mut batch) = source.batch() else { return Ok(()) };
        number += 1;
        client.submit(WorkUnit::new(batch.ask(), number))?;
        under_way.insert(number, batch);
        Ok::<_, Error>(())
    };
    for _ in 0..batches {
        begin(&mut under_way)?;
    }
    while let Some(answer) = client.take() {
        let output = answer.output?;
        let batch = under_way.get_mut(&answer.ticket).ok_or(Error::WrongAnswer)?;
        match batch.go_on(output, &mut found)? {
            Some(work) => client.submit(WorkUnit::new(work, answer.ticket))?,
            None => {
                under_way.remove(&answer.ticket);
                begin(&mut under_way)?;
            }
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use bottega_hra::{HraConfig, VirtualCpu};

    use super::*;

    #[test]
    fn the_allocator_finds_the_same_light_as_direct_calls() {
        let scene = RayScene::a().unwrap();
        let direct = walk(&scene, &Caller::Direct, 20_000, 512, 1).unwrap();
        assert!(direct.light() > 0.0 && direct.rays > 60_000, "{} rays", direct.rays);
        for lanes in [1, 3] {
            let hra = Hra::new(HraConfig::default(), VirtualCpu::lanes(lanes, RenderWork::perform));
            let found = walk(&scene, &Caller::Allocator(&hra, 0), 20_000, 777, lanes).unwrap();
            assert!(found == direct, "{lanes} lanes: {} and {} rays", found.rays, direct.rays);
        }
    }
}
