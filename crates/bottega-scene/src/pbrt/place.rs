//! Placement of shapes: analytic spheres, and small meshes transformed to world space and joined.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DVec3, Mat3, Vec2};

use super::context::Context;
use super::transform::axes_and_scale;
use crate::facing_curves::CurveLook;
use crate::import::path::TransformPath;
use crate::import::sphere::orientation;
use crate::import::text_place::{ImportResult, TextPlace};
use crate::model::{COORDINATE_MAX, Mesh, Sphere};
use crate::motion::SphereKey;
use crate::visibility::Visibility;

/// Vertex count from which no more meshes are joined to a mesh.
const JOINED_MAX: usize = 1 << 22;

/// Returns the transformed sphere; `None` if it is not a sphere.
///
/// - `needs_azimuth`: the orientation of its texture matters.
pub(super) fn sphere(radius: f64, world_from_sphere: &DAffine3, needs_azimuth: bool) -> Option<Sphere> {
    let (axes, scale) = axes_and_scale(world_from_sphere);
    let is_round = scale.max_element() <= scale.min_element() * (1.0 + 1e-5)
        && (axes * axes.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-5);
    let mirrors = axes.determinant() < 0.0;
    if !is_round || (mirrors && needs_azimuth) {
        return None;
    }
    let axes = if mirrors { axes * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)) } else { axes };
    let (center, radius) = (world_from_sphere.translation.as_vec3(), (radius * scale.max_element()) as f32);
    let is_in_reach = center.abs().max_element() < COORDINATE_MAX && radius < COORDINATE_MAX;
    let world_from_object = orientation(&axes);
    let visibility = Visibility::ALL;
    let sphere = Sphere { center, radius, world_from_object, material: 0, visibility, motion: Vec::new() };
    (is_in_reach && radius.is_normal()).then_some(sphere)
}

/// Returns the sphere on a path; `None` if it is not a sphere at some time.
pub(super) fn moving_sphere(radius: f64, path: &TransformPath, needs_azimuth: bool) -> Option<Sphere> {
    let first = sphere(radius, &path.first(), needs_azimuth)?;
    if path.is_still() {
        return Some(first);
    }
    let key = |(time, transform): &(f64, DAffine3)| {
        let Sphere { center, radius, world_from_object, .. } = sphere(radius, transform, needs_azimuth)?;
        Some(SphereKey { time: *time, center, radius, world_from_object })
    };
    let motion = path.keys().iter().map(key).collect::<Option<Vec<SphereKey>>>()?;
    Some(Sphere { motion, ..first })
}

/// Returns the uniform scale of a transformation; `None` if it is not uniform.
pub(super) fn scaling(transform: &DAffine3) -> Option<f64> {
    let (axes, scale) = axes_and_scale(transform);
    let is_equal = scale.max_element() <= scale.min_element() * (1.0 + 1e-5);
    (is_equal && (axes * axes.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-5)).then(|| scale.max_element())
}

/// Transforms a mesh. Curves need a uniform scale.
pub(super) fn baked(
    context: &mut Context<'_>,
    mut mesh: Mesh,
    transform: &DAffine3,
    at: TextPlace,
) -> ImportResult<Mesh> {
    let linear = transform.matrix3;
    let normal_matrix: Option<Mat3> = {
        let inverse = linear.inverse().transpose();
        // Scale does not affect the direction of normals.
        let scale = inverse.to_cols_array().iter().fold(0.0f64, |greatest, x| greatest.max(x.abs()));
        let matrix = inverse * (1.0 / scale);
        matrix.is_finite().then(|| matrix.as_mat3())
    };
    for position in &mut mesh.positions {
        *position = transform.transform_point3(position.as_dvec3()).as_vec3();
    }
    if mesh.positions.iter().any(|p| !p.is_finite() || p.abs().max_element() > COORDINATE_MAX) {
        return Err(at.fault("the shape is out of reach").into());
    }
    match normal_matrix {
        Some(matrix) => mesh.normals.iter_mut().for_each(|normal| *normal = matrix * *normal),
        None => {
            context.warn(at, "the transformation in force here makes the shape flat; it is used without its normals");
            mesh.normals = Vec::new();
        }
    }
    for tangent in &mut mesh.tangents {
        *tangent = (linear.as_mat3() * tangent.truncate()).extend(tangent.w);
    }
    if let Some(curves) = &mut mesh.curves {
        let factor = scaling(transform).unwrap_or(1.0);
        let moved = |p: glam::Vec3| transform.transform_point3(p.as_dvec3()).as_vec3();
        curves.map(moved, |tangent| (linear * tangent.as_dvec3()).normalize_or(DVec3::X).as_vec3());
        curves.points.iter_mut().for_each(|point| point.radius = (f64::from(point.radius) * factor) as f32);
    }
    if linear.determinant() < 0.0 {
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        mesh.tangents.iter_mut().for_each(|tangent| tangent.w = -tangent.w);
    }
    mesh.mend_normals();
    mesh.mend_tangents();
    Ok(mesh)
}

