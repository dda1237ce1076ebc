//! Looks of shapes: textures, media and materials.

use super::context::ImportContext;
use super::document::{Class, Object};
use super::material::MitsubaMaterials;
use super::medium::MitsubaMedia;
use super::shared::MeshNeeds;
use super::texture::MitsubaTextures;
use crate::import::text_place::ImportResult;

/// The textures, media and materials of a scene.
pub(super) struct SceneLooks<'a> {
    pub(super) textures: MitsubaTextures<'a>,
    pub(super) media: MitsubaMedia,
    pub(super) materials: MitsubaMaterials,
}

impl<'a> SceneLooks<'a> {
    /// Makes empty collections.
    pub(super) fn new(textures: MitsubaTextures<'a>) -> Self {
        Self { textures, media: MitsubaMedia::default(), materials: MitsubaMaterials::default() }
    }

    /// Returns the material of a shape, from its nested objects, and what it needs of the mesh.
    pub(super) fn of_shape(
        &mut self,
        context: &mut ImportContext<'_>,
        object: &Object,
    ) -> ImportResult<(u32, MeshNeeds)> {
        let (mut bsdf, mut emitter, mut interior, mut exterior) = (None, None, None, None);
        for child in &object.children {
            let inner = context.document.get(child.object);
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
        let Self { textures, media, materials } = self;
        let interior = interior.map(|id| media.medium(context, textures, id)).transpose()?;
        let exterior = exterior.map(|id| media.medium(context, textures, id)).transpose()?;
        materials.material(context, textures, (bsdf, emitter, interior, exterior))
    }
}
