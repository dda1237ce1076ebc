//! Polygon meshes (UsdGeomMesh) and their subsets.

use std::rc::Rc;

use glam::{DMat3, DVec3, Vec2, Vec3};
use openusd::usd::Prim;

use super::look::PartLook;
use super::primvar::{self, Counts, Interpolation, Primvar};
use super::source::StageSource;
use super::subdivision::{self, RefinedValue};
use super::{polygon, skel, values};
use crate::edit::corner_mesh::CornerMesh;
use crate::edit::mesh_parts::MeshParts;
use crate::error::SceneError;
use crate::model::Mesh;
use crate::subdivision::{Scheme, Subdivision};
use crate::values::VALUE_MAX;

/// A subset of a mesh's faces that has a material of its own.
pub(super) struct Subset {
    pub(super) prim: Prim,
    faces: Vec<i32>,
}

/// Returns the subsets of a mesh to which materials are bound.
pub(super) fn subsets(source: &StageSource<'_>, prim: &Prim, time: f64) -> Vec<Subset> {
    let mut subsets = Vec::new();
    for child in source.or_warn(prim.path().as_str(), prim.children()) {
        if source.type_of(&child) != "GeomSubset" {
            continue;
        }
        let kind = source.text(&child, "elementType", time);
        if kind.as_deref().is_some_and(|kind| kind != "face") {
            continue;
        }
        let family = source.text(&child, "familyName", time).unwrap_or_default();
        if family.is_empty() || family == "materialBind" {
            let faces = source.read(&child, "indices", time, values::integers).unwrap_or_default();
            subsets.push(Subset { prim: child, faces });
        }
    }
    subsets
}

/// The topology and points of a mesh.
struct Topology {
    points: Vec<Vec3>,
    /// Corners of each face of the file.
    counts: Vec<usize>,
    /// Point of each corner of the file.
    corner_points: Vec<i32>,
    /// Triangles as indices of corners, and the face of the file of each.
    triangles: Vec<[i32; 3]>,
    faces: Vec<usize>,
    /// Change of the normal of each point by the pose of the mesh; empty: there is none.
    normal_changes: Vec<DMat3>,
    /// The refined mesh, whose corners the triangles have.
    surface: Option<RefinedMesh>,
}

/// A refined mesh.
struct RefinedMesh {
    subdivision: Rc<Subdivision>,
    points: Vec<Vec3>,
    /// Normals of the points, zero where there are none; empty: flat faces.
    normals: Vec<Vec3>,
}

impl Topology {
    fn element_counts(&self) -> Counts {
        Counts { faces: self.counts.len(), points: self.points.len(), corners: self.corner_points.len() }
    }

    /// Returns the points that corners refer to, and the point of each corner.
    fn vertices(&self) -> (&[Vec3], &[i32]) {
        match &self.surface {
            Some(surface) => (&surface.points, bytemuck::cast_slice(surface.subdivision.corner_points())),
            None => (&self.points, &self.corner_points),
        }
    }

    /// Returns the value of a primvar at each corner.
    fn by_corner<T: RefinedValue, U>(&self, primvar: &Primvar<T>, usual: T, convert: impl Fn(T) -> U) -> Vec<U> {
        if let Some(surface) = &self.surface {
            let corner_points = bytemuck::cast_slice(&self.corner_points);
            let values = subdivision::by_corner(&surface.subdivision, corner_points, primvar, usual);
            return values.into_iter().map(convert).collect();
        }
        let mut values = Vec::with_capacity(self.corner_points.len());
        let mut corner = 0;
        for (face, &count) in self.counts.iter().enumerate() {
            for _ in 0..count {
                let point = self.corner_points[corner] as usize;
                values.push(convert(primvar.of_corner(face, point, corner).unwrap_or(usual)));
                corner += 1;
            }
        }
        values
    }
}

