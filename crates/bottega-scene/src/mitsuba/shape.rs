//! Shapes: in the scene, and in groups that are instanced.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DMat4, DVec3};

use super::attribute::with_attributes;
use super::context::ImportContext;
use super::curve;
use super::document::{Class, Object, ObjectId};
use super::looks::SceneLooks;
use super::mesh::{self, Normals, cofactors, with_face_colors, with_vertex_colors};
use super::placement::{Transform, polar};
use super::sdf::{self, SdfGrid, SdfNormals};
use super::shared::{Ball, Group, MeshKey, mesh_key, shared_meshes};
use super::solids;
use super::volume::{self, Numbers, VolumeError};
use crate::import::path::TransformPath;
use crate::import::placed_meshes::{MIRROR, PlacedMeshes};
use crate::import::text_place::{ImportResult, TextPlace};
use crate::model::{Instance, Mesh, Scene, Sphere};
use crate::motion::SphereKey;
use crate::text::shortened;
use crate::visibility::Visibility;

/// Meshes with fewer triangles are not instanced.
const SHARED_MIN: usize = 256;

/// A part of a shape, in the space of its group.
#[derive(Clone, Debug)]
pub(super) enum GroupPart {
    Mesh(Mesh),
    /// A mesh of the scene that several shapes use.
    Shared(u32, DMat4),
    Sphere(Ball),
    /// An instance of a group.
    Group(ObjectId, DMat4),
}

/// The shapes of a scene.
pub(super) struct Shapes {
    /// Meshes, instances and spheres so far; nothing else.
    pub(super) scene: Scene,
    /// Shape groups that were converted.
    groups: BTreeMap<ObjectId, Group>,
    /// Number of shapes of each mesh from a file, and the mesh once it is made. Small meshes are removed, and each
    /// shape gets its own.
    shared: BTreeMap<MeshKey, (usize, Option<u32>)>,
    placed: PlacedMeshes,
    /// The shape whose own transformation is left out, because it moves by it.
    posed: Option<ObjectId>,
}

impl Shapes {
    /// Makes an empty collection for the shapes of a document.
    pub(super) fn new(context: &ImportContext<'_>) -> Self {
        Self {
            scene: Scene::default(),
            groups: BTreeMap::new(),
            shared: shared_meshes(context.document),
            placed: PlacedMeshes::new(context.origin),
            posed: None,
        }
    }

    /// Adds a shape of the scene.
    pub(super) fn add(
        &mut self,
        context: &mut ImportContext<'_>,
        looks: &mut SceneLooks<'_>,
        id: ObjectId,
        to_world: DMat4,
    ) -> ImportResult<()> {
        if context.document.get(id).plugin == "shapegroup" {
            // Placed by its instances.
            return Ok(());
        }
        if let Some(path) = context.document.get(id).animation("to_world") {
            return self.add_moving(context, looks, id, &path.then(&DAffine3::from_mat4(to_world)));
        }
        for part in self.parts(context, looks, id, to_world)? {
            match part {
                GroupPart::Mesh(mesh) => self.scene.push_surface(mesh),
                GroupPart::Shared(mesh, matrix) => self.place(context, mesh, &matrix, context.document.get(id).at)?,
                GroupPart::Sphere(ball) => self.add_ball(context, looks, ball, context.document.get(id).at)?,
                GroupPart::Group(group, matrix) => {
                    let path = TransformPath::still(DAffine3::from_mat4(matrix));
                    self.add_instance(context, looks, group, &path)?;
                }
            }
        }
        Ok(())
    }

    /// Adds a shape that moves along a path, as if it were an instance of itself.
    fn add_moving(
        &mut self,
        context: &mut ImportContext<'_>,
        looks: &mut SceneLooks<'_>,
        id: ObjectId,
        path: &TransformPath,
    ) -> ImportResult<()> {
        let at = context.document.get(id).at;
        self.posed = Some(id);
        let parts = self.parts(context, looks, id, DMat4::IDENTITY);
        self.posed = None;
        for part in parts? {
            match part {
                GroupPart::Mesh(mesh) => {
                    let mesh = self.scene.push_mesh(mesh);
                    self.place_on(context, mesh, path, at)?;
                }
                GroupPart::Shared(mesh, inside) => {
                    self.place_on(context, mesh, &path.after(&DAffine3::from_mat4(inside)), at)?;
                }
                GroupPart::Sphere(ball) => self.add_ball_on(context, looks, ball, path, at)?,
                GroupPart::Group(group, inside) => {
                    self.add_instance(context, looks, group, &path.after(&DAffine3::from_mat4(inside)))?;
                }
            }
        }
        Ok(())
    }

