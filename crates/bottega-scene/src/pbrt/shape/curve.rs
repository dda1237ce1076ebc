//! The shape `curve`: hair, fur and grass.
//!
//! A curve is divided into straight pieces that deviate by at most 2 % of its width. A `flat` curve turns its width to
//! each ray, and so does a `cylinder`, which is round (see [`FacingCurves`](crate::FacingCurves)). A `ribbon` is a band of triangles. An
//! emissive curve, which pbrt cannot sample, is a tube of triangles.

use glam::{DVec3, Vec2};

use super::super::context::Context;
use super::super::params::Params;
use super::geometry::{Geometry, positions};
use crate::facing_curves::CurveLook;
use crate::import::bezier::{BezierSegment, bezier_of_bspline, parameters};
use crate::import::strand::{self, Station, each_ring, sides_between};
use crate::import::text_place::{ImportResult, TextPlace};
use crate::model::Mesh;
use crate::text::shortened;

/// Maximal deviation of a straight piece from the curve, in widths.
const TOLERANCE: f64 = 0.02;

/// Corners of a cross-section of a tube.
const SIDES: u32 = 5;

/// Factor of a tube's radius that makes its polygonal cross-section as wide on average as the curve, over all viewing
/// directions. (The mean width of a convex shape is its perimeter over π.) The width deviates by at most 3.5 %.
const WIDENING: f64 = 1.068_959; // π ∕ (5 sin(π ∕ 5))

/// Maximal number of pieces per Bézier segment.
const PIECES_MAX: f64 = 32.0;

/// Reads a curve; `None` if it is left out.
///
/// - `shines`: it is an area light.
pub(super) fn read(
    context: &mut Context<'_>,
    params: &Params,
    at: TextPlace,
    shines: bool,
) -> ImportResult<Option<Geometry>> {
    let points = params.points3("P", "point3")?.ok_or_else(|| at.fault("`curve` needs the control points `P`"))?;
    positions(&points, params.place_of("P"))?;
    let width = params.float("width")?.unwrap_or(1.0);
    let widths = [params.float("width0")?.unwrap_or(width), params.float("width1")?.unwrap_or(width)];
    if !(widths[0] >= 0.0 && widths[1] >= 0.0 && widths[0] + widths[1] > 0.0) {
        return Err(at.fault("a curve's width must be above 0").into());
    }
    let degree = params.integer("degree")?.unwrap_or(3);
    if degree != 2 && degree != 3 {
        return Err(params.place_of("degree").fault("a curve's degree is 2 or 3").into());
    }
    let degree = degree as usize;
    let basis = params.text("basis")?.unwrap_or("bezier");
    let segments = match basis {
        "bezier" => bezier_segments(&points, degree),
        "bspline" => bspline_segments(&points, degree),
        _ => {
            let problem = format!("a curve's basis is \"bezier\" or \"bspline\", not \"{}\"", shortened(basis));
            return Err(params.place_of("basis").fault(problem).into());
        }
    };
    let Some(segments) = segments else {
        return Err(params
            .place_of("P")
            .fault(format!("{} points make no curve of degree {degree}", points.len()))
            .into());
    };
    let kind = params.text("type")?.unwrap_or("flat");
    let normals = params.points3("N", "normal")?;
    let normals = match (kind, normals) {
        ("ribbon", Some(normals)) if normals.len() == segments.len() + 1 => Some(normals),
        ("ribbon", _) => {
            return Err(at.fault("a ribbon needs one normal `N` more than it has segments").into());
        }
        ("flat" | "cylinder", _) => None,
        _ => {
            let problem = format!("a curve is flat, a cylinder or a ribbon, not \"{}\"", shortened(kind));
            return Err(params.place_of("type").fault(problem).into());
        }
    };
    let line = polyline(&segments, widths);
    // Vertices and triangles, and for a hull the points of the curve.
    let bytes = strand::memory_bytes(line.len()).max(line.len() * SIDES as usize * (32 + 24));
    let place = context.place(at);
    context.resources.budget().take(context.path(at.file), &place, bytes)?;
    let look = if kind == "cylinder" { CurveLook::Round } else { CurveLook::Flat };
    let mut mesh = match &normals {
        Some(normals) => ribbon(&line, normals),
        None if shines => tube(&line),
        None => {
            let mut mesh = Mesh::default();
            strand::add_hull(&mut mesh, &line, look);
            mesh
        }
    };
    mesh.mend_normals();
    mesh.face_normals();
    if mesh.triangles.is_empty() {
        context.warn(at, "the curve has no length, and is left out");
        return Ok(None);
    }
    Ok(Some(Geometry::Mesh { mesh: Box::new(mesh), primitive_count: segments.len() }))
}

