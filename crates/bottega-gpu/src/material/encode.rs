//! Encoding of a scene's materials as 32-bit words.

use bottega_render::bsdf::precomputed;
use bottega_render::flat::Portable as _;
use bottega_scene::{
    AlphaMode, Back, Material, Relief, ReliefRule, ReliefSource, Scene, Sides, Spectrum, Surface, TextureMap,
};
use glam::Vec2;

use super::features::Features;
use super::surfaces::add_surface;
use super::textures::EncodedTextures;
use super::word_buffer::{WordBuffer, finite};
use super::writer::Writer;
use crate::shared::materials::*;

/// The maximum number of words: places are 32-bit indices.
const WORDS_MAX: usize = 1 << 32;

/// A scene's materials and textures in the layout of the shaders.
#[derive(Debug)]
pub(crate) struct EncodedMaterials {
    /// The contents of the array `material_words`.
    pub(crate) material_words: Vec<u32>,
    /// The contents of the array `texture_words`.
    pub(crate) texture_words: Vec<u32>,
    /// The shader features that the materials use.
    pub(crate) features: Features,
    /// Texture handles of the extra maps, in the order of the request.
    pub(crate) extra: Vec<u32>,
}

/// The parts of a scene's materials that the GPU does not support, one message each.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("not for a GPU: {}", .0.join("; "))]
pub(crate) struct Unsupported(pub(crate) Vec<String>);

impl EncodedMaterials {
    /// Encodes the materials and textures of a scene.
    ///
    /// - `extra`: texture maps to add to those of materials.
    ///
    /// # Errors
    /// The scene has unsupported parts; the error lists all of them.
    pub(crate) fn new(scene: &Scene, extra: &[TextureMap]) -> Result<Self, Unsupported> {
        let mut textures = EncodedTextures::new(scene, extra);
        let extra = extra.iter().map(|map| textures.color(map)).collect();
        let mut writer = Writer {
            scene,
            words: WordBuffer::default(),
            textures,
            features: Features::default(),
            missing: Vec::new(),
        };
        let place_of = |index: usize| MaterialsRecord::WORDS as usize + MaterialRecord::WORDS as usize * index;
        writer.words.fill_to(place_of(scene.materials.len()));
        for (index, material) in scene.materials.iter().enumerate() {
            let record = material_record(&mut writer, material);
            writer.words.put(place_of(index), &record);
        }
        let mut heads = MaterialsRecord { count: scene.materials.len() as u32, curves: 0 };
        if scene.materials.iter().any(is_layered) {
            heads.curves = writer.words.place() as u32;
            precomputed::albedo_curves().for_each(|curve| writer.words.numbers(&curve));
        }
        writer.words.put(0, &heads);
        if writer.words.place().max(writer.textures.words.place()) > WORDS_MAX {
            writer.missing.push("textures of more than 16 GiB".into());
        }
        writer.missing.sort();
        writer.missing.dedup();
        let mut maps = scene.materials.iter().flat_map(Material::textures);
        if maps.any(|map| map.mapping(scene).is_some()) {
            writer.missing.push("textures mapped by world position".into());
        }
        let is_textured = scene.materials.iter().any(|material| !material.textures().is_empty());
        if writer.missing.is_empty() {
            let features = writer.features.with_if(is_textured, Features::TEXTURES);
            Ok(Self { features, material_words: writer.words.0, texture_words: writer.textures.words.0, extra })
        } else {
            Err(Unsupported(writer.missing))
        }
    }
}

/// Returns the record of a material, after writing its surfaces.
fn material_record(writer: &mut Writer<'_>, material: &Material) -> MaterialRecord {
    let front = add_side(writer, material, true);
    let back = if material.back == Back::Same { front } else { add_side(writer, material, false) };
    let (opacity, emission) = (writer.scalar(&material.opacity), writer.color(&material.emission));
    let [exterior, interior] = [material.exterior, material.interior].map(|medium| {
        let medium = medium.filter(|_| material.transmits());
        medium.map_or(Spectrum::ZERO, |medium| writer.scene.media[medium.0 as usize].absorption.map(finite))
    });
    let (relief, relief_map, relief_scale) = relief_of(writer, material.relief.as_ref());
    let layered = material.layered();
    let coat = layered.and_then(|layered| layered.coat_normal.as_ref());
    let coat_map = writer.handle(coat.map(|(map, _)| map));
    let anisotropy = layered.and_then(|layered| layered.anisotropy.as_ref());
    let anisotropy_map = writer.handle(anisotropy.and_then(|it| it.texture.as_ref()));
    let (sin, cos) = bottega_kernels::math::sin_cos(anisotropy.map_or(0.0, |it| it.rotation));
    MaterialRecord {
        flags: flags(material),
        front,
        back,
        cutoff: if let AlphaMode::Mask { cutoff } = material.alpha_mode { finite(cutoff) } else { 0.0 },
        opacity,
        emission,
        exterior,
        interior,
        relief,
        relief_map,
        relief_scale: finite(relief_scale),
        coat_map,
        coat_scale: finite(coat.map_or(1.0, |(_, scale)| *scale)),
        anisotropy_map,
        anisotropy_turn: Vec2::new(finite(cos), finite(sin)),
        unlit_color: match &material.surface {
            Surface::Unlit(color) => writer.color(color),
            _ => Param { factor: Spectrum::ZERO, texture: 0 },
        },
    }
}

