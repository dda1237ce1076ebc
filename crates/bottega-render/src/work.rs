//! Work units that the renderer submits to the Hardware Resource Allocator, and their CPU implementation.

use std::{fmt, ops::Range, sync::Arc};

use bottega_hra::{DataId, Primitive, RayQuery, RayWork, Work};
use bottega_image::{Rect, Tile};
use bottega_kernels::{Hit, Ray};
use bottega_scene::Spectrum;

use crate::{
    ala::{Agent, AgentWork, SensorReadings, SensorWork},
    catchers::ShadowCatchers,
    error::RenderError,
    integrator::{GroupBuffer, Integrator, Wanted, WantedSurface, Wave},
    lights::LightGroups,
    photon::{IrradiancePlaces, IrradianceWork, PhotonWork, TracedPhotons},
    prepare::PreparedScene,
    prepass::Prepass,
    settings::{PathSettings, View},
    survey::{SurveyPixel, probe},
    wave_work::WaveWork,
};

/// Number of samples whose paths are traced before they are added to their pixels.
const SAMPLES_AT_ONCE: usize = 256;

/// A unit of rendering work. It refers to the scene by a pointer, and does not contain it.
#[derive(Clone)]
pub enum RenderWork {
    /// Finds the closest hit of each ray.
    Rays {
        /// The scene to render.
        scene: Arc<PreparedScene>,
        /// The rays; shared, since the submitter may need them again with the answer.
        rays: Arc<Vec<Ray>>,
    },
    /// Tests if each ray hits anything.
    Occlusion {
        /// The scene to render.
        scene: Arc<PreparedScene>,
        /// The rays; shared, since the submitter may need them again with the answer.
        rays: Arc<Vec<Ray>>,
    },
    /// Adds samples to a block of pixels.
    Block(BlockWork),
    /// Shades the paths of a wave at their vertices.
    Wave(Box<WaveWork>),
    /// Probes a block of pixels.
    Probe(ProbeWork),
    /// Traces a batch of photons from the lights.
    Photons(Box<PhotonWork>),
    /// Estimates irradiance from photons at a batch of points.
    Irradiance(IrradianceWork),
    /// Casts a batch of lighting agents from the lights.
    Agents(AgentWork),
    /// Lets agents sense their surroundings.
    Sensors(Box<SensorWork>),
}

/// A work unit that adds samples to the running sums of a block of pixels.
#[derive(Clone)]
pub struct BlockWork {
    /// The scene to render.
    pub scene: Arc<PreparedScene>,
    /// Prepass data of the scene.
    pub prepass: Arc<Prepass>,
    /// Camera and size of the picture.
    pub view: View,
    /// Settings of the integrator.
    pub settings: Arc<PathSettings>,
    /// Running sums of all previous samples; its rectangle gives the pixels.
    pub tile: Tile,
    /// Indices of the samples to add to each pixel.
    pub samples: Range<u32>,
    /// Groups of light whose sums are kept apart, in the averaged layers of the tile; `None`: there are none. Photon
    /// mapping adds nothing to them.
    pub light_groups: Option<Arc<LightGroups>>,
    /// Shadow catchers; `None`: there are none.
    pub catchers: Option<Arc<ShadowCatchers>>,
}

/// A work unit that probes a block of pixels quickly, by unguided paths.
#[derive(Clone)]
pub struct ProbeWork {
    /// The scene to render.
    pub scene: Arc<PreparedScene>,
    /// Camera and size of the picture.
    pub view: View,
    /// Settings of the paths.
    pub settings: Arc<PathSettings>,
    /// The block of pixels.
    pub rect: Rect,
    /// Number of samples per pixel; 0 counts as 1.
    pub sample_count: u32,
}

/// The output of a [`RenderWork`], of the corresponding kind.
#[derive(Clone, Debug)]
pub enum RenderOutput {
    /// Hits, one per ray.
    Hits(Vec<Hit>),
    /// Occlusion, one per ray: `true` if it hits anything.
    Occlusion(Vec<bool>),
    /// Sums of the block with the samples added.
    Block(BlockOutput),
    /// The wave with its next rays.
    Wave(Box<Wave>),
    /// Probed pixels, row-major.
    Probe(Vec<SurveyPixel>),
    /// Photons at the surfaces that they reached, in the order of their indices.
    Photons(TracedPhotons),
    /// Irradiance, one per point.
    Irradiance(IrradiancePlaces),
    /// Stored agents, in the order of their identities.
    Agents(Vec<Agent>),
    /// Readings of the agents' sensors, in the order of the agents.
    Sensors(SensorReadings),
    /// The requested picture cannot be rendered.
    Refused(Arc<RenderError>),
}