/// Reads a mesh as one mesh per used slot: 0 for the faces outside of all subsets, then one for each subset.
///
/// - `looks`: the look of each slot.
pub(super) fn read(
    source: &StageSource<'_>,
    prim: &Prim,
    ancestors: &[Prim],
    time: f64,
    subsets: &[Subset],
    looks: &[PartLook],
) -> Result<Vec<(u32, Mesh)>, SceneError> {
    let path = prim.path().as_str();
    let Some(topology) = topology(source, prim, time)? else { return Ok(Vec::new()) };
    let normals = normals(source, prim, time, &topology);
    let slots = slots(source, &topology, subsets);
    // Parts that take the same primvars are made together
    let mut parts = Vec::new();
    let mut is_made = vec![false; looks.len()];
    for slot in 0..looks.len() {
        if is_made[slot] {
            continue;
        }
        let is_alike = |other: &PartLook| {
            other.look.uv_sets == looks[slot].look.uv_sets
                && (&other.color, &other.opacity) == (&looks[slot].color, &looks[slot].opacity)
        };
        let wanted: Vec<bool> = looks.iter().map(is_alike).collect();
        (0..looks.len()).for_each(|other| is_made[other] |= wanted[other]);
        let is_chosen = |row: &usize| wanted[slots[topology.faces[*row]] as usize];
        let rows: Vec<usize> = (0..topology.triangles.len()).filter(is_chosen).collect();
        if rows.is_empty() {
            continue;
        }
        let triangles: Vec<[i32; 3]> = rows.iter().map(|&row| topology.triangles[row]).collect();
        let triangle_slots: Vec<i32> = rows.iter().map(|&row| slots[topology.faces[row]]).collect();
        let uvs: Vec<Option<Vec<[f32; 2]>>> =
            (0..2).map(|set| uvs(source, prim, ancestors, time, &topology, &looks[slot], set)).collect();
        let colors = colors(source, prim, ancestors, time, &topology, &looks[slot]);
        let (points, corner_points) = topology.vertices();
        let _held = match &topology.surface {
            Some(_) => Some(source.request.resources.budget().hold(source.request.path, corner_points.len() * 64)?),
            None => {
                source.take(path, corner_points.len().saturating_mul(64))?;
                None
            }
        };
        let corner_mesh = CornerMesh {
            positions: bytemuck::cast_slice(points),
            corner_vertices: Some(corner_points),
            triangles: &triangles,
            normals: normals.as_deref(),
            uvs: [uvs[0].as_deref(), uvs[1].as_deref()],
            colors: colors.as_deref(),
            triangle_materials: Some(&triangle_slots),
            drop_empty: true,
        };
        match MeshParts::new(path, &corner_mesh, looks.len()) {
            Ok(made) => {
                for (slot, mut mesh) in made.into_meshes() {
                    if mesh.mend_normals() {
                        source.warn(path, "some normals are not directions and are replaced by those of the surface");
                    }
                    parts.push((slot, mesh));
                }
            }
            Err(problem) => source.warn(path, format!("the mesh is left out: {problem}")),
        }
    }
    Ok(parts)
}

