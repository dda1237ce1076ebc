//! Meshes that several shapes share: from the same file, or in groups.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DMat4};

use super::document::{Class, Document, Object, ObjectId};
use crate::import::sphere::orientation;
use crate::model::COORDINATE_MAX;
use crate::motion::SphereKey;

/// The key of a mesh from a file, without its transformation: plugin, properties and nested objects.
pub(super) type MeshKey = (String, Vec<String>, Vec<ObjectId>);

/// Returns the key of a shape from a mesh file; `None`: the shape is not from a file.
pub(super) fn mesh_key(object: &Object) -> Option<MeshKey> {
    if !matches!(object.plugin.as_str(), "obj" | "ply" | "serialized") {
        return None;
    }
    let properties = object.properties.iter().filter(|property| property.name != "to_world");
    // Include the referring file, as its folder is searched too.
    let mut texts: Vec<String> =
        properties.map(|property| format!("{} {:?} {}", property.name, property.value, property.at.file)).collect();
    texts.sort();
    let mut parts: Vec<ObjectId> = object.children.iter().map(|child| child.object).collect();
    parts.sort();
    Some((object.plugin.clone(), texts, parts))
}

/// Returns the number of shapes of each mesh that several shapes of a document use.
pub(super) fn shared_meshes(document: &Document) -> BTreeMap<MeshKey, (usize, Option<u32>)> {
    let mut shared: BTreeMap<MeshKey, (usize, Option<u32>)> = BTreeMap::new();
    for key in document.objects.iter().filter(|object| object.class == Class::Shape).filter_map(mesh_key) {
        shared.entry(key).or_default().0 += 1;
    }
    shared.retain(|_, (uses, _)| *uses > 1);
    shared
}

/// An analytic sphere: the transformed unit sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    /// Maps the unit sphere to the space of the group.
    pub(super) to_group: DMat4,
    /// `true`: the ball's front is inside, because its normals are flipped or its own transformation mirrors it. An instance's
    /// transformation does not count.
    pub(super) inward: bool,
    /// Index of the material.
    pub(super) material: u32,
    pub(super) needs: MeshNeeds,
}

impl Ball {
    /// Returns the sphere that a transformation of the unit sphere makes, as a key; `None`: it is not round, or only
    /// triangles can show its picture.
    pub(super) fn round_at(&self, to_world: &DAffine3, time: f64) -> Option<SphereKey> {
        let linear = to_world.matrix3;
        let center = to_world.translation;
        let determinant = linear.determinant();
        let radius = determinant.abs().cbrt();
        let rotation = linear * (1.0 / (radius * determinant.signum()));
        let gram = rotation.transpose() * rotation;
        let is_round = gram.abs_diff_eq(DMat3::IDENTITY, 1e-5);
        // Only a texture distinguishes a mirrored sphere from a rotated one.
        let is_mirrored_picture = determinant < 0.0 && self.needs.uvs;
        let in_reach = center.abs().max_element() + radius < f64::from(COORDINATE_MAX) && radius as f32 > 0.0;
        (is_round && !is_mirrored_picture && in_reach).then(|| SphereKey {
            time,
            center: center.as_vec3(),
            radius: radius as f32,
            world_from_object: orientation(&rotation),
        })
    }
}

/// The contents of a group; nested groups are flattened.
#[derive(Clone, Debug, Default)]
pub(super) struct Group {
    /// Meshes of the scene and their transformations.
    pub(super) meshes: Vec<(u32, DMat4)>,
    pub(super) balls: Vec<Ball>,
}

/// The attributes that a material needs of its mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct MeshNeeds {
    /// `true`: texture coordinates.
    pub(super) uvs: bool,
    /// `true`: tangents along u.
    pub(super) tangents: bool,
    /// Colours per vertex.
    pub(super) colors: bool,
    /// Colours per face.
    pub(super) face_colors: bool,
}
