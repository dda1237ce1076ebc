//! Curves that face each ray with their whole width: hair and grass of pbrt (`curve`).
//!
//! The triangles of their mesh are only a hull around them. A ray that hits the hull hits a curve if it passes the
//! curve's centre line within half the width there, measured perpendicular to the ray. So silhouettes are exact and
//! curves are not tessellated.

use glam::{Affine3A, Vec3};
use serde::{Deserialize, Serialize};

use crate::error::Violation;

/// Radius of the hull's corners over half the width of the curve. Four sides around it, with room for bends.
pub(crate) const HULL: f32 = 1.15 * std::f32::consts::SQRT_2;

/// Maximal number of pieces searched from a hit of the hull: a ray may lie nearly along the curve.
const STEPS_MAX: usize = 64;

/// Distance from the axis of a round curve, in radii, within which rays start on its surface or inside. They do not enter it
/// again: it has no inside. Above 1, because pieces meet at angles and become thinner.
const WITHIN: f32 = 1.1;

/// The shape of a curve's cross-section, as a ray sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CurveLook {
    /// A flat ribbon that faces each ray.
    Flat,
    /// A round tube without an inside: rays that start within leave it unhindered.
    Round,
}

/// A point on the centre line of a curve, which is straight between two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// Position, object space.
    pub position: Vec3,
    /// Direction of the curve, object space, unit length.
    pub tangent: Vec3,
    /// Half the width of the curve, object space.
    pub radius: f32,
    /// Texture coordinate along the curve.
    pub along: f32,
    /// `true`: the curve ends here.
    pub is_last: bool,
}

/// Curves inside a mesh whose triangles are only the hull around them: a ray that hits a triangle is tested against the
/// curve by [`Self::meet`].
#[derive(Clone, Debug, PartialEq)]
pub struct FacingCurves {
    /// The shape of all curves.
    pub look: CurveLook,
    /// Points of all curves, one curve after another.
    pub points: Vec<CurvePoint>,
    /// For each triangle of the mesh, the index of the point at which the enclosed piece of curve begins.
    pub pieces: Vec<u32>,
}

/// The intersection of a ray with a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveMeeting {
    /// Distance along the ray, in lengths of its direction.
    pub t: f32,
    /// Direction of the curve, object space, unit length.
    pub tangent: Vec3,
    /// Half the width of the curve, object space.
    pub radius: f32,
    /// Position across the curve, in [−1, 1].
    pub across: f32,
    /// Texture coordinate along the curve.
    pub along: f32,
    /// dp/d`along`: length of the curve per unit of that coordinate, in object space.
    pub stretch: f32,
}