/// Returns the cubic Bézier segments of a curve whose segments share their ends.
fn bezier_segments(points: &[DVec3], degree: usize) -> Option<Vec<[DVec3; 4]>> {
    if points.len() <= degree || !(points.len() - 1).is_multiple_of(degree) {
        return None;
    }
    let segment = |index: usize| match &points[index * degree..=(index + 1) * degree] {
        &[a, b, c] => elevated([a, b, c]),
        controls => [controls[0], controls[1], controls[2], controls[3]],
    };
    Some((0..(points.len() - 1) / degree).map(segment).collect())
}

/// Returns the cubic Bézier segments of a uniform B-spline.
fn bspline_segments(points: &[DVec3], degree: usize) -> Option<Vec<[DVec3; 4]>> {
    if points.len() <= degree {
        return None;
    }
    let segment = |controls: &[DVec3]| match *controls {
        [a, b, c] => elevated([a.lerp(b, 0.5), b, b.lerp(c, 0.5)]),
        _ => bezier_of_bspline([controls[0], controls[1], controls[2], controls[3]]),
    };
    Some(points.windows(degree + 1).map(segment).collect())
}

/// Elevates a quadratic segment to a cubic one.
fn elevated([a, b, c]: [DVec3; 3]) -> [DVec3; 4] {
    [a, a.lerp(b, 2.0 / 3.0), c.lerp(b, 2.0 / 3.0), c]
}

fn polyline(segments: &[[DVec3; 4]], [width0, width1]: [f64; 2]) -> Vec<Station> {
    let mut line = Vec::new();
    let count = segments.len() as f64;
    for (index, controls) in segments.iter().enumerate() {
        let segment = BezierSegment(controls.map(|point| point.extend(0.0)));
        let tolerance = (TOLERANCE * width0.max(width1)).max(1e-4 * segment.control_length());
        for t in parameters(index == 0, segment.pieces(tolerance, PIECES_MAX)) {
            let u = index as f64 + t;
            let (position, tangent) = (segment.point(t).truncate(), segment.third_of_slope(t).truncate());
            let chord = controls[3] - controls[0];
            let tangent = tangent.try_normalize().or_else(|| chord.try_normalize()).unwrap_or(DVec3::X);
            let along = u / count;
            line.push(Station { position, tangent, width: width0 + (width1 - width0) * along, along });
        }
    }
    line
}

fn tube(line: &[Station]) -> Mesh {
    let mut mesh = Mesh::default();
    let mut corner = 0;
    each_ring(line, SIDES, |station, normal| {
        mesh.positions.push((station.position + normal * (0.5 * WIDENING * station.width)).as_vec3());
        mesh.normals.push(normal.as_vec3());
        // Position across the width, to the other edge and back.
        let across = 0.5 + 0.5 * (std::f64::consts::TAU * f64::from(corner % SIDES) / f64::from(SIDES)).cos();
        mesh.uvs[0].push(Vec2::new(station.along as f32, across as f32));
        corner += 1;
    });
    for ring in 1..line.len() as u32 {
        mesh.triangles.extend(sides_between(ring - 1, SIDES));
    }
    mesh
}

