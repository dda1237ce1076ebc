//! Division of polygons into triangles.

use glam::{DVec2, DVec3};

/// Most corners of a polygon whose ears are searched; one with more is a fan.
const CORNERS_MAX: usize = 4096;

/// Divides a polygon into triangles with its orientation, as indices of its corners. A convex one becomes a fan around its
/// first corner.
///
/// - `corners`: at least 3.
pub(super) fn triangles(corners: &[DVec3]) -> Vec<[u32; 3]> {
    let count = corners.len();
    let fan = || (2..count as u32).map(|corner| [0, corner - 1, corner]).collect();
    if count == 3 || count > CORNERS_MAX {
        return fan();
    }
    let flat = flattened(corners);
    let is_left = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp_dot(flat[c] - flat[b]) >= 0.0;
    if (0..count).all(|corner| is_left(corner, (corner + 1) % count, (corner + 2) % count)) {
        return fan();
    }
    // Cut off ears: convex corners whose triangle has no other corner within
    let mut rest: Vec<usize> = (0..count).collect();
    let mut triangles = Vec::with_capacity(count - 2);
    while rest.len() > 3 {
        let length = rest.len();
        let ear = (0..length).find(|&at| {
            let [a, b, c] = [rest[(at + length - 1) % length], rest[at], rest[(at + 1) % length]];
            let is_within =
                |&p: &usize| ![a, b, c].contains(&p) && is_left(a, b, p) && is_left(b, c, p) && is_left(c, a, p);
            (flat[b] - flat[a]).perp_dot(flat[c] - flat[b]) > 0.0 && !rest.iter().any(is_within)
        });
        // A polygon that crosses itself may have none
        let at = ear.unwrap_or(1);
        let [a, b, c] = [rest[(at + length - 1) % length], rest[at], rest[(at + 1) % length]];
        triangles.push([a, b, c].map(|corner| corner as u32));
        rest.remove(at);
    }
    triangles.push([rest[0], rest[1], rest[2]].map(|corner| corner as u32));
    triangles
}

/// Returns the corners in the plane of the polygon, counter-clockwise as a whole (Newell's normal).
fn flattened(corners: &[DVec3]) -> Vec<DVec2> {
    let next = corners.iter().cycle().skip(1);
    let normal: DVec3 = corners.iter().zip(next).map(|(a, b)| (*a - corners[0]).cross(*b - corners[0])).sum();
    let normal = normal.try_normalize().unwrap_or(DVec3::Z);
    let x = normal.any_orthonormal_vector();
    let y = normal.cross(x);
    corners.iter().map(|corner| DVec2::new((*corner - corners[0]).dot(x), (*corner - corners[0]).dot(y))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[DVec3]) -> (f64, f64) {
        let each = triangles(corners);
        let area = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(|corner| corners[corner as usize]);
            0.5 * (b - a).cross(c - a).z
        };
        (each.iter().map(|&triangle| area(triangle)).sum(), each.iter().map(|&triangle| area(triangle).abs()).sum())
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        let star: Vec<DVec3> = (0..10)
            .map(|index| {
                let (sin, cos) = (f64::from(index) * std::f64::consts::PI / 5.0).sin_cos();
                DVec3::new(cos, sin, 0.0) * if index % 2 == 0 { 1.0 } else { 0.3 }
            })
            .collect();
        let (signed, absolute) = area(&star);
        // Ten triangles with the sides 1 and 0.3 around an angle of 36°
        let expected = 10.0 * 0.5 * 0.3 * (std::f64::consts::PI / 5.0).sin();
        assert!((signed - expected).abs() < 1e-12 && (absolute - expected).abs() < 1e-12, "{signed} {absolute}");
        let turned: Vec<DVec3> = star.iter().rev().copied().collect();
        assert!((area(&turned).0 + expected).abs() < 1e-12);
    }

    #[test]
    fn strange_polygons_end() {
        let point = [DVec3::ONE; 7];
        assert_eq!(triangles(&point).len(), 5);
        let bow = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0), DVec3::NAN];
        assert_eq!(triangles(&bow).len(), 3);
    }
}
