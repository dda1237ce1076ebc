//! Exit pupils: the parts of the last surface's plane through which places of the film see the scene.

use glam::{Vec2, Vec3};

use super::{description::LensSurface, trace};

/// Number of intervals of the film's radius, each with a pupil of its own.
const INTERVALS: usize = 64;
/// Number of rays per side of the grid that looks for a pupil.
const GRID: usize = 48;
/// Extent of the first grid, in radii of the last surface's opening.
const MARGIN: f32 = 1.5;

/// A rectangle of the plane through the last surface's vertex, for places of the film on the positive x axis.
#[derive(Clone, Copy, Debug)]
struct Rectangle {
    min: Vec2,
    max: Vec2,
}

/// The pupils of a system, by the distance of a place from the centre of the film.
#[derive(Debug)]
pub(super) struct Pupils {
    by_radius: Vec<Rectangle>,
    /// Distance of the last surface from the film.
    rear: f32,
    /// Half of the film's diagonal.
    film_radius: f32,
}

impl Pupils {
    /// Finds the pupils by tracing rays. `None`: no place of the film sees the scene.
    pub(super) fn find(surfaces: &[LensSurface], film_diagonal: f32) -> Option<Self> {
        let last = surfaces.last()?;
        let (rear, film_radius) = (last.thickness, 0.5 * film_diagonal);
        let whole = Rectangle {
            min: Vec2::splat(-MARGIN * last.aperture_radius),
            max: Vec2::splat(MARGIN * last.aperture_radius),
        };
        let pupil = |interval: usize| {
            let span = [interval, interval + 1].map(|edge| film_radius * edge as f32 / INTERVALS as f32);
            // Look twice: the second grid measures small pupils as finely as large ones
            let coarse = seen_through(surfaces, span, whole)?;
            Some(seen_through(surfaces, span, coarse).unwrap_or(coarse))
        };
        let found: Vec<Option<Rectangle>> = (0..INTERVALS).map(pupil).collect();
        found.iter().any(Option::is_some).then(|| {
            let by_radius = found.into_iter().map(|pupil| pupil.unwrap_or(whole)).collect();
            Self { by_radius, rear, film_radius }
        })
    }

    /// Samples a point of the pupil of a place of the film. Returns it in camera space, with the area of the pupil.
    pub(super) fn sample(&self, film: Vec2, [u, v]: [f32; 2]) -> (Vec3, f32) {
        let radius = film.length();
        let interval = (radius / self.film_radius * INTERVALS as f32) as usize;
        let Rectangle { min, max } = self.by_radius[interval.min(INTERVALS - 1)];
        let point = min + (max - min) * Vec2::new(u, v);
        // Turn the point with the place
        let axis = if radius > 0.0 { film / radius } else { Vec2::X };
        let extent = max - min;
        (axis.rotate(point).extend(-self.rear), extent.x * extent.y)
    }
}

/// Returns the bounds of the points of a rectangle through which places of the film see the scene, with a margin of one
/// cell of the grid. `None`: there are none.
///
/// - `span`: distances of the places from the centre of the film.
fn seen_through(surfaces: &[LensSurface], [from, to]: [f32; 2], within: Rectangle) -> Option<Rectangle> {
    let rear = surfaces.last()?.thickness;
    let cell = (within.max - within.min) / GRID as f32;
    let (mut min, mut max) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    for index in 0..GRID * GRID {
        let (column, row) = (index % GRID, index / GRID);
        let point = within.min + cell * Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
        // Places of the span take turns along rows and columns; both ends are among them
        let place = from + (to - from) * ((column + row) % 4) as f32 / 3.0;
        let film = Vec3::new(place, 0.0, 0.0);
        if trace::through(surfaces, film, point.extend(-rear) - film).is_some() {
            (min, max) = (min.min(point), max.max(point));
        }
    }
    (min.x <= max.x)
        .then(|| Rectangle { min: (min - 1.5 * cell).max(within.min), max: (max + 1.5 * cell).min(within.max) })
}