    /// Converts a shape to parts, in the space of `to_group`.
    fn parts(
        &mut self,
        context: &mut ImportContext<'_>,
        looks: &mut SceneLooks<'_>,
        id: ObjectId,
        to_group: DMat4,
    ) -> ImportResult<Vec<GroupPart>> {
        let object = context.visit(id)?;
        let is_posed = self.posed == Some(id);
        if !is_posed && object.animation("to_world").is_some() {
            context.warn(object.at, format!("the {} within a group stands still", object.describe()));
        }
        let own = if is_posed { Transform::IDENTITY } else { object.full_transform("to_world")? };
        let matrix = to_group * own.matrix;
        if !matrix.is_finite() || DMat3::from_mat4(matrix).determinant() == 0.0 {
            context.warn(object.at, format!("the {} is squeezed flat by `to_world`, and left out", object.describe()));
            object.accept_all();
            return Ok(Vec::new());
        }
        let mesh = match object.plugin.as_str() {
            "obj" | "ply" | "serialized" if own.taken_inverse.is_none() => {
                match self.shared_mesh(context, looks, object)? {
                    Some(mesh) => return Ok(vec![GroupPart::Shared(mesh, matrix)]),
                    None => mesh::read(context, object)?,
                }
            }
            "obj" | "ply" | "serialized" => mesh::read(context, object)?,
            "rectangle" => solids::rectangle(),
            "cube" => solids::cube(),
            "disk" => solids::disk(),
            "bsplinecurve" | "linearcurve" => {
                let Some(mesh) = curve::read(context, object, &matrix)? else { return Ok(Vec::new()) };
                // The hull of hair needs no normals.
                let normals = Normals { flat: mesh.curves.is_some(), ..Normals::default() };
                return finish(context, looks, object, mesh, DMat4::IDENTITY, normals, false);
            }
            "sdfgrid" => distance_grid(context, object)?,
            "cylinder" => return cylinder(context, looks, object, to_group, &own),
            "sphere" => return sphere(context, looks, object, to_group, &own),
            "instance" => return instance(context, object, to_group * own.by_inverse()),
            "merge" => {
                let mut parts = Vec::new();
                for child in
                    object.children.iter().filter(|child| context.document.get(child.object).class == Class::Shape)
                {
                    child.used.set(true);
                    parts.extend(self.parts(context, looks, child.object, matrix)?);
                }
                return Ok(parts);
            }
            _ => {
                context.warn(object.at, format!("the {} is not supported and left out", object.describe()));
                object.accept_all();
                return Ok(Vec::new());
            }
        };
        let mut normals = Normals::of(object)?;
        let mut matrix = matrix;
        if let Some(taken) = own.taken_inverse {
            if object.plugin == "disk" {
                matrix = to_group * own.by_inverse();
            }
            normals.matrix = Some(cofactors(&DMat3::from_mat4(to_group)) * DMat3::from_mat4(taken));
        }
        // Triangle normals suffice.
        let is_flat = matches!(object.plugin.as_str(), "rectangle" | "cube" | "disk") && normals.matrix.is_none();
        finish(context, looks, object, mesh, matrix, normals, is_flat)
    }

    /// Returns the mesh that several shapes share, made for the first of them. `None`: the shape has its own mesh.
    fn shared_mesh(
        &mut self,
        context: &mut ImportContext<'_>,
        looks: &mut SceneLooks<'_>,
        object: &Object,
    ) -> ImportResult<Option<u32>> {
        let Some(key) = mesh_key(object).filter(|key| self.shared.contains_key(key)) else { return Ok(None) };
        if let Some((_, Some(known))) = self.shared.get(&key) {
            object.accept_all();
            return Ok(Some(*known));
        }
        let mesh = mesh::read(context, object)?;
        if mesh.triangles.len() < SHARED_MIN {
            self.shared.remove(&key);
            return Ok(None);
        }
        let normals = Normals::of(object)?;
        let Some(GroupPart::Mesh(mesh)) = finish(context, looks, object, mesh, DMat4::IDENTITY, normals, false)?.pop()
        else {
            return Ok(None);
        };
        let made = self.scene.push_mesh(mesh);
        self.shared.insert(key, (0, Some(made)));
        Ok(Some(made))
    }

    /// Places a mesh of the scene.
    fn place(&mut self, context: &mut ImportContext<'_>, mesh: u32, matrix: &DMat4, at: TextPlace) -> ImportResult<()> {
        self.place_on(context, mesh, &TransformPath::still(DAffine3::from_mat4(*matrix)), at)
    }

