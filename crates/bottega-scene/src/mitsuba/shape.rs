//! Shapes: in the scene, and in groups that are instanced.

use std::collections::BTreeMap;

use glam::{Affine3A, DAffine3, DMat3, DMat4, DQuat, DVec3, Quat, Vec3};

use super::bsdf::turned;
use super::document::{Class, Object, ObjectId};
use super::importer::Importer;
use super::mesh::{Normals, cofactors, place};
use super::placement::{Transform, polar};
use super::sdf::{self, SdfGrid, SdfNormals};
use super::shared::{Ball, Group, MeshNeeds, mesh_key};
use super::solids;
use super::volume::{self, Numbers};
use super::xml::XmlPlace;
use crate::origin::{centered, rounding};
use crate::text::shortened;
use crate::{COORDINATE_MAX, Instance, Mesh, SceneError, Sphere};

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

impl Importer<'_> {
    /// Adds a shape of the scene.
    pub(super) fn add_shape(&mut self, id: ObjectId, to_world: DMat4) -> Result<(), SceneError> {
        if self.document.get(id).plugin == "shapegroup" {
            // Placed by its instances.
            return Ok(());
        }
        for part in self.parts(id, to_world)? {
            match part {
                GroupPart::Mesh(mesh) => self.scene.push_surface(mesh),
                GroupPart::Shared(mesh, matrix) => self.show(mesh, &matrix, self.document.get(id).at)?,
                GroupPart::Sphere(ball) => self.add_ball(ball, self.document.get(id).at)?,
                GroupPart::Group(group, matrix) => self.add_instance(group, matrix)?,
            }
        }
        Ok(())
    }

    /// Converts a shape to parts, in the space of `to_group`.
    fn parts(&mut self, id: ObjectId, to_group: DMat4) -> Result<Vec<GroupPart>, SceneError> {
        let object = self.visit(id)?;
        let own = self.bad(object.full_transform("to_world"))?;
        let matrix = to_group * own.matrix;
        if !matrix.is_finite() || DMat3::from_mat4(matrix).determinant() == 0.0 {
            self.report
                .warn(object.at, format!("the {} is squeezed flat by `to_world`, and left out", object.describe()));
            self.accept_shape(object);
            return Ok(Vec::new());
        }
        let mesh = match object.plugin.as_str() {
            "obj" | "ply" | "serialized" if own.taken_inverse.is_none() => match self.shared_mesh(object)? {
                Some(mesh) => return Ok(vec![GroupPart::Shared(mesh, matrix)]),
                None => self.read_mesh(object)?,
            },
            "obj" | "ply" | "serialized" => self.read_mesh(object)?,
            "rectangle" => solids::rectangle(),
            "cube" => solids::cube(),
            "disk" => solids::disk(),
            "bsplinecurve" | "linearcurve" => return self.curves(object, matrix),
            "sdfgrid" => self.distance_grid(object)?,
            "cylinder" => return self.cylinder(object, to_group, &own),
            "sphere" => return self.sphere(object, to_group, &own),
            "instance" => return self.instance(object, to_group * own.by_inverse()),
            "merge" => {
                let mut parts = Vec::new();
                for child in
                    object.children.iter().filter(|child| self.document.get(child.object).class == Class::Shape)
                {
                    child.used.set(true);
                    parts.extend(self.parts(child.object, matrix)?);
                }
                return Ok(parts);
            }
            _ => {
                self.report.warn(object.at, format!("the {} is not supported and left out", object.describe()));
                self.accept_shape(object);
                return Ok(Vec::new());
            }
        };
        let mut normals = self.normals(object)?;
        let mut matrix = matrix;
        if let Some(taken) = own.taken_inverse {
            if object.plugin == "disk" {
                matrix = to_group * own.by_inverse();
            }
            normals.matrix = Some(cofactors(&DMat3::from_mat4(to_group)) * DMat3::from_mat4(taken));
        }
        // Triangle normals suffice.
        let is_flat = matches!(object.plugin.as_str(), "rectangle" | "cube" | "disk") && normals.matrix.is_none();
        self.finish(object, mesh, matrix, normals, is_flat)
    }

    /// Tessellates a signed distance grid.
    fn distance_grid(&mut self, object: &Object) -> Result<Mesh, SceneError> {
        let normals = match self.bad(object.string("normals"))? {
            Some("analytic") => SdfNormals::Analytic,
            Some("smooth") | None => SdfNormals::Smooth,
            Some(other) => {
                let message = format!("`normals` of a grid of distances cannot be `{}`", shortened(other));
                return Err(self.report.invalid(object.at, message));
            }
        };
        let location = self.filename(object)?;
        let bytes = self.resources.read(&location)?;
        let damaged = |problem| SceneError::Damaged { path: location.path().into(), problem };
        let Numbers { size, channels, values, .. } = volume::numbers(&bytes).map_err(damaged)?;
        if channels != 1 {
            return Err(damaged(format!("a grid of distances has one channel, not {channels}")));
        }
        let grid = SdfGrid::new(size, values).map_err(damaged)?;
        sdf::triangles(&grid, normals, |bytes| {
            self.placed(object.at, self.resources.budget().check(self.report.path(object.at.file), bytes))
        })
    }

    /// Returns the mesh that several shapes share, made for the first of them. `None`: the shape has its own mesh.
    fn shared_mesh(&mut self, object: &Object) -> Result<Option<u32>, SceneError> {
        let Some(key) = mesh_key(object).filter(|key| self.shared.meshes.contains_key(key)) else { return Ok(None) };
        if let Some((_, Some(known))) = self.shared.meshes.get(&key) {
            self.accept_all(object);
            return Ok(Some(*known));
        }
        let mesh = self.read_mesh(object)?;
        if mesh.triangles.len() < SHARED_MIN {
            self.shared.meshes.remove(&key);
            return Ok(None);
        }
        let normals = self.normals(object)?;
        let Some(GroupPart::Mesh(mesh)) = self.finish(object, mesh, DMat4::IDENTITY, normals, false)?.pop() else {
            return Ok(None);
        };
        let made = self.scene.push_mesh(mesh);
        self.shared.meshes.insert(key, (0, Some(made)));
        Ok(Some(made))
    }

    /// Places a mesh of the scene.
    fn show(&mut self, mesh: u32, matrix: &DMat4, at: XmlPlace) -> Result<(), SceneError> {
        self.take(at, size_of::<Instance>())?;
        let matrix = &(*matrix * DMat4::from_translation(self.center(mesh, at)));
        let mirrors = DMat3::from_mat4(*matrix).determinant() < 0.0;
        let (mesh, matrix) = match self.shared.mirrored.get(&mesh) {
            _ if !mirrors => (mesh, *matrix),
            Some(&mirrored) => (mirrored, *matrix * DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0))),
            None => {
                let original = &self.scene.meshes[mesh as usize];
                self.take(at, original.memory_bytes())?;
                let copy = original.clone().mirrored();
                let mirrored = self.scene.push_mesh(copy);
                self.shared.mirrored.insert(mesh, mirrored);
                (mirrored, *matrix * DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)))
            }
        };
        let world_from_object = affine(&matrix);
        if self.shared.bounds.is_placeable(&self.scene, mesh, &world_from_object) {
            self.scene.instances.push(Instance { mesh, world_from_object });
        } else {
            self.report.warn(at, "a shape or an instance is squeezed flat or out of reach, and left out");
        }
        Ok(())
    }

    /// Returns the former centre of a mesh, if it was moved: in scenes far from the origin, meshes may also be far from
    /// theirs.
    fn center(&mut self, mesh: u32, at: XmlPlace) -> DVec3 {
        if self.origin == DVec3::ZERO {
            return DVec3::ZERO;
        }
        if let Some(&known) = self.shared.centers.get(&mesh) {
            return known;
        }
        let center = centered(&mut self.scene.meshes[mesh as usize]);
        if let Some(center) = center {
            self.report.warn(at, rounding(center));
        }
        let center = center.unwrap_or(DVec3::ZERO);
        self.shared.centers.insert(mesh, center);
        center
    }

    fn accept_shape(&self, object: &Object) {
        self.accept_all(object);
    }

    /// Returns the material of a shape, from its nested objects.
    fn shape_material(&mut self, object: &Object) -> Result<(u32, MeshNeeds), SceneError> {
        let (mut bsdf, mut emitter, mut interior, mut exterior) = (None, None, None, None);
        for child in &object.children {
            let inner = self.document.get(child.object);
            match inner.class {
                Class::Bsdf if bsdf.is_none() => bsdf = Some(child.object),
                Class::Emitter if emitter.is_none() && inner.plugin == "area" => emitter = Some(child.object),
                Class::Medium if child.name == "interior" => interior = Some(child.object),
                Class::Medium if child.name == "exterior" => exterior = Some(child.object),
                Class::Medium if interior.is_none() => interior = Some(child.object),
                _ => continue,
            }
            child.used.set(true);
        }
        let interior = interior.map(|medium| self.medium(medium)).transpose()?.flatten();
        let exterior = exterior.map(|medium| self.medium(medium)).transpose()?.flatten();
        self.material((bsdf, emitter, interior, exterior))
    }

    /// Finishes a mesh: sets its material and transforms it.
    pub(super) fn finish(
        &mut self,
        object: &Object,
        mut mesh: Mesh,
        matrix: DMat4,
        normals: Normals,
        is_flat: bool,
    ) -> Result<Vec<GroupPart>, SceneError> {
        let (material, needs) = self.shape_material(object)?;
        if mesh.triangles.is_empty() {
            self.report.warn(object.at, format!("the {} has no triangles, and is left out", object.describe()));
            return Ok(Vec::new());
        }
        if mesh.name.is_empty() {
            mesh.name = if object.id.is_empty() { object.plugin.clone() } else { object.id.clone() };
        }
        self.take(object.at, mesh.memory_bytes())?;
        if let Some(awaited) = self.awaited_by.remove(&material) {
            mesh = self.with_attributes(object, mesh, &awaited)?;
        }
        if needs.colors && mesh.colors.is_empty() {
            mesh = self.with_vertex_colors(object, mesh)?;
        }
        if needs.face_colors {
            mesh = self.with_face_colors(object, mesh)?;
        }
        let Some(mut mesh) = place(mesh.with_material(material), &matrix, normals, needs) else {
            self.report.warn(object.at, format!("the {} lies out of reach, and is left out", object.describe()));
            return Ok(Vec::new());
        };
        if is_flat && !needs.tangents {
            mesh.normals = Vec::new();
        }
        Ok(vec![GroupPart::Mesh(mesh)])
    }

    fn cylinder(&mut self, object: &Object, to_group: DMat4, own: &Transform) -> Result<Vec<GroupPart>, SceneError> {
        let p0 = self.bad(object.vector("p0"))?.unwrap_or(DVec3::ZERO);
        let p1 = self.bad(object.vector("p1"))?.unwrap_or(DVec3::Z);
        let radius = self.number_at_least(object, "radius", 0.0, 1.0)?;
        let (axis, length) = ((p1 - p0).normalize_or_zero(), p0.distance(p1));
        if axis == DVec3::ZERO || radius == 0.0 {
            self.report.warn(object.at, "a cylinder without length or radius is left out");
            self.accept_shape(object);
            return Ok(Vec::new());
        }
        let (s, t) = axis.any_orthonormal_pair();
        let frame = DMat3::from_cols(s * radius, t * radius, axis * length);
        let to_object = DMat4::from(DAffine3::from_mat3_translation(frame, p0));
        let normals = Normals { flat: false, ..self.normals(object)? };
        let placed = match own.taken_inverse {
            Some(_) => to_group * scaled_along_axes(&(own.matrix * to_object), [0, 0, 2]),
            None => to_group * own.matrix * to_object,
        };
        self.finish(object, solids::cylinder(), placed, normals, false)
    }

    fn sphere(&mut self, object: &Object, to_group: DMat4, own: &Transform) -> Result<Vec<GroupPart>, SceneError> {
        let center = self.bad(object.vector("center"))?.unwrap_or(DVec3::ZERO);
        let radius = self.number_at_least(object, "radius", 0.0, 1.0)?;
        let normals = self.normals(object)?;
        let (to_center, to_size) = (DMat4::from_translation(center), DMat4::from_scale(DVec3::splat(radius)));
        let to_group = match own.taken_inverse {
            Some(_) => to_group * scaled_along_axes(&(own.matrix * to_center * to_size), [0; 3]),
            None => to_group * own.matrix * to_center * to_size,
        };
        if DMat3::from_mat4(to_group).determinant() == 0.0 {
            self.report.warn(object.at, "a sphere without radius is left out");
            self.accept_shape(object);
            return Ok(Vec::new());
        }
        let (material, needs) = self.shape_material(object)?;
        if let Some(awaited) = self.awaited_by.remove(&material) {
            self.with_attributes(object, Mesh::default(), &awaited)?;
        }
        let inward = normals.flipped != (DMat3::from_mat4(to_group).determinant() < 0.0);
        Ok(vec![GroupPart::Sphere(Ball { to_group, inward, material, needs })])
    }

    fn instance(&mut self, object: &Object, matrix: DMat4) -> Result<Vec<GroupPart>, SceneError> {
        let is_group = |id: ObjectId| self.document.get(id).plugin == "shapegroup";
        let Some(child) = object.children.iter().find(|child| is_group(child.object)) else {
            return Err(self.report.invalid(object.at, "an instance needs a shapegroup"));
        };
        child.used.set(true);
        Ok(vec![GroupPart::Group(child.object, matrix)])
    }

    /// Makes the meshes of a group once.
    fn load_group(&mut self, id: ObjectId) -> Result<(), SceneError> {
        if self.groups.contains_key(&id) {
            return Ok(());
        }
        let object = self.visit(id)?;
        // Nested groups multiply: check the memory before building.
        let shapes = self.shape_count(id, &mut BTreeMap::new());
        let bytes = shapes.saturating_mul(size_of::<(u32, DMat4)>());
        self.placed(object.at, self.resources.budget().check(self.report.path(object.at.file), bytes))?;
        let mut group = Group::default();
        for child in &object.children {
            if self.document.get(child.object).class != Class::Shape {
                continue;
            }
            child.used.set(true);
            for part in self.parts(child.object, DMat4::IDENTITY)? {
                match part {
                    GroupPart::Mesh(mesh) => group.meshes.push((self.scene.push_mesh(mesh), DMat4::IDENTITY)),
                    GroupPart::Shared(mesh, matrix) => group.meshes.push((mesh, matrix)),
                    GroupPart::Sphere(ball) => group.balls.push(ball),
                    GroupPart::Group(inner, matrix) => {
                        self.load_group(inner)?;
                        let Some(inner) = self.groups.get(&inner) else { continue };
                        let bytes =
                            inner.meshes.len() * size_of::<(u32, DMat4)>() + inner.balls.len() * size_of::<Ball>();
                        self.take(object.at, bytes)?;
                        // The lists of nested groups grow exponentially with depth.
                        let room = group.meshes.try_reserve(inner.meshes.len());
                        if room.and_then(|()| group.balls.try_reserve(inner.balls.len())).is_err() {
                            return Err(self.report.invalid(object.at, "there is no memory for what is in this group"));
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

    /// Counts the shapes in an object, including nested groups.
    fn shape_count(&self, id: ObjectId, known: &mut BTreeMap<ObjectId, usize>) -> usize {
        if let Some(&count) = known.get(&id) {
            return count;
        }
        let object = self.document.get(id);
        let count = match object.plugin.as_str() {
            "shapegroup" | "instance" | "merge" => {
                let shapes =
                    object.children.iter().filter(|child| self.document.get(child.object).class == Class::Shape);
                shapes.fold(0, |sum: usize, child| sum.saturating_add(self.shape_count(child.object, known)))
            }
            _ => 1,
        };
        known.insert(id, count);
        count
    }

    fn add_instance(&mut self, id: ObjectId, matrix: DMat4) -> Result<(), SceneError> {
        self.load_group(id)?;
        let at = self.document.get(id).at;
        let Some(group) = self.groups.remove(&id) else { return Ok(()) };
        let room = self.scene.instances.try_reserve(group.meshes.len());
        if room.and_then(|()| self.scene.spheres.try_reserve(group.balls.len())).is_err() {
            return Err(self.report.invalid(at, "there is no memory for what is in this group"));
        }
        for &(mesh, inside) in &group.meshes {
            self.show(mesh, &(matrix * inside), at)?;
        }
        let bytes = group.balls.len() * size_of::<Sphere>();
        self.take(at, bytes)?;
        for &ball in &group.balls {
            self.add_ball(Ball { to_group: matrix * ball.to_group, ..ball }, at)?;
        }
        self.groups.insert(id, group);
        Ok(())
    }

    /// Adds a sphere in world space: analytic if it is round, otherwise triangles.
    fn add_ball(&mut self, ball: Ball, at: XmlPlace) -> Result<(), SceneError> {
        let linear = DMat3::from_mat4(ball.to_group);
        let center = ball.to_group.w_axis.truncate();
        let determinant = linear.determinant();
        let radius = determinant.abs().cbrt();
        let rotation = linear * (1.0 / (radius * determinant.signum()));
        let gram = rotation.transpose() * rotation;
        let is_round = gram.abs_diff_eq(DMat3::IDENTITY, 1e-5);
        // Only a texture distinguishes a mirrored sphere from a rotated one.
        let is_mirrored_picture = determinant < 0.0 && ball.needs.uvs;
        let in_reach = center.abs().max_element() + radius < f64::from(COORDINATE_MAX) && radius as f32 > 0.0;
        if is_round && !is_mirrored_picture && in_reach {
            let material = if ball.inward { self.turned_material(ball.material) } else { Some(ball.material) };
            if let Some(material) = material {
                self.scene.spheres.push(Sphere {
                    center: center.as_vec3(),
                    radius: radius as f32,
                    world_from_object: orientation(&rotation),
                    material,
                });
                return Ok(());
            }
        }
        let normals = Normals { flipped: ball.inward, ..Normals::default() };
        let mesh = Mesh { name: "sphere".into(), material: ball.material, ..solids::sphere() };
        self.take(at, mesh.memory_bytes())?;
        if let Some(mesh) = place(mesh, &ball.to_group, normals, ball.needs) {
            self.scene.push_surface(mesh);
        }
        Ok(())
    }

    /// Returns the material for a surface turned inside out.
    fn turned_material(&mut self, material: u32) -> Option<u32> {
        let turned = turned(&self.scene.materials[material as usize])?;
        let known = self.scene.materials.iter().position(|known| *known == turned);
        Some(known.map_or_else(|| self.scene.push_material(turned), |index| index as u32))
    }
}

/// Returns Mitsuba's transformation of a sphere or cylinder: rotation, position and one scale per axis.
///
/// - `axes`: source axis of each of the three scales.
fn scaled_along_axes(placed: &DMat4, axes: [usize; 3]) -> DMat4 {
    let (scale, rotation) = polar(&DMat3::from_mat4(*placed));
    let scale = DVec3::from_array(axes.map(|axis| scale.col(axis)[axis]));
    DMat4::from(DAffine3::from_mat3_translation(rotation * DMat3::from_diagonal(scale), placed.w_axis.truncate()))
}

/// Returns the orientation of a sphere: Mitsuba's pole is z, ours is y.
fn orientation(rotation: &DMat3) -> Quat {
    // Our u starts at −z and increases towards −x; Mitsuba's starts at +x and increases towards +y.
    let ours = DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X);
    DQuat::from_mat3(&(*rotation * ours)).normalize().as_quat().normalize()
}

fn affine(matrix: &DMat4) -> Affine3A {
    let column = |index: usize| -> Vec3 { matrix.col(index).truncate().as_vec3() };
    Affine3A::from_cols(column(0).into(), column(1).into(), column(2).into(), column(3).into())
}
