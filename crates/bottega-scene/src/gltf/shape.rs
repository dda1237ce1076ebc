//! Primitives in the state in which nodes show them.

use super::document;
use super::source::GltfSource;

/// A primitive with its material, morph weights and skin, shown by one or more nodes.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PrimitiveShape {
    /// Index of the mesh in the document.
    pub(super) mesh: usize,
    /// Index of the primitive in its mesh.
    pub(super) primitive: usize,
    /// Index of the material; `None`: the default material.
    pub(super) material: Option<usize>,
    /// Bits of the morph weights; absent ones are 0.
    pub(super) weights: Vec<u32>,
    /// Index of the skin; `None`: not skinned.
    pub(super) skin: Option<usize>,
}

impl PrimitiveShape {
    /// Returns the primitive of the document.
    pub(super) fn primitive<'a>(&self, source: &GltfSource<'a>) -> &'a document::Primitive {
        &source.document.meshes[self.mesh].primitives[self.primitive]
    }

    /// Returns the location of a member of the primitive.
    pub(super) fn place(&self, member: &str) -> String {
        format!("meshes[{}].primitives[{}]{member}", self.mesh, self.primitive)
    }
}