    /// Places a mesh of the scene on a path.
    fn place_on(
        &mut self,
        context: &mut ImportContext<'_>,
        mesh: u32,
        path: &TransformPath,
        at: TextPlace,
    ) -> ImportResult<()> {
        let center = self.placed.center(&mut self.scene, mesh, |warning| context.warn(at, warning));
        let mut path = path.after(&DAffine3::from_translation(center));
        let mut mesh = mesh;
        if path.first().matrix3.determinant() < 0.0 {
            mesh = self.placed.mirrored(&mut self.scene, mesh, |bytes| context.take(at, bytes))?;
            path = path.after(&DAffine3::from_scale(MIRROR));
        }
        let mut motion = path.motion(DAffine3::as_affine3a);
        context.take(at, size_of::<Instance>() + size_of_val(&*motion))?;
        if motion.iter().any(|key| !self.placed.is_placeable(&self.scene, mesh, &key.transform)) {
            context.warn(at, "a moving shape becomes flat, mirrored or too large, so it stays where it starts");
            motion.clear();
        }
        let world_from_object = path.first().as_affine3a();
        if self.placed.is_placeable(&self.scene, mesh, &world_from_object) {
            self.scene.instances.push(Instance { motion, ..Instance::new(mesh, world_from_object) });
        } else {
            context.warn(at, "a shape or an instance is squeezed flat or out of reach, and left out");
        }
        Ok(())
    }

    /// Makes the meshes of a group once.
    fn load_group(
        &mut self,
        context: &mut ImportContext<'_>,
        looks: &mut SceneLooks<'_>,
        id: ObjectId,
    ) -> ImportResult<()> {
        if self.groups.contains_key(&id) {
            return Ok(());
        }
        let object = context.visit(id)?;
        // Nested groups multiply: check the memory before building.
        let shapes = shape_count(context, id, &mut BTreeMap::new());
        let bytes = shapes.saturating_mul(size_of::<(u32, DMat4)>());
        context.check_memory(object.at, bytes)?;
        let mut group = Group::default();
        for child in &object.children {
            if context.document.get(child.object).class != Class::Shape {
                continue;
            }
            child.used.set(true);
            for part in self.parts(context, looks, child.object, DMat4::IDENTITY)? {
                match part {
                    GroupPart::Mesh(mesh) => group.meshes.push((self.scene.push_mesh(mesh), DMat4::IDENTITY)),
                    GroupPart::Shared(mesh, matrix) => group.meshes.push((mesh, matrix)),
                    GroupPart::Sphere(ball) => group.balls.push(ball),
                    GroupPart::Group(inner, matrix) => {
                        self.load_group(context, looks, inner)?;
                        let Some(inner) = self.groups.get(&inner) else { continue };
                        let bytes =
                            inner.meshes.len() * size_of::<(u32, DMat4)>() + inner.balls.len() * size_of::<Ball>();
                        context.take(object.at, bytes)?;
                        // The lists of nested groups grow exponentially with depth.
                        let room = group.meshes.try_reserve(inner.meshes.len());
                        if room.and_then(|()| group.balls.try_reserve(inner.balls.len())).is_err() {
                            return Err(object.at.fault("there is no memory for what is in this group").into());
                        }
                        group.meshes.extend(inner.meshes.iter().map(|&(mesh, inside)| (mesh, matrix * inside)));
                        let moved = |ball: &Ball| Ball { to_group: matrix * ball.to_group, ..*ball };
                        group.balls.extend(inner.balls.iter().map(moved));
                    }
                }
            }
        }
        self.groups.insert(id, group);
        Ok(())
    }

    fn add_instance(
        &mut self,
        context: &mut ImportContext<'_>,
        looks: &mut SceneLooks<'_>,
        id: ObjectId,
        path: &TransformPath,
    ) -> ImportResult<()> {
        self.load_group(context, looks, id)?;
        let at = context.document.get(id).at;
        let Some(group) = self.groups.remove(&id) else { return Ok(()) };
        let room = self.scene.instances.try_reserve(group.meshes.len());
        if room.and_then(|()| self.scene.spheres.try_reserve(group.balls.len())).is_err() {
            return Err(at.fault("there is no memory for what is in this group").into());
        }
        for &(mesh, inside) in &group.meshes {
            self.place_on(context, mesh, &path.after(&DAffine3::from_mat4(inside)), at)?;
        }
        let bytes = group.balls.len() * size_of::<Sphere>();
        context.take(at, bytes)?;
        for &ball in &group.balls {
            self.add_ball_on(context, looks, ball, path, at)?;
        }
        self.groups.insert(id, group);
        Ok(())
    }

