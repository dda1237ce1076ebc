//! Blocks of pixels that are rendered together, in the layout of the kernels.

use std::sync::Arc;

use bottega_hra::DataId;
use bottega_image::{Aov, Layout, Tile};
use bottega_render::flat::{FlatPicture, NONE, Portable as _, sobol_table};
use bottega_render::{BlockOutput, BlockWork, DirectLight, PathSettings, View};

use crate::error::GpuError;
use crate::shared::paths::{BatchParams, DIRECT_BSDF_SAMPLING, DIRECT_COMBINED, DIRECT_LIGHT_SAMPLING, JobRecord};

/// The maximum number of paths per batch; path numbers must fit into words.
pub(super) const PATHS_MAX: u64 = 1 << 31;

/// The settings that blocks must share to be rendered in one batch.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BatchKind {
    pub(super) data: DataId,
    pub(super) view: View,
    pub(super) settings: Arc<PathSettings>,
    pub(super) layout: Layout,
}

impl BatchKind {
    pub(super) fn of(block: &BlockWork) -> Self {
        Self {
            data: block.scene.data_id(),
            view: block.view.clone(),
            settings: Arc::clone(&block.settings),
            layout: block.tile.layout().clone(),
        }
    }

    /// Returns the floats per pixel: those of its layout, and the number of dropped samples.
    pub(super) fn stride(&self) -> usize {
        self.layout.stride() + 1
    }
}

/// Returns the number of paths of a block.
pub(super) fn path_count(block: &BlockWork) -> u64 {
    block.tile.rect().area() * block.samples.len() as u64
}

/// A batch of blocks of one kind, encoded for the kernels.
#[derive(Debug)]
pub(super) struct BlockBatch {
    pub(super) params: BatchParams,
    pub(super) words: Vec<u32>,
    pub(super) path_count: u32,
    stride: usize,
}

impl BlockBatch {
    /// Encodes a batch.
    ///
    /// - `blocks`: blocks of that kind, with fewer than [`PATHS_MAX`] paths in all.
    pub(super) fn new(kind: &BatchKind, blocks: &[&BlockWork]) -> Result<Self, GpuError> {
        let picture =
            FlatPicture::new(&kind.view, kind.settings.filter).map_err(|error| GpuError::Invalid(error.to_string()))?;
        let mut words = sobol_table();
        let picture_at = words.len() as u32;
        words.extend(&picture.words);
        let jobs_at = words.len() as u32;
        let (mut paths, mut pixels) = (0, 0);
        for block in blocks {
            let rect = block.tile.rect();
            let (area, count) = (rect.area() as u32, path_count(block) as u32);
            let job = JobRecord {
                x: rect.x0,
                y: rect.y0,
                columns: rect.width(),
                pixels: area,
                first_sample: block.samples.start,
                first_path: paths,
                first_pixel: pixels,
                paths: count,
            };
            job.put(&mut words);
            paths += count;
            pixels += area;
        }
        let settings = &kind.settings;
        let seed = bottega_render::sampler::mixed_seed(settings.seed);
        let at = |aov: Aov| kind.layout.offset(aov).map_or(NONE, |offset| offset as u32);
        let params = BatchParams {
            mixed_seed: [seed as u32, (seed >> 32) as u32],
            job_count: blocks.len() as u32,
            pixel_count: pixels,
            picture_at,
            jobs_at,
            max_depth: settings.max_depth,
            roulette_depth: settings.roulette_depth,
            light_samples: settings.light_samples.max(1),
            direct_light: match settings.direct_light {
                DirectLight::Combined => DIRECT_COMBINED,
                DirectLight::LightSampling => DIRECT_LIGHT_SAMPLING,
                DirectLight::BsdfSampling => DIRECT_BSDF_SAMPLING,
            },
            stride: kind.stride() as u32,
            albedo_at: at(Aov::Albedo),
            normal_at: at(Aov::Normal),
            depth_at: at(Aov::Depth),
            sample_max: settings.sample_max.min(f32::MAX).to_bits(),
            ..BatchParams::default()
        };
        Ok(Self { params, words, path_count: paths, stride: kind.stride() })
    }

    /// Returns the number of floats in the sums of all pixels.
    pub(super) fn sums(&self) -> usize {
        self.params.pixel_count as usize * self.stride
    }

    /// Adds sums from the device to the tiles of their blocks, which are in the batch's order.
    pub(super) fn add(&self, sums: &[u32], blocks: Vec<BlockWork>) -> Vec<BlockOutput> {
        let mut rest = sums;
        let add = |block: BlockWork| {
            let mut tile = block.tile;
            let (own, others) = rest.split_at(tile.rect().area() as usize * self.stride);
            rest = others;
            BlockOutput { dropped_count: add_to(&mut tile, own, self.stride), tile }
        };
        blocks.into_iter().map(add).collect()
    }
}

/// Adds sums to the pixels of a tile. Returns the number of dropped samples.
fn add_to(tile: &mut Tile, sums: &[u32], stride: usize) -> u64 {
    let mut dropped = 0;
    for (pixel, added) in tile.sums_mut().chunks_exact_mut(stride - 1).zip(sums.chunks_exact(stride)) {
        for (sum, &added) in pixel.iter_mut().zip(added) {
            *sum += f32::from_bits(added);
        }
        dropped += f32::from_bits(added[stride - 1]) as u64;
    }
    dropped
}
