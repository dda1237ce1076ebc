//! The shapes `bsplinecurve` and `linearcurve` (Mitsuba 3's documentation, Shapes), as tubes of triangles.
//!
//! Like Mitsuba, `to_world` transforms the control points but not their radii. Tubes of B-splines are open at their
//! ends; linear pieces meet and end in spheres. Mitsuba culls the insides of curves, so rays that start within pass
//! unhindered. Here they have an inside, black if the material is one-sided, which is visible through open ends.
//!
//! Curves of hair, which light passes through, are round [`FacingCurves`](crate::FacingCurves) without an inside.

use glam::{DMat3, DMat4, DVec3, DVec4, Vec4};

use super::context::ImportContext;
use super::document::{Class, Object};
use crate::facing_curves::CurveLook;
use crate::import::bezier::{BezierSegment, bezier_of_bspline, parameters};
use crate::import::strand::{self, Station};
use crate::import::text_place::ImportResult;
use crate::import::tube::{self, Ring};
use crate::mesh_file::curves::{self, Curves};
use crate::model::{COORDINATE_MAX, Mesh};

/// Maximal number of pieces per B-spline segment.
const PIECES_MAX: f64 = 64.0;

/// Maximal nesting of bsdfs in which hair is looked for.
const DEPTH_MAX: usize = 16;
/// Maximal deviation of a straight piece of hair from the curve, in widths.
const HAIR_TOLERANCE: f64 = 0.02;

/// Returns true if a shape is hair that does not shine.
pub(super) fn is_hair(context: &ImportContext<'_>, object: &Object) -> bool {
    fn has_hair(context: &ImportContext<'_>, object: &Object, depth: usize) -> bool {
        let mut children = object.children.iter().map(|child| context.document.get(child.object));
        let bsdf = children.find(|inner| inner.class == Class::Bsdf);
        bsdf.is_some_and(|bsdf| bsdf.plugin == "hair" || (depth > 0 && has_hair(context, bsdf, depth - 1)))
    }
    let shines = object.children.iter().any(|child| context.document.get(child.object).class == Class::Emitter);
    !shines && has_hair(context, object, DEPTH_MAX)
}

/// Converts the curves of a shape to tubes, or keeps them as round curves if they are hair. `None`: they are out of range;
/// adds a warning.
pub(super) fn read(context: &mut ImportContext<'_>, object: &Object, matrix: &DMat4) -> ImportResult<Option<Mesh>> {
    let is_spline = object.plugin == "bsplinecurve";
    let location = context.filename(object)?;
    let bytes = context.resources.read(&location)?;
    let least = if is_spline { 4 } else { 2 };
    let curves = curves::read(location.path(), &bytes, least, context.resources.budget());
    let curves = context.resources.attribute(&location, curves)?;
    drop(bytes);
    let segments: usize = curves.iter().map(|curve| curve.len() + 1 - least).sum();
    let moved = |points: &[Vec4]| points.iter().map(|point| moved(point, matrix)).collect::<Vec<DVec4>>();
    let mesh = if is_hair(context, object) {
        strands(context, object, &curves, segments, |points| {
            let points = moved(points);
            if is_spline { spline_stations(&points) } else { linear_stations(&points) }
        })?
    } else {
        tubes(context, object, &curves, segments, |points| {
            let points = moved(points);
            if is_spline { spline_rings(&points, sides(segments)) } else { linear_rings(&points, sides(segments)) }
        })?
    };
    if mesh.is_none() {
        context.warn(object.at, format!("the {} lies out of reach, and is left out", object.describe()));
        object.accept_all();
    }
    Ok(mesh)
}

