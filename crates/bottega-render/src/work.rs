//! The units of work that the renderer asks of the Hardware Resource Allocator, and what a processor does for each.

use std::{fmt, ops::Range, sync::Arc};

use bottega_hra::{DataId, Primitive, RayQuery, RayWork, Work};
use bottega_image::{Aov, Rect, Tile};
use bottega_kernels::{Hit, Ray};

use crate::{
    PathSettings, PreparedScene, Prepass, RenderError, View, WaveWork,
    ala::{Agent, AgentWork, SensorReadings, SensorWork},
    integrator::{Integrator, Wanted, Wave},
    photon::{IrradiancePlaces, IrradianceWork, PhotonWork, TracedPhotons},
    survey::{SurveyPixel, probe},
};

/// Samples whose paths are followed before they are added to their pixels.
const SAMPLES_AT_ONCE: usize = 256;

/// A unit of rendering work. It refers to the scene and never carries it.
#[derive(Clone)]
pub enum RenderWork {
    /// The closest hit of each ray.
    Rays {
        /// The scene.
        scene: Arc<PreparedScene>,
        /// The rays, which stay where they are: whoever asks may need them again with the answer.
        rays: Arc<Vec<Ray>>,
    },
    /// Whether each ray hits anything.
    Occlusion {
        /// The scene.
        scene: Arc<PreparedScene>,
        /// The rays, which stay where they are: whoever asks may need them again with the answer.
        rays: Arc<Vec<Ray>>,
    },
    /// Samples of a block of pixels.
    Block(BlockWork),
    /// Paths of a wave at their vertices.
    Wave(Box<WaveWork>),
    /// A fast look at a block of pixels.
    Probe(ProbeWork),
    /// Photons on their way.
    Photons(Box<PhotonWork>),
    /// Irradiance from photons at a batch of points.
    Irradiance(IrradianceWork),
    /// Agents on their way.
    Agents(AgentWork),
    /// Agents that look around.
    Sensors(Box<SensorWork>),
}

/// Samples of a block of pixels, added to running sums.
#[derive(Clone)]
pub struct BlockWork {
    /// The scene.
    pub scene: Arc<PreparedScene>,
    /// What is known of it.
    pub prepass: Arc<Prepass>,
    /// The picture.
    pub view: View,
    /// How.
    pub settings: Arc<PathSettings>,
    /// The running sums of all samples before; the pixels are those of its rectangle.
    pub tile: Tile,
    /// Which samples to add to each pixel.
    pub samples: Range<u32>,
}

/// A fast look at a block of pixels, by paths that learn nothing.
#[derive(Clone)]
pub struct ProbeWork {
    /// The scene.
    pub scene: Arc<PreparedScene>,
    /// The picture.
    pub view: View,
    /// How.
    pub settings: Arc<PathSettings>,
    /// Which pixels.
    pub rect: Rect,
    /// Samples a pixel.
    pub sample_count: u32,
}

/// The output of a [`RenderWork`], of the same kind.
#[derive(Clone, Debug)]
pub enum RenderOutput {
    /// One a ray.
    Hits(Vec<Hit>),
    /// One a ray.
    Occlusion(Vec<bool>),
    /// The sums, with the samples added.
    Block(BlockOutput),
    /// The wave, with its next rays.
    Wave(Box<Wave>),
    /// One a pixel, row-major.
    Probe(Vec<SurveyPixel>),
    /// Where they arrived, in the order of their indices.
    Photons(TracedPhotons),
    /// One a point.
    Irradiance(IrradiancePlaces),
    /// Where they were stored, in the order of their identities.
    Agents(Vec<Agent>),
    /// What they found out, in the same order.
    Sensors(SensorReadings),
    /// The picture asked for cannot be painted.
    Refused(Arc<RenderError>),
}

/// The output of a [`BlockWork`].
#[derive(Clone, Debug, PartialEq)]
pub struct BlockOutput {
    /// The sums, with the samples added.
    pub tile: Tile,
    /// Samples whose radiance was not finite and counted as 0.
    pub dropped_count: u64,
}

