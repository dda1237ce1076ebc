//! Primitives: from accessors to triangles. glTF 2.0, section 3.7.2.

use glam::{Vec2, Vec3, Vec4};

use super::accessor::{Accessor, Component};
use super::node::Hierarchy;
use super::{Source, document, skin, unsupported};
use crate::error::Warnings;
use crate::model::COORDINATE_MAX;
use crate::{Material, Mesh, SceneError};

/// One primitive as one or more nodes show it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Shape {
    pub(super) mesh: usize,
    pub(super) primitive: usize,
    pub(super) material: Option<usize>,
    /// Bits of the weights of the morph targets; absent ones are 0.
    pub(super) weights: Vec<u32>,
    pub(super) skin: Option<usize>,
}

impl Shape {
    fn primitive<'a>(&self, source: &Source<'a>) -> &'a document::Primitive {
        &source.document.meshes[self.mesh].primitives[self.primitive]
    }

    fn place(&self, member: &str) -> String {
        format!("meshes[{}].primitives[{}]{member}", self.mesh, self.primitive)
    }
}

/// How vertices make triangles.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mode {
    Triangles,
    Strip,
    Fan,
}

fn mode(primitive: &document::Primitive) -> Result<Option<Mode>, String> {
    Ok(match primitive.mode.unwrap_or(4) {
        0..=3 => None,
        4 => Some(Mode::Triangles),
        5 => Some(Mode::Strip),
        6 => Some(Mode::Fan),
        other => return Err(format!("unknown mode {other}")),
    })
}

/// Whether a primitive has triangles; else a warning says that it is left out.
pub(super) fn is_surface(source: &Source<'_>, shape: &Shape, warnings: &mut Warnings) -> Result<bool, SceneError> {
    let mode = mode(shape.primitive(source)).map_err(|problem| source.invalid(shape.place(".mode"), problem))?;
    if mode.is_none() {
        warnings.add(shape.place(""), "points and lines have no surface and are left out");
    }
    Ok(mode.is_some())
}

/// Reads a primitive. `None`: no triangle is left of it.
///
/// Left out, with a warning that counts them: triangles without area, and those with a vertex that is not finite or
/// beyond [`COORDINATE_MAX`]. Vertices that no triangle uses are left out, and so are texture coordinates and tangents
/// that `material` has no use for.
pub(super) fn read(
    source: &Source<'_>,
    hierarchy: &Hierarchy,
    shape: &Shape,
    material: &Material,
    warnings: &mut Warnings,
) -> Result<Option<Mesh>, SceneError> {
    let primitive = shape.primitive(source);
    let reader = Reader { source, shape, vertex_count: 0, selection: None };
    let Some((positions, name)) = reader.positions_accessor(primitive)? else { return Ok(None) };
    let mut triangles = reader.triangles(primitive, positions.count)?;
    let selection = select_used(&mut triangles, positions.count);
    let reader = Reader { vertex_count: positions.count, selection, ..reader };
    let attributes = &primitive.attributes;

    let mut mesh = Mesh {
        name: source.document.meshes[shape.mesh].name.clone(),
        positions: reader.read(&positions, &name, Vec3::from_array)?,
        triangles,
        ..Mesh::default()
    };
    mesh.normals = reader.optional(attributes.normal, ".attributes.NORMAL", Vec3::from_array)?;
    if material.needs_tangents() {
        mesh.tangents = reader.optional(attributes.tangent, ".attributes.TANGENT", Vec4::from_array)?;
    }
    let uses_set = |set: u8| material.textures().iter().any(|map| map.uv_set == set);
    if uses_set(0) {
        mesh.uvs[0] = reader.optional(attributes.uv0, ".attributes.TEXCOORD_0", Vec2::from_array)?;
    }
    if uses_set(1) {
        mesh.uvs[1] = reader.optional(attributes.uv1, ".attributes.TEXCOORD_1", Vec2::from_array)?;
    }
    for set in 0..2u8 {
        if uses_set(set) && mesh.uvs[usize::from(set)].is_empty() {
            warnings.add(shape.place(".attributes"), format!("TEXCOORD_{set} is missing, its textures show one texel"));
        }
    }
    mesh.colors = reader.colors(attributes.color)?;
    reader.add_targets(primitive, &mut mesh, warnings)?;
    if let Some(skin) = shape.skin {
        let influences = reader.influences(attributes)?;
        skin::apply(source, hierarchy, skin, &influences, &mut mesh, warnings)?;
    }
    clean(&mut mesh, shape, warnings);
    Ok((!mesh.triangles.is_empty()).then_some(mesh))
}

