//! The materials of a scene as words: the layout that `material.wgsl` reads.

use bottega_render::bsdf::precomputed;
use bottega_scene::{
    AlphaMode, Back, ColorParam, Material, Relief, ReliefRule, ReliefSource, ScalarParam, Scene, Sides, Spectrum,
    Surface, TextureMap,
};

use super::features::Features;
use super::surfaces::add_surface;
use super::textures::EncodedTextures;
use super::words::Words;

/// Words before those of the first material: the number of materials, the place of the albedo curves (0: none).
const HEADS: usize = 8;
/// Words of a material.
const STRIDE: usize = 32;
/// More words than this cannot be told apart by their place.
const WORDS_MAX: usize = 1 << 32;

/// A scene's materials and textures for a device.
#[derive(Debug)]
pub(crate) struct EncodedMaterials {
    /// What `material_words` is to be.
    pub(crate) material_words: Vec<u32>,
    /// What `texture_words` is to be.
    pub(crate) texture_words: Vec<u32>,
    /// What shaders must have for them.
    pub(crate) features: Features,
    /// Handles of the pictures that were asked for beside those of materials.
    pub(crate) extra: Vec<u32>,
}

/// What of a scene's materials devices do not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("not for a GPU: {}", .0.join("; "))]
pub(crate) struct Unsupported(pub(crate) Vec<String>);

/// What is written, while it is written.
pub(super) struct Writer<'a> {
    pub(super) scene: &'a Scene,
    pub(super) words: Words,
    pub(super) textures: EncodedTextures,
    pub(super) features: Features,
    /// What devices do not have.
    pub(super) missing: Vec<String>,
}

impl EncodedMaterials {
    /// - `extra`: pictures that are wanted beside those of materials.
    ///
    /// # Errors
    /// Something is not for devices; all such things are told.
    pub(crate) fn new(scene: &Scene, extra: &[TextureMap]) -> Result<Self, Unsupported> {
        let mut textures = EncodedTextures::new(scene, extra);
        let extra = extra.iter().map(|map| textures.color(map)).collect();
        let mut writer =
            Writer { scene, words: Words::default(), textures, features: Features::default(), missing: Vec::new() };
        writer.words.word(scene.materials.len() as u32);
        writer.words.fill_to(HEADS + STRIDE * scene.materials.len());
        for (index, material) in scene.materials.iter().enumerate() {
            writer.add_material(HEADS + STRIDE * index, material);
        }
        if scene.materials.iter().any(is_layered) {
            let place = writer.words.place();
            writer.words.0[1] = place as u32;
            precomputed::albedo_curves().for_each(|curve| writer.words.numbers(&curve));
        }
        if writer.words.place().max(writer.textures.words.place()) > WORDS_MAX {
            writer.missing.push("textures of more than 16 GiB".into());
        }
        writer.missing.sort();
        writer.missing.dedup();
        let mut maps = scene.materials.iter().flat_map(Material::textures);
        if maps.any(|map| map.mapping(scene).is_some()) {
            writer.missing.push("textures that lie by a place in the world".into());
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

impl Writer<'_> {
    fn add_material(&mut self, head: usize, material: &Material) {
        let mut words = Words::default();
        words.word(flags(material));
        let front = self.add_side(material, true);
        let back = if material.back == Back::Same { front } else { self.add_side(material, false) };
        words.word(front);
        words.word(back);
        words.number(if let AlphaMode::Mask { cutoff } = material.alpha_mode { cutoff } else { 0.0 });
        self.scalar(&mut words, &material.opacity);
        self.color(&mut words, &material.emission);
        for medium in [material.exterior, material.interior] {
            let medium = medium.filter(|_| material.transmits());
            words.color(medium.map_or(Spectrum::ZERO, |medium| self.scene.media[medium.0 as usize].absorption));
            words.word(0);
        }
        self.add_relief(&mut words, material.relief.as_ref());
        let layered = material.layered();
        let coat = layered.and_then(|layered| layered.coat_normal.as_ref());
        words.word(coat.map_or(0, |(map, _)| self.textures.color(map)));
        words.number(coat.map_or(1.0, |(_, scale)| *scale));
        let anisotropy = layered.and_then(|layered| layered.anisotropy.as_ref());
        words.word(anisotropy.and_then(|it| it.texture.as_ref()).map_or(0, |map| self.textures.color(map)));
        let (sin, cos) = bottega_kernels::math::sin_cos(anisotropy.map_or(0.0, |it| it.rotation));
        words.numbers(&[cos, sin]);
        match &material.surface {
            Surface::Unlit(color) => self.color(&mut words, color),
            _ => words.fill_to(STRIDE),
        }
        self.words.0[head..head + STRIDE].copy_from_slice(&words.0);
    }

    /// Returns the place of the surface that scatters on a side; 0: none does.
    fn add_side(&mut self, material: &Material, front: bool) -> u32 {
        material.surface_of(front).map_or(0, |surface| add_surface(self, surface))
    }

    fn add_relief(&mut self, words: &mut Words, relief: Option<&Relief>) {
        let Some(relief) = relief else { return words.numbers(&[0.0; 3]) };
        let (kind, handle, factor) = match &relief.source {
            ReliefSource::Normals(map, scale) => (1, self.textures.color(map), *scale),
            ReliefSource::Heights(height) => {
                let map = height.texture.as_ref();
                // Heights that are the same everywhere lift nothing.
                map.map_or((0, 0, 0.0), |(map, channel)| (2, self.textures.scalar(map, *channel), height.factor))
            }
        };
        let rule = match relief.rule {
            ReliefRule::Bent => 0,
            ReliefRule::Mitsuba { turns, shadows, mirrored } => {
                1 | u32::from(turns) << 1 | u32::from(shadows) << 2 | u32::from(mirrored) << 3
            }
        };
        words.word(kind | rule << 4);
        words.word(handle);
        words.number(factor);
    }

    /// Four words: a factor, and the handle of a texture or 0.
    pub(super) fn color(&mut self, words: &mut Words, param: &ColorParam) {
        words.color(param.factor);
        words.word(param.texture.as_ref().map_or(0, |map| self.textures.color(map)));
    }

    /// The same of a number.
    pub(super) fn scalar(&mut self, words: &mut Words, param: &ScalarParam) {
        words.numbers(&[param.factor, 0.0, 0.0]);
        words.word(param.texture.as_ref().map_or(0, |(map, channel)| self.textures.scalar(map, *channel)));
    }
}

/// The flags of `material.wgsl`, in its order.
fn flags(material: &Material) -> u32 {
    let is_null = material.surface == Surface::Null;
    let layered = material.layered();
    let sides = material.emission_sides;
    let flags = [
        is_null || material.alpha_mode != AlphaMode::Opaque,
        is_null,
        matches!(material.surface, Surface::Unlit(_)),
        material.emission.factor.max_element() > 0.0,
        material.transmits(),
        material.transmits() && !material.parts_media(),
        material.needs_tangents(),
        !material.textures().is_empty(),
        sides != Sides::Back,
        sides != Sides::Front,
        material.is_blended(),
        material.relief.is_some(),
        layered.is_some_and(|layered| layered.coat.factor > 0.0),
        layered.is_some_and(|layered| layered.anisotropy.is_some()),
        layered.is_some(),
        matches!(material.alpha_mode, AlphaMode::Mask { .. }),
        material.alpha_mode == AlphaMode::Blend,
    ];
    flags.into_iter().zip(0..).fold(0, |all, (is_set, bit)| all | u32::from(is_set) << bit)
}

/// Whether some part of it is the layered surface.
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