impl RenderWork {
    /// Does the work on the calling thread.
    pub fn perform(self) -> RenderOutput {
        match self {
            Self::Rays { scene, rays } => {
                let mut hits = vec![Hit::NONE; rays.len()];
                scene.accel().intersect_batch(&rays, &mut hits);
                RenderOutput::Hits(hits)
            }
            Self::Occlusion { scene, rays } => {
                let mut occluded = vec![false; rays.len()];
                scene.accel().occluded_batch(&rays, &mut occluded);
                RenderOutput::Occlusion(occluded)
            }
            Self::Block(block) => match block.perform() {
                Ok(output) => RenderOutput::Block(output),
                Err(error) => RenderOutput::Refused(Arc::new(error)),
            },
            Self::Wave(work) => match work.perform() {
                Ok(wave) => RenderOutput::Wave(Box::new(wave)),
                Err(error) => RenderOutput::Refused(Arc::new(error)),
            },
            Self::Probe(work) => match probe(&work.scene, work.view, &work.settings, work.rect, work.sample_count) {
                Ok(pixels) => RenderOutput::Probe(pixels),
                Err(error) => RenderOutput::Refused(Arc::new(error)),
            },
            Self::Photons(work) => RenderOutput::Photons(work.perform()),
            Self::Irradiance(work) => RenderOutput::Irradiance(work.perform()),
            Self::Agents(work) => RenderOutput::Agents(work.perform()),
            Self::Sensors(work) => match (*work).perform() {
                Ok(sensed) => RenderOutput::Sensors(sensed),
                Err(error) => RenderOutput::Refused(Arc::new(error)),
            },
        }
    }

    fn scene(&self) -> &PreparedScene {
        match self {
            Self::Rays { scene, .. } | Self::Occlusion { scene, .. } => scene,
            Self::Block(block) => &block.scene,
            Self::Wave(work) => &work.scene,
            Self::Probe(probe) => &probe.scene,
            Self::Photons(work) => &work.scene,
            Self::Irradiance(work) => &work.scene,
            Self::Agents(work) => &work.scene,
            Self::Sensors(work) => &work.scene,
        }
    }
}

impl BlockWork {
    /// Adds the samples on the calling thread. Each pixel is a left fold over its samples in the order of their
    /// indices, so any cut into ranges ends with the same bits.
    pub fn perform(self) -> Result<BlockOutput, RenderError> {
        let Self { scene, prepass, view, settings, mut tile, samples } = self;
        let layout = tile.layout();
        let wanted = Wanted { albedo: layout.offset(Aov::Albedo).is_some(), cost: layout.offset(Aov::Cost).is_some() };
        let integrator = Integrator::new(&scene, &prepass, view, &settings, wanted)?;
        if let Integrator::Photons(photons) = &integrator {
            photons.cast(samples.clone());
        }
        let mut dropped_count = 0;
        let (mut some, mut records) = (Vec::new(), Vec::new());
        let mut all = tile.rect().pixels().flat_map(|(x, y)| samples.clone().map(move |sample| (x, y, sample)));
        loop {
            some.clear();
            some.extend(all.by_ref().take(SAMPLES_AT_ONCE));
            if some.is_empty() {
                break;
            }
            integrator.paint(&some, &mut records);
            for (&(x, y, _), record) in some.iter().zip(&records) {
                dropped_count += u64::from(record.is_dropped);
                tile.add(x, y, &record.values);
            }
        }
        Ok(BlockOutput { tile, dropped_count })
    }
}

impl Work for RenderWork {
    type Output = RenderOutput;

    fn primitive(&self) -> Primitive {
        match self {
            Self::Rays { .. } => Primitive::Intersect,
            Self::Occlusion { .. } => Primitive::Occluded,
            Self::Block(_) | Self::Probe(_) => Primitive::PixelBlock,
            Self::Wave(_) => Primitive::Shade,
            Self::Photons(_) | Self::Agents(_) => Primitive::PhotonBatch,
            Self::Irradiance(_) => Primitive::PhotonGather,
            Self::Sensors(_) => Primitive::SensorBatch,
        }
    }

