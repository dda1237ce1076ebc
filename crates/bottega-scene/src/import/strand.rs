//! Curves with a hull of triangles around them, from points on their centre lines.

use glam::DVec3;

use crate::facing_curves::{CurveLook, CurvePoint, FacingCurves, HULL};
use crate::model::Mesh;

/// Corners of a cross-section of the hull.
const SIDES: u32 = 4;

/// Maximal distance between the curve and the axis of its prism, in half widths of the curve. A larger value makes fewer prisms,
/// and more rays hit a prism and miss its curve.
const SLACK: f64 = 0.5;
/// Least cosine between a prism of the hull and the curve within.
const STRAIGHT: f64 = 0.95;
/// Maximal number of pieces of a curve in a prism.
const PIECES_MAX: usize = 16;

/// A point on the centre line of a curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Station {
    pub(crate) position: DVec3,
    /// Direction of the curve, unit length.
    pub(crate) tangent: DVec3,
    pub(crate) width: f64,
    /// Texture coordinate along the curve.
    pub(crate) along: f64,
}

/// Returns the memory that [`add_hull`] uses for `stations` points, in bytes.
pub(crate) fn memory_bytes(stations: usize) -> usize {
    let corners = SIDES as usize * size_of::<[f32; 3]>();
    let triangles = 2 * SIDES as usize * (size_of::<[u32; 3]>() + size_of::<u32>());
    stations.saturating_mul(corners + triangles + size_of::<CurvePoint>())
}

/// Adds a curve with its hull, closed at its ends, to a mesh that holds curves of the same look or nothing.
pub(crate) fn add_hull(mesh: &mut Mesh, line: &[Station], look: CurveLook) {
    let Some(last) = line.len().checked_sub(1).filter(|&last| last > 0) else { return };
    let first_corner = mesh.positions.len() as u32;
    let curves =
        mesh.curves.get_or_insert_with(|| Box::new(FacingCurves { look, points: Vec::new(), pieces: Vec::new() }));
    let first_point = curves.points.len() as u32;
    curves.points.extend(line.iter().enumerate().map(|(index, station)| CurvePoint {
        position: station.position.as_vec3(),
        tangent: station.tangent.as_vec3().normalize(),
        radius: (0.5 * station.width) as f32,
        along: station.along as f32,
        is_last: index == last,
    }));
    let rings = rings(line);
    let around: Vec<Station> =
        rings.iter().map(|&(station, half)| Station { width: 2.0 * half, ..line[station] }).collect();
    each_ring(&around, SIDES, |station, out| {
        mesh.positions.push((station.position + out * (0.5 * f64::from(HULL) * station.width)).as_vec3());
    });
    for (ring, ends) in rings.windows(2).enumerate() {
        let corners = sides_between(ring as u32, SIDES).map(|triangle| triangle.map(|corner| corner + first_corner));
        mesh.triangles.extend(corners);
        // Search for the piece that is hit from the middle.
        let middle = (ends[0].0 + ends[1].0) / 2;
        curves.pieces.extend([first_point + middle as u32; 2 * SIDES as usize]);
    }
    let (a, b) = (first_corner, first_corner + (rings.len() as u32 - 1) * SIDES);
    mesh.triangles.extend([[a, a + 2, a + 1], [a, a + 3, a + 2], [b, b + 1, b + 2], [b, b + 2, b + 3]]);
    curves.pieces.extend([0, 0, last - 1, last - 1].map(|piece| first_point + piece as u32));
}

/// Returns the stations at which the hull has a cross-section, with the half width that it must enclose there.
fn rings(line: &[Station]) -> Vec<(usize, f64)> {
    let last = line.len() - 1;
    let mut rings = vec![(0, 0.0)];
    let mut from = 0;
    while from < last {
        // Make the prism as long as the curve is straight enough
        let alone = 0.5 * line[from].width.max(line[from + 1].width);
        let (mut to, mut half) = (from + 1, alone);
        while to < last.min(from + PIECES_MAX)
            && let Some(longer) = half_width(&line[from..=to + 1])
        {
            (to, half) = (to + 1, longer);
        }
        if let Some(before) = rings.last_mut() {
            before.1 = half.max(before.1);
        }
        rings.push((to, half));
        from = to;
    }
    rings
}

/// Returns the half width of a prism that goes straight from the first to the last station. `None`: the curve bends too
/// much within.
fn half_width(line: &[Station]) -> Option<f64> {
    let (first, last) = (line.first()?, line.last()?);
    let axis = (last.position - first.position).try_normalize()?;
    let (mut widest, mut off) = (0.0_f64, 0.0_f64);
    for station in line {
        if station.tangent.dot(axis) < STRAIGHT {
            return None;
        }
        widest = widest.max(0.5 * station.width);
        off = off.max((station.position - first.position).reject_from_normalized(axis).length());
    }
    (off <= SLACK * widest).then_some(widest + off)
}

