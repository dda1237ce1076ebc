//! Curves (UsdGeomBasisCurves) as strands, and points (UsdGeomPoints) as spheres.

use std::rc::Rc;

use glam::{DAffine3, DVec3, DVec4, Vec3};

use super::context::{VisitedPrim, Walk};
use super::look::look_of;
use super::placement::{self, Thing, ThingPlacement};
use super::primvar::{self, Interpolation, Primvar};
use super::values;

use crate::error::SceneError;
use crate::facing_curves::CurveLook;
use crate::import::bezier::{BezierSegment, bezier_of_bspline, parameters};
use crate::import::strand::{self, Station, add_hull};
use crate::model::Mesh;

/// Maximal deviation of a straight piece from the curve, in widths.
const TOLERANCE: f64 = 0.02;

/// Maximal number of pieces per segment.
const PIECES_MAX: f64 = 32.0;

/// The form of curves.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CurveForm {
    basis: Basis,
    wrap: CurveWrap,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Basis {
    Linear,
    Bezier,
    Bspline,
    CatmullRom,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CurveWrap {
    Open,
    Periodic,
    Pinned,
}

/// Adds curves.
pub(super) fn add(
    walk: &mut Walk<'_, '_, '_>,
    visited: &VisitedPrim<'_>,
    placements: &mut Vec<ThingPlacement>,
) -> Result<(), SceneError> {
    let (source, prim, time) = (walk.source, visited.prim, walk.time);
    let path = prim.path().as_str();
    let points = source.read(prim, "points", time, values::vectors).unwrap_or_default();
    let counts = source.read(prim, "curveVertexCounts", time, values::integers).unwrap_or_default();
    if points.is_empty() || counts.is_empty() {
        return Ok(());
    }
    let text = |name: &str| source.text(prim, name, time).unwrap_or_default();
    let basis = match (text("type").as_str(), text("basis").as_str()) {
        ("linear", _) => Basis::Linear,
        (_, "bspline") => Basis::Bspline,
        (_, "catmullRom") => Basis::CatmullRom,
        (_, "bezier" | "") => Basis::Bezier,
        (_, other) => {
            source.unsupported(path, format!("curves of the basis `{other}` are left out"));
            return Ok(());
        }
    };
    let wrap = match text("wrap").as_str() {
        "periodic" => CurveWrap::Periodic,
        "pinned" => CurveWrap::Pinned,
        _ => CurveWrap::Open,
    };
    let sum: i64 = counts.iter().map(|&count| i64::from(count)).sum();
    if counts.iter().any(|&count| count < 0) || sum > points.len() as i64 {
        source.warn(path, format!("has {} points for curves of {sum}; the curves are left out", points.len()));
        return Ok(());
    }
    if points.iter().any(|point| !values::is_reachable(point)) {
        source.warn(path, "a point is not finite, or out of reach; the curves are left out");
        return Ok(());
    }
    if source.value(prim, "normals", time).is_some() || source.value(prim, "primvars:normals", time).is_some() {
        source.unsupported_once(path, "curves with normals are rendered as round tubes");
    }
    let widths = ["primvars:widths", "widths"]
        .iter()
        .find_map(|name| primvar::read(source, prim, name, time, Interpolation::Vertex, values::numbers));
    if widths.is_none() {
        source.warn(path, "the curves have no width; it is 1, as the schema says");
    }
    let widths = widths.unwrap_or_else(|| Primvar::new(vec![1.0], Interpolation::Constant));
    let form = CurveForm { basis, wrap };
    let mut mesh = Mesh::default();
    let (mut first, mut first_varying) = (0, 0);
    for (curve, &count) in counts.iter().enumerate() {
        let count = count as usize;
        let controls = &points[first..first + count];
        let varying = form.varying_count(count);
        let width = |index: usize| {
            let element = match widths.interpolation {
                Interpolation::Constant => 0,
                Interpolation::Uniform => curve,
                Interpolation::Varying if form.basis != Basis::Linear => first_varying + index * varying / count.max(1),
                _ => first + index,
            };
            f64::from(widths.at(element).or(widths.at(0)).unwrap_or(1.0)).max(0.0)
        };
        let controls: Vec<DVec4> =
            controls.iter().enumerate().map(|(index, point)| point.as_dvec3().extend(width(index))).collect();
        let line = form.line(&controls);
        source.take(path, strand::memory_bytes(line.len()))?;
        add_hull(&mut mesh, &line, CurveLook::Round);
        first += count;
        first_varying += varying;
    }
    if mesh.triangles.is_empty() {
        source.warn(path, "the curves have no length and are left out");
        return Ok(());
    }
    let part = look_of(walk, visited, prim.path());
    if part.color.is_some() || !part.look.uv_sets.is_empty() {
        source.unsupported_once(path, "colours and textures that vary on curves are left out");
    }
    let material = part.look.material;
    mesh.material = material;
    mesh.name = prim.path().name().unwrap_or_default().to_owned();
    let mesh = walk.scene.push_mesh(mesh);
    let thing = Thing::Mesh { mesh, material };
    placements.push(ThingPlacement { thing, world_from_object: visited.world_from_prim, path: path.into() });
    Ok(())
}

impl CurveForm {
    /// Returns the number of ends of segments of a curve.
    fn varying_count(&self, controls: usize) -> usize {
        let segments = self.segments(&vec![DVec4::ZERO; controls]).len();
        if self.wrap == CurveWrap::Periodic { segments } else { segments + 1 }
    }

    /// Returns the Bézier control points of the segments of a curve; w is the width.
    fn segments(&self, controls: &[DVec4]) -> Vec<[DVec4; 4]> {
        let count = controls.len();
        let is_periodic = self.wrap == CurveWrap::Periodic;
        let at = |index: usize| controls[index % count];
        match self.basis {
            Basis::Linear => {
                let segments = if is_periodic && count > 1 { count } else { count.saturating_sub(1) };
                let segment = |start: usize| {
                    let (a, b) = (at(start), at(start + 1));
                    [a, a.lerp(b, 1.0 / 3.0), a.lerp(b, 2.0 / 3.0), b]
                };
                (0..segments).map(segment).collect()
            }
            Basis::Bezier => {
                let segments = if is_periodic { count / 3 } else { count.saturating_sub(1) / 3 };
                (0..segments).map(|start| [0, 1, 2, 3].map(|index| at(3 * start + index))).collect()
            }
            Basis::Bspline | Basis::CatmullRom => {
                // Further points before and behind let a pinned curve end at its end points
                let pinned: Vec<DVec4>;
                let controls = match controls {
                    [first, second, .., before, last] if self.wrap == CurveWrap::Pinned => {
                        let ends = [*first * 2.0 - *second, *last * 2.0 - *before];
                        pinned = std::iter::once(ends[0]).chain(controls.iter().copied()).chain([ends[1]]).collect();
                        &pinned
                    }
                    controls => controls,
                };
                let count = controls.len();
                let segments = match count {
                    0..3 => 0,
                    _ if is_periodic => count,
                    _ => count.saturating_sub(3),
                };
                let four = |start: usize| [0, 1, 2, 3].map(|index| controls[(start + index) % count]);
                let bezier = |points: [DVec4; 4]| {
                    if self.basis == Basis::Bspline {
                        return bezier_of_bspline(points);
                    }
                    let [a, b, c, d] = points;
                    [b, b + (c - a) / 6.0, c - (d - b) / 6.0, c]
                };
                (0..segments).map(|start| bezier(four(start))).collect()
            }
        }
    }

    /// Returns the stations of a curve, without points in the same place; empty if it has no length.
    fn line(&self, controls: &[DVec4]) -> Vec<Station> {
        let segments = self.segments(controls);
        let mut places: Vec<DVec4> = Vec::new();
        for (number, segment) in segments.iter().enumerate() {
            let segment = BezierSegment(*segment);
            let width = segment.0.iter().map(|point| point.w).fold(0.0, f64::max);
            let tolerance = (TOLERANCE * width).max(1e-4 * segment.control_length());
            let pieces = if self.basis == Basis::Linear { 1 } else { segment.pieces(tolerance, PIECES_MAX) };
            for t in parameters(number == 0, pieces) {
                let point = segment.point(t);
                if places.last().is_none_or(|last| last.truncate().as_vec3() != point.truncate().as_vec3()) {
                    places.push(point);
                }
            }
        }
        stations(&places)
    }
}

/// Returns the stations through places; w is the width.
fn stations(places: &[DVec4]) -> Vec<Station> {
    let Some(last) = places.len().checked_sub(1).filter(|&last| last > 0) else { return Vec::new() };
    let place = |index: usize| places[index].truncate();
    let total: f64 = (0..last).map(|index| (place(index + 1) - place(index)).length()).sum();
    let mut along = 0.0;
    let station = |index: usize| {
        if index > 0 {
            along += (place(index) - place(index - 1)).length();
        }
        // A curve that turns back has the direction of its next piece there
        let onward = (place((index + 1).min(last)) - place(index.min(last - 1))).normalize_or(DVec3::X);
        let tangent = (place((index + 1).min(last)) - place(index.saturating_sub(1))).try_normalize().unwrap_or(onward);
        Station { position: place(index), tangent, width: places[index].w, along: along / total }
    };
    (0..places.len()).map(station).collect()
}

/// Adds points as spheres.
pub(super) fn add_points(
    walk: &mut Walk<'_, '_, '_>,
    visited: &VisitedPrim<'_>,
    placements: &mut Vec<ThingPlacement>,
) -> Result<(), SceneError> {
    let (source, prim, time) = (walk.source, visited.prim, walk.time);
    let path: Rc<str> = prim.path().as_str().into();
    let points = source.read(prim, "points", time, values::vectors).unwrap_or_default();
    let widths = ["primvars:widths", "widths"]
        .iter()
        .find_map(|name| primvar::read(source, prim, name, time, Interpolation::Vertex, values::numbers));
    let part = look_of(walk, visited, prim.path());
    let colors =
        part.color.as_ref().and_then(|name| primvar::vectors(source, prim, &visited.inherited.ancestors, name, time));
    placement::book(source, &path, placements.len(), points.len())?;
    for (index, point) in points.iter().enumerate() {
        let width = match &widths {
            Some(widths) if widths.interpolation == Interpolation::Constant => widths.at(0),
            Some(widths) => widths.at(index),
            None => Some(1.0),
        };
        let width = f64::from(width.unwrap_or(1.0));
        if !(point.is_finite() && width.is_finite()) {
            source.warn(&path, "some points are not finite and are left out");
            continue;
        }
        if width <= 0.0 {
            continue;
        }
        let material = match colors.as_ref().and_then(|colors| colors.at(index)) {
            Some(color) => walk.materials.plain(Vec3::extend(color, 1.0).to_array()).material,
            None => part.look.material,
        };
        let world_from_object = visited.world_from_prim * DAffine3::from_translation(point.as_dvec3());
        let thing = Thing::Sphere { radius: 0.5 * width, material };
        placements.push(ThingPlacement { thing, world_from_object, path: path.clone() });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(count: usize) -> Vec<DVec4> {
        (0..count).map(|index| DVec4::new(index as f64, (index * index) as f64, 0.0, 0.1)).collect()
    }

    #[test]
    fn curves_have_the_segments_of_their_form() {
        let count = |basis, wrap, controls| CurveForm { basis, wrap }.segments(&points(controls)).len();
        assert_eq!(count(Basis::Linear, CurveWrap::Open, 5), 4);
        assert_eq!(count(Basis::Linear, CurveWrap::Periodic, 5), 5);
        assert_eq!(count(Basis::Bezier, CurveWrap::Open, 7), 2);
        assert_eq!(count(Basis::Bezier, CurveWrap::Periodic, 6), 2);
        assert_eq!(count(Basis::Bspline, CurveWrap::Open, 6), 3);
        assert_eq!(count(Basis::Bspline, CurveWrap::Periodic, 6), 6);
        assert_eq!(count(Basis::CatmullRom, CurveWrap::Pinned, 4), 3);
        for basis in [Basis::Linear, Basis::Bezier, Basis::Bspline, Basis::CatmullRom] {
            for wrap in [CurveWrap::Open, CurveWrap::Periodic, CurveWrap::Pinned] {
                for controls in 0..5 {
                    let line = CurveForm { basis, wrap }.line(&points(controls));
                    assert!(line.iter().all(|station| station.tangent.is_normalized()));
                }
            }
        }
    }

    #[test]
    fn pinned_curves_end_at_their_end_points() {
        for basis in [Basis::Bspline, Basis::CatmullRom] {
            let controls = points(5);
            let segments = CurveForm { basis, wrap: CurveWrap::Pinned }.segments(&controls);
            assert!((segments[0][0] - controls[0]).length() < 1e-12, "{basis:?}");
            assert!((segments[segments.len() - 1][3] - controls[4]).length() < 1e-12, "{basis:?}");
        }
    }
}