    /// Adds a sphere in world space: analytic if it is round, otherwise triangles.
    fn add_ball(
        &mut self,
        context: &mut ImportContext<'_>,
        looks: &mut SceneLooks<'_>,
        ball: Ball,
        at: TextPlace,
    ) -> ImportResult<()> {
        self.add_ball_on(context, looks, ball, &TransformPath::still(DAffine3::IDENTITY), at)
    }

    /// Adds a sphere on a path.
    fn add_ball_on(
        &mut self,
        context: &mut ImportContext<'_>,
        looks: &mut SceneLooks<'_>,
        ball: Ball,
        outer: &TransformPath,
        at: TextPlace,
    ) -> ImportResult<()> {
        let path = outer.after(&DAffine3::from_mat4(ball.to_group));
        let key = |(time, to_world): &(f64, DAffine3)| ball.round_at(to_world, *time);
        if let Some(keys) = path.keys().iter().map(key).collect::<Option<Vec<SphereKey>>>()
            && let Some(material) =
                if ball.inward { looks.materials.turned(ball.material) } else { Some(ball.material) }
        {
            let SphereKey { center, radius, world_from_object, .. } = keys[0];
            let (visibility, motion) = (Visibility::ALL, if path.is_still() { Vec::new() } else { keys });
            self.scene.spheres.push(Sphere { center, radius, world_from_object, material, visibility, motion });
            return Ok(());
        }
        let normals = Normals { flipped: ball.inward, ..Normals::default() };
        let mesh = Mesh { name: "sphere".into(), material: ball.material, ..solids::sphere() };
        context.take(at, mesh.memory_bytes())?;
        if path.is_still() {
            if let Some(mesh) = mesh::place(mesh, &DMat4::from(path.first()), normals, ball.needs) {
                self.scene.push_surface(mesh);
            }
        } else if let Some(mesh) = mesh::place(mesh, &DMat4::IDENTITY, normals, ball.needs) {
            let mesh = self.scene.push_mesh(mesh);
            self.place_on(context, mesh, &path, at)?;
        }
        Ok(())
    }
}

/// Tessellates a signed distance grid.
fn distance_grid(context: &ImportContext<'_>, object: &Object) -> ImportResult<Mesh> {
    let normals = match object.string("normals")? {
        Some("analytic") => SdfNormals::Analytic,
        Some("smooth") | None => SdfNormals::Smooth,
        Some(other) => {
            let message = format!("`normals` of a grid of distances cannot be `{}`", shortened(other));
            return Err(object.at.fault(message).into());
        }
    };
    let location = context.filename(object)?;
    let bytes = context.resources.read(&location)?;
    let damaged = |error: VolumeError| error.in_file(location.path());
    let Numbers { size, channels, values, .. } = volume::numbers(&bytes).map_err(damaged)?;
    if channels != 1 {
        return Err(damaged(VolumeError::DistanceChannels { channels }).into());
    }
    let grid = SdfGrid::new(size, values).map_err(damaged)?;
    sdf::triangles(&grid, normals, |bytes| context.check_memory(object.at, bytes))
}

/// Finishes a mesh: sets its material and transforms it.
pub(super) fn finish(
    context: &mut ImportContext<'_>,
    looks: &mut SceneLooks<'_>,
    object: &Object,
    mut mesh: Mesh,
    matrix: DMat4,
    normals: Normals,
    is_flat: bool,
) -> ImportResult<Vec<GroupPart>> {
    let (material, needs) = looks.of_shape(context, object)?;
    if mesh.triangles.is_empty() {
        context.warn(object.at, format!("the {} has no triangles, and is left out", object.describe()));
        return Ok(Vec::new());
    }
    if mesh.name.is_empty() {
        mesh.name = if object.id.is_empty() { object.plugin.clone() } else { object.id.clone() };
    }
    context.take(object.at, mesh.memory_bytes())?;
    if let Some(awaited) = looks.materials.take_awaited(material) {
        mesh = with_attributes(context, &mut looks.textures.pictures, object, mesh, &awaited)?;
    }
    if needs.colors && mesh.colors.is_empty() {
        mesh = with_vertex_colors(context, object, mesh)?;
    }
    if needs.face_colors {
        mesh = with_face_colors(context, object, mesh)?;
    }
    let Some(mut mesh) = mesh::place(mesh.with_material(material), &matrix, normals, needs) else {
        context.warn(object.at, format!("the {} lies out of reach, and is left out", object.describe()));
        return Ok(Vec::new());
    };
    if is_flat && !needs.tangents {
        mesh.normals = Vec::new();
    }
    Ok(vec![GroupPart::Mesh(mesh)])
}

