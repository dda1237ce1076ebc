//! Meshes: reading from files, transformation, and orientation of their fronts.

use glam::{DMat3, DMat4, DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::context::ImportContext;
use super::document::{Class, Object};
use super::shared::MeshNeeds;
use crate::import::text_place::{ImportResult, TextFault};
use crate::mesh_file::{obj, ply, serialized};
use crate::model::{COORDINATE_MAX, Mesh};
use crate::origin::{far_center, rounding};
use crate::text::shortened;

/// The treatment of normals.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Normals {
    /// `true`: use only the normals of the triangles.
    pub(super) flat: bool,
    /// `true`: flip them.
    pub(super) flipped: bool,
    /// Transformation of the normals, if it is not that of the shape.
    pub(super) matrix: Option<DMat3>,
}

impl Normals {
    /// Reads the options of a shape.
    pub(super) fn of(object: &Object) -> Result<Self, TextFault> {
        Ok(Self {
            flat: object.boolean("face_normals", false)?,
            flipped: object.boolean("flip_normals", false)?,
            matrix: None,
        })
    }
}

/// Reads the mesh file of a shape, in object space.
pub(super) fn read(context: &mut ImportContext<'_>, object: &Object) -> ImportResult<Mesh> {
    let location = context.filename(object)?;
    let bytes = context.resources.read(&location)?;
    let (path, budget) = (location.path(), context.resources.budget());
    let read = match object.plugin.as_str() {
        "obj" => {
            let has_bsdf = object.children.iter().any(|it| context.document.get(it.object).class == Class::Bsdf);
            if object.boolean("load_materials", false)? && !has_bsdf {
                context.warn(object.at, "the materials that the file names are left out");
            }
            obj::read(path, &bytes, budget).and_then(|mut file| {
                for (line, message) in file.take_notes() {
                    context.warn(object.at, format!("`{}`, line {line}: {message}", shortened(&location.name)));
                }
                file.into_single()
            })
        }
        "ply" => {
            if !object.boolean("srgb", true)? {
                context.warn(object.at, "colours by whole numbers are sRGB, though `srgb` is false");
            }
            ply::read(path, &bytes, budget)
        }
        _ => {
            let index = object.integer("shape_index")?.unwrap_or(0);
            let index =
                u32::try_from(index).map_err(|_| object.at.fault("`shape_index` is not the index of a shape"))?;
            serialized::read(path, &bytes, index, budget)
        }
    };
    let mut mesh = context.resources.attribute(&location, read)?;
    // In OBJ files v usually points up.
    if object.boolean("flip_tex_coords", object.plugin == "obj")? {
        mesh.flip_v();
    }
    if let Some(center) = far_center(&mesh).filter(|_| context.origin != DVec3::ZERO) {
        context.warn(object.at, rounding(center));
    }
    mesh.name = if object.id.is_empty() { location.name.clone() } else { object.id.clone() };
    Ok(mesh)
}

/// Returns the mesh with the attribute `vertex_color` as vertex colours.
pub(super) fn with_vertex_colors(
    context: &mut ImportContext<'_>,
    object: &Object,
    mut mesh: Mesh,
) -> ImportResult<Mesh> {
    let colors = named_colors(context, object, "vertex_color")?.unwrap_or_default();
    if colors.len() == mesh.positions.len() {
        mesh.colors = colors;
    } else {
        context.warn(object.at, format!("the {} has no colours of vertices; they are white", object.describe()));
    }
    Ok(mesh)
}

/// Returns an attribute of a file as colours. `None`: there is none of that name.
fn named_colors(context: &ImportContext<'_>, object: &Object, name: &str) -> ImportResult<Option<Vec<Vec4>>> {
    if object.plugin != "ply" {
        return Ok(None);
    }
    let location = context.filename(object)?;
    let bytes = context.resources.read(&location)?;
    let attribute = ply::attribute(location.path(), &bytes, name, context.resources.budget())?;
    let color = |value: &[f32; 3]| Vec3::from_array(*value).extend(1.0);
    Ok(attribute.map(|attribute| attribute.values.iter().map(color).collect()))
}

