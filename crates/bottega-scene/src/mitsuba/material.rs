//! Materials of shapes: bsdfs combined with emission and media.

use std::collections::BTreeMap;

use super::attribute::{AwaitedTexture, MeshData};
use super::bsdf::{LoweredBsdf, bsdf};
use super::context::ImportContext;
use super::document::ObjectId;
use super::shared::MeshNeeds;
use super::texture::MitsubaTextures;
use crate::color::Spectrum;
use crate::emission::EmissionProfile;
use crate::import::text_place::ImportResult;
use crate::material::{AlphaMode, Back, Material, Sides};
use crate::medium::MediumId;
use crate::param::ColorParam;
use crate::spectrum::role::ColorRole;
use crate::surface::{Dielectric, Surface};

/// The key of a material: bsdf, emitter, interior and exterior medium.
pub(super) type MaterialKey = (Option<ObjectId>, Option<ObjectId>, Option<MediumId>, Option<MediumId>);

/// The materials of a scene.
#[derive(Default)]
pub(super) struct MitsubaMaterials {
    /// The materials so far.
    pub(super) list: Vec<Material>,
    /// Material and mesh needs of each combination of bsdf, emitter and media.
    made: BTreeMap<MaterialKey, (u32, MeshNeeds)>,
    /// Mesh attributes that textures of each material use.
    awaited: BTreeMap<u32, Vec<AwaitedTexture>>,
}

impl MitsubaMaterials {
    /// Returns the material of a shape, shared by all shapes with the same parts.
    pub(super) fn material(
        &mut self,
        context: &mut ImportContext<'_>,
        textures: &mut MitsubaTextures<'_>,
        key: MaterialKey,
    ) -> ImportResult<(u32, MeshNeeds)> {
        if let Some(&known) = self.made.get(&key) {
            return Ok(known);
        }
        let (bsdf_id, emitter, interior, exterior) = key;
        textures.mesh_data = MeshData::default();
        let lowered = match bsdf_id {
            Some(id) => bsdf(context, textures, id)?,
            // An emitter without a bsdf is black.
            None if emitter.is_some() => LoweredBsdf::one_sided(Surface::matte(Spectrum::ZERO)),
            None => LoweredBsdf::one_sided(Surface::matte(Spectrum::splat(0.5))),
        };
        let emission = match emitter {
            Some(emitter) => area_radiance(context, textures, emitter)?,
            None => ColorParam::default(),
        };
        // Opacity does not affect emission.
        let shines = emission.factor.max_element() > 0.0;
        let lowered = if shines { lowered.met_everywhere() } else { lowered };
        let name = bsdf_id.map_or_else(String::new, |id| context.document.get(id).id.clone());
        let is_boundary = lowered.transmits();
        let material = Material {
            name,
            culls_back: false,
            alpha_mode: if lowered.opacity.is_some() { AlphaMode::Blend } else { AlphaMode::Opaque },
            surface: lowered.surface,
            back: lowered.back,
            opacity: lowered.opacity.unwrap_or_default(),
            emission,
            emission_sides: Sides::Front,
            emission_profile: EmissionProfile::Diffuse,
            relief: lowered.relief,
            displacement: None,
            interior: interior.filter(|_| is_boundary),
            exterior: exterior.filter(|_| is_boundary),
            see_through: false,
        };
        let tangents = material.needs_tangents();
        let uvs = tangents || !material.textures().is_empty();
        let mesh_data = std::mem::take(&mut textures.mesh_data);
        let needs = MeshNeeds { uvs, tangents, colors: mesh_data.vertex_colors, face_colors: mesh_data.face_colors };
        let made = (self.push(material), needs);
        if mesh_data.textures.is_empty() {
            self.made.insert(key, made);
        } else {
            // Each mesh has its own values.
            self.awaited.insert(made.0, mesh_data.textures);
        }
        Ok(made)
    }

    /// Takes the mesh attributes that textures of a material use; `None`: there are none.
    pub(super) fn take_awaited(&mut self, material: u32) -> Option<Vec<AwaitedTexture>> {
        self.awaited.remove(&material)
    }

    /// Returns the material for a surface turned inside out. `None`: it cannot be expressed.
    pub(super) fn turned(&mut self, material: u32) -> Option<u32> {
        let turned = turned(&self.list[material as usize])?;
        let known = self.list.iter().position(|known| *known == turned);
        Some(known.map_or_else(|| self.push(turned), |index| index as u32))
    }

    fn push(&mut self, material: Material) -> u32 {
        self.list.push(material);
        self.list.len() as u32 - 1
    }
}

/// Returns the radiance that a surface emits from its front.
fn area_radiance(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    emitter: ObjectId,
) -> ImportResult<ColorParam> {
    let object = context.visit(emitter)?;
    textures.color(context, object, "radiance", ColorRole::Emission, Spectrum::ONE)
}

/// Returns the material for a surface turned inside out. `None`: it cannot be expressed.
fn turned(material: &Material) -> Option<Material> {
    let mut turned = material.clone();
    turned.turn_sides();
    match (&material.surface, &material.back) {
        (Surface::Dielectric(dielectric), Back::Same) if dielectric.eta > 0.0 => {
            turned.surface = Surface::Dielectric(Dielectric { eta: 1.0 / dielectric.eta, ..dielectric.clone() });
        }
        (Surface::Null, Back::Same) => {}
        (surface, _) if material.transmits() && !surface.is_thin() => return None,
        (_, Back::Same) => {}
        (surface, Back::Black) => {
            turned.surface = Surface::matte(Spectrum::ZERO);
            turned.back = Back::Other(Box::new(surface.clone()));
        }
        (surface, Back::Other(back)) => {
            turned.surface = (**back).clone();
            turned.back = Back::Other(Box::new(surface.clone()));
        }
    }
    Some(turned)
}
