//! Meshes that several shapes share: from the same file, and groups.

use std::collections::BTreeMap;

use glam::{DMat4, DVec3};

use super::document::{Class, Document, Object, ObjectId};
use crate::model::MeshBounds;

/// What a mesh from a file is made of, apart from where it is: plugin, properties, and what stands within it.
pub(super) type MeshKey = (String, Vec<String>, Vec<ObjectId>);

/// The key of a shape that is in a file.
pub(super) fn mesh_key(object: &Object) -> Option<MeshKey> {
    if !matches!(object.plugin.as_str(), "obj" | "ply" | "serialized") {
        return None;
    }
    let properties = object.properties.iter().filter(|property| property.name != "to_world");
    // Files are looked for beside the one that asks for them, too.
    let mut texts: Vec<String> =
        properties.map(|property| format!("{} {:?} {}", property.name, property.value, property.at.file)).collect();
    texts.sort();
    let mut parts: Vec<ObjectId> = object.children.iter().map(|child| child.object).collect();
    parts.sort();
    Some((object.plugin.clone(), texts, parts))
}

/// Meshes that several shapes show.
#[derive(Debug, Default)]
pub(super) struct SharedMeshes {
    /// How many shapes, and the mesh once it is there; of one with few triangles every shape gets its own.
    pub(super) meshes: BTreeMap<MeshKey, (usize, Option<u32>)>,
    /// Mirrored copies, where they were asked for.
    pub(super) mirrored: BTreeMap<u32, u32>,
    /// Where the middles of meshes were that were moved.
    pub(super) centers: BTreeMap<u32, DVec3>,
    pub(super) bounds: MeshBounds,
}

impl SharedMeshes {
    /// Counts the shapes of a document.
    pub(super) fn new(document: &Document) -> Self {
        let mut shared = Self::default();
        for key in document.objects.iter().filter(|object| object.class == Class::Shape).filter_map(mesh_key) {
            shared.meshes.entry(key).or_default().0 += 1;
        }
        shared.meshes.retain(|_, (uses, _)| *uses > 1);
        shared
    }
}

/// An analytic sphere: the unit sphere, transformed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub(super) to_group: DMat4,
    /// Whether its front is inside: because its normals are flipped, or because its own transformation mirrors it. That of
    /// an instance does not count.
    pub(super) inward: bool,
    pub(super) material: u32,
    pub(super) needs: MeshNeeds,
}

/// What instances of a group place: nested groups are flattened.
#[derive(Clone, Debug, Default)]
pub(super) struct Group {
    /// Mesh of the scene, and where it is.
    pub(super) meshes: Vec<(u32, DMat4)>,
    pub(super) balls: Vec<Ball>,
}

/// What a material asks of its mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct MeshNeeds {
    pub(super) uvs: bool,
    pub(super) tangents: bool,
    /// Colours of its vertices.
    pub(super) colors: bool,
    /// Colours of its faces.
    pub(super) face_colors: bool,
}
