//! The measure of lengths for photons and agents: what is seen, or the whole scene.

use glam::Vec3;

use crate::prepare::PreparedScene;

/// Lengths as a share of the radius: half of what is seen is finer than the whole of it.
const DETAIL: f32 = 0.5;

/// Where what a camera sees is, and how wide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    /// In the middle of what is seen.
    pub(crate) center: Vec3,
    /// Of what is seen.
    pub(crate) radius: f32,
    /// Radius of the scene; the same where what is seen is no small part of it.
    pub(crate) whole: f32,
}

impl Extent {
    /// Of a whole scene. Without surfaces the radius is 0.
    pub(crate) fn whole(prepared: &PreparedScene) -> Self {
        let bounds = prepared.accel().bounds();
        let radius = 0.5 * (bounds.max - bounds.min).length();
        let is_sound = radius.is_finite() && bounds.center().is_finite();
        let (center, radius) = if is_sound { (bounds.center(), radius) } else { (Vec3::ZERO, 0.0) };
        Self { center, radius, whole: radius }
    }

    /// Whether the scene itself is the measure.
    #[inline(always)]
    pub(crate) fn is_whole(&self) -> bool {
        self.radius >= self.whole
    }

    /// The length that others are shares of at a place: half the radius of what is seen, and farther off half of how far it is.
    #[inline(always)]
    pub(crate) fn length_at(&self, p: Vec3) -> f32 {
        if self.is_whole() { self.whole } else { DETAIL * p.distance(self.center).clamp(self.radius, self.whole) }
    }
}