struct Reader<'a, 's> {
    source: &'s Source<'a>,
    shape: &'s Shape,
    vertex_count: usize,
    /// The vertices that are used, where not all are.
    selection: Option<Vec<u32>>,
}

impl<'a> Reader<'a, '_> {
    fn accessor(&self, index: usize, member: &str) -> Result<Accessor<'a>, SceneError> {
        Accessor::new(self.source.document, self.source.buffers, index).map_err(|problem| self.invalid(member, problem))
    }

    fn invalid(&self, member: &str, problem: impl Into<String>) -> SceneError {
        self.source.invalid(self.shape.place(member), problem)
    }

    /// The accessor of the positions, and its place. `None`: there are no vertices.
    fn positions_accessor(
        &self,
        primitive: &document::Primitive,
    ) -> Result<Option<(Accessor<'a>, String)>, SceneError> {
        let member = ".attributes.POSITION";
        let Some(index) = primitive.attributes.position else {
            return Err(self.invalid(member, "a surface needs positions"));
        };
        let positions = self.accessor(index, member)?;
        if positions.is_unbacked() {
            self.refuse_compression(primitive, index)?;
            if positions.count > self.source.buffer_bytes() {
                return Err(self.invalid(member, format!("no buffer holds its {} elements", positions.count)));
            }
        }
        Ok((positions.count > 0).then(|| (positions, member.into())))
    }

    /// Data that only a compressed form holds is not there for us.
    fn refuse_compression(&self, primitive: &document::Primitive, accessor: usize) -> Result<(), SceneError> {
        let draco = primitive.extensions.draco.is_some();
        let sparse = self.source.document.accessors[accessor].sparse.is_some();
        if draco && !sparse {
            let place = self.shape.place(".extensions");
            return Err(unsupported(self.source.path, place, "KHR_draco_mesh_compression".into()));
        }
        Ok(())
    }

    /// The triangles, with indices that are all below `vertex_count`.
    fn triangles(&self, primitive: &document::Primitive, vertex_count: usize) -> Result<Vec<[u32; 3]>, SceneError> {
        let mode = mode(primitive).map_err(|problem| self.invalid(".mode", problem))?;
        let Some(mode) = mode else { return Ok(Vec::new()) };
        let Some(index) = primitive.indices else {
            self.book_triangles(mode, vertex_count)?;
            return Ok(assemble(mode, vertex_count, |index| index as u32));
        };
        let member = ".indices";
        let indices = self.accessor(index, member)?;
        if indices.width != 1 || !matches!(indices.component, Component::U8 | Component::U16 | Component::U32) {
            return Err(self.invalid(member, format!("accessor {index} does not hold unsigned scalars")));
        }
        if indices.is_unbacked() {
            self.refuse_compression(primitive, index)?;
            return Err(self.invalid(member, format!("no buffer holds the elements of accessor {index}")));
        }
        self.book_triangles(mode, indices.count)?;
        let triangles = assemble(mode, indices.count, |index| indices.index_at(index));
        let greatest = triangles.iter().map(|[a, b, c]| *a.max(b).max(c)).max();
        match greatest {
            Some(greatest) if greatest as usize >= vertex_count => {
                Err(self.invalid(member, format!("refers to vertex {greatest}, but there are {vertex_count}")))
            }
            _ => Ok(triangles),
        }
    }

    /// Takes the memory for the triangles of so many vertices.
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

    fn optional<const N: usize, T>(
        &self,
        index: Option<usize>,
        member: &str,
        make: impl Fn([f32; N]) -> T,
    ) -> Result<Vec<T>, SceneError> {
        match index {
            None => Ok(Vec::new()),
            Some(index) => self.read(&self.accessor(index, member)?, member, make),
        }
    }

    /// COLOR_0: RGB or RGBA. White everywhere is as good as nothing.
    fn colors(&self, index: Option<usize>) -> Result<Vec<Vec4>, SceneError> {
        let member = ".attributes.COLOR_0";
        let Some(index) = index else { return Ok(Vec::new()) };
        let mut accessor = self.accessor(index, member)?;
        // Integers must be normalized; those that do not say so mean it all the same.
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
    fn add_targets(
        &self,
        primitive: &document::Primitive,
        mesh: &mut Mesh,
        warnings: &mut Warnings,
    ) -> Result<(), SceneError> {
        if self.shape.weights.len() > primitive.targets.len() {
            warnings.add(self.shape.place(".targets"), "there are more weights than morph targets");
        }
        for (number, (target, &weight)) in primitive.targets.iter().zip(&self.shape.weights).enumerate() {
            let weight = f32::from_bits(weight);
            if weight == 0.0 {
                continue;
            }
            let scaled = |v: [f32; 3]| Vec3::from_array(v) * weight;
            let member = |name: &str| format!(".targets[{number}].{name}");
            for (to, delta) in
                mesh.positions.iter_mut().zip(self.optional(target.position, &member("POSITION"), scaled)?)
            {
                *to += delta;
            }
            for (to, delta) in mesh.normals.iter_mut().zip(self.optional(target.normal, &member("NORMAL"), scaled)?) {
                *to += delta;
            }
            for (to, delta) in
                mesh.tangents.iter_mut().zip(self.optional(target.tangent, &member("TANGENT"), scaled)?)
            {
                *to += delta.extend(0.0);
            }
        }
        Ok(())
    }

    /// Which joints move a vertex, and how much: up to two sets of four.
    fn influences(&self, attributes: &document::Attributes) -> Result<Vec<Vec<skin::Influence>>, SceneError> {
        let sets = [
            (attributes.joints0, attributes.weights0, ".attributes.JOINTS_0", ".attributes.WEIGHTS_0"),
            (attributes.joints1, attributes.weights1, ".attributes.JOINTS_1", ".attributes.WEIGHTS_1"),
        ];
        let mut influences = Vec::new();
        for (joints, weights, joints_member, weights_member) in sets {
            let (Some(joints), Some(weights)) = (joints, weights) else { continue };
            let joints =
                self.optional(Some(joints), joints_member, |joints: [f32; 4]| joints.map(|joint| joint as u32))?;
            let mut accessor = self.accessor(weights, weights_member)?;
            accessor.normalized = true;
            let weights = self.read(&accessor, weights_member, |weights: [f32; 4]| weights)?;
            let set = joints.into_iter().zip(weights).map(|(joints, weights)| skin::Influence { joints, weights });
            influences.push(set.collect());
        }
        Ok(influences)
    }
}