/// Gives every triangle its own vertices, with pbrt's default texture coordinates.
pub(super) fn with_own_corners(mesh: &Mesh) -> Mesh {
    let corners = || mesh.triangles.iter().flatten().map(|&vertex| vertex as usize);
    let count = mesh.triangles.len() as u32;
    Mesh {
        name: mesh.name.clone(),
        positions: corners().map(|vertex| mesh.positions[vertex]).collect(),
        normals: if mesh.normals.is_empty() {
            Vec::new()
        } else {
            corners().map(|vertex| mesh.normals[vertex]).collect()
        },
        uvs: [mesh.triangles.iter().flat_map(|_| [Vec2::Y, Vec2::ONE, Vec2::X]).collect(), Vec::new()],
        triangles: (0..count).map(|triangle| [3 * triangle, 3 * triangle + 1, 3 * triangle + 2]).collect(),
        material: mesh.material,
        ..Mesh::default()
    }
}

/// The key of joined meshes: material, presence of normals, texture coordinates and tangents, and the look of curves.
type JoinKey = (u32, [bool; 3], Option<CurveLook>);

/// Small meshes, joined by their key.
#[derive(Default)]
pub(super) struct JoinedMeshes {
    meshes: BTreeMap<JoinKey, (Mesh, TextPlace)>,
}

impl JoinedMeshes {
    /// Adds a mesh to those that it can be joined with. Returns a joined mesh that has become large; `None`: none has.
    pub(super) fn add(&mut self, mesh: Mesh, at: TextPlace) -> Option<Mesh> {
        let has = [!mesh.normals.is_empty(), !mesh.uvs[0].is_empty(), !mesh.tangents.is_empty()];
        let key = (mesh.material, has, mesh.curves.as_ref().map(|curves| curves.look));
        let (joined, _) = match self.meshes.entry(key) {
            std::collections::btree_map::Entry::Vacant(entry) => {
                entry.insert((mesh, at));
                return None;
            }
            std::collections::btree_map::Entry::Occupied(entry) => entry.into_mut(),
        };
        let first = joined.positions.len() as u32;
        joined.positions.extend(mesh.positions);
        joined.normals.extend(mesh.normals);
        joined.tangents.extend(mesh.tangents);
        let [uvs, _] = mesh.uvs;
        joined.uvs[0].extend(uvs);
        joined.triangles.extend(mesh.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first)));
        if let (Some(joined), Some(curves)) = (&mut joined.curves, mesh.curves) {
            joined.append(*curves);
        }
        if joined.positions.len() > JOINED_MAX {
            return self.meshes.remove(&key).map(|(mesh, _)| mesh);
        }
        None
    }

    /// Returns the remaining joined meshes.
    pub(super) fn finish(self) -> impl Iterator<Item = (Mesh, TextPlace)> {
        self.meshes.into_values()
    }
}

/// Returns the orthonormal axes of a transformation; they may mirror.
pub(super) fn axes(context: &mut Context<'_>, ctm: &DAffine3, at: TextPlace) -> ImportResult<DMat3> {
    let (axes, scale) = axes_and_scale(ctm);
    let is_perpendicular = (axes * axes.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-3);
    if !axes.is_finite() || !is_perpendicular {
        return Err(at.fault("the transformation of the light is singular or skewed").into());
    }
    if scale.max_element() > 1.001 * scale.min_element() {
        context.unsupported(at, "the scale of the light's space is left out: it would distort the light");
    }
    Ok(axes)
}
