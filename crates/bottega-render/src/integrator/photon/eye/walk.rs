//! A path under way: where it is, what it carries, and how it goes on.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::super::super::transport::{self, SCATTERED_SPREAD};
use crate::{
    PreparedScene,
    bsdf::{BsdfAt, BsdfSample},
    camera::{CameraRay, RayCone},
    interaction::Interaction,
    lights::Receiver,
};

/// What is known of the light that a path may run into.
#[derive(Clone, Copy)]
pub(super) enum ArrivalKind {
    /// From the camera, over mirrors and glass at most: all that shines is seen.
    Camera,
    /// From a point that spreads light: lights were sampled there, too.
    Spread {
        receiver: Receiver,
        /// Density with which the direction was drawn.
        pdf: f32,
        /// Whether the surface scatters there sharply.
        is_sharp: bool,
    },
    /// From such a point over mirrors and glass: photons stand for what shines, unless the point scattered sharply.
    Mirrored { sharply: bool },
}

/// A path under way.
#[derive(Clone, Copy)]
pub(super) struct Walk {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    pub(super) cone: RayCone,
    /// How far from the camera it starts, and how far its next ray sees surfaces.
    pub(super) start: f32,
    pub(super) reach: f32,
    pub(super) throughput: Spectrum,
    /// Of the solid that it is in.
    pub(super) absorption: Spectrum,
    /// By how much radiance was squeezed into denser solids.
    pub(super) squeezed: f32,
    /// Surfaces that it has left.
    pub(super) depth: u32,
    /// Which numbers it takes: beyond all those of the path that it split from.
    pub(super) vertex: u32,
    pub(super) comes: ArrivalKind,
    /// Whether only what shines is looked for, at the next surface.
    pub(super) is_short: bool,
    /// How much counts of all that does not shine straight at the next surface: the rest is known.
    pub(super) unknown: f32,
}

impl Walk {
    pub(super) fn of_camera(ray: &CameraRay) -> Self {
        Self {
            origin: ray.origin,
            direction: ray.direction,
            cone: ray.cone,
            start: ray.start,
            reach: ray.reach,
            throughput: Spectrum::ONE,
            absorption: Spectrum::ZERO,
            squeezed: 1.0,
            depth: 0,
            vertex: 0,
            comes: ArrivalKind::Camera,
            is_short: false,
            unknown: 1.0,
        }
    }
}

/// What a path that comes to a surface has left to find.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Remainder {
    Nothing,
    /// What shines straight at the surface.
    Lamps,
    /// All the rest.
    Light,
}

/// How much of the light of lamps is found by looking for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LightShare {
    /// All of it: the path ends here.
    All,
    /// The share that is left by those paths that go on and run into them.
    Mis,
}

/// What goes on at a surface.
pub(super) struct Place<'b> {
    pub(super) point: &'b Interaction,
    pub(super) bsdf: &'b BsdfAt<'b>,
    pub(super) receiver: Receiver,
    pub(super) wo: Vec3,
}

/// Goes on in a direction that was drawn. False where that leads nowhere.
pub(super) fn scatter(
    prepared: &PreparedScene,
    walk: &mut Walk,
    place: &Place<'_>,
    sample: &BsdfSample,
    part: f32,
) -> bool {
    let point = place.point;
    let wi = point.to_world(sample.wi);
    let is_reflection = point.is_reflection(wi);
    if (sample.wi.z > 0.0) != is_reflection {
        return false;
    }
    walk.throughput *= sample.weight() * part;
    if !is_reflection {
        let known = prepared.material(point.material).1;
        if known.parts_media {
            walk.absorption = known.absorption[usize::from(point.front)];
        }
        walk.squeezed *= sample.eta * sample.eta;
    }
    if sample.is_delta() {
        if let ArrivalKind::Spread { is_sharp, .. } = walk.comes {
            walk.comes = ArrivalKind::Mirrored { sharply: is_sharp };
        }
    } else {
        walk.cone.spread = walk.cone.spread.max(SCATTERED_SPREAD / sample.pdf.sqrt());
        let (receiver, pdf) = (place.receiver, sample.pdf);
        walk.comes = ArrivalKind::Spread { receiver, pdf, is_sharp: is_sharp(prepared, pdf) };
    }
    (walk.origin, walk.direction) = (point.ray_origin(wi), wi);
    walk.depth += 1;
    walk.vertex += 1;
    true
}

/// Russian roulette, as paths have it.
///
/// - `worth`: with what chance the path is worth going on beside that.
pub(super) fn survives(walk: &mut Walk, worth: f32, u: f32) -> bool {
    /// Bounces before it.
    const SURE: u32 = 3;
    if u >= worth {
        return false;
    }
    walk.throughput /= worth;
    transport::survives(&mut walk.throughput, walk.squeezed, walk.depth <= SURE, u / worth)
}

/// Whether light from a direction over mirrors and glass is found by going there and not by photons, of which too few come within
/// so narrow a lobe: each direction by one of the two.
///
/// - `pdf`: of the direction in sr⁻¹, as the surface draws it.
#[inline(always)]
pub(super) fn is_sharp(prepared: &PreparedScene, pdf: f32) -> bool {
    /// A lobe that covers a sixtieth of the hemisphere: of fifty photons, less than one.
    const SHARP: f32 = 10.0;
    // Nobody runs into a light that is a point.
    pdf >= SHARP && prepared.scene().lights.is_empty()
}
