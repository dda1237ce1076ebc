//! A path through media, under way.

use bottega_scene::{MediumId, Spectrum};
use glam::Vec3;

use super::super::record::PathRecord;
use crate::{
    PathSettings, PreparedScene,
    camera::RayCone,
    lights::{Receiver, Segment},
    sampler::PixelSampler,
};

/// Where the path comes from, as far as multiple importance sampling must know.
#[derive(Clone, Copy)]
pub(super) struct Previous {
    /// The point for which lights were sampled.
    pub(super) receiver: Receiver,
    /// Density per solid angle of the direction taken; `None`: light sampling could not have found what comes.
    pub(super) pdf: Option<f32>,
    /// Where that point is on a segment through a medium, if it is in one.
    pub(super) along: Option<SegmentPoint>,
}

/// A point of a segment through a medium.
#[derive(Clone, Copy)]
pub(super) struct SegmentPoint {
    pub(super) segment: Segment,
    pub(super) distance: f32,
    /// Density of the distance as drawn by extinction.
    pub(super) pdf: f32,
}

/// A path under way.
pub(super) struct Path<'a> {
    pub(super) prepared: &'a PreparedScene,
    pub(super) settings: &'a PathSettings,
    pub(super) sampler: PixelSampler,
    pub(super) throughput: Spectrum,
    pub(super) radiance: Spectrum,
    /// What the path is in; `None`: vacuum.
    pub(super) medium: Option<MediumId>,
    /// What the throughput owes to radiance that was squeezed into a denser solid, not to losses.
    pub(super) eta_scale: f32,
    pub(super) depth: u32,
    /// Segments so far; more than `depth` where boundaries of media were crossed.
    pub(super) segment: u32,
    pub(super) boundaries: u32,
    /// How far the path came since it was scattered last.
    pub(super) travelled: f32,
    /// How far the next ray sees surfaces.
    pub(super) reach: f32,
    /// Numbers that tracking took so far.
    pub(super) numbers_drawn: u64,
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    pub(super) cone: RayCone,
    pub(super) previous: Previous,
    pub(super) hides_emitters: bool,
    pub(super) wants_albedo: bool,
    pub(super) wants_cost: bool,
    pub(super) record: PathRecord,
}
