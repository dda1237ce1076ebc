//! The two eyes of a stereo picture.

use bottega_kernels::math;
use bottega_scene::{Stereo, StereoLayout};
use glam::{Vec2, Vec3};

/// Angles above the horizon, in radians, between which the distance of the eyes falls to 0 in panoramas: at the poles the
/// eyes would turn about each other.
const MERGED: [f32; 2] = [std::f32::consts::FRAC_PI_3, 5.0 / 12.0 * std::f32::consts::PI];

/// The eyes of a stereo picture of one size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Eyes {
    layout: StereoLayout,
    /// Size of the picture of one eye, in pixels.
    size: Vec2,
    half_distance: f32,
    convergence: f32,
}

impl Eyes {
    /// Creates the eyes. Returns them with the size of the picture of one eye.
    ///
    /// - `size`: that of the whole picture, in pixels.
    pub(super) fn new(stereo: Stereo, size: Vec2) -> (Self, Vec2) {
        let size = match stereo.layout {
            StereoLayout::SideBySide => size * Vec2::new(0.5, 1.0),
            StereoLayout::TopBottom => size * Vec2::new(1.0, 0.5),
            StereoLayout::Left | StereoLayout::Right => size,
        };
        let eyes = Self {
            layout: stereo.layout,
            size,
            half_distance: 0.5 * stereo.eye_distance,
            convergence: stereo.convergence,
        };
        (eyes, size)
    }

    /// Returns the offset to the right of the eye that sees a pixel, in scene units, and the place in its picture.
    ///
    /// - `center`: centre of the pixel in the whole picture.
    pub(super) fn of_pixel(&self, center: Vec2) -> (f32, Vec2) {
        let (is_right, corner) = match self.layout {
            StereoLayout::SideBySide => (center.x >= self.size.x, Vec2::new(self.size.x, 0.0)),
            StereoLayout::TopBottom => (center.y >= self.size.y, Vec2::new(0.0, self.size.y)),
            StereoLayout::Left => (false, Vec2::ZERO),
            StereoLayout::Right => (true, Vec2::ZERO),
        };
        if is_right { (self.half_distance, center - corner) } else { (-self.half_distance, center) }
    }

    /// Moves the origin of a ray to an eye beside the camera. Both rays of a place meet in the plane of convergence.
    ///
    /// - `direction`: with z = −1.
    pub(super) fn beside_axis(&self, offset: f32, origin: &mut Vec3, direction: &mut Vec3) {
        origin.x += offset;
        if self.convergence.is_finite() {
            direction.x -= offset / self.convergence;
        }
    }

    /// Returns how far a ray of the eye leans towards the axis, per unit of depth.
    pub(super) fn slant(&self, offset: f32) -> f32 {
        if self.convergence.is_finite() { offset / self.convergence } else { 0.0 }
    }

    /// Moves the origin of a ray to an eye. Both rays of a direction meet at the distance of convergence.
    ///
    /// - `direction`: of any length; returned with unit length.
    /// - `turns`: the eyes turn with the direction, as in panoramas.
    pub(super) fn on_sphere(&self, offset: f32, turns: bool, direction: Vec3) -> (Vec3, Vec3) {
        let towards = direction.normalize();
        let origin = if turns {
            let horizontal = Vec3::new(-towards.z, 0.0, towards.x);
            let altitude = math::atan2(towards.y.abs(), horizontal.length());
            let share = ((altitude - MERGED[0]) / (MERGED[1] - MERGED[0])).clamp(0.0, 1.0);
            let nearer = if share >= 1.0 { 0.0 } else { math::cos(share * std::f32::consts::FRAC_PI_2) };
            horizontal.normalize_or_zero() * (offset * nearer)
        } else {
            Vec3::new(offset, 0.0, 0.0)
        };
        let towards =
            if self.convergence.is_finite() { (towards * self.convergence - origin).normalize() } else { towards };
        (origin, towards)
    }
}
