//! Points on the opening of a lens.

use std::f32::consts::PI;

use bottega_kernels::math;
use bottega_scene::Aperture;
use glam::Vec2;

use crate::sampling::uniform_disk;

/// The opening of a lens, from which points are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LensOpening {
    radius: f32,
    polygon: Option<Polygon>,
    /// Width as a multiple of the height.
    width: f32,
}

/// A regular polygon in the unit circle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Polygon {
    corners: f32,
    rotation: f32,
    /// A corner of the triangle between the centre and an edge; the other one is below the x axis.
    corner: Vec2,
}

impl LensOpening {
    /// Creates the opening of a lens.
    ///
    /// - `radius`: in scene units; 0: a point.
    pub(super) fn new(radius: f32, aperture: Aperture) -> Self {
        let polygon = (aperture.blades >= 3).then(|| {
            let (sin, cos) = math::sin_cos(PI / aperture.blades as f32);
            Polygon { corners: aperture.blades as f32, rotation: aperture.rotation, corner: Vec2::new(cos, sin) }
        });
        Self { radius, polygon, width: 1.0 / aperture.ratio }
    }

    /// Returns the radius in scene units; 0: a point.
    pub(crate) fn radius(&self) -> f32 {
        self.radius
    }

    /// Returns true if the opening is a point.
    #[inline(always)]
    pub(super) fn is_point(&self) -> bool {
        self.radius <= 0.0
    }

    /// Returns a point of the opening, uniform by area, in scene units.
    #[inline(always)]
    pub(super) fn sample(&self, numbers: [f32; 2]) -> Vec2 {
        let point = match &self.polygon {
            None => uniform_disk(numbers),
            Some(polygon) => polygon.sample(numbers),
        };
        self.radius * Vec2::new(point.x * self.width, point.y)
    }
}

impl Polygon {
    fn sample(&self, [u, v]: [f32; 2]) -> Vec2 {
        // The first number chooses one of the equal triangles around the centre, and the rest of it a point there
        let scaled = u * self.corners;
        let triangle = scaled.floor().min(self.corners - 1.0);
        let outward = (scaled - triangle).max(0.0).sqrt();
        let across = (2.0 * v - 1.0) * outward;
        let point = Vec2::new(outward * self.corner.x, across * self.corner.y);
        let (sin, cos) = math::sin_cos(self.rotation + triangle * (2.0 * PI / self.corners));
        Vec2::new(cos, sin).rotate(point)
    }
}
