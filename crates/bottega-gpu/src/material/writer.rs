//! The writer of a scene's materials.

use bottega_render::flat::Portable;
use bottega_scene::{Channel, ColorParam, ScalarParam, Scene, TextureMap};
use glam::Vec3;

use super::features::Features;
use super::textures::EncodedTextures;
use super::words::{Words, finite};
use crate::shared::materials::Param;

/// The words so far, and what was noticed on the way.
pub(super) struct Writer<'a> {
    pub(super) scene: &'a Scene,
    pub(super) words: Words,
    pub(super) textures: EncodedTextures,
    pub(super) features: Features,
    /// What devices do not have.
    pub(super) missing: Vec<String>,
}

impl Writer<'_> {
    /// Writes a record, and what belongs behind it. Returns its place.
    pub(super) fn record(&mut self, head: &impl Portable, tail: &impl Portable) -> u32 {
        let place = self.words.record(head);
        self.words.record(tail);
        place
    }

    /// A factor, and the handle of a texture or 0.
    pub(super) fn color(&mut self, param: &ColorParam) -> Param {
        self.mapped(param.factor, param.texture.as_ref())
    }

    /// The same of a number.
    pub(super) fn scalar(&mut self, param: &ScalarParam) -> Param {
        let factor = Vec3::new(finite(param.factor), 0.0, 0.0);
        let texture = param.texture.as_ref().map_or(0, |(map, channel)| self.textures.scalar(map, *channel));
        Param { factor, texture }
    }

    /// A factor, and all colours of a texture.
    pub(super) fn mapped(&mut self, factor: Vec3, map: Option<&TextureMap>) -> Param {
        Param { factor: factor.map(finite), texture: self.handle(map) }
    }

    /// A factor, and one channel of a texture.
    pub(super) fn channel(&mut self, factor: Vec3, map: Option<&(TextureMap, Channel)>) -> Param {
        let texture = map.map_or(0, |(map, channel)| self.textures.scalar(map, *channel));
        Param { factor: factor.map(finite), texture }
    }

    /// The handle of all colours of a texture; 0: there is none.
    pub(super) fn handle(&mut self, map: Option<&TextureMap>) -> u32 {
        map.map_or(0, |map| self.textures.color(map))
    }
}