impl FacingCurves {
    /// Intersects a ray that hit a triangle of the hull with the curve inside; `None`: the ray misses it.
    ///
    /// - `triangle`: index of the triangle in the mesh.
    /// - `origin`, `direction`: the ray in object space; the direction is of any length.
    /// - `t_hull`: distance to the triangle; `t_max`: end of the ray, both in lengths of the direction.
    ///
    /// # Panics
    ///
    /// If there is no such triangle.
    pub fn meet(
        &self,
        triangle: usize,
        origin: Vec3,
        direction: Vec3,
        [t_hull, t_max]: [f32; 2],
    ) -> Option<CurveMeeting> {
        let from = origin;
        // Move the origin close, so that differences of positions keep their precision.
        let origin = origin + direction * t_hull;
        let inverse_square = direction.length_squared().recip();
        // Project along the ray, which then passes through 0.
        let seen = |v: Vec3| v - direction * (v.dot(direction) * inverse_square);
        let mut piece = self.pieces[triangle] as usize;
        let mut way = 0_i8;
        for _ in 0..STEPS_MAX {
            let (start, end) = (&self.points[piece], &self.points[piece + 1]);
            let (a, b) = (seen(start.position - origin), seen(end.position - origin));
            // Adjacent pieces are separated by the projected cross-sections of the curve.
            if a.dot(seen(start.tangent)) > 0.0 {
                if way > 0 || piece == 0 || self.points[piece - 1].is_last {
                    return None;
                }
                (piece, way) = (piece - 1, -1);
                continue;
            }
            if b.dot(seen(end.tangent)) < 0.0 {
                if way < 0 || end.is_last {
                    return None;
                }
                (piece, way) = (piece + 1, 1);
                continue;
            }
            let axis = b - a;
            let share = (-a.dot(axis) / axis.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
            let off = a + axis * share;
            let radius = start.radius + (end.radius - start.radius) * share;
            let distance_squared = off.length_squared();
            if distance_squared > radius * radius {
                return None;
            }
            let tangent = start.tangent.lerp(end.tangent, share).normalize_or(start.tangent);
            let middle = start.position.lerp(end.position, share);
            let mut t = t_hull + (middle - origin).dot(direction) * inverse_square;
            if self.look == CurveLook::Round {
                let straight = (end.position - start.position).normalize_or(tangent);
                if (from - middle).reject_from_normalized(straight).length() < WITHIN * radius {
                    return None;
                }
                let slant = direction.cross(straight).length().max(f32::MIN_POSITIVE);
                t -= (radius * radius - distance_squared).max(0.0).sqrt() / slant;
            }
            let side = off.cross(tangent).dot(direction);
            let across = (distance_squared.sqrt() / radius).min(1.0).copysign(side);
            let span = (end.along - start.along).max(f32::MIN_POSITIVE);
            return (t > 0.0 && t <= t_max).then_some(CurveMeeting {
                t,
                tangent,
                radius,
                across,
                along: start.along + span * share,
                stretch: start.position.distance(end.position) / span,
            });
        }
        None
    }

    /// The offset at which a ray that leaves a flat curve starts, so that it is outside of the hull; in half widths of
    /// the curve.
    pub const CLEARANCE: f32 = 1.05 * HULL;

    /// Appends other curves; the caller appends their hull to the mesh.
    pub(crate) fn append(&mut self, other: Self) {
        let first = self.points.len() as u32;
        self.points.extend(other.points);
        self.pieces.extend(other.pieces.iter().map(|piece| piece + first));
    }

    /// Maps the positions and tangents of all points.
    pub(crate) fn map(&mut self, position: impl Fn(Vec3) -> Vec3, tangent: impl Fn(Vec3) -> Vec3) {
        for point in &mut self.points {
            (point.position, point.tangent) = (position(point.position), tangent(point.tangent));
        }
    }

    /// Returns the memory of the curves, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.points) + size_of_val(&*self.pieces)
    }

    /// Checks the invariants of the curves for a mesh of `triangles` triangles.
    pub(crate) fn check(&self, triangles: usize) -> Result<(), Violation> {
        let is_sound = |point: &CurvePoint| {
            let is_finite = point.position.is_finite() && point.along.is_finite() && point.radius.is_finite();
            is_finite && point.radius >= 0.0 && (point.tangent.length_squared() - 1.0).abs() < 1e-3
        };
        let has_end =
            |&piece: &u32| self.points.get(piece as usize..).is_some_and(|rest| rest.len() > 1 && !rest[0].is_last);
        let problem = if self.pieces.len() != triangles {
            "its curves have another number of triangles"
        } else if !self.points.iter().all(is_sound) {
            "a point of its curves is not finite"
        } else if self.points.last().is_some_and(|point| !point.is_last) || !self.pieces.iter().all(has_end) {
            "a piece of its curves has no end"
        } else {
            return Ok(());
        };
        Err(Violation(problem.into()))
    }
}