/// Returns the mesh with the colour of each face.
pub(super) fn with_face_colors(context: &mut ImportContext<'_>, object: &Object, mut mesh: Mesh) -> ImportResult<Mesh> {
    mesh.colors = Vec::new();
    let mut colors = None;
    if object.plugin == "ply" {
        let location = context.filename(object)?;
        let bytes = context.resources.read(&location)?;
        colors = ply::face_colors(location.path(), &bytes, context.resources.budget())?;
        if colors.is_none() {
            colors = named_colors(context, object, "face_color")?;
        }
        context.resources.budget().take(location.path(), "", 2 * mesh.memory_bytes())?;
    }
    let Some(colors) = colors else {
        context.warn(object.at, format!("the {} has no colours of faces; they are white", object.describe()));
        return Ok(mesh);
    };
    // Unshared vertices cannot have smooth normals: compute these first.
    if mesh.normals.is_empty() {
        mesh.smooth_normals();
    }
    Ok(mesh.with_triangle_colors(&colors).unwrap_or_else(|| {
        context.warn(object.at, "the triangle strips of the mesh have no colours; they are white");
        mesh
    }))
}

/// Transforms a mesh, and winds its triangles counter-clockwise seen from the front. `None`: it is out of range.
pub(super) fn place(mut mesh: Mesh, to_world: &DMat4, normals: Normals, needs: MeshNeeds) -> Option<Mesh> {
    let linear = DMat3::from_mat4(*to_world);
    if *to_world != DMat4::IDENTITY {
        mesh.positions.par_iter_mut().for_each(|p| *p = to_world.transform_point3(p.as_dvec3()).as_vec3());
        let matrix = normals.matrix.unwrap_or_else(|| cofactors(&linear));
        mesh.normals.par_iter_mut().for_each(|n| *n = (matrix * n.as_dvec3()).normalize_or_zero().as_vec3());
    }
    let is_in_reach = |p: &Vec3| p.is_finite() && p.abs().max_element() <= COORDINATE_MAX;
    if !mesh.positions.par_iter().all(is_in_reach) {
        return None;
    }
    if normals.flat {
        mesh.normals = Vec::new();
    } else if mesh.normals.is_empty() {
        mesh.smooth_normals();
    } else {
        mesh.mend_normals();
    }
    if normals.flipped {
        mesh.normals.par_iter_mut().for_each(|n| *n = -*n);
        if normals.flat {
            mesh.triangles.par_iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
    }
    turn_triangles(&mut mesh);
    if !needs.uvs {
        mesh.uvs = Default::default();
    }
    mesh.tangents = Vec::new();
    if needs.tangents && !mesh.uvs[0].is_empty() {
        add_tangents(&mut mesh);
    }
    if !needs.colors && !needs.face_colors {
        mesh.colors = Vec::new();
    }
    Some(mesh)
}

/// Returns the matrix that transforms normals as the inverse transpose does, up to length.
pub(super) fn cofactors(linear: &DMat3) -> DMat3 {
    let sign = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
    let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * sign
}

/// Flips the triangles that disagree with their vertex normals.
fn turn_triangles(mesh: &mut Mesh) {
    if mesh.normals.is_empty() {
        return;
    }
    let (positions, normals) = (&mesh.positions, &mesh.normals);
    mesh.triangles.par_iter_mut().for_each(|triangle| {
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize].as_dvec3());
        let sum: DVec3 = triangle.iter().map(|&vertex| normals[vertex as usize].as_dvec3()).sum();
        if (b - a).cross(c - a).dot(sum) < 0.0 {
            triangle.swap(1, 2);
        }
    });
}

/// Adds tangents along u. Mitsuba's second axis is the cross product of normal and tangent, whatever the direction of
/// v.
fn add_tangents(mesh: &mut Mesh) {
    let needs_normals = mesh.normals.is_empty();
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let p = triangle.map(|vertex| mesh.positions[vertex as usize].as_dvec3());
        let uv = triangle.map(|vertex| mesh.uvs[0].get(vertex as usize).copied().unwrap_or(Vec2::ZERO).as_dvec2());
        let (d1, d2) = (uv[1] - uv[0], uv[2] - uv[0]);
        let tangent = ((p[1] - p[0]) * d2.y - (p[2] - p[0]) * d1.y) * d1.perp_dot(d2).signum();
        triangle.iter().for_each(|&vertex| sums[vertex as usize] += tangent);
    }
    if needs_normals {
        // Tangents need normals: give each triangle its own vertices.
        *mesh = mesh.unshared();
        let corner = |triangle: &[u32; 3]| mesh.cross(*triangle).as_dvec3().normalize_or_zero().as_vec3();
        mesh.normals = mesh.triangles.iter().flat_map(|triangle| [corner(triangle); 3]).collect();
        mesh.mend_normals();
        add_tangents(mesh);
        return;
    }
    let tangents = sums.iter().zip(&mesh.normals).map(|(sum, normal)| {
        let normal = normal.as_dvec3();
        let tangent = (*sum - normal * normal.dot(*sum)).normalize_or_zero().as_vec3();
        Vec4::from((tangent, 1.0))
    });
    mesh.tangents = tangents.collect();
    mesh.mend_tangents();
}
