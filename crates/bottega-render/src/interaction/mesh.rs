//! The surface at a point of a triangle: positions, texture coordinates and tangents.

use bottega_kernels::{Hit, prefetch};
use bottega_scene::Mesh;
use glam::{Vec2, Vec3};

use crate::surfaces::Surfaces;

/// Prefetches the triangle that was hit.
#[inline(always)]
pub(crate) fn request_triangle(surfaces: &Surfaces, hit: &Hit) {
    if !hit.is_none() && hit.sphere().is_none() {
        prefetch(&surfaces.mesh(hit.instance).triangles, hit.primitive as usize);
    }
}

/// Prefetches the vertices of the triangle that was hit.
#[inline(always)]
pub(crate) fn request_vertices(surfaces: &Surfaces, hit: &Hit) {
    if hit.is_none() || hit.sphere().is_some() {
        return;
    }
    let mesh = surfaces.mesh(hit.instance);
    for vertex in mesh.triangles[hit.primitive as usize] {
        prefetch(&mesh.positions, vertex as usize);
        prefetch(&mesh.normals, vertex as usize);
        prefetch(&mesh.uvs[0], vertex as usize);
    }
}

/// A triangle: the indices of its vertices, and where they are in object space.
pub(super) struct TriangleShape {
    pub(super) triangle: [u32; 3],
    pub(super) corners: [Vec3; 3],
}

/// Returns the offset from a point of a facet to the curved surface that the vertex normals describe; zero if it lies
/// above.
///
/// Source: Hanika 2021, *Hacking the Shadow Terminator*, Ray Tracing Gems II, chapter 4.
#[inline(always)]
pub(super) fn lift_off_facets(
    p: Vec3,
    corners: &[Vec3; 3],
    normals: &[Vec3; 3],
    weights: [f32; 3],
    front: bool,
) -> Vec3 {
    let side = if front { 1.0 } else { -1.0 };
    let mut lift = Vec3::ZERO;
    for i in 0..3 {
        let below = (side * (p - corners[i]).dot(normals[i])).min(0.0);
        lift -= normals[i] * (side * weights[i] * below);
    }
    lift
}

/// Interpolates values of the vertices at barycentric coordinates; `None`: the mesh has none.
#[inline(always)]
pub(super) fn interpolate<T>(values: &[T], triangle: [u32; 3], u: f32, v: f32) -> Option<T>
where
    T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    if values.is_empty() {
        return None;
    }
    let [a, b, c] = triangle.map(|vertex| values[vertex as usize]);
    Some(a * (1.0 - u - v) + b * u + c * v)
}

/// Returns both sets of texture coordinates; the second falls back to the first, and the first to 0.
#[inline(always)]
pub(super) fn uvs_at(mesh: &Mesh, triangle: [u32; 3], u: f32, v: f32) -> [Vec2; 2] {
    let first = interpolate(&mesh.uvs[0], triangle, u, v).unwrap_or_default();
    [first, interpolate(&mesh.uvs[1], triangle, u, v).unwrap_or(first)]
}

/// Returns the width of a ray cone in texture coordinates: the geometric mean of the axes of its elliptical footprint.
pub(super) fn footprint(mesh: &Mesh, triangle: [u32; 3], double_area: f32, width: f32, cosine: f32) -> f32 {
    if mesh.uvs[0].is_empty() || double_area <= 0.0 {
        return 0.0;
    }
    let [a, b, c] = triangle.map(|vertex| mesh.uvs[0][vertex as usize]);
    let double_uv_area = (b - a).perp_dot(c - a).abs();
    width * (double_uv_area / (double_area * cosine.abs().max(0.01))).sqrt()
}

/// Returns the tangent of increasing u in object space, and the sign of the bitangent.
pub(super) fn tangent_at(mesh: &Mesh, shape: &TriangleShape, u: f32, v: f32, uv_set: u8) -> (Vec3, f32) {
    let &TriangleShape { triangle, corners } = shape;
    if let Some(tangent) = interpolate(&mesh.tangents, triangle, u, v) {
        // One vertex is enough: all three have the same sign in a valid mesh
        return (tangent.truncate(), mesh.tangents[triangle[0] as usize].w);
    }
    let uvs = &mesh.uvs[usize::from(uv_set & 1)];
    let [p0, p1, p2] = corners;
    if uvs.is_empty() {
        return (p1 - p0, 1.0);
    }
    let [a, b, c] = triangle.map(|vertex| uvs[vertex as usize]);
    let (d1, d2) = (b - a, c - a);
    let determinant = d1.perp_dot(d2);
    let tangent = ((p1 - p0) * d2.y - (p2 - p0) * d1.y) * determinant.signum();
    // v grows downwards, so texture coordinates that are not mirrored have a negative determinant; n × t then points up
    // in the texture, as normal maps expect.
    (tangent, -determinant.signum())
}

/// Returns the derivatives of the position by u and v in object space; `None`: texture coordinates are missing or
/// degenerate.
pub(super) fn derivatives(mesh: &Mesh, shape: &TriangleShape, uv_set: u8) -> Option<[Vec3; 2]> {
    let &TriangleShape { triangle, corners } = shape;
    let uvs = &mesh.uvs[usize::from(uv_set & 1)];
    if uvs.is_empty() {
        return None;
    }
    let [p0, p1, p2] = corners;
    let [a, b, c] = triangle.map(|vertex| uvs[vertex as usize]);
    let (e1, e2, d1, d2) = (p1 - p0, p2 - p0, b - a, c - a);
    let inverse = 1.0 / d1.perp_dot(d2);
    let along = [(e1 * d2.y - e2 * d1.y) * inverse, (e2 * d1.x - e1 * d2.x) * inverse];
    along.iter().all(|along| along.is_finite()).then_some(along)
}