/// Reads and checks the faces of a mesh; `None`: there are none, or they are wrong.
fn topology(source: &StageSource<'_>, prim: &Prim, time: f64) -> Result<Option<Topology>, SceneError> {
    let path = prim.path().as_str();
    let mut points = source.read(prim, "points", time, values::vectors).unwrap_or_default();
    let counts = source.read(prim, "faceVertexCounts", time, values::integers).unwrap_or_default();
    let corner_points = source.read(prim, "faceVertexIndices", time, values::integers).unwrap_or_default();
    if points.is_empty() || counts.is_empty() {
        return Ok(None);
    }
    let wrong = |problem: String| {
        source.warn(path, format!("the mesh is left out: {problem}"));
        Ok(None)
    };
    if let Some(count) = counts.iter().find(|&&count| count < 0) {
        return wrong(format!("a face has {count} corners"));
    }
    let sum: u64 = counts.iter().map(|&count| count as u64).sum();
    if sum != corner_points.len() as u64 {
        return wrong(format!("its faces have {sum} corners, and faceVertexIndices {}", corner_points.len()));
    }
    if let Some(index) = corner_points.iter().find(|&&index| index < 0 || index as usize >= points.len()) {
        return wrong(format!("faceVertexIndices has {index}, and there are {} points", points.len()));
    }
    let normal_changes = skel::pose(source, prim, time, &mut points);
    if points.iter().any(|point| !values::is_reachable(point)) {
        return wrong("a point is not finite, or out of reach".into());
    }
    source.take(path, (points.len() + 2 * corner_points.len()).saturating_mul(24))?;
    let holes = source.read(prim, "holeIndices", time, values::integers).unwrap_or_default();
    let mut is_hole = vec![false; counts.len()];
    for hole in holes {
        if let Some(is_hole) = usize::try_from(hole).ok().and_then(|hole| is_hole.get_mut(hole)) {
            *is_hole = true;
        }
    }
    let is_left = source.text(prim, "orientation", time).as_deref() == Some("leftHanded");
    let counts: Vec<usize> = counts.into_iter().map(|count| count as usize).collect();
    let (mut triangles, mut faces) = (Vec::new(), Vec::new());
    let refined = subdivision::read(source, prim, time, points.len(), &counts, bytemuck::cast_slice(&corner_points))?;
    if let Some(subdivision) = refined {
        let surface = surface(subdivision, &points, is_left, &mut triangles, &mut faces);
        return Ok(Some(Topology {
            points,
            counts,
            corner_points,
            triangles,
            faces,
            normal_changes,
            surface: Some(surface),
        }));
    }
    let mut first = 0;
    let mut corners: Vec<DVec3> = Vec::new();
    for (face, &count) in counts.iter().enumerate() {
        if count >= 3 && !is_hole[face] {
            corners.clear();
            let indices = &corner_points[first..first + count];
            corners.extend(indices.iter().map(|&index| points[index as usize].as_dvec3()));
            for [a, b, c] in polygon::triangles(&corners) {
                let [a, b, c] = [a, b, c].map(|corner| first as i32 + corner as i32);
                triangles.push(if is_left { [a, c, b] } else { [a, b, c] });
                faces.push(face);
            }
        }
        first += count;
    }
    Ok(Some(Topology { points, counts, corner_points, triangles, faces, normal_changes, surface: None }))
}

/// Refines the points of a mesh, and divides the refined faces into triangles.
///
/// - `is_left`: the normals are on the side from which faces turn clockwise.
/// - `triangles`, `faces`: get the corners of each triangle, and the face of the file.
fn surface(
    subdivision: Rc<Subdivision>,
    points: &[Vec3],
    is_left: bool,
    triangles: &mut Vec<[i32; 3]>,
    faces: &mut Vec<usize>,
) -> RefinedMesh {
    let (points, mut normals) = subdivision.points(points);
    if is_left {
        normals.iter_mut().for_each(|normal| *normal = -*normal);
    }
    let sides = subdivision.sides() as i32;
    for (source, first) in subdivision.face_sources().zip((0..).step_by(sides as usize)) {
        let Some(source) = source else { continue };
        for corner in 2..sides {
            let (b, c) = if is_left { (corner, corner - 1) } else { (corner - 1, corner) };
            triangles.push([first, first + b, first + c]);
            faces.push(source);
        }
    }
    RefinedMesh { subdivision, points, normals }
}

/// Returns the slot of each face.
fn slots(source: &StageSource<'_>, topology: &Topology, subsets: &[Subset]) -> Vec<i32> {
    let mut slots = vec![0; topology.counts.len()];
    for (subset, slot) in subsets.iter().zip(1..) {
        for &face in &subset.faces {
            match usize::try_from(face).ok().and_then(|face| slots.get_mut(face)) {
                Some(of_face) => *of_face = slot,
                None => {
                    let message = format!("refers to face {face}, and there are {}", topology.counts.len());
                    source.warn(subset.prim.path().as_str(), message);
                    break;
                }
            }
        }
    }
    slots
}