fn cylinder(
    context: &mut ImportContext<'_>,
    looks: &mut SceneLooks<'_>,
    object: &Object,
    to_group: DMat4,
    own: &Transform,
) -> ImportResult<Vec<GroupPart>> {
    let p0 = object.vector("p0")?.unwrap_or(DVec3::ZERO);
    let p1 = object.vector("p1")?.unwrap_or(DVec3::Z);
    let radius = object.float_at_least("radius", 0.0, 1.0)?;
    let (axis, length) = ((p1 - p0).normalize_or_zero(), p0.distance(p1));
    if axis == DVec3::ZERO || radius == 0.0 {
        context.warn(object.at, "a cylinder without length or radius is left out");
        object.accept_all();
        return Ok(Vec::new());
    }
    let (s, t) = axis.any_orthonormal_pair();
    let frame = DMat3::from_cols(s * radius, t * radius, axis * length);
    let to_object = DMat4::from(DAffine3::from_mat3_translation(frame, p0));
    let normals = Normals { flat: false, ..Normals::of(object)? };
    let placed = match own.taken_inverse {
        Some(_) => to_group * scaled_along_axes(&(own.matrix * to_object), [0, 0, 2]),
        None => to_group * own.matrix * to_object,
    };
    finish(context, looks, object, solids::cylinder(), placed, normals, false)
}

fn sphere(
    context: &mut ImportContext<'_>,
    looks: &mut SceneLooks<'_>,
    object: &Object,
    to_group: DMat4,
    own: &Transform,
) -> ImportResult<Vec<GroupPart>> {
    let center = object.vector("center")?.unwrap_or(DVec3::ZERO);
    let radius = object.float_at_least("radius", 0.0, 1.0)?;
    let normals = Normals::of(object)?;
    let (to_center, to_size) = (DMat4::from_translation(center), DMat4::from_scale(DVec3::splat(radius)));
    let to_group = match own.taken_inverse {
        Some(_) => to_group * scaled_along_axes(&(own.matrix * to_center * to_size), [0; 3]),
        None => to_group * own.matrix * to_center * to_size,
    };
    if DMat3::from_mat4(to_group).determinant() == 0.0 {
        context.warn(object.at, "a sphere without radius is left out");
        object.accept_all();
        return Ok(Vec::new());
    }
    let (material, needs) = looks.of_shape(context, object)?;
    if let Some(awaited) = looks.materials.take_awaited(material) {
        with_attributes(context, &mut looks.textures.pictures, object, Mesh::default(), &awaited)?;
    }
    let inward = normals.flipped != (DMat3::from_mat4(to_group).determinant() < 0.0);
    Ok(vec![GroupPart::Sphere(Ball { to_group, inward, material, needs })])
}

fn instance(context: &ImportContext<'_>, object: &Object, matrix: DMat4) -> ImportResult<Vec<GroupPart>> {
    let is_group = |id: ObjectId| context.document.get(id).plugin == "shapegroup";
    let Some(child) = object.children.iter().find(|child| is_group(child.object)) else {
        return Err(object.at.fault("an instance needs a shapegroup").into());
    };
    child.used.set(true);
    Ok(vec![GroupPart::Group(child.object, matrix)])
}

/// Counts the shapes in an object, including nested groups.
fn shape_count(context: &ImportContext<'_>, id: ObjectId, known: &mut BTreeMap<ObjectId, usize>) -> usize {
    if let Some(&count) = known.get(&id) {
        return count;
    }
    let object = context.document.get(id);
    let count = match object.plugin.as_str() {
        "shapegroup" | "instance" | "merge" => {
            let shapes =
                object.children.iter().filter(|child| context.document.get(child.object).class == Class::Shape);
            shapes.fold(0, |sum: usize, child| sum.saturating_add(shape_count(context, child.object, known)))
        }
        _ => 1,
    };
    known.insert(id, count);
    count
}

/// Returns Mitsuba's transformation of a sphere or cylinder: rotation, position and one scale per axis.
///
/// - `axes`: source axis of each of the three scales.
fn scaled_along_axes(placed: &DMat4, axes: [usize; 3]) -> DMat4 {
    let (scale, rotation) = polar(&DMat3::from_mat4(*placed));
    let scale = DVec3::from_array(axes.map(|axis| scale.col(axis)[axis]));
    DMat4::from(DAffine3::from_mat3_translation(rotation * DMat3::from_diagonal(scale), placed.w_axis.truncate()))
}