/// The output of a [`BlockWork`].
#[derive(Clone, Debug, PartialEq)]
pub struct BlockOutput {
    /// Sums of the block with the samples added.
    pub tile: Tile,
    /// Number of samples whose radiance was not finite and counted as 0.
    pub dropped_count: u64,
}

impl RenderWork {
    /// Performs the work on the calling thread. Returns the output of the corresponding kind, or
    /// [`RenderOutput::Refused`] if it failed.
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
            Self::Probe(work) => match probe(&work.scene, &work.view, &work.settings, work.rect, work.sample_count) {
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
    /// indices, so any division into ranges gives the same bits.
    ///
    /// # Errors
    /// [`RenderError::EmptyPicture`]; with photons, [`RenderError::PhotonsInMedia`].
    pub fn perform(self) -> Result<BlockOutput, RenderError> {
        let Self { scene, prepass, view, settings, mut tile, samples, light_groups, catchers } = self;
        let layout = tile.layout();
        let wanted_surface = WantedSurface::by(layout);
        let wanted = Wanted::by(layout);
        let integrator =
            Integrator::new(&scene, &prepass, &view, &settings, wanted)?.with_catchers(catchers.as_deref());
        match &integrator {
            Integrator::Paths(_) => {}
            Integrator::Photons(photons) => photons.cast(samples.clone()),
            Integrator::ByZone(both) => both.photons().cast(samples.clone()),
        }
        let mut dropped_count = 0;
        let (mut some, mut records, mut group_sums) = (Vec::new(), Vec::new(), Vec::new());
        let mut all = tile.rect().pixels().flat_map(|(x, y)| samples.clone().map(move |sample| (x, y, sample)));
        loop {
            some.clear();
            some.extend(all.by_ref().take(SAMPLES_AT_ONCE));
            if some.is_empty() {
                break;
            }
            let groups = light_groups.as_deref();
            let buffer = groups.map(|groups| GroupBuffer { groups, sums: &mut group_sums });
            integrator.paint(&some, &mut records, buffer);
            for (&(x, y, _), record) in some.iter().zip(&records) {
                dropped_count += u64::from(record.is_dropped);
                tile.add(x, y, &record.values);
            }
            if let Some(groups) = groups {
                let of_samples = group_sums.chunks_exact(groups.count());
                let of_samples = some.iter().zip(of_samples);
                of_samples.for_each(|(&(x, y, _), sums)| tile.add_layers(x, y, sums.iter().flat_map(Spectrum::as_ref)));
            }
            if catchers.is_some() {
                let seen = some.iter().zip(&records).filter(|(_, record)| record.is_caught);
                let seen: Vec<_> = seen.map(|(&sample, _)| sample).collect();
                let caught = integrator.caught(&seen);
                seen.iter().zip(&caught).for_each(|(&(x, y, _), light)| tile.add_caught(x, y, light));
            }
            if let Some(wanted) = wanted_surface {
                let surfaces = integrator.surfaces(&some, wanted);
                some.iter().zip(&surfaces).for_each(|(&(x, y, _), surface)| tile.add_surface(x, y, surface));
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
            // One bit per ray
            Self::Occlusion { rays, .. } => rays.len().div_ceil(8) as u64,
            // Running sums return as they were sent
            Self::Block(_) => self.payload_bytes(),
            Self::Wave(_)
            | Self::Probe(_)
            | Self::Photons(_)
            | Self::Irradiance(_)
            | Self::Agents(_)
            | Self::Sensors(_) => 0,
        }
    }

    /// Checks that rays have as many answers: another process may have traced them, and a missing answer must not render
    /// black.
    fn check(output: &RenderOutput, size: u64) -> Result<(), String> {
        let count = match output {
            RenderOutput::Hits(hits) => hits.len(),
            RenderOutput::Occlusion(occluded) => occluded.len(),
            _ => return Ok(()),
        };
        if count as u64 == size { Ok(()) } else { Err(format!("{count} answers to {size} rays")) }
    }

    fn backup(&self) -> Option<Self> {
        // Copying a wave costs as much as shading it
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
