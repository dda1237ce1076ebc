//! Simple shapes as triangles, with the parameterization of Mitsuba 3.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec2, Vec3};

use crate::model::Mesh;

/// Segments of a circle: chords deviate by at most 1 − cos(π ∕ 256) < 10⁻⁴ of the radius.
const SEGMENTS: u32 = 256;

/// Returns the square [−1, 1]² at z = 0, front towards +z.
pub(super) fn rectangle() -> Mesh {
    let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(u, v)| Vec2::new(u as f32, v as f32));
    Mesh {
        positions: corners.iter().map(|uv| (2.0 * *uv - Vec2::ONE).extend(0.0)).collect(),
        normals: vec![Vec3::Z; 4],
        uvs: [corners.to_vec(), Vec::new()],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// Returns the cube [−1, 1]³, front outside.
pub(super) fn cube() -> Mesh {
    // Normal, u direction and v direction of each side.
    const SIDES: [[Vec3; 3]; 6] = [
        [Vec3::NEG_Y, Vec3::Z, Vec3::X],
        [Vec3::Y, Vec3::NEG_X, Vec3::NEG_Z],
        [Vec3::X, Vec3::Y, Vec3::NEG_Z],
        [Vec3::Z, Vec3::Y, Vec3::X],
        [Vec3::NEG_X, Vec3::Y, Vec3::Z],
        [Vec3::NEG_Z, Vec3::NEG_Y, Vec3::X],
    ];
    let mut mesh = Mesh::default();
    for [normal, u, v] in SIDES {
        let first = mesh.positions.len() as u32;
        for uv in [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y] {
            mesh.positions.push(normal + u * (2.0 * uv.x - 1.0) + v * (2.0 * uv.y - 1.0));
            mesh.normals.push(normal);
            mesh.uvs[0].push(uv);
        }
        // The texture is mirrored on some sides.
        let (second, last) = if u.cross(v).dot(normal) > 0.0 { (first + 1, first + 3) } else { (first + 3, first + 1) };
        mesh.triangles.extend([[first, second, first + 2], [first, first + 2, last]]);
    }
    mesh
}

/// Returns the unit disk at z = 0, front towards +z. u grows along the radius, v around.
pub(super) fn disk() -> Mesh {
    let mut mesh = Mesh::default();
    for segment in 0..=SEGMENTS {
        let v = f64::from(segment) / f64::from(SEGMENTS);
        let (sin, cos) = (v * TAU).sin_cos();
        // Each segment has its own centre vertex, half-way in v.
        let middle = ((f64::from(segment) + 0.5) / f64::from(SEGMENTS)) as f32;
        mesh.positions.extend([Vec3::new(cos as f32, sin as f32, 0.0), Vec3::ZERO]);
        mesh.uvs[0].extend([Vec2::new(1.0, v as f32), Vec2::new(0.0, middle)]);
        if segment < SEGMENTS {
            mesh.triangles.push([2 * segment + 1, 2 * segment, 2 * segment + 2]);
        }
    }
    mesh.normals = vec![Vec3::Z; mesh.positions.len()];
    mesh
}

/// Returns the unit cylinder around z from 0 to 1 without caps, front outside. u grows around, v along.
pub(super) fn cylinder() -> Mesh {
    let mut mesh = Mesh::default();
    for segment in 0..=SEGMENTS {
        let u = f64::from(segment) / f64::from(SEGMENTS);
        let (sin, cos) = (u * TAU).sin_cos();
        let normal = Vec3::new(cos as f32, sin as f32, 0.0);
        mesh.positions.extend([normal, normal + Vec3::Z]);
        mesh.normals.extend([normal; 2]);
        mesh.uvs[0].extend([Vec2::new(u as f32, 0.0), Vec2::new(u as f32, 1.0)]);
        if segment < SEGMENTS {
            let a = 2 * segment;
            mesh.triangles.extend([[a, a + 2, a + 3], [a, a + 3, a + 1]]);
        }
    }
    mesh
}

/// Returns the unit sphere, front outside. u grows around +z from +x, v from +z down.
pub(super) fn sphere() -> Mesh {
    const ROWS: u32 = SEGMENTS / 2;
    let mut mesh = Mesh::default();
    for row in 0..=ROWS {
        let v = f64::from(row) / f64::from(ROWS);
        let (sin_polar, cos_polar) = (v * PI).sin_cos();
        for segment in 0..=SEGMENTS {
            let u = f64::from(segment) / f64::from(SEGMENTS);
            let (sin, cos) = (u * TAU).sin_cos();
            let normal = DVec3::new(sin_polar * cos, sin_polar * sin, cos_polar).as_vec3();
            mesh.positions.push(normal);
            mesh.normals.push(normal);
            mesh.uvs[0].push(Vec2::new(u as f32, v as f32));
        }
    }
    for row in 0..ROWS {
        for segment in 0..SEGMENTS {
            let upper = row * (SEGMENTS + 1) + segment;
            let lower = upper + SEGMENTS + 1;
            if row > 0 {
                mesh.triangles.push([upper, lower, upper + 1]);
            }
            if row + 1 < ROWS {
                mesh.triangles.push([upper + 1, lower, lower + 1]);
            }
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_run_counter_clockwise_around_their_normals() {
        for (mesh, area) in [(rectangle(), 4.0), (cube(), 24.0), (disk(), PI), (cylinder(), TAU), (sphere(), 2.0 * TAU)]
        {
            let mut sum = 0.0;
            for &triangle in &mesh.triangles {
                let cross = mesh.cross(triangle);
                assert!(triangle.iter().all(|&vertex| mesh.normals[vertex as usize].dot(cross) > 0.0));
                sum += f64::from(cross.length()) / 2.0;
            }
            assert!((sum / area - 1.0).abs() < 3e-4, "{sum} {area}");
        }
    }

    #[test]
    fn chords_stay_within_the_stated_error() {
        assert!(1.0 - (PI / f64::from(SEGMENTS)).cos() < 1e-4);
    }
}
