//! Meshes that several shapes share: from the same file, or in groups.

use std::collections::BTreeMap;

use glam::{DMat4, DVec3};

use super::document::{Class, Document, Object, ObjectId};
use crate::model::MeshBounds;

/// The key of a mesh from a file, without its transformation: plugin, properties and nested objects.
pub(super) type MeshKey = (String, Vec<String>, Vec<ObjectId>);

/// Returns the key of a shape from a mesh file.
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

/// The shared meshes.
#[derive(Debug, Default)]
pub(super) struct SharedMeshes {
    /// Number of shapes, and the mesh once it is made; small meshes are removed, and each shape gets its own.
    pub(super) meshes: BTreeMap<MeshKey, (usize, Option<u32>)>,
    /// Mirrored copies of meshes.
    pub(super) mirrored: BTreeMap<u32, u32>,
    /// Former centres of the meshes that were moved to their origin.
    pub(super) centers: BTreeMap<u32, DVec3>,
    pub(super) bounds: MeshBounds,
}

impl SharedMeshes {
    /// Finds the meshes that several shapes of a document use.
    pub(super) fn new(document: &Document) -> Self {
        let mut shared = Self::default();
        for key in document.objects.iter().filter(|object| object.class == Class::Shape).filter_map(mesh_key) {
            shared.meshes.entry(key).or_default().0 += 1;
        }
        shared.meshes.retain(|_, (uses, _)| *uses > 1);
        shared
    }
}

/// An analytic sphere: the transformed unit sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    /// Maps the unit sphere to the space of the group.
    pub(super) to_group: DMat4,
    /// `true`: its front is inside, because its normals are flipped or its own transformation mirrors it. An instance's
    /// transformation does not count.
    pub(super) inward: bool,
    /// Index of the material.
    pub(super) material: u32,
    pub(super) needs: MeshNeeds,
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
