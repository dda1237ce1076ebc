//! The unit of length for photons and agents: the size of the visible part, or of the scene.

use glam::Vec3;

use crate::prepare::PreparedScene;

/// Lengths as a fraction of the radius; the visible part needs finer ones than the whole scene.
const DETAIL: f32 = 0.5;

/// Position and size of the part of a scene that a camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    /// Centre of the visible part.
    pub(crate) center: Vec3,
    /// Radius of the visible part.
    pub(crate) radius: f32,
    /// Radius of the scene; equal to [`Self::radius`] unless the visible part is a small part of it.
    pub(crate) whole: f32,
}

impl Extent {
    /// Returns the extent of a whole scene; the radius is 0 without surfaces.
    pub(crate) fn whole(prepared: &PreparedScene) -> Self {
        let bounds = prepared.accel().bounds();
        let radius = 0.5 * (bounds.max - bounds.min).length();
        let is_sound = radius.is_finite() && bounds.center().is_finite();
        let (center, radius) = if is_sound { (bounds.center(), radius) } else { (Vec3::ZERO, 0.0) };
        Self { center, radius, whole: radius }
    }

    /// Returns true if the scene itself is the unit.
    #[inline(always)]
    pub(crate) fn is_whole(&self) -> bool {
        self.radius >= self.whole
    }

    /// Returns the unit of length at a point: half the radius of the visible part, or half the distance to its centre if
    /// that is larger; the scene's radius if everything counts as visible.
    #[inline(always)]
    pub(crate) fn length_at(&self, p: Vec3) -> f32 {
        if self.is_whole() { self.whole } else { DETAIL * p.distance(self.center).clamp(self.radius, self.whole) }
    }
}