/// Makes a mesh of all curves. `None`: a point is out of range.
///
/// - `rings`: returns the cross-sections of a curve, whose `v` counts its segments.
fn tubes(
    context: &ImportContext<'_>,
    object: &Object,
    curves: &Curves,
    segments: usize,
    rings: impl Fn(&[Vec4]) -> Vec<Ring>,
) -> ImportResult<Option<Mesh>> {
    let sides = sides(segments);
    let mut mesh = Mesh::default();
    let mut before = 0.0;
    for points in curves.iter() {
        let mut rings = rings(points);
        let is_in_reach = |ring: &Ring| (ring.center.abs().max_element() + ring.radius) < f64::from(COORDINATE_MAX);
        if !rings.iter().all(is_in_reach) {
            return Ok(None);
        }
        context.take(object.at, tube::memory_bytes(rings.len(), sides))?;
        if mesh.positions.len() + rings.len() * (sides as usize + 1) > u32::MAX as usize {
            let problem = "the curves have more corners than a mesh can hold; share them out to several files";
            return Err(object.at.fault(problem).into());
        }
        let here = rings.last().map_or(0.0, |ring| ring.v);
        rings.iter_mut().for_each(|ring| ring.v = (before + ring.v) / segments as f64);
        if rings.iter().any(|ring| ring.radius > 0.0) {
            tube::add(&mut mesh, &rings, sides, azimuth);
        }
        before += here;
    }
    Ok(Some(mesh))
}

/// Makes a mesh of round curves. `None`: a point is out of range.
///
/// - `stations`: returns points on the centre line of a curve, whose `along` counts its segments.
fn strands(
    context: &ImportContext<'_>,
    object: &Object,
    curves: &Curves,
    segments: usize,
    stations: impl Fn(&[Vec4]) -> Vec<Station>,
) -> ImportResult<Option<Mesh>> {
    let mut mesh = Mesh::default();
    let mut before = 0.0;
    for points in curves.iter() {
        let mut line = stations(points);
        let reach = |station: &Station| station.position.abs().max_element() + 2.0 * station.width;
        if !line.iter().all(|station| reach(station) < f64::from(COORDINATE_MAX)) {
            return Ok(None);
        }
        context.take(object.at, strand::memory_bytes(line.len()))?;
        if mesh.positions.len() + 8 * line.len() > u32::MAX as usize / 2 {
            let problem = "the curves have more corners than a mesh can hold; share them out to several files";
            return Err(object.at.fault(problem).into());
        }
        let here = line.last().map_or(0.0, |station| station.along);
        line.iter_mut().for_each(|station| station.along = (before + station.along) / segments as f64);
        if line.iter().any(|station| station.width > 0.0) {
            strand::add_hull(&mut mesh, &line, CurveLook::Round);
        }
        before += here;
    }
    Ok(Some(mesh))
}

/// Returns points along a cubic B-spline.
fn spline_stations(points: &[DVec4]) -> Vec<Station> {
    let mut line: Vec<Station> = Vec::new();
    for (index, segment) in points.array_windows::<4>().enumerate() {
        let segment = BezierSegment(bezier_of_bspline(*segment));
        let [a, b, c, d] = segment.0;
        let width = 2.0 * a.w.max(b.w).max(c.w).max(d.w);
        let tolerance = (HAIR_TOLERANCE * width).max(1e-4 * segment.control_length());
        for t in parameters(index == 0, segment.pieces(tolerance, PIECES_MAX)) {
            let (point, slope) = (segment.point(t), segment.third_of_slope(t).truncate());
            let before = line.last().map_or(DVec3::X, |station| station.tangent);
            let tangent = slope.try_normalize().unwrap_or(before);
            line.push(Station { position: point.truncate(), tangent, width: 2.0 * point.w, along: index as f64 + t });
        }
    }
    line
}

/// Returns the control points of straight pieces, which meet where their angle is halved. Of coincident points the first
/// counts.
fn linear_stations(points: &[DVec4]) -> Vec<Station> {
    let mut line: Vec<Station> = Vec::with_capacity(points.len());
    for (index, point) in points.iter().enumerate() {
        let position = point.truncate();
        if line.last().is_none_or(|station| station.position != position) {
            line.push(Station { position, tangent: DVec3::X, width: 2.0 * point.w, along: index as f64 });
        }
    }
    for index in 0..line.len() {
        let way = |from: usize, to: usize| (line[to].position - line[from].position).normalize_or_zero();
        let (before, after) = (index.saturating_sub(1), (index + 1).min(line.len() - 1));
        let (from, to) = (way(before, index), way(index, after));
        line[index].tangent = (from + to).try_normalize().or_else(|| to.try_normalize()).unwrap_or(DVec3::X);
    }
    line
}

