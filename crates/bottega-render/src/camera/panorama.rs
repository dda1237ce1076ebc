//! Directions of panoramas and fisheyes, in camera space.

use std::f32::consts::PI;

use bottega_kernels::math;
use bottega_scene::{FisheyeMapping, Panorama};
use glam::{Vec2, Vec3};

use crate::lights::direction_of_square;

/// Number of faces of a cube, side by side in its picture.
const FACES: f32 = 6.0;

/// Returns the direction at a position of a panorama, both coordinates from 0 to 1. Filters may ask beyond the edges,
/// where the sphere continues.
///
/// - `center`: centre of the pixel, which decides on the face of a cube.
#[inline(always)]
pub(super) fn direction_of_panorama(panorama: Panorama, center: Vec2, place: Vec2) -> Vec3 {
    match panorama {
        Panorama::Equirectangular => {
            let ((sin_theta, cos_theta), (sin_phi, cos_phi)) =
                (math::sin_cos(PI * place.y), math::sin_cos(2.0 * PI * (place.x - 0.5)));
            Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
        }
        Panorama::EqualArea => {
            let mut place = place;
            // Beyond an edge, the picture is mirrored along it
            for (axis, other) in [(0, 1), (1, 0)] {
                if !(0.0..=1.0).contains(&place[axis]) {
                    let edge = if place[axis] < 0.0 { 0.0 } else { 2.0 };
                    place[axis] = edge - place[axis];
                    place[other] = 1.0 - place[other];
                }
            }
            let square = direction_of_square(place);
            Vec3::new(square.x, square.z, -square.y)
        }
        Panorama::Cube => {
            let face = (center.x * FACES).floor().clamp(0.0, FACES - 1.0);
            direction_of_face(face as u32, Vec2::new(place.x * FACES - face, place.y))
        }
    }
}

/// Returns the direction at a position of a cube's face, not of unit length.
///
/// - `place`: from the upper left corner, from 0 to 1.
fn direction_of_face(face: u32, place: Vec2) -> Vec3 {
    let (right, up) = (2.0 * place.x - 1.0, 1.0 - 2.0 * place.y);
    match face {
        0 => Vec3::new(1.0, up, right),
        1 => Vec3::new(-1.0, up, -right),
        2 => Vec3::new(right, 1.0, up),
        3 => Vec3::new(right, -1.0, -up),
        4 => Vec3::new(-right, up, 1.0),
        _ => Vec3::new(right, up, -1.0),
    }
}

/// Returns the position of a direction in the picture of a cube, as if the face at `column` went on beyond its edges.
/// `None`: it is behind that face.
///
/// - `column`: from the left edge of the picture, from 0 to 1.
pub(super) fn place_on_face(column: f32, direction: Vec3) -> Option<Vec2> {
    let Vec3 { x, y, z } = direction;
    let face = (column * FACES).floor().clamp(0.0, FACES - 1.0);
    let (ahead, right, up) = match face as u32 {
        0 => (x, z, y),
        1 => (-x, -z, y),
        2 => (y, x, z),
        3 => (-y, x, -z),
        4 => (z, -x, y),
        _ => (-z, x, y),
    };
    let place = Vec2::new(0.5 + 0.5 * right / ahead, 0.5 - 0.5 * up / ahead);
    (ahead > 0.0).then(|| Vec2::new((face + place.x) / FACES, place.y))
}

/// A fisheye for one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fisheye {
    mapping: FisheyeMapping,
    /// Angle between the axis and the rim, in radians.
    rim: f32,
    /// Sine of half that angle.
    sin_half_rim: f32,
}

impl Fisheye {
    /// Creates a fisheye.
    ///
    /// - `field_of_view`: angle between opposite directions on the rim, in radians.
    pub(super) fn new(mapping: FisheyeMapping, field_of_view: f32) -> Self {
        let rim = 0.5 * field_of_view;
        Self { mapping, rim, sin_half_rim: math::sin_cos(0.5 * rim).0 }
    }

    /// Returns the angle between the axis and the rim, in radians.
    pub(super) fn rim(&self) -> f32 {
        self.rim
    }

    /// Returns the mapping from angles to the film.
    pub(super) fn mapping(&self) -> FisheyeMapping {
        self.mapping
    }

    /// Returns the direction at a position on the film, of unit length. `None`: it lies beyond the rim.
    ///
    /// - `film`: from the axis, right and up, in radii of the rim.
    pub(super) fn direction(&self, film: Vec2) -> Option<Vec3> {
        let radius = film.length();
        if radius > 1.0 {
            return None;
        }
        if radius == 0.0 {
            return Some(Vec3::NEG_Z);
        }
        let (sin, cos) = match self.mapping {
            FisheyeMapping::Equidistant => math::sin_cos(radius * self.rim),
            FisheyeMapping::Equisolid => {
                // Double the half angle
                let sin_half = radius * self.sin_half_rim;
                let cos_half = (1.0 - sin_half * sin_half).max(0.0).sqrt();
                (2.0 * sin_half * cos_half, 1.0 - 2.0 * sin_half * sin_half)
            }
        };
        Some((film * (sin / radius)).extend(-cos))
    }
}
