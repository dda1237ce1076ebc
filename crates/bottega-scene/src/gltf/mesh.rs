//! Primitives: conversion of accessors to triangles. glTF 2.0, section 3.7.2.

use glam::{Vec2, Vec3, Vec4};

use super::accessor::{Accessor, Component};
use super::draco::{DracoMesh, DracoMeshes};
use super::error::GltfError;
use super::hierarchy::Hierarchy;
use super::shape::PrimitiveShape;
use super::source::GltfSource;
use super::{document, skin};
use crate::error::{SceneError, Warnings};
use crate::material::Material;
use crate::model::{COORDINATE_MAX, Mesh};

/// The topology of a primitive.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mode {
    Triangles,
    Strip,
    Fan,
}

fn mode(primitive: &document::Primitive) -> Result<Option<Mode>, GltfError> {
    Ok(match primitive.mode.unwrap_or(4) {
        0..=3 => None,
        4 => Some(Mode::Triangles),
        5 => Some(Mode::Strip),
        6 => Some(Mode::Fan),
        other => return Err(GltfError::PrimitiveMode(other)),
    })
}

/// Returns true if a primitive has triangles; otherwise warns that it is left out.
pub(super) fn is_surface(
    source: &GltfSource<'_>,
    shape: &PrimitiveShape,
    warnings: &mut Warnings,
) -> Result<bool, SceneError> {
    let mode = mode(shape.primitive(source)).map_err(|problem| source.invalid(shape.place(".mode"), problem))?;
    if mode.is_none() {
        warnings.unsupported(shape.place(""), "points and lines have no surface and are left out");
    }
    Ok(mode.is_some())
}

/// Reads a primitive. `None`: no triangle remains.
///
/// Triangles without area, and those with a vertex that is not finite or beyond [`COORDINATE_MAX`], are left out, with
/// a warning that counts them. Unused vertices are left out, and so are texture coordinates and tangents that
/// `material` does not need.
pub(super) fn read(
    source: &GltfSource<'_>,
    hierarchy: &Hierarchy,
    draco: &DracoMeshes,
    shape: &PrimitiveShape,
    material: &Material,
    warnings: &mut Warnings,
) -> Result<Option<Mesh>, SceneError> {
    let primitive = shape.primitive(source);
    let compressed = primitive.extensions.draco.as_deref();
    let draco = compressed.and_then(|compressed| Some((draco.get(&compressed.buffer_view)?, &*compressed.attributes)));
    let reader = PrimitiveReader { source, shape, primitive, draco, vertex_count: 0, selection: None };
    let positions = reader.positions()?;
    if positions.count == 0 {
        return Ok(None);
    }
    let mut triangles = reader.triangles(positions.count)?;
    let selection = select_used(&mut triangles, positions.count);
    let reader = PrimitiveReader { vertex_count: positions.count, selection, ..reader };

    let mut mesh = Mesh {
        name: source.document.meshes[shape.mesh].name.clone(),
        positions: reader.read(&positions, POSITION, Vec3::from_array)?,
        triangles,
        ..Mesh::default()
    };
    mesh.normals = reader.attribute(|a| a.normal, ".attributes.NORMAL", Vec3::from_array)?;
    if material.needs_tangents() {
        mesh.tangents = reader.attribute(|a| a.tangent, ".attributes.TANGENT", Vec4::from_array)?;
    }
    let uses_set = |set: u8| material.textures().iter().any(|map| map.uv_set == set);
    if uses_set(0) {
        mesh.uvs[0] = reader.attribute(|a| a.uv0, ".attributes.TEXCOORD_0", Vec2::from_array)?;
    }
    if uses_set(1) {
        mesh.uvs[1] = reader.attribute(|a| a.uv1, ".attributes.TEXCOORD_1", Vec2::from_array)?;
    }
    for set in 0..2u8 {
        if uses_set(set) && mesh.uvs[usize::from(set)].is_empty() {
            warnings.add(shape.place(".attributes"), format!("TEXCOORD_{set} is missing, its textures show one texel"));
        }
    }
    mesh.colors = reader.colors()?;
    reader.add_targets(&mut mesh, warnings)?;
    if let Some(skin) = shape.skin {
        let influences = reader.influences(warnings)?;
        skin::apply(source, hierarchy, skin, &influences, &mut mesh, warnings)?;
    }
    clean(&mut mesh, shape, warnings);
    Ok((!mesh.triangles.is_empty()).then_some(mesh))
}