/// Visits the corners of all cross-sections: their stations and outward directions.
pub(crate) fn each_ring(line: &[Station], sides: u32, mut visit: impl FnMut(&Station, DVec3)) {
    let mut x = line.first().map_or(DVec3::X, |station| station.tangent.any_orthonormal_vector());
    for station in line {
        // The frame twists no more than the curve does.
        x = (x - station.tangent * station.tangent.dot(x))
            .try_normalize()
            .unwrap_or(station.tangent.any_orthonormal_vector());
        let y = station.tangent.cross(x);
        for side in 0..sides {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(side) / f64::from(sides)).sin_cos();
            visit(station, x * cos + y * sin);
        }
    }
}

/// Returns the triangles between a cross-section and the next.
pub(crate) fn sides_between(ring: u32, sides: u32) -> impl Iterator<Item = [u32; 3]> {
    let (a, b) = (ring * sides, (ring + 1) * sides);
    (0..sides).flat_map(move |side| {
        let next = (side + 1) % sides;
        [[a + side, a + next, b + next], [a + side, b + next, b + side]]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hull_encloses_its_curve_in_few_prisms() {
        // A quarter of a circle of radius 1 and width 0.05, in 32 pieces.
        let line: Vec<Station> = (0..=32)
            .map(|i| {
                let along = f64::from(i) / 32.0;
                let (sin, cos) = (along * std::f64::consts::FRAC_PI_2).sin_cos();
                Station { position: DVec3::new(cos, sin, 0.0), tangent: DVec3::new(-sin, cos, 0.0), width: 0.05, along }
            })
            .collect();
        let mut mesh = Mesh::default();
        add_hull(&mut mesh, &line, CurveLook::Round);
        let prisms = (mesh.triangles.len() - 4) / 8;
        assert!((3..=12).contains(&prisms), "{prisms}");
        assert!(mesh.curves.as_ref().unwrap().check(mesh.triangles.len()).is_ok());
        // Each point of the surface of the curve lies behind all triangles of its prism.
        let rings = rings(&line);
        for (station, at) in line.iter().zip(0..) {
            let prism = rings.windows(2).position(|ends| (ends[0].0..=ends[1].0).contains(&at)).unwrap();
            let other = station.tangent.cross(DVec3::Z);
            for turn in 0..16 {
                let (sin, cos) = (f64::from(turn) * std::f64::consts::TAU / 16.0).sin_cos();
                let point = station.position + (DVec3::Z * cos + other * sin) * (0.5 * station.width);
                for triangle in &mesh.triangles[8 * prism..8 * (prism + 1)] {
                    let corner = mesh.positions[triangle[0] as usize].as_dvec3();
                    let out = mesh.cross(*triangle).as_dvec3();
                    assert!((point - corner).dot(out) < 0.0, "{at} {turn}");
                }
            }
        }
        // A straight curve is one prism for 16 pieces, and what turns sharply has one for each piece.
        let straight =
            [0.0, 1.0, 2.0, 3.0].map(|x| Station { position: DVec3::X * x, tangent: DVec3::X, width: 0.1, along: x });
        assert_eq!(super::rings(&straight), [(0, 0.05), (3, 0.05)]);
        let mut bent = straight;
        (bent[1].position, bent[2].position) = (DVec3::new(1.0, 1.0, 0.0), DVec3::new(2.0, -1.0, 0.0));
        assert_eq!(super::rings(&bent).len(), 4);
    }

    #[test]
    fn curves_in_one_mesh_keep_their_points_and_hulls() {
        let line = |x: f64| {
            [0.0, 1.0, 2.0].map(|y| Station {
                position: DVec3::new(x, y, 0.0),
                tangent: DVec3::Y,
                width: 0.2,
                along: 0.5 * y,
            })
        };
        let mut mesh = Mesh::default();
        add_hull(&mut mesh, &line(0.0), CurveLook::Round);
        add_hull(&mut mesh, &line(0.0)[..1], CurveLook::Round);
        add_hull(&mut mesh, &line(5.0), CurveLook::Round);
        let curves = mesh.curves.as_ref().unwrap();
        assert_eq!((curves.points.len(), mesh.triangles.len(), curves.pieces.len()), (6, 24, 24));
        assert!(curves.check(mesh.triangles.len()).is_ok());
        assert!(memory_bytes(6) >= mesh.memory_bytes());
        for (triangle, piece) in mesh.triangles.iter().zip(&curves.pieces) {
            let of_second = triangle.iter().all(|&corner| mesh.positions[corner as usize].x > 2.0);
            assert_eq!(of_second, *piece >= 3, "{triangle:?} {piece}");
        }
    }
}
