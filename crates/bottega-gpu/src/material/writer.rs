//! A writer for the materials of a scene.

use bottega_render::flat::Portable;
use bottega_scene::{Channel, ColorParam, ScalarParam, Scene, TextureMap};
use glam::Vec3;

use super::features::Features;
use super::textures::EncodedTextures;
use super::word_buffer::{WordBuffer, finite};
use crate::shared::materials::Param;

/// The words written so far, and the unsupported features found.
pub(super) struct Writer<'a> {
    pub(super) scene: &'a Scene,
    pub(super) words: WordBuffer,
    pub(super) textures: EncodedTextures,
    pub(super) features: Features,
    /// The features that the GPU does not support, one message each.
    pub(super) missing: Vec<String>,
}

impl Writer<'_> {
    /// Writes a head and the parameters that follow it. Returns the place of the head.
    pub(super) fn record(&mut self, head: &impl Portable, tail: &impl Portable) -> u32 {
        let place = self.words.record(head);
        self.words.record(tail);
        place
    }

    /// Returns a colour parameter: a factor, and the handle of its texture or 0.
    pub(super) fn color(&mut self, param: &ColorParam) -> Param {
        self.mapped(param.factor, param.texture.as_ref())
    }

    /// Returns a scalar parameter: a factor in x, and the handle of its texture or 0.
    pub(super) fn scalar(&mut self, param: &ScalarParam) -> Param {
        let factor = Vec3::new(finite(param.factor), 0.0, 0.0);
        let texture = param.texture.as_ref().map_or(0, |(map, channel)| self.textures.scalar(map, *channel));
        Param { factor, texture }
    }

    /// Returns a parameter with all colour channels of a texture.
    pub(super) fn mapped(&mut self, factor: Vec3, map: Option<&TextureMap>) -> Param {
        Param { factor: factor.map(finite), texture: self.handle(map) }
    }

    /// Returns a parameter with one channel of a texture.
    pub(super) fn channel(&mut self, factor: Vec3, map: Option<&(TextureMap, Channel)>) -> Param {
        let texture = map.map_or(0, |(map, channel)| self.textures.scalar(map, *channel));
        Param { factor: factor.map(finite), texture }
    }

    /// Returns the handle of all colour channels of a texture; 0: there is no texture.
    pub(super) fn handle(&mut self, map: Option<&TextureMap>) -> u32 {
        map.map_or(0, |map| self.textures.color(map))
    }
}
