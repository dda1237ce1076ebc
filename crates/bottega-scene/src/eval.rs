//! Evaluation of textures at a point of a surface.

use glam::{Vec2, Vec4};

use crate::color::Spectrum;
use crate::material::{AlphaMode, Material};
use crate::model::Scene;
use crate::param::{ColorParam, ScalarParam};
use crate::texture::{Mapping, SURFACE_UV_SETS, TextureMap};

/// A source of the texture coordinates of one point: those of the surface, or those computed from its position.
pub trait Uvs: Copy {
    /// Returns the texture coordinates for a map, and the width of its lookup in their units.
    ///
    /// - `footprint`: width of the lookup in the surface's own coordinates.
    fn of(&self, scene: &Scene, map: &TextureMap, footprint: f32) -> (Vec2, f32);
}

/// The two sets of a surface. Maps with a mapping by world position use one of these sets.
impl Uvs for [Vec2; 2] {
    #[inline(always)]
    fn of(&self, _: &Scene, map: &TextureMap, footprint: f32) -> (Vec2, f32) {
        (self[usize::from(map.uv_set & 1)], footprint)
    }
}

impl TextureMap {
    /// Returns the mapping that computes the texture coordinates from world positions; `None`: the surface has them.
    ///
    /// # Panics
    ///
    /// If the mapping is not in the scene, which [`Scene::validate`] excludes.
    #[inline(always)]
    pub fn mapping<'a>(&self, scene: &'a Scene) -> Option<&'a Mapping> {
        let index = self.uv_set.checked_sub(SURFACE_UV_SETS)?;
        Some(&scene.mappings[usize::from(index)])
    }
}

impl ColorParam {
    /// Returns the colour at a point of a surface: the factor times RGB of the texture.
    ///
    /// - `uvs`: texture coordinates of the point.
    /// - `footprint`: width of the lookup in units of these coordinates; 0: the finest level.
    ///
    /// # Panics
    ///
    /// If the texture's image is not in the scene, which [`Scene::validate`] excludes.
    pub fn eval(&self, scene: &Scene, uvs: impl Uvs, footprint: f32) -> Spectrum {
        match &self.texture {
            None => self.factor,
            Some(map) => self.factor * look_up(scene, map, uvs, footprint).truncate(),
        }
    }
}

impl ScalarParam {
    /// Returns the number at a point of a surface: the factor times one channel of the texture. Arguments and panics
    /// are those of [`ColorParam::eval`].
    pub fn eval(&self, scene: &Scene, uvs: impl Uvs, footprint: f32) -> f32 {
        match &self.texture {
            None => self.factor,
            Some((map, channel)) => self.factor * look_up(scene, map, uvs, footprint)[*channel as usize],
        }
    }
}

fn look_up(scene: &Scene, map: &TextureMap, uvs: impl Uvs, footprint: f32) -> Vec4 {
    let (uv, footprint) = uvs.of(scene, map, footprint);
    scene.images[map.image.0 as usize].eval(map, uv, footprint)
}

impl Material {
    /// Returns the probability that the surface is present, in [0, 1]; 0 or 1 for [`AlphaMode::Mask`].
    ///
    /// - `vertex_alpha`: interpolated from [`Mesh::colors`](crate::Mesh::colors); 1 without vertex colours.
    /// - `uvs`, `footprint`: as for [`ColorParam::eval`].
    ///
    /// # Panics
    ///
    /// If the texture's image is not in the scene, which [`Scene::validate`] excludes.
    pub fn opacity_at(&self, scene: &Scene, uvs: impl Uvs, footprint: f32, vertex_alpha: f32) -> f32 {
        let alpha = || vertex_alpha * self.opacity.eval(scene, uvs, footprint);
        match self.alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask { cutoff } => f32::from(u8::from(alpha() >= cutoff)),
            AlphaMode::Blend => alpha().clamp(0.0, 1.0),
            AlphaMode::Absent => 0.0,
        }
    }
}