const POSITION: &str = ".attributes.POSITION";
const INDICES: &str = ".indices";

/// A function that selects an attribute's accessor, or its id in compressed data.
type AttributeChoice = fn(&document::Attributes) -> Option<usize>;

struct PrimitiveReader<'s> {
    source: &'s GltfSource<'s>,
    shape: &'s PrimitiveShape,
    primitive: &'s document::Primitive,
    /// Compressed data of the primitive, and its attribute ids.
    draco: Option<(&'s DracoMesh, &'s document::Attributes)>,
    vertex_count: usize,
    /// Indices of the used vertices; `None`: all.
    selection: Option<Vec<u32>>,
}

impl<'s> PrimitiveReader<'s> {
    fn accessor(&self, index: usize, member: &str) -> Result<Accessor<'s>, SceneError> {
        Accessor::new(self.source.document, self.source.bytes, index).map_err(|problem| self.invalid(member, problem))
    }

    fn invalid(&self, member: &str, problem: impl std::fmt::Display) -> SceneError {
        self.source.invalid(self.shape.place(member), problem)
    }

    /// Returns the accessor of an attribute. Compressed data takes precedence.
    fn find(&self, which: AttributeChoice, member: &str) -> Result<Option<Accessor<'s>>, SceneError> {
        let index = which(&self.primitive.attributes);
        if let Some((mesh, attributes)) = self.draco
            && let Some(number) = which(attributes)
        {
            let description = index.and_then(|index| self.source.document.accessors.get(index));
            let accessor = mesh.accessor(number, description.is_some_and(|accessor| accessor.normalized));
            return accessor
                .map(Some)
                .map_err(|problem| self.invalid(".extensions.KHR_draco_mesh_compression.attributes", problem));
        }
        index.map(|index| self.accessor(index, member)).transpose()
    }

    fn positions(&self) -> Result<Accessor<'s>, SceneError> {
        let positions = self.find(|a| a.position, POSITION)?;
        let positions = positions.ok_or_else(|| self.invalid(POSITION, "a surface needs positions"))?;
        if positions.is_unbacked() && positions.count > self.source.buffer_bytes() {
            return Err(self.invalid(POSITION, format!("no buffer holds its {} elements", positions.count)));
        }
        Ok(positions)
    }

    /// Returns the triangles, whose indices are all below `vertex_count`.
    fn triangles(&self, vertex_count: usize) -> Result<Vec<[u32; 3]>, SceneError> {
        let mode = mode(self.primitive).map_err(|problem| self.invalid(".mode", problem))?;
        let Some(mode) = mode else { return Ok(Vec::new()) };
        if let Some((mesh, _)) = self.draco {
            // Draco data are triangles in any mode.
            self.book_triangles(Mode::Triangles, 3 * mesh.triangles.len())?;
            return self.in_range(mesh.triangles.clone(), vertex_count);
        }
        let Some(index) = self.primitive.indices else {
            self.book_triangles(mode, vertex_count)?;
            return Ok(assemble(mode, vertex_count, |index| index as u32));
        };
        let indices = self.accessor(index, INDICES)?;
        if indices.width != 1 || !matches!(indices.component, Component::U8 | Component::U16 | Component::U32) {
            return Err(self.invalid(INDICES, format!("accessor {index} does not hold unsigned scalars")));
        }
        if indices.is_unbacked() {
            return Err(self.invalid(INDICES, format!("no buffer holds the elements of accessor {index}")));
        }
        self.book_triangles(mode, indices.count)?;
        self.in_range(assemble(mode, indices.count, |index| indices.index_at(index)), vertex_count)
    }

    fn in_range(&self, triangles: Vec<[u32; 3]>, vertex_count: usize) -> Result<Vec<[u32; 3]>, SceneError> {
        let greatest = triangles.iter().map(|[a, b, c]| *a.max(b).max(c)).max();
        match greatest {
            Some(greatest) if greatest as usize >= vertex_count => {
                Err(self.invalid(INDICES, format!("refers to vertex {greatest}, but there are {vertex_count}")))
            }
            _ => Ok(triangles),
        }
    }

    /// Books memory for the triangles of `count` vertices.
    fn book_triangles(&self, mode: Mode, count: usize) -> Result<(), SceneError> {
        let triangles = if mode == Mode::Triangles { count / 3 } else { count };
        let bytes = triangles.saturating_mul(size_of::<[u32; 3]>());
        self.source.budget.take(self.source.path, &self.shape.place(""), bytes)
    }

    fn read<const N: usize, T>(
        &self,
        accessor: &Accessor<'_>,
        member: &str,
        make: impl Fn([f32; N]) -> T,
    ) -> Result<Vec<T>, SceneError> {
        if accessor.width != N {
            return Err(self.invalid(member, format!("has {} components, needs {N}", accessor.width)));
        }
        if accessor.count != self.vertex_count {
            let problem = format!("has {} elements for {} positions", accessor.count, self.vertex_count);
            return Err(self.invalid(member, problem));
        }
        let count = self.selection.as_ref().map_or(accessor.count, Vec::len);
        self.source.budget.take(self.source.path, &self.shape.place(member), count * size_of::<T>())?;
        Ok(accessor.read(self.selection.as_deref(), make))
    }

    /// Reads an attribute; empty if the primitive lacks it.
    fn attribute<const N: usize, T>(
        &self,
        which: AttributeChoice,
        member: &str,
        make: impl Fn([f32; N]) -> T,
    ) -> Result<Vec<T>, SceneError> {
        match self.find(which, member)? {
            None => Ok(Vec::new()),
            Some(accessor) => self.read(&accessor, member, make),
        }
    }

    /// Reads COLOR_0: RGB or RGBA. Empty if all are white.
    fn colors(&self) -> Result<Vec<Vec4>, SceneError> {
        let member = ".attributes.COLOR_0";
        let Some(mut accessor) = self.find(|a| a.color, member)? else { return Ok(Vec::new()) };
        // Integers must be normalized; treat others as such.
        accessor.normalized = true;
        let clean = |color: Vec4| Vec4::select(color.cmpge(Vec4::ZERO), color.min(Vec4::splat(f32::MAX)), Vec4::ZERO);
        let colors = if accessor.width == 3 {
            self.read(&accessor, member, |[r, g, b]| clean(Vec4::new(r, g, b, 1.0)))?
        } else {
            self.read(&accessor, member, |rgba| clean(Vec4::from_array(rgba)))?
        };
        Ok(if colors.iter().all(|&color| color == Vec4::ONE) { Vec::new() } else { colors })
    }

    /// Adds the morph targets with their weights: glTF 2.0, section 3.7.2.2.
    fn add_targets(&self, mesh: &mut Mesh, warnings: &mut Warnings) -> Result<(), SceneError> {
        let targets = &self.primitive.targets;
        if self.shape.weights.len() > targets.len() {
            warnings.add(self.shape.place(".targets"), "there are more weights than morph targets");
        }
        for (number, (target, &weight)) in targets.iter().zip(&self.shape.weights).enumerate() {
            let weight = f32::from_bits(weight);
            if weight == 0.0 {
                continue;
            }
            let displacements = |name: &str, index: Option<usize>| {
                let member = format!(".targets[{number}].{name}");
                let Some(index) = index else { return Ok(Vec::new()) };
                self.read(&self.accessor(index, &member)?, &member, |v| Vec3::from_array(v) * weight)
            };
            for (to, delta) in mesh.positions.iter_mut().zip(displacements("POSITION", target.position)?) {
                *to += delta;
            }
            for (to, delta) in mesh.normals.iter_mut().zip(displacements("NORMAL", target.normal)?) {
                *to += delta;
            }
            for (to, delta) in mesh.tangents.iter_mut().zip(displacements("TANGENT", target.tangent)?) {
                *to += delta.extend(0.0);
            }
            for (set, name, index) in [(0, "TEXCOORD_0", target.uv0), (1, "TEXCOORD_1", target.uv1)] {
                // Sets that the material does not use were not read.
                let Some(index) = index.filter(|_| !mesh.uvs[set].is_empty()) else { continue };
                let member = format!(".targets[{number}].{name}");
                let deltas = self.read(&self.accessor(index, &member)?, &member, Vec2::from_array)?;
                for (to, delta) in mesh.uvs[set].iter_mut().zip(deltas) {
                    *to += delta * weight;
                }
            }
            if let Some(index) = target.color {
                self.add_target_colors(&mut mesh.colors, number, index, weight)?;
            }
        }
        Ok(())
    }

    /// Adds a morph target's colours; results are clamped to [0, 1].
    fn add_target_colors(
        &self,
        colors: &mut Vec<Vec4>,
        number: usize,
        index: usize,
        weight: f32,
    ) -> Result<(), SceneError> {
        let member = format!(".targets[{number}].COLOR_0");
        let accessor = self.accessor(index, &member)?;
        let deltas = if accessor.width == 3 {
            self.read(&accessor, &member, |rgb: [f32; 3]| Vec3::from_array(rgb).extend(0.0))?
        } else {
            self.read(&accessor, &member, Vec4::from_array)?
        };
        // White colours were dropped: restore them.
        colors.resize(deltas.len(), Vec4::ONE);
        for (to, delta) in colors.iter_mut().zip(deltas) {
            let sum = *to + delta * weight;
            // NaN becomes 0.
            *to = Vec4::select(sum.cmpge(Vec4::ZERO), sum.min(Vec4::ONE), Vec4::ZERO);
        }
        Ok(())
    }

    /// Reads the joints and weights of the vertices: up to two sets of four.
    fn influences(&self, warnings: &mut Warnings) -> Result<Vec<Vec<skin::Influence>>, SceneError> {
        if self.primitive.attributes.joints2.is_some() {
            let message = "only the first eight joints of a vertex move it";
            warnings.unsupported(self.shape.place(".attributes.JOINTS_2"), message);
        }
        let sets: [(AttributeChoice, AttributeChoice, &str, &str); 2] = [
            (|a| a.joints0, |a| a.weights0, ".attributes.JOINTS_0", ".attributes.WEIGHTS_0"),
            (|a| a.joints1, |a| a.weights1, ".attributes.JOINTS_1", ".attributes.WEIGHTS_1"),
        ];
        let mut influences = Vec::new();
        for (joints, weights, joints_member, weights_member) in sets {
            let (Some(joints), Some(mut weights)) =
                (self.find(joints, joints_member)?, self.find(weights, weights_member)?)
            else {
                continue;
            };
            let joints = self.read(&joints, joints_member, |joints: [f32; 4]| joints.map(|joint| joint as u32))?;
            weights.normalized = true;
            let weights = self.read(&weights, weights_member, |weights: [f32; 4]| weights)?;
            let set = joints.into_iter().zip(weights).map(|(joints, weights)| skin::Influence { joints, weights });
            influences.push(set.collect());
        }
        Ok(influences)
    }
}