    fn size(&self) -> u64 {
        match self {
            Self::Rays { rays, .. } | Self::Occlusion { rays, .. } => rays.len() as u64,
            Self::Block(block) => block.tile.rect().area() * block.samples.len() as u64,
            Self::Wave(work) => work.wave.path_count(),
            Self::Probe(probe) => probe.rect.area() * u64::from(probe.sample_count),
            Self::Photons(work) => work.indices.len() as u64,
            Self::Irradiance(work) => work.points.len() as u64,
            Self::Agents(work) => work.indices.len() as u64,
            Self::Sensors(work) => work.agent_count(),
        }
    }

    fn data(&self) -> Option<DataId> {
        Some(self.scene().data_id())
    }

    fn data_bytes(&self) -> u64 {
        self.scene().device_bytes()
    }

    fn payload_bytes(&self) -> u64 {
        match self {
            Self::Rays { rays, .. } | Self::Occlusion { rays, .. } => size_of_val(rays.as_slice()) as u64,
            Self::Block(block) => size_of_val(block.tile.sums()) as u64,
            Self::Wave(_)
            | Self::Probe(_)
            | Self::Photons(_)
            | Self::Irradiance(_)
            | Self::Agents(_)
            | Self::Sensors(_) => 0,
        }
    }

    fn answer_bytes(&self) -> u64 {
        match self {
            Self::Rays { rays, .. } => (rays.len() * size_of::<Hit>()) as u64,
            // Bits.
            Self::Occlusion { rays, .. } => rays.len().div_ceil(8) as u64,
            // Running sums come back as they went.
            Self::Block(_) => self.payload_bytes(),
            Self::Wave(_)
            | Self::Probe(_)
            | Self::Photons(_)
            | Self::Irradiance(_)
            | Self::Agents(_)
            | Self::Sensors(_) => 0,
        }
    }

    /// Rays have as many answers: who followed them may be another process, and what is missing would be black.
    fn check(output: &RenderOutput, size: u64) -> Result<(), String> {
        let count = match output {
            RenderOutput::Hits(hits) => hits.len(),
            RenderOutput::Occlusion(occluded) => occluded.len(),
            _ => return Ok(()),
        };
        if count as u64 == size { Ok(()) } else { Err(format!("{count} answers to {size} rays")) }
    }

    fn backup(&self) -> Option<Self> {
        // A wave is as much to copy as it is to shade.
        (!matches!(self, Self::Wave(_))).then(|| self.clone())
    }
}

impl RayWork for RenderWork {
    fn query(&self) -> Option<RayQuery<'_>> {
        match self {
            Self::Rays { rays, .. } => Some(RayQuery::Intersect(rays)),
            Self::Occlusion { rays, .. } => Some(RayQuery::Occluded(rays)),
            Self::Block(_)
            | Self::Wave(_)
            | Self::Probe(_)
            | Self::Photons(_)
            | Self::Irradiance(_)
            | Self::Agents(_)
            | Self::Sensors(_) => None,
        }
    }

    fn hits(self, hits: Vec<Hit>) -> RenderOutput {
        RenderOutput::Hits(hits)
    }

    fn occlusion(self, occluded: Vec<bool>) -> RenderOutput {
        RenderOutput::Occlusion(occluded)
    }
}

impl fmt::Debug for RenderWork {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} × {}", self.primitive(), self.size())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_that_is_too_short_or_too_long_is_none() {
        for (hits, right) in [(1, false), (2, true), (3, false)] {
            assert_eq!(RenderWork::check(&RenderOutput::Hits(vec![Hit::NONE; hits]), 2).is_ok(), right, "{hits}");
            assert_eq!(RenderWork::check(&RenderOutput::Occlusion(vec![true; hits]), 2).is_ok(), right, "{hits}");
        }
    }
}
