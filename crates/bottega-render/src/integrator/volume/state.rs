//! The state of a path through media.

use bottega_image::SurfaceValues;
use bottega_kernels::Hit;
use bottega_scene::{MediumId, Spectrum, Visibility};
use glam::Vec3;

use super::super::{group_sums::GroupSums, record::PathRecord, surface::WantedSurface};
use crate::{
    camera::RayCone,
    catchers::CatcherRole,
    density::SolidAnglePdf,
    interaction::Interaction,
    lights::{Receiver, Segment},
    prepare::PreparedScene,
    sampler::PixelSampler,
    settings::PathSettings,
};

/// The previous vertex, as multiple importance sampling needs it.
#[derive(Clone, Copy)]
pub(super) struct PreviousVertex {
    /// The point that lights were sampled for.
    pub(super) receiver: Receiver,
    /// Density of the direction taken from there; `None`: light sampling could not have found light in that direction.
    pub(super) pdf: Option<SolidAnglePdf>,
    /// Position of the receiver on its segment, if it is inside a homogeneous medium.
    pub(super) along: Option<SegmentPoint>,
}

/// A point on a segment through a homogeneous medium.
#[derive(Clone, Copy)]
pub(super) struct SegmentPoint {
    /// The segment, from its start to the next surface.
    pub(super) segment: Segment,
    /// Distance from the start of the segment.
    pub(super) distance: f32,
    /// Density of drawing the distance by extinction, per length.
    pub(super) pdf: f32,
}

/// The first surface of a path, or its first scattering in a medium.
#[derive(Clone, Copy)]
pub(super) struct FirstSurface {
    /// Its values, without motion vectors.
    pub(super) values: SurfaceValues,
    /// The hit; [`Hit::NONE`] in a medium.
    pub(super) hit: Hit,
}

/// A path through media being traced.
pub(super) struct MediumPath<'a> {
    /// The prepared scene.
    pub(super) prepared: &'a PreparedScene,
    /// Settings of the picture.
    pub(super) settings: &'a PathSettings,
    /// Random numbers of the sample.
    pub(super) sampler: PixelSampler,
    /// Time of the path, from 0 when the shutter opens to 1 when it is closed.
    pub(super) time: f32,
    /// Throughput of the path, β.
    pub(super) throughput: Spectrum,
    /// Radiance found so far.
    pub(super) radiance: Spectrum,
    /// Medium that the path is in; `None`: vacuum.
    pub(super) medium: Option<MediumId>,
    /// Factor by which radiance was compressed on entering denser solids; it does not count as loss in Russian
    /// roulette.
    pub(super) eta_scale: f32,
    /// Number of scattering events so far.
    pub(super) depth: u32,
    /// Kind of the last event.
    pub(super) event: Visibility,
    /// Number of segments so far; more than `depth` where boundaries were crossed.
    pub(super) segment: u32,
    /// Number of boundaries crossed so far.
    pub(super) boundaries: u32,
    /// Distance since the last scattering event.
    pub(super) travelled: f32,
    /// Length of the next ray.
    pub(super) reach: f32,
    /// Number of random numbers that tracking has drawn.
    pub(super) numbers_drawn: u64,
    /// Start of the next ray.
    pub(super) origin: Vec3,
    /// Direction of the next ray; unit length.
    pub(super) direction: Vec3,
    /// Ray cone, for texture filtering.
    pub(super) cone: RayCone,
    /// The previous vertex, for MIS.
    pub(super) previous: PreviousVertex,
    /// `true`: the camera does not see emitters.
    pub(super) hides_emitters: bool,
    /// The part that shadow catchers play.
    pub(super) catchers: CatcherRole<'a>,
    /// Values of the first surface to record; `None`: none.
    pub(super) wants_surface: Option<WantedSurface>,
    /// The first surface, once it is met, if it is wanted.
    pub(super) surface: Option<FirstSurface>,
    /// `true`: the albedo is wanted and not recorded yet.
    pub(super) wants_albedo: bool,
    /// `true`: costs are wanted.
    pub(super) wants_cost: bool,
    /// Record of the path.
    pub(super) record: PathRecord,
    /// Light by groups of lights, if it is wanted.
    pub(super) groups: Option<GroupSums<'a>>,
}

/// Light that arrives at the path from the end of a segment.
#[derive(Clone, Copy)]
pub(super) struct ArrivingLight<'p> {
    /// Radiance at the end of the segment, weighted by MIS.
    pub(super) radiance: Spectrum,
    /// The surface that emits it; `None`: it comes from infinity.
    pub(super) point: Option<&'p Interaction>,
}

impl MediumPath<'_> {
    /// Adds light that scattered `bounces` times.
    #[inline(always)]
    pub(super) fn add(&mut self, light: Spectrum, bounces: u32) {
        self.radiance += light;
        self.count_direct(light, bounces);
    }

    /// Adds light that scattered `bounces` times to the direct light, if it is direct.
    #[inline(always)]
    pub(super) fn count_direct(&mut self, light: Spectrum, bounces: u32) {
        if bounces <= 1 {
            self.record.add_direct(light);
        }
    }
}