/// Assembles vertices to triangles; glTF 2.0, section 3.7.2.1, gives the order for each mode.
fn assemble(mode: Mode, count: usize, vertex: impl Fn(usize) -> u32) -> Vec<[u32; 3]> {
    let overlapping = count.saturating_sub(2);
    match mode {
        Mode::Triangles => (0..count / 3).map(|i| [vertex(3 * i), vertex(3 * i + 1), vertex(3 * i + 2)]).collect(),
        Mode::Strip => (0..overlapping).map(|i| [vertex(i), vertex(i + 1 + i % 2), vertex(i + 2 - i % 2)]).collect(),
        Mode::Fan => (0..overlapping).map(|i| [vertex(i + 1), vertex(i + 2), vertex(0)]).collect(),
    }
}

/// Finds the vertices that triangles use, and renumbers the triangles' indices. `None`: all are used.
fn select_used(triangles: &mut [[u32; 3]], vertex_count: usize) -> Option<Vec<u32>> {
    let vertices = || triangles.iter().flatten().copied();
    let (first, last) = (vertices().min()?, vertices().max()?);
    let span = (last - first) as usize + 1;
    let mut is_used = vec![false; span];
    vertices().for_each(|vertex| is_used[(vertex - first) as usize] = true);
    let selection: Vec<u32> = (first..=last).filter(|vertex| is_used[(vertex - first) as usize]).collect();
    if selection.len() == vertex_count {
        return None;
    }
    let mut number = vec![0; span];
    for (new, &old) in selection.iter().enumerate() {
        number[(old - first) as usize] = new as u32;
    }
    triangles.iter_mut().flatten().for_each(|vertex| *vertex = number[(*vertex - first) as usize]);
    Some(selection)
}