/// Returns the origin and the direction of a world-space ray in object space. The direction is not normalized, so
/// distances along the ray keep their values.
pub fn ray_in_object(world_from_object: &Affine3A, origin: Vec3, direction: Vec3) -> (Vec3, Vec3) {
    if *world_from_object == Affine3A::IDENTITY {
        return (origin, direction);
    }
    let object_from_world = world_from_object.inverse();
    (object_from_world.transform_point3(origin), object_from_world.transform_vector3(direction))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A polyline of width 0.2 through these points, with one hull triangle per segment.
    fn curve(look: CurveLook, places: &[Vec3]) -> FacingCurves {
        let last = places.len() - 1;
        let towards = |from: usize, to: usize| places[to] - places[from];
        let points = (0..places.len()).map(|i| CurvePoint {
            position: places[i],
            tangent: towards(i.saturating_sub(1), (i + 1).min(last)).normalize(),
            radius: 0.1,
            along: i as f32 / last as f32,
            is_last: i == last,
        });
        FacingCurves { look, points: points.collect(), pieces: (0..last as u32).collect() }
    }

    fn met(curves: &FacingCurves, piece: usize, from: Vec3, to: Vec3) -> Option<CurveMeeting> {
        curves.meet(piece, from, to - from, [0.5, f32::INFINITY])
    }

    #[test]
    fn a_ray_meets_a_hull_as_wide_as_the_curve() {
        for (look, depth) in [(CurveLook::Flat, 0.0), (CurveLook::Round, 0.1 * 0.75_f32.sqrt())] {
            let line = curve(look, &[Vec3::NEG_X, Vec3::X]);
            for from in [Vec3::Z, Vec3::new(0.0, 0.6, 0.8), Vec3::NEG_Y] {
                let aside = Vec3::X.cross(from);
                let found = met(&line, 0, 4.0 * from + 0.05 * aside, 0.05 * aside - 4.0 * from).unwrap();
                assert!((found.t - (4.0 - depth) / 8.0).abs() < 1e-5, "{look:?} {from}: {found:?}");
                assert!((found.across.abs() - 0.5).abs() < 1e-4 && (found.along - 0.5).abs() < 1e-5, "{found:?}");
                let other = met(&line, 0, 4.0 * from - 0.05 * aside, -0.05 * aside - 4.0 * from).unwrap();
                assert!((other.across + found.across).abs() < 1e-4, "the other side of the middle");
                assert!(met(&line, 0, 4.0 * from + 0.101 * aside, 0.101 * aside - 4.0 * from).is_none());
                // Beyond the end, and a curve behind the ray.
                let end = Vec3::X * 1.001;
                assert!(met(&line, 0, end + from, end - from).is_none());
                assert!(line.meet(0, -from, -from, [0.5, 9.0]).is_none());
            }
        }
    }

    #[test]
    fn rays_leave_a_round_curve_through_its_inside() {
        let line = curve(CurveLook::Round, &[Vec3::NEG_X, Vec3::X]);
        for inward in [Vec3::NEG_Z, Vec3::new(0.5, 0.3, -0.8), Vec3::new(-0.3, -0.6, -0.5)] {
            // On the surface, and a little before it, as where pieces meet at an angle
            for height in [0.1, 0.103] {
                assert_eq!(line.meet(0, height * Vec3::Z, inward, [0.3, f32::INFINITY]), None, "{inward}");
            }
            let found = line.meet(0, 0.13 * Vec3::Z, inward, [0.3, f32::INFINITY]);
            assert!(found.is_some_and(|met| met.t > 0.0), "{inward}: from outside");
        }
    }

    #[test]
    fn a_ray_meets_the_same_place_through_any_part_of_the_hull() {
        let bend: Vec<Vec3> = (0..=8)
            .map(|i| {
                let (sin, cos) = (0.2 * i as f32).sin_cos();
                Vec3::new(cos, sin, 0.0)
            })
            .collect();
        let bend = curve(CurveLook::Flat, &bend);
        let at = Vec3::new(0.7, 0.7, 0.0);
        let expected = met(&bend, 3, at + Vec3::Z, at - Vec3::Z).unwrap();
        for piece in 0..8 {
            assert_eq!(met(&bend, piece, at + Vec3::Z, at - Vec3::Z), Some(expected), "{piece}");
        }
        // A ray inside of the bend passes by.
        assert!(met(&bend, 0, 0.8 * at + Vec3::Z, 0.8 * at - Vec3::Z).is_none());
    }

    #[test]
    fn unsound_curves_are_found() {
        let line = curve(CurveLook::Flat, &[Vec3::NEG_X, Vec3::X]);
        assert!(line.check(1).is_ok() && line.check(2).is_err());
        let broken = |change: fn(&mut FacingCurves)| {
            let mut broken = line.clone();
            change(&mut broken);
            broken.check(1).is_err()
        };
        assert!(broken(|curves| curves.pieces[0] = 1));
        assert!(broken(|curves| curves.points[1].is_last = false));
        assert!(broken(|curves| curves.points[0].radius = f32::NAN));
        assert!(broken(|curves| curves.points[1].tangent = Vec3::ZERO));
    }
}