fn ribbon(line: &[Station], normals: &[DVec3]) -> Mesh {
    let mut mesh = Mesh::default();
    let count = (normals.len() - 1) as f64;
    for station in line {
        let u = station.along * count;
        let before = (u as usize).min(normals.len() - 2);
        let normal = turned(normals[before], normals[before + 1], u - before as f64);
        // Make the normal perpendicular to the curve.
        let normal = (normal - station.tangent * normal.dot(station.tangent)).normalize_or(normal);
        let side = normal.cross(station.tangent).normalize_or_zero() * (0.5 * station.width);
        for (sign, v) in [(-1.0, 1.0), (1.0, 0.0)] {
            mesh.positions.push((station.position + side * sign).as_vec3());
            mesh.normals.push(normal.as_vec3());
            mesh.uvs[0].push(Vec2::new(station.along as f32, v));
        }
    }
    for next in 1..line.len() as u32 {
        let (a, b) = (2 * (next - 1), 2 * next);
        mesh.triangles.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
    }
    mesh
}

/// Interpolates normals by equal angles.
fn turned(from: DVec3, to: DVec3, share: f64) -> DVec3 {
    let (from, to) = (from.normalize_or_zero(), to.normalize_or_zero());
    let angle = from.dot(to).clamp(-1.0, 1.0).acos();
    let sine = angle.sin();
    if sine < 1e-6 {
        return from.lerp(to, share);
    }
    (from * ((1.0 - share) * angle).sin() + to * (share * angle).sin()) / sine
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_bases_pass_through_the_same_curve() {
        // A straight line with equidistant points is the same in every basis.
        let points: Vec<DVec3> = (0..4).map(|i| DVec3::X * f64::from(i)).collect();
        let bezier = bezier_segments(&points, 3).unwrap();
        assert_eq!((bezier.len(), bezier[0][3].x), (1, 3.0));
        let bspline = bspline_segments(&points, 3).unwrap();
        assert!((bspline[0][0].x - 1.0).abs() < 1e-12 && (bspline[0][3].x - 2.0).abs() < 1e-12);
        let quadratic = bspline_segments(&points, 2).unwrap();
        assert_eq!(quadratic.len(), 2);
        assert!((quadratic[0][3] - quadratic[1][0]).length() < 1e-12);
        assert!(bezier_segments(&points, 2).is_none() && bspline_segments(&points[..2], 2).is_none());
    }

    #[test]
    fn a_tube_keeps_its_width_around_a_bend() {
        let arc = [DVec3::X, DVec3::new(1.0, 0.5523, 0.0), DVec3::new(0.5523, 1.0, 0.0), DVec3::Y];
        let line = polyline(&[arc], [0.1, 0.1]);
        let mesh = tube(&line);
        assert!(line.len() > 4);
        for position in &mesh.positions {
            // Distance from the circle of radius 1 in the plane z = 0.
            let p = position.as_dvec3();
            let off = (p.truncate().length() - 1.0).hypot(p.z);
            assert!((off - 0.05 * WIDENING).abs() < 1e-3, "{off}");
        }
    }

    #[test]
    fn a_tube_seen_from_all_around_is_as_wide_as_the_curve() {
        let station = |x: f64| Station { position: DVec3::X * x, tangent: DVec3::X, width: 0.2, along: x };
        let mesh = tube(&[station(0.0), station(1.0)]);
        let widths: Vec<f64> = (0..360)
            .map(|degrees| {
                let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
                let across = |position: &glam::Vec3| f64::from(position.y) * cos + f64::from(position.z) * sin;
                let places = || mesh.positions.iter().map(across);
                places().fold(f64::MIN, f64::max) - places().fold(f64::MAX, f64::min)
            })
            .collect();
        assert!((widths.iter().sum::<f64>() / 360.0 / 0.2 - 1.0).abs() < 1e-3);
        assert!(widths.iter().all(|width| (width / 0.2 - 1.0).abs() < 0.035), "{widths:?}");
    }
}
