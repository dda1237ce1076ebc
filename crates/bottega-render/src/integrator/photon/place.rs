//! Placement of the irradiance cache's records: the first of two passes over the picture.
//!
//! The order of the pixels depends only on the picture, coarse before fine, and each batch sees only the records of
//! earlier batches. So the records do not depend on the number of threads.

use bottega_kernels::{
    compiled::{self, Task},
    mix64,
};
use glam::Vec3;
use rayon::prelude::*;

use super::{
    PhotonIntegrator,
    gather::{GatherBuffers, GatherPath, KnownLight, RecordPoint},
};
use crate::{
    camera::BEAM,
    photon::{
        PhotonMaps,
        cache::{IrradianceCache, IrradianceRecord, Measurement, RAYS, direction},
    },
    sampler::{DimensionSet, PixelSampler},
};

/// Pixel spacing of the first and of the last round.
const STEP_FIRST: u32 = 32;
const STEP_LAST: u32 = 2;
/// Number of pixels that are searched before their records are added.
const BATCH: usize = 64;
/// Least radius of a record in pixels, and greatest radius as a share of the visible extent.
const PIXELS_MIN: f32 = 8.0;
const SHARE_MAX: f32 = 0.5;
/// Seed of the records' random numbers, distinct from those of pixels.
const RECORD_SEED: u64 = 0x6972_7261_6469_616e;

/// Builds the irradiance cache of all matte surfaces that the camera sees.
pub(super) fn records(integrator: &PhotonIntegrator<'_>, maps: &PhotonMaps) -> IrradianceCache {
    let bounds = integrator.base.prepared().accel().bounds();
    let size = bounds.max - bounds.min;
    let tolerance = integrator.photons.irradiance_cache.clamp(0.0, 1.0);
    let mut cache = IrradianceCache::new(bounds.min, size.max_element() * 1.001, tolerance);
    if !(bounds.min.is_finite() && size.is_finite()) {
        return cache;
    }
    // Search the pixels of each round, coarse to fine, and add records batch by batch
    let mut step = STEP_FIRST;
    while step >= STEP_LAST {
        for batch in pixels(integrator, step).chunks(BATCH) {
            let found: Vec<IrradianceRecord> = batch
                .par_iter()
                .filter_map(|&(x, y)| compiled::run(Search { integrator, maps, cache: &cache, x, y }))
                .collect();
            found.into_iter().for_each(|record| cache.add(record));
        }
        step /= 2;
    }
    cache.settled()
}

/// Returns the pixels of a round, shuffled so that neighbours are far apart.
fn pixels(integrator: &PhotonIntegrator<'_>, step: u32) -> Vec<(u32, u32)> {
    let (width, height) = (integrator.view.width, integrator.view.height);
    let is_new = |x: u32, y: u32| step == STEP_FIRST || !x.is_multiple_of(2 * step) || !y.is_multiple_of(2 * step);
    let rows = (0..height).step_by(step as usize);
    let mut pixels: Vec<(u32, u32)> = rows
        .flat_map(|y| (0..width).step_by(step as usize).filter(move |&x| is_new(x, y)).map(move |x| (x, y)))
        .collect();
    pixels.sort_by_key(|&(x, y)| mix64(u64::from(x) << 32 | u64::from(y)));
    pixels
}

/// Searches a pixel for a matte point where the cache has no record.
struct Search<'a> {
    integrator: &'a PhotonIntegrator<'a>,
    maps: &'a PhotonMaps,
    cache: &'a IrradianceCache,
    x: u32,
    y: u32,
}

impl Task for Search<'_> {
    type Output = Option<IrradianceRecord>;

    #[inline(always)]
    fn run(self) -> Option<IrradianceRecord> {
        let Self { integrator, maps, cache, x, y } = self;
        // Find a matte point where the cache has no record
        let sampler = PixelSampler::new(integrator.base.settings().seed ^ RECORD_SEED, x, y, 0);
        let (ray, _) = integrator.base.camera_ray(&sampler, x, y);
        let mut buffers = GatherBuffers::new(integrator).with_bounces();
        let known = KnownLight { maps, cache: None, agents: None };
        let mut path = GatherPath::new(integrator, known, sampler, &mut buffers);
        let point: RecordPoint =
            path.find_record_point(&ray).filter(|point| cache.at(point.p(), point.n(), u32::MAX).is_none())?;
        // Gather light over strata of its hemisphere
        let n: Vec3 = point.n();
        let samples: Vec<_> = (0..RAYS)
            .map(|index| {
                let [u, v, ..] = sampler.split_quad(DimensionSet::scattering(0), index, RAYS);
                path.gather_from(&point, direction(n, index, [u, v]), index)
            })
            .collect();
        // Make a record with its gradients, and bound its radius
        let radius_max = SHARE_MAX * integrator.passes.plan().extent().length_at(point.p());
        let reach = [PIXELS_MIN / BEAM * point.width(), radius_max];
        Some(IrradianceRecord::new(point.p(), n, &Measurement::new(samples, 1), reach).with_bounces(buffers.bounces()))
    }
}