/// Writes the surface of one side and returns its place; 0: nothing scatters on that side.
fn add_side(writer: &mut Writer<'_>, material: &Material, front: bool) -> u32 {
    material.surface_of(front).map_or(0, |surface| add_surface(writer, surface))
}

/// Returns the kind and rule of a relief, the handle of its texture, and its scale.
fn relief_of(writer: &mut Writer<'_>, relief: Option<&Relief>) -> (u32, u32, f32) {
    let Some(relief) = relief else { return (RELIEF_NONE, 0, 0.0) };
    let (kind, handle, scale) = match &relief.source {
        ReliefSource::Normals(map, scale) => (RELIEF_NORMALS, writer.textures.color(map), *scale),
        ReliefSource::Heights(height) => {
            let map = height.texture.as_ref();
            // Constant heights have no effect.
            map.map_or((RELIEF_NONE, 0, 0.0), |(map, channel)| {
                (RELIEF_HEIGHTS, writer.textures.scalar(map, *channel), height.factor)
            })
        }
    };
    let rule = match relief.rule {
        ReliefRule::Bent => 0,
        ReliefRule::Mitsuba { turns, shadows, mirrored } => {
            RELIEF_MITSUBA | flag(turns, RELIEF_TURNS) | flag(shadows, RELIEF_SHADOWS) | flag(mirrored, RELIEF_MIRRORED)
        }
    };
    (kind | rule, handle, scale)
}

fn flag(is_set: bool, flag: u32) -> u32 {
    if is_set { flag } else { 0 }
}

/// Returns the flags of a material.
fn flags(material: &Material) -> u32 {
    let is_null = material.surface == Surface::Null;
    let layered = material.layered();
    let sides = material.emission_sides;
    let flags = [
        (is_null || material.alpha_mode != AlphaMode::Opaque, MATERIAL_HAS_OPACITY),
        (is_null, MATERIAL_NULL),
        (matches!(material.surface, Surface::Unlit(_)), MATERIAL_UNLIT),
        (material.emission.factor.max_element() > 0.0, MATERIAL_SHINES),
        (material.transmits(), MATERIAL_TRANSMITS),
        (material.transmits() && !material.parts_media(), MATERIAL_KEEPS_MEDIUM),
        (material.needs_tangents(), MATERIAL_NEEDS_TANGENTS),
        (!material.textures().is_empty(), MATERIAL_TEXTURED),
        (sides != Sides::Back, MATERIAL_EMITS_FRONT),
        (sides != Sides::Front, MATERIAL_EMITS_BACK),
        (material.is_blended(), MATERIAL_BLENDED),
        (material.relief.is_some(), MATERIAL_HAS_RELIEF),
        (layered.is_some_and(|layered| layered.coat.factor > 0.0), MATERIAL_HAS_COAT),
        (layered.is_some_and(|layered| layered.anisotropy.is_some()), MATERIAL_HAS_ANISOTROPY),
        (layered.is_some(), MATERIAL_LAYERED),
        (matches!(material.alpha_mode, AlphaMode::Mask { .. }), MATERIAL_MASKS),
        (material.alpha_mode == AlphaMode::Blend, MATERIAL_BLENDS_ALPHA),
    ];
    flags.into_iter().fold(0, |all, (is_set, bit)| all | flag(is_set, bit))
}

/// Returns true if any part of the material is the layered surface.
fn is_layered(material: &Material) -> bool {
    fn has(surface: &Surface) -> bool {
        match surface {
            Surface::Layered(_) => true,
            Surface::Blend { surfaces, .. } => surfaces.iter().any(has),
            _ => false,
        }
    }
    has(&material.surface) || matches!(&material.back, Back::Other(surface) if has(surface))
}