/// Returns the number of corners of a cross-section: fewer if there are many curves, each of which is then small in the
/// picture.
fn sides(segments: usize) -> u32 {
    match segments {
        ..1_000 => 32,
        1_000..20_000 => 16,
        20_000..200_000 => 8,
        _ => 5,
    }
}

/// Transforms a control point; the radius is unchanged.
fn moved(point: &Vec4, matrix: &DMat4) -> DVec4 {
    matrix.transform_point3(point.truncate().as_dvec3()).extend(f64::from(point.w))
}

/// Returns the direction of u = 0, as measured on Mitsuba 3.9: u = ¼ is as close to +z as the axis allows.
fn azimuth(axis: DVec3) -> DVec3 {
    (DVec3::Z - axis * axis.z).try_normalize().unwrap_or(DVec3::Y).cross(axis)
}

/// Returns cross-sections along a cubic B-spline with open ends.
fn spline_rings(points: &[DVec4], sides: u32) -> Vec<Ring> {
    let mut rings = Vec::new();
    let mut last_axis = None;
    for (index, segment) in points.array_windows::<4>().enumerate() {
        let segment = BezierSegment(bezier_of_bspline(*segment));
        // Use the same tolerance along the curve as around it.
        let [a, b, c, d] = segment.0;
        let radius = a.w.max(b.w).max(c.w).max(d.w);
        let sagitta = 1.0 - (std::f64::consts::PI / f64::from(sides)).cos();
        let tolerance = (2.0 * sagitta * radius).max(1e-5 * segment.control_length());
        for t in parameters(index == 0, segment.pieces(tolerance, PIECES_MAX)) {
            let (point, slope) = (segment.point(t), segment.third_of_slope(t) * 3.0);
            let speed = slope.truncate().length();
            let axis = slope.truncate().try_normalize().or(last_axis).unwrap_or(DVec3::X);
            last_axis = Some(axis);
            rings.push(Ring {
                center: point.truncate(),
                axis,
                radius: point.w,
                lean: -slope.w / speed.hypot(slope.w).max(f64::MIN_POSITIVE),
                v: index as f64 + t,
            });
        }
    }
    rings
}

/// Returns cross-sections along straight pieces: the hulls of the spheres around adjacent points.
fn linear_rings(points: &[DVec4], sides: u32) -> Vec<Ring> {
    // Merge coincident points: the larger sphere covers the smaller.
    let mut knots: Vec<(DVec4, f64)> = Vec::with_capacity(points.len());
    for (index, &point) in points.iter().enumerate() {
        match knots.last_mut() {
            Some((last, _)) if last.truncate() == point.truncate() => last.w = last.w.max(point.w),
            _ => knots.push((point, index as f64)),
        }
    }
    let mut pieces: Vec<(DVec3, f64)> = knots.array_windows().map(|[(a, _), (b, _)]| piece(*a, *b)).collect();
    if pieces.is_empty() {
        pieces.push((DVec3::X, 0.0));
    }
    let step = std::f64::consts::TAU / f64::from(sides);
    let mut rings = Vec::new();
    for (index, &(point, v)) in knots.iter().enumerate() {
        let (to, lean_to) = pieces[index.min(pieces.len() - 1)];
        let (from, lean_from) = pieces[index.saturating_sub(1)];
        let mut push = |axis: DVec3, lean: f64| rings.push(on_sphere(point, axis, lean, v));
        if index == 0 {
            // From the pole to where the sphere meets the cone.
            let (start, end) = (-std::f64::consts::FRAC_PI_2, lean_to.asin());
            arc(start, end, step, |angle| push(to, if angle == start { -1.0 } else { angle.sin() }));
        }
        let bend = from.angle_between(to);
        if index > 0 && index + 1 < knots.len() && bend > 1e-6 {
            let hinge = from.cross(to).try_normalize().unwrap_or_else(|| from.any_orthonormal_vector());
            arc(0.0, bend, step, |angle| {
                let share = angle / bend;
                let axis = (DMat3::from_axis_angle(hinge, angle) * from).normalize();
                push(axis, lean_from + (lean_to - lean_from) * share);
            });
        } else if index > 0 && index + 1 < knots.len() {
            push(from, lean_from);
            // On a straight line, skip a repeated ring, whose triangles have no area.
            if (lean_to - lean_from).abs() > 1e-6 {
                push(to, lean_to);
            }
        }
        if index + 1 == knots.len() {
            let end = std::f64::consts::FRAC_PI_2;
            arc(lean_from.asin(), end, step, |angle| push(from, if angle == end { 1.0 } else { angle.sin() }));
        }
    }
    rings
}