/// Returns the normals by corner; `None`: flat faces.
///
/// A subdivision surface has the normals of its limit, or smooth ones if it is rendered as its polygons.
fn normals(source: &StageSource<'_>, prim: &Prim, time: f64, topology: &Topology) -> Option<Vec<[f32; 3]>> {
    let path = prim.path().as_str();
    let is_smooth = matches!(subdivision::scheme(source, prim, time), Some(Scheme::CatmullClark | Scheme::Loop));
    let own = ["primvars:normals", "normals"]
        .iter()
        .find_map(|name| primvar::read(source, prim, name, time, Interpolation::Vertex, values::vectors));
    if let Some(surface) = &topology.surface {
        if own.is_some() {
            let message =
                "normals of subdivision surfaces are ignored; with `subdivisionScheme` none polygons keep theirs";
            source.warn_once(path, message);
        }
        let corners = surface.subdivision.corner_points().iter();
        let of_point = |&point: &u32| surface.normals[point as usize].to_array();
        return (!surface.normals.is_empty()).then(|| corners.map(of_point).collect());
    }
    let own = own.filter(|normals| match normals.misfit(topology.element_counts()) {
        None => true,
        Some(problem) => {
            source.warn(path, format!("the normals are left out: they have a primvar that {problem}"));
            false
        }
    });
    if let Some(normals) = own {
        let sound = |normal: Vec3| if normal.is_finite() { normal } else { Vec3::ZERO };
        let mut corners = topology.by_corner(&normals, Vec3::ZERO, |normal| sound(normal).to_array());
        if !topology.normal_changes.is_empty() {
            for (normal, &point) in corners.iter_mut().zip(&topology.corner_points) {
                let turned = topology.normal_changes[point as usize] * Vec3::from_array(*normal).as_dvec3();
                *normal = sound(turned.as_vec3()).to_array();
            }
        }
        return Some(corners);
    }
    if !is_smooth {
        return None;
    }
    let vertex = |corner: i32| topology.corner_points[corner as usize] as u32;
    let mut mesh = Mesh {
        positions: topology.points.clone(),
        triangles: topology.triangles.iter().map(|triangle| triangle.map(vertex)).collect(),
        ..Mesh::default()
    };
    mesh.smooth_normals();
    Some(topology.corner_points.iter().map(|&point| mesh.normals[point as usize].to_array()).collect())
}

/// Returns a set of texture coordinates by corner, with v pointing down; `None`: the look has no such set, or the mesh
/// lacks it.
fn uvs(
    source: &StageSource<'_>,
    prim: &Prim,
    ancestors: &[Prim],
    time: f64,
    topology: &Topology,
    part: &PartLook,
    set: usize,
) -> Option<Vec<[f32; 2]>> {
    let name = part.look.uv_sets.get(set)?;
    let path = prim.path().as_str();
    let Some(primvar) = primvar::pairs(source, prim, ancestors, name, time) else {
        source.warn(path, format!("the coordinates `{name}` are missing, its textures show one texel"));
        return None;
    };
    if let Some(problem) = primvar.misfit(topology.element_counts()) {
        source.warn(path, format!("the coordinates `{name}` are left out: the primvar {problem}"));
        return None;
    }
    let flipped = |uv: Vec2| if uv.is_finite() { [uv.x, 1.0 - uv.y] } else { [0.0; 2] };
    Some(topology.by_corner(&primvar, Vec2::ZERO, flipped))
}

/// Returns colours by corner; `None`: the look takes none.
fn colors(
    source: &StageSource<'_>,
    prim: &Prim,
    ancestors: &[Prim],
    time: f64,
    topology: &Topology,
    part: &PartLook,
) -> Option<Vec<[f32; 4]>> {
    let path = prim.path().as_str();
    let report = |name: &str, problem: Option<String>| {
        if let Some(problem) = &problem {
            source.warn(path, format!("`{name}` is left out: the primvar {problem}"));
        }
        problem.is_none()
    };
    let counts = topology.element_counts();
    let color = part.color.as_ref().and_then(|name| {
        let color = primvar::vectors(source, prim, ancestors, name, time)?;
        report(name, color.misfit(counts)).then_some(color)
    });
    let opacity = part.opacity.as_ref().and_then(|name| {
        let opacity = primvar::numbers(source, prim, ancestors, name, time)?;
        report(name, opacity.misfit(counts)).then_some(opacity)
    });
    if color.is_none() && opacity.is_none() {
        return None;
    }
    let sound = |value: f32| if value >= 0.0 { value.min(VALUE_MAX) } else { 0.0 };
    let constant = |value: Vec3| Primvar::new(vec![value], Interpolation::Constant);
    let color = color.unwrap_or_else(|| constant(Vec3::ONE));
    let mut colors = topology.by_corner(&color, Vec3::ONE, |rgb| rgb.extend(1.0).to_array().map(sound));
    if let Some(opacity) = opacity {
        let alphas = topology.by_corner(&opacity, 1.0, |alpha: f32| sound(alpha).min(1.0));
        colors.iter_mut().zip(alphas).for_each(|(color, alpha)| color[3] = alpha);
    }
    Some(colors)
}
