//! Placement of meshes by nodes.

use std::collections::BTreeMap;

use glam::{Affine3A, DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::accessor::{Accessor, find};
use super::document;
use super::draco::DracoMeshes;
use super::flat;
use super::hierarchy::{Hierarchy, affine};
use super::mesh;
use super::shape::PrimitiveShape;
use super::source::GltfSource;
use crate::error::{SceneError, Warnings};
use crate::import::placed_meshes::MIRROR;
use crate::material::Material;
use crate::model::{Instance, Mesh, is_placeable};

/// The shapes of the scene and their placements.
#[derive(Default)]
pub(super) struct Placements {
    /// Shapes, in the order of their first placement.
    pub(super) shapes: Vec<PrimitiveShape>,
    list: Vec<Placement>,
}

struct Placement {
    /// Index into the shapes.
    shape: usize,
    node: usize,
    world_from_object: DAffine3,
}

/// Lists the shapes and placements of the scene's nodes.
pub(super) fn placements(
    source: &GltfSource<'_>,
    hierarchy: &Hierarchy,
    warnings: &mut Warnings,
) -> Result<Placements, SceneError> {
    let mut placements = Placements::default();
    // `None`: not a surface.
    let mut number_of: BTreeMap<PrimitiveShape, Option<usize>> = BTreeMap::new();
    for index in hierarchy.visible() {
        let node = &source.document.nodes[index];
        let (Some(mesh_index), Some(world)) = (node.mesh, hierarchy.world_from_node[index]) else { continue };
        let mesh = find("mesh", &source.document.meshes, mesh_index);
        let mesh = mesh.map_err(|problem| source.invalid(format!("nodes[{index}].mesh"), problem))?;
        // A skin gives world-space vertices and overrides the node's transformation (glTF 2.0, section 3.7.3.3).
        let transforms = match node.extensions.as_ref().and_then(|extensions| extensions.instancing.as_ref()) {
            _ if node.skin.is_some() => vec![DAffine3::IDENTITY],
            None => vec![world],
            Some(instancing) => instances(source, index, &instancing.attributes)?.iter().map(|&m| world * m).collect(),
        };
        let animated = hierarchy.pose.get(&index).and_then(|pose| pose.weights.as_ref());
        let weights = animated.or(node.weights.as_ref()).or(mesh.weights.as_ref());
        for primitive in 0..mesh.primitives.len() {
            let material = material(source, &mesh.primitives[primitive]);
            let weights = weights.map(|weights| weights.iter().map(|w| w.to_bits()).collect()).unwrap_or_default();
            let shape = PrimitiveShape { mesh: mesh_index, primitive, material, weights, skin: node.skin };
            let number = match number_of.get(&shape) {
                Some(&number) => number,
                None => {
                    let number = mesh::is_surface(source, &shape, warnings)?.then_some(placements.shapes.len());
                    placements.shapes.extend(number.map(|_| shape.clone()));
                    number_of.insert(shape, number);
                    number
                }
            };
            let Some(shape) = number else { continue };
            source.budget.take(source.path, "nodes", transforms.len() * size_of::<Instance>())?;
            let place = |&world_from_object| Placement { shape, node: index, world_from_object };
            placements.list.extend(transforms.iter().map(place));
        }
    }
    Ok(placements)
}

/// Returns the material of a primitive in the selected variant (KHR_materials_variants).
fn material(source: &GltfSource<'_>, primitive: &document::Primitive) -> Option<usize> {
    let variants = primitive.extensions.variants.as_ref();
    let mapping = source
        .variant
        .zip(variants)
        .and_then(|(variant, variants)| variants.mappings.iter().find(|mapping| mapping.variants.contains(&variant)));
    mapping.map(|mapping| mapping.material).or(primitive.material)
}

/// Returns the instance transformations of EXT_mesh_gpu_instancing: instance space to node space.
fn instances(
    source: &GltfSource<'_>,
    node: usize,
    attributes: &document::InstancingAttributes,
) -> Result<Vec<DAffine3>, SceneError> {
    let place = |name: &str| format!("nodes[{node}].extensions.EXT_mesh_gpu_instancing.attributes.{name}");
    let accessor = |name: &str, index: Option<usize>, width: usize| {
        let Some(index) = index else { return Ok(None) };
        let accessor = Accessor::new(source.document, source.bytes, index);
        let accessor = accessor.map_err(|problem| source.invalid(place(name), problem))?;
        if accessor.width != width || accessor.is_unbacked() {
            return Err(source.invalid(place(name), format!("accessor {index} has not {width} stored components")));
        }
        Ok(Some(accessor))
    };
    let translations = accessor("TRANSLATION", attributes.translation, 3)?;
    let rotations = accessor("ROTATION", attributes.rotation, 4)?;
    let scales = accessor("SCALE", attributes.scale, 3)?;
    let counts: Vec<usize> = [&translations, &rotations, &scales].into_iter().flatten().map(|a| a.count).collect();
    let count = counts.first().copied().unwrap_or(0);
    if counts.iter().any(|&other| other != count) {
        return Err(source.invalid(place("*"), format!("the attributes have different counts: {counts:?}")));
    }
    let triples = |accessor: Option<Accessor<'_>>| accessor.map(|a| a.read(None, |v: [f32; 3]| v.map(f64::from)));
    let (translations, scales) = (triples(translations), triples(scales));
    let rotations = rotations.map(|accessor| accessor.read(None, |v: [f32; 4]| v.map(f64::from)));
    let at = |index: usize| {
        affine(
            scales.as_ref().map(|list| list[index]),
            rotations.as_ref().map(|list| list[index]),
            translations.as_ref().map(|list| list[index]),
        )
    };
    Ok((0..count).map(at).collect())
}

/// Reads every placed shape once, and makes instances of it.
///
/// - `hierarchy`: transformations of the joints.
/// - `draco`: decompressed primitives.
pub(super) fn build(
    source: &GltfSource<'_>,
    hierarchy: &Hierarchy,
    placements: &Placements,
    draco: &DracoMeshes,
    materials: &[Material],
    material_of: &BTreeMap<Option<usize>, u32>,
    warnings: &mut Warnings,
) -> Result<(Vec<Mesh>, Vec<Instance>), SceneError> {
    let read = |shape: &PrimitiveShape| {
        let mut warnings = Warnings::default();
        let material = material_of[&shape.material];
        let mesh = mesh::read(source, hierarchy, draco, shape, &materials[material as usize], &mut warnings);
        (mesh.map(|mesh| mesh.map(|mesh| Mesh { material, ..mesh })), warnings)
    };
    let read: Vec<_> = placements.shapes.par_iter().map(read).collect();
    let mut placed = NodeMeshes::default();
    for (mesh, news) in read {
        warnings.append(news);
        placed.shapes.push(mesh?.map(|mesh| NodeShape::new(mesh, source.origin != DVec3::ZERO)));
    }
    let rounded = placed.shapes.iter().flatten().map(|shape| shape.center);
    if let Some(center) = rounded.max_by(|a, b| a.length().total_cmp(&b.length())).filter(|&it| it != DVec3::ZERO) {
        warnings.add("meshes", crate::origin::rounding(center));
    }
    let mut left_out: BTreeMap<(usize, &str), u32> = BTreeMap::new();
    for placement in &placements.list {
        if let Some(reason) = placed.add(source, placement)? {
            *left_out.entry((placement.node, reason)).or_insert(0) += 1;
        }
    }
    for ((node, reason), count) in left_out {
        let surfaces = if count == 1 { "a surface is" } else { &format!("{count} surfaces are") };
        warnings.add(format!("nodes[{node}]"), format!("{surfaces} left out: {reason}"));
    }
    Ok(placed.finish())
}

/// Meshes and instances under construction. A mirroring placement gets a mirrored mesh, so that no instance mirrors; a
/// flattening one gets a flat mesh.
#[derive(Default)]
struct NodeMeshes {
    /// Shapes that were read; `None`: no triangle remains.
    shapes: Vec<Option<NodeShape>>,
    /// Flattened meshes in world space.
    flat: Vec<Mesh>,
    instances: Vec<(InstancedMesh, Affine3A)>,
}

struct NodeShape {
    mesh: Mesh,
    bounds: (Vec3, Vec3),
    /// Former centre of the mesh in its own space, if it was moved to the origin.
    center: DVec3,
    /// True if the shape is placed unmirrored; true if it is placed mirrored.
    used: [bool; 2],
}

/// The mesh of an instance.
enum InstancedMesh {
    /// Index of a shape, and true if it is mirrored.
    Shape(usize, bool),
    /// Index of a flattened mesh.
    Flat(usize),
}

impl NodeShape {
    /// Creates a shape of a mesh.
    ///
    /// - `is_far`: the scene is far from the origin, and the mesh may also be far from its own.
    fn new(mut mesh: Mesh, is_far: bool) -> Self {
        let center = if is_far { crate::origin::centered(&mut mesh) } else { None };
        Self { bounds: mesh.bounds(), center: center.unwrap_or(DVec3::ZERO), mesh, used: [false; 2] }
    }
}

impl NodeMeshes {
    /// Places a shape, or returns why it cannot be placed. Shapes without triangles, and those scaled to a point (the
    /// usual way to hide them; glTF 2.0, section 5.25), are skipped silently.
    fn add(&mut self, source: &GltfSource<'_>, placement: &Placement) -> Result<Option<&'static str>, SceneError> {
        let Some(shape) = &mut self.shapes[placement.shape] else { return Ok(None) };
        let world = match shape.center {
            DVec3::ZERO => placement.world_from_object,
            center => placement.world_from_object * DAffine3::from_translation(center),
        };
        let mirrors = world.matrix3.determinant() < 0.0;
        let upright = if mirrors { world * DAffine3::from_scale(MIRROR) } else { world };
        let world_from_object = upright.as_affine3a();
        if is_placeable(shape.bounds, &world_from_object) {
            let was_used = shape.used;
            shape.used[usize::from(mirrors)] = true;
            if was_used != [true; 2] && shape.used == [true; 2] {
                source.budget.take(source.path, "meshes", shape.mesh.memory_bytes())?;
            }
            self.instances.push((InstancedMesh::Shape(placement.shape, mirrors), world_from_object));
            return Ok(None);
        }
        if world.matrix3 == DMat3::ZERO {
            return Ok(None);
        }
        if !world.is_finite() {
            return Ok(Some("the transformation is not finite"));
        }
        // At most three vertices per triangle.
        source.budget.take(source.path, "meshes", shape.mesh.memory_bytes().saturating_mul(4))?;
        Ok(match flat::flattened(&shape.mesh, &world) {
            Ok(Some(mesh)) => {
                self.instances.push((InstancedMesh::Flat(self.flat.len()), Affine3A::IDENTITY));
                self.flat.push(mesh);
                None
            }
            Ok(None) => Some("the transformation flattens all of it"),
            Err(flat::OutOfReach) => Some("the transformation moves it out of reach"),
        })
    }

    fn finish(self) -> (Vec<Mesh>, Vec<Instance>) {
        let mut meshes = Vec::with_capacity(self.shapes.len());
        let mut numbers = Vec::with_capacity(self.shapes.len());
        for shape in self.shapes {
            let next = meshes.len() as u32;
            let used = shape.as_ref().map_or([false; 2], |shape| shape.used);
            numbers.push([next, next + u32::from(used[0])]);
            match (shape, used) {
                (Some(shape), [true, false]) => meshes.push(shape.mesh),
                (Some(shape), [false, true]) => meshes.push(shape.mesh.mirrored()),
                (Some(shape), [true, true]) => {
                    let mirrored = shape.mesh.clone().mirrored();
                    meshes.extend([shape.mesh, mirrored]);
                }
                _ => {}
            }
        }
        let first_flat = meshes.len() as u32;
        meshes.extend(self.flat);
        let instance = |(which, world_from_object): (InstancedMesh, Affine3A)| {
            let mesh = match which {
                InstancedMesh::Shape(shape, mirrors) => numbers[shape][usize::from(mirrors)],
                InstancedMesh::Flat(number) => first_flat + number as u32,
            };
            Instance::new(mesh, world_from_object)
        };
        (meshes, self.instances.into_iter().map(instance).collect())
    }
}