/// Drops triangles that no ray can hit, and replaces invalid normals and tangents.
fn clean(mesh: &mut Mesh, shape: &PrimitiveShape, warnings: &mut Warnings) {
    let is_sound = |p: &Vec3| p.abs().max_element() <= COORDINATE_MAX;
    let unsound = mesh.positions.iter().any(|p| !is_sound(p) || !p.is_finite());
    let positions = &mesh.positions;
    let (mut far, mut flat) = (0u64, 0u64);
    mesh.triangles.retain(|triangle| {
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
        if unsound && ![a, b, c].iter().all(|p| p.is_finite() && is_sound(p)) {
            far += 1;
            return false;
        }
        let is_flat = (b - a).as_dvec3().cross((c - a).as_dvec3()).length_squared() == 0.0;
        flat += u64::from(is_flat);
        !is_flat
    });
    if far > 0 {
        let message =
            format!("{far} triangles with a position that is not finite, or beyond {COORDINATE_MAX:e}, are left out");
        warnings.add(shape.place(".attributes.POSITION"), message);
    }
    if flat > 0 {
        warnings.add(shape.place(""), format!("{flat} triangles without area are left out"));
    }
    if unsound {
        drop_unused_vertices(mesh);
    }
    if mesh.mend_normals() {
        warnings
            .add(shape.place(".attributes.NORMAL"), "some are not directions and are replaced by those of the surface");
    }
    if mesh.mend_tangents() {
        warnings.add(shape.place(".attributes.TANGENT"), "some are not directions and are replaced");
    }
    let mut replaced = 0;
    for uv in mesh.uvs.iter_mut().flatten().filter(|uv| !uv.is_finite()) {
        *uv = Vec2::ZERO;
        replaced += 1;
    }
    if replaced > 0 {
        warnings.add(shape.place(".attributes"), format!("{replaced} texture coordinates are not finite and become 0"));
    }
}

/// Drops the vertices without triangles, among them those with invalid positions.
fn drop_unused_vertices(mesh: &mut Mesh) {
    let count = mesh.positions.len();
    let Some(selection) =
        (if mesh.triangles.is_empty() { Some(Vec::new()) } else { select_used(&mut mesh.triangles, count) })
    else {
        return;
    };
    fn keep<T: Copy>(list: &mut Vec<T>, selection: &[u32]) {
        if !list.is_empty() {
            *list = selection.iter().map(|&index| list[index as usize]).collect();
        }
    }
    keep(&mut mesh.positions, &selection);
    keep(&mut mesh.normals, &selection);
    keep(&mut mesh.tangents, &selection);
    keep(&mut mesh.colors, &selection);
    mesh.uvs.iter_mut().for_each(|uvs| keep(uvs, &selection));
}
