//! The shape `bilinearmesh`: bilinear patches.

use glam::{DVec2, DVec3};

use super::super::context::Context;
use super::super::params::Params;
use super::geometry::{Geometry, indices, matching, positions, texture_coordinate};
use crate::import::text_place::{ImportResult, TextPlace};
use crate::model::Mesh;

/// Maximal deviation of the triangles from the patch, in diagonals of the patch.
const TOLERANCE: f64 = 1e-3;

/// Maximal number of strips in either direction.
const STEPS_MAX: f64 = 32.0;

/// Reads a `bilinearmesh`.
pub(super) fn read(context: &mut Context<'_>, params: &Params, at: TextPlace) -> ImportResult<Geometry> {
    let points = params.points3("P", "point3")?.ok_or_else(|| at.fault("`bilinearmesh` needs the positions `P`"))?;
    positions(&points, params.place_of("P"))?;
    let count = points.len();
    let corners = match params.integers("indices") {
        Some(numbers) => indices(numbers, count, params.place_of("indices"))?,
        None if count == 4 => vec![0, 1, 2, 3],
        None => return Err(at.fault("`bilinearmesh` needs `indices`").into()),
    };
    let (patches, rest) = corners.as_chunks::<4>();
    if !rest.is_empty() {
        context.warn(
            params.place_of("indices"),
            "the number of indices is not a multiple of 4; the last ones are left out",
        );
    }
    let normals = params.points3("N", "normal")?;
    let normals = matching(context, normals, "N", count, params.place_of("N"));
    let uvs = params.points2("uv")?;
    let uvs = matching(context, uvs, "uv", count, params.place_of("uv"));

    let mut mesh = Mesh::default();
    let place = context.place(at);
    for patch in patches {
        let [p00, p10, p01, p11] = patch.map(|vertex| points[vertex as usize]);
        let twist = 0.25 * (p00 - p10 - p01 + p11).length();
        let size = (p11 - p00).length().max((p01 - p10).length());
        let steps = (twist / (TOLERANCE * size)).sqrt().ceil().clamp(1.0, STEPS_MAX) as u32;
        // Position, normal and texture coordinates of a vertex, and two triangles.
        let bytes = (steps as usize + 1).pow(2) * (32 + 24);
        context.resources.budget().take(context.path(at.file), &place, bytes)?;
        let first = mesh.positions.len() as u32;
        for row in 0..=steps {
            for column in 0..=steps {
                let uv = DVec2::new(f64::from(column), f64::from(row)) / f64::from(steps);
                mesh.positions.push(blend(patch, &points, uv).as_vec3());
                if !normals.is_empty() {
                    mesh.normals.push(blend(patch, &normals, uv).as_vec3());
                }
                let uv = if uvs.is_empty() { uv } else { blend(patch, &uvs, uv) };
                mesh.uvs[0].push(texture_coordinate(uv));
            }
        }
        for row in 0..steps {
            for column in 0..steps {
                let a = first + row * (steps + 1) + column;
                let b = a + steps + 1;
                mesh.triangles.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
            }
        }
        // A single twisted patch has smooth normals.
        if normals.is_empty() && patches.len() == 1 && steps > 1 {
            smooth(&mut mesh, [p00, p10, p01, p11], steps);
        }
    }
    mesh.mend_normals();
    mesh.face_normals();
    Ok(Geometry::Mesh { mesh: Box::new(mesh), primitive_count: patches.len() })
}

/// Interpolates values of the corners bilinearly.
fn blend<T>(patch: &[u32; 4], values: &[T], uv: DVec2) -> T
where
    T: Copy + std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T>,
{
    let [a, b, c, d] = patch.map(|vertex| values[vertex as usize]);
    (a * (1.0 - uv.x) + b * uv.x) * (1.0 - uv.y) + (c * (1.0 - uv.x) + d * uv.x) * uv.y
}

fn smooth(mesh: &mut Mesh, [p00, p10, p01, p11]: [DVec3; 4], steps: u32) {
    for row in 0..=steps {
        for column in 0..=steps {
            let uv = DVec2::new(f64::from(column), f64::from(row)) / f64::from(steps);
            let along_u = (p10 - p00).lerp(p11 - p01, uv.y);
            let along_v = (p01 - p00).lerp(p11 - p10, uv.x);
            mesh.normals.push(along_u.cross(along_v).normalize_or_zero().as_vec3());
        }
    }
}