/// Vertices to triangles; glTF 2.0, section 3.7.2.1, gives the order for each mode.
fn assemble(mode: Mode, count: usize, vertex: impl Fn(usize) -> u32) -> Vec<[u32; 3]> {
    let overlapping = count.saturating_sub(2);
    match mode {
        Mode::Triangles => (0..count / 3).map(|i| [vertex(3 * i), vertex(3 * i + 1), vertex(3 * i + 2)]).collect(),
        Mode::Strip => (0..overlapping).map(|i| [vertex(i), vertex(i + 1 + i % 2), vertex(i + 2 - i % 2)]).collect(),
        Mode::Fan => (0..overlapping).map(|i| [vertex(i + 1), vertex(i + 2), vertex(0)]).collect(),
    }
}

/// Finds the vertices that triangles use and makes the triangles count among them. `None`: all are used.
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

/// Leaves out what no ray can hit, and mends what would poison the shading.
fn clean(mesh: &mut Mesh, shape: &Shape, warnings: &mut Warnings) {
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
            .add(shape.place(".attributes.NORMAL"), "some are no directions and are replaced by those of the surface");
    }
    if mesh.mend_tangents() {
        warnings.add(shape.place(".attributes.TANGENT"), "some are no directions and are replaced");
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

/// Keeps only vertices of the triangles that are left, so that no position is unsound.
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
