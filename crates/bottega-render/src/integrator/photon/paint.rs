//! Rendering of samples with photons, and the preparation of maps, cache and agents.

use std::ops::Range;

use bottega_kernels::compiled::{self, Task};

use super::{
    super::record::PathRecord,
    PhotonIntegrator,
    gather::{GatherBuffers, GatherPath, KnownLight},
    place,
};
use crate::{ala::Agents, camera::CameraRay, photon::cache::IrradianceCache, sampler::PixelSampler};

impl PhotonIntegrator<'_> {
    /// Traces the photons that some samples need, and builds the irradiance cache and the lighting agents, if they are
    /// used and do not exist yet. Uses all threads that the scene was prepared with.
    ///
    /// - `samples`: indices of the samples; only a progressive picture has photons for each.
    pub fn cast(&self, samples: Range<u32>) {
        // Trace the photons of each pass; all samples share one pass unless the rendering is progressive
        for sample in samples {
            self.passes.of_sample(self.base.prepared(), sample);
            if !self.photons.progressive {
                break;
            }
        }
        self.cache();
        self.agents();
    }

    /// Returns the irradiance cache, if one is used; the first caller has it built.
    fn cache(&self) -> Option<&IrradianceCache> {
        let prepared = self.base.prepared();
        let make = || prepared.on_threads(|| place::records(self, self.passes.of_sample(prepared, 0)));
        self.cache.as_ref().map(|cache| cache.get_or_init(make))
    }

    /// Returns the lighting agents, if any are used; the first caller has them cast.
    fn agents(&self) -> Option<&Agents> {
        let settings = self.photons.agents?;
        let prepared = self.base.prepared();
        let make = || {
            prepared.on_threads(|| {
                let maps = self.passes.of_sample(prepared, 0);
                Agents::new(prepared, settings, self, maps, self.base.settings().seed)
                    .unwrap_or_else(|_| unreachable!("errands on this machine are run"))
            })
        };
        Some(self.passes.agents(make))
    }

    /// Traces samples, given as (x, y, sample index). Replaces the contents of `records` with their records, in the
    /// same order.
    pub(crate) fn paint(&self, samples: &[(u32, u32, u32)], records: &mut Vec<PathRecord>) {
        records.clear();
        let mut buffers = GatherBuffers::new(self);
        let (cache, agents) = (self.cache(), self.agents());
        for &(x, y, index) in samples {
            // Generate the camera ray, and trace it with the maps of its pass
            let sampler = PixelSampler::new(self.base.settings().seed, x, y, index);
            let (ray, factor) = self.base.camera_ray(&sampler, x, y);
            let maps = self.passes.of_sample(self.base.prepared(), index);
            let known = KnownLight { maps, cache, agents };
            let sample = PixelSample { integrator: self, known, sampler, ray, buffers: &mut buffers };
            records.push(compiled::run(sample).scaled(factor));
        }
        if let Some(agents) = agents {
            agents.count(&buffers.tally);
        }
    }
}

/// One sample of a pixel to trace.
struct PixelSample<'a> {
    integrator: &'a PhotonIntegrator<'a>,
    known: KnownLight<'a>,
    sampler: PixelSampler,
    ray: CameraRay,
    buffers: &'a mut GatherBuffers,
}

impl Task for PixelSample<'_> {
    type Output = PathRecord;

    #[inline(always)]
    fn run(self) -> PathRecord {
        GatherPath::new(self.integrator, self.known, self.sampler, self.buffers).trace(&self.ray)
    }
}
