//! The loop above the allocator: follows paths, and asks for hits and occlusion of their rays.

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

use super::studio::{Path, SIDE, Step, Studio};
use crate::error::CliError;

/// Batches that one loop has under way: there are as many loops as processors, so that each of these follows rays or makes some.
/// More would only push each other out of the cache.
const BATCHES_UNDER_WAY: usize = 1;
/// The same for each GPU, which is some way off.
const BATCHES_OF_A_GPU: usize = 6;
/// A unit of light, as a share of what a pixel's film counts in: sums of whole numbers do not depend on their order.
pub(super) const LIGHT_UNITS: f32 = (1 << 20) as f32;

/// What a walk has found.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Found {
    /// Rays of all kinds.
    pub(super) rays: u64,
    /// Light by pixel.
    pub(super) film: Vec<u64>,
}

impl Found {
    fn new() -> Self {
        Self { rays: 0, film: vec![0; (SIDE * SIDE) as usize] }
    }

    fn merge(&mut self, other: &Self) {
        self.rays += other.rays;
        self.film.iter_mut().zip(&other.film).for_each(|(sum, light)| *sum += light);
    }

    /// Mean light of a pixel.
    pub(super) fn light(&self) -> f64 {
        self.film.iter().map(|&light| light as f64).sum::<f64>() / f64::from(LIGHT_UNITS) / self.film.len() as f64
    }
}

/// Who does the primitives.
pub(super) enum Caller<'a> {
    /// Whoever asks, in place.
    Direct,
    /// The resources of an allocator, so many GPUs among them.
    Allocator(&'a Hra<RenderWork>, usize),
}

/// Follows `paths` paths in batches of `batch`, by so many loops at once.
pub(super) fn walk(
    studio: &Studio,
    caller: &Caller<'_>,
    paths: u64,
    batch: u32,
    loops: usize,
) -> Result<Found, CliError> {
    let next = AtomicU64::new(0);
    let source = Source { studio, paths, batch: u64::from(batch), next: &next };
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
        let mut found = Found::new();
        for one in loops {
            let one = one.join().map_err(|_| CliError::failed("a loop ended in a panic", "report it"))?;
            found.merge(&one?);
        }
        Ok(found)
    })
}

/// Where batches come from.
#[derive(Clone, Copy)]
struct Source<'a> {
    studio: &'a Studio,
    paths: u64,
    batch: u64,
    next: &'a AtomicU64,
}

impl<'a> Source<'a> {
    fn batch(&self) -> Option<Batch<'a>> {
        let first = self.next.fetch_add(self.batch, Ordering::Relaxed);
        let end = (first + self.batch).min(self.paths);
        let (paths, rays): (_, Vec<_>) = (first..end).map(|n| self.studio.path(n)).unzip();
        let rays = Arc::new(rays);
        (first < end).then_some(Batch { studio: self.studio, paths, rays, next: Vec::new(), shadows: Vec::new() })
    }
}

/// Paths that are followed together.
struct Batch<'a> {
    studio: &'a Studio,
    paths: Vec<Path>,
    /// Of each path the ray that is asked for.
    rays: Arc<Vec<Ray>>,
    next: Vec<(Path, Ray)>,
    /// Pixel, and light if it comes through.
    shadows: Vec<(u32, f32)>,
}

impl Batch<'_> {
    /// What is asked first.
    fn ask(&mut self) -> RenderWork {
        // The rays are needed again when their hits are known.
        RenderWork::Rays { scene: Arc::clone(&self.studio.prepared), rays: Arc::clone(&self.rays) }
    }

    /// Takes an answer; returns what is asked next, if the batch is not through.
    fn go_on(&mut self, answer: RenderOutput, found: &mut Found) -> Result<Option<RenderWork>, CliError> {
        match answer {
            RenderOutput::Hits(hits) => Ok(self.hits(&hits, found)),
            RenderOutput::Occlusion(occluded) => {
                found.rays += occluded.len() as u64;
                for ((pixel, light), _) in self.shadows.drain(..).zip(occluded).filter(|(_, occluded)| !occluded) {
                    found.film[pixel as usize] += (light * LIGHT_UNITS) as u64;
                }
                Ok(self.bounce())
            }
            _ => Err(CliError::failed("the allocator answered something else than was asked", "report it")),
        }
    }

    fn hits(&mut self, hits: &[Hit], found: &mut Found) -> Option<RenderWork> {
        found.rays += hits.len() as u64;
        let mut rays = Vec::with_capacity(hits.len());
        for ((path, ray), hit) in self.paths.iter().zip(self.rays.iter()).zip(hits) {
            let Step { shadow, next } = self.studio.step(*path, ray, hit);
            if let Some((ray, light)) = shadow {
                rays.push(ray);
                self.shadows.push((path.pixel, light));
            }
            self.next.extend(next);
        }
        if rays.is_empty() {
            return self.bounce();
        }
        Some(RenderWork::Occlusion { scene: Arc::clone(&self.studio.prepared), rays: Arc::new(rays) })
    }

    fn bounce(&mut self) -> Option<RenderWork> {
        let (paths, rays): (_, Vec<_>) = self.next.drain(..).unzip();
        (self.paths, self.rays) = (paths, Arc::new(rays));
        (!self.rays.is_empty()).then(|| self.ask())
    }
}

fn in_place(source: Source<'_>) -> Result<Found, CliError> {
    let mut found = Found::new();
    while let Some(mut batch) = source.batch() {
        let mut work = Some(batch.ask());
        while let Some(asked) = work {
            work = batch.go_on(asked.perform(), &mut found)?;
        }
    }
    Ok(found)
}

fn by_allocator<'a>(source: Source<'a>, client: &HraClient<RenderWork>, batches: usize) -> Result<Found, CliError> {
    let wrong = |error: &dyn std::fmt::Display| CliError::failed(error.to_string(), "this is unexpected; report it");
    let mut found = Found::new();
    let mut under_way = BTreeMap::new();
    let mut number = 0;
    let mut begin = |under_way: &mut BTreeMap<u64, Batch<'a>>| {
        let Some(mut batch) = source.batch() else { return Ok(()) };
        number += 1;
        client.submit(WorkUnit::new(batch.ask(), number)).map_err(|error| wrong(&error))?;
        under_way.insert(number, batch);
        Ok::<_, CliError>(())
    };
    for _ in 0..batches {
        begin(&mut under_way)?;
    }
    while let Some(answer) = client.take() {
        let output = answer.output.map_err(|error| wrong(&error))?;
        let Some(batch) = under_way.get_mut(&answer.ticket) else {
            return Err(wrong(&"an answer to a unit that was not asked for"));
        };
        match batch.go_on(output, &mut found)? {
            Some(work) => client.submit(WorkUnit::new(work, answer.ticket)).map_err(|error| wrong(&error))?,
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
        let studio = Studio::a().unwrap();
        let direct = walk(&studio, &Caller::Direct, 20_000, 512, 1).unwrap();
        assert!(direct.light() > 0.0 && direct.rays > 60_000, "{} rays", direct.rays);
        for lanes in [1, 3] {
            let hra = Hra::new(HraConfig::default(), VirtualCpu::lanes(lanes, RenderWork::perform));
            let found = walk(&studio, &Caller::Allocator(&hra, 0), 20_000, 777, lanes).unwrap();
            assert!(found == direct, "{lanes} lanes: {} and {} rays", found.rays, direct.rays);
        }
    }
}