/// Returns the direction from one sphere to the next, and the component along it of the normals of the cone tangent to
/// both, clamped if one sphere contains the other.
fn piece(a: DVec4, b: DVec4) -> (DVec3, f64) {
    let way = b.truncate() - a.truncate();
    (way.normalize(), ((a.w - b.w) / way.length()).clamp(-1.0, 1.0))
}

/// Returns the ring of a sphere where its normals have the component `lean` along an axis.
fn on_sphere(sphere: DVec4, axis: DVec3, lean: f64, v: f64) -> Ring {
    let radius = sphere.w * (1.0 - lean * lean).max(0.0).sqrt();
    Ring { center: sphere.truncate() + axis * (lean * sphere.w), axis, radius, lean, v }
}

/// Visits angles from `start` to `end`, both included, at most `step` apart.
fn arc(start: f64, end: f64, step: f64, mut visit: impl FnMut(f64)) {
    let count = ((end - start) / step).ceil().clamp(1.0, 1e3) as u32;
    visit(start);
    for index in 1..count {
        visit(start + (end - start) * f64::from(index) / f64::from(count));
    }
    visit(end);
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn mesh(rings: &[Ring], sides: u32) -> Mesh {
        let mut mesh = Mesh::default();
        tube::add(&mut mesh, rings, sides, azimuth);
        mesh
    }

    fn area(mesh: &Mesh) -> f64 {
        mesh.triangles.iter().map(|&triangle| f64::from(mesh.cross(triangle).length()) / 2.0).sum()
    }

    /// The volume that triangles enclose, by the divergence theorem.
    fn volume(mesh: &Mesh) -> f64 {
        let part = |&triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize].as_dvec3());
            a.dot(b.cross(c)) / 6.0
        };
        mesh.triangles.iter().map(part).sum()
    }

    #[test]
    fn a_linear_curve_is_a_capsule() {
        let points = [DVec4::new(0.0, 0.0, 0.0, 0.5), DVec4::new(0.0, 0.0, 2.0, 0.5)];
        let mesh = mesh(&linear_rings(&points, 128), 128);
        // Cylinder and a whole sphere.
        assert!((area(&mesh) / (PI * 2.0 + PI) - 1.0).abs() < 1e-3, "{}", area(&mesh));
        assert!((volume(&mesh) / (PI * 0.5 + PI / 6.0) - 1.0).abs() < 2e-3, "{}", volume(&mesh));
    }

    #[test]
    fn the_cone_between_two_spheres_touches_both() {
        // Radii 0.8 and 0.2, one apart: the normals lean by 0.6.
        let points = [DVec4::new(0.0, 0.0, 0.0, 0.8), DVec4::new(1.0, 0.0, 0.0, 0.2)];
        let rings = linear_rings(&points, 64);
        for ring in &rings {
            // Within the hull of both, and on it: distance to the nearer sphere's surface along the cone.
            let normal = DVec3::X * ring.lean + DVec3::Y * (1.0 - ring.lean * ring.lean).sqrt();
            let place = ring.center + DVec3::Y * ring.radius;
            let reach = points.iter().map(|sphere| sphere.truncate().dot(normal) + sphere.w).fold(f64::MIN, f64::max);
            assert!((place.dot(normal) - reach).abs() < 1e-12, "{ring:?}");
        }
        assert!(rings.iter().filter(|ring| (ring.lean - 0.6).abs() < 1e-12).count() == 2);
    }

    #[test]
    fn a_small_sphere_within_a_large_one_adds_nothing() {
        let points = [DVec4::new(0.0, 0.0, 0.0, 1.0), DVec4::new(0.1, 0.0, 0.0, 0.2)];
        let mesh = mesh(&linear_rings(&points, 64), 64);
        let farthest = mesh.positions.iter().map(|position| position.length()).fold(0.0, f32::max);
        assert!((farthest - 1.0).abs() < 2e-3, "{farthest}");
        assert!(mesh.positions.iter().all(|position| position.is_finite()));
    }

    #[test]
    fn bends_are_round_whatever_their_angle() {
        for degrees in [0.0f64, 1.0, 60.0, 90.0, 150.0, 180.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let points = [
                DVec4::new(-1.0, 0.0, 0.0, 0.2),
                DVec4::new(0.0, 0.0, 0.0, 0.2),
                DVec4::new(cos, sin, 0.0, 0.2),
                DVec4::new(cos, sin, 0.0, 0.2),
            ];
            let mesh = mesh(&linear_rings(&points, 32), 32);
            for position in &mesh.positions {
                let p = position.as_dvec3();
                let distance = |[a, b]: &[DVec4; 2]| {
                    let (a, way) = (a.truncate(), (b - a).truncate());
                    let t = ((p - a).dot(way) / way.length_squared()).clamp(0.0, 1.0);
                    (p - a - way * t).length()
                };
                // No vertex lies outside the union of both capsules.
                let distance = points[..3].array_windows().map(distance).fold(f64::MAX, f64::min);
                assert!(distance < 0.2 * 1.01, "{degrees}: {distance}");
            }
            assert!(mesh.normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5), "{degrees}");
        }
    }

    /// Places, normals and coordinates that Mitsuba 3.9 finds on a ray along −z at x = 1.5 (radii 0.1, 0.1, 0.2, 0.2).
    #[test]
    fn tubes_are_where_mitsuba_has_them() {
        let points: Vec<DVec4> =
            [0.1, 0.1, 0.2, 0.2].iter().zip(0..).map(|(&w, x)| DVec4::new(f64::from(x), 0.0, 0.0, w)).collect();
        let rings = spline_rings(&points, 32);
        let (first, last) = (rings.first().unwrap(), rings.last().unwrap());
        assert!((first.center.x - 1.0).abs() < 1e-12 && (last.center.x - 2.0).abs() < 1e-12);
        let middle = (8..128).find_map(|sides| spline_rings(&points, sides).into_iter().find(|ring| ring.v == 0.5));
        let middle = middle.expect("some number of pieces is even");
        assert!((middle.radius - 0.15).abs() < 1e-6 && (middle.lean + 0.07479).abs() < 1e-5, "{middle:?}");
        let linear = linear_rings(&points, 32);
        assert!(linear.iter().any(|ring| (ring.lean + 0.1).abs() < 1e-9 && ring.v == 1.0), "{linear:?}");
    }

    /// Expected values: Mitsuba 3.9, with rays at tubes along ten axes, including these.
    #[test]
    fn u_runs_as_in_mitsuba() {
        assert_eq!((azimuth(DVec3::X), azimuth(DVec3::Z), azimuth(-DVec3::Z)), (DVec3::Y, DVec3::X, -DVec3::X));
        // A corner at u = 0.0477 is 0.3 around from there.
        let axis = DVec3::new(0.364, 0.864, 0.348).normalize();
        let points = [DVec3::ZERO, axis * 3.0].map(|point| point.extend(0.1));
        let mesh = mesh(&linear_rings(&points, 32), 32);
        let (zero, quarter) = (azimuth(axis), axis.cross(azimuth(axis)));
        assert!(quarter.z > 0.0 && (quarter - (DVec3::Z - axis * axis.z).normalize()).length() < 1e-12);
        for (position, uv) in mesh.positions.iter().zip(&mesh.uvs[0]) {
            let p = position.as_dvec3();
            let out = p - axis * p.dot(axis);
            if out.length() > 0.05 {
                let u = out.dot(quarter).atan2(out.dot(zero)) / std::f64::consts::TAU;
                let off = (f64::from(uv.x) - u).rem_euclid(1.0);
                assert!(off.min(1.0 - off) < 1e-5, "{uv} {u}");
            }
        }
    }
}
