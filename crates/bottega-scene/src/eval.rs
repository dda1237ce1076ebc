//! The evaluation of textures at a point of a surface.

use glam::{Vec2, Vec4};

use crate::texture::SURFACE_UV_SETS;
use crate::{AlphaMode, ColorParam, Mapping, Material, ScalarParam, Scene, Spectrum, TextureMap};

/// Texture coordinates of a point.
pub trait Uvs: Copy {
    /// Those by which a picture is laid, and the width of its lookup in their units.
    ///
    /// - `footprint`: that width in the surface's own coordinates.
    fn of(&self, scene: &Scene, map: &TextureMap, footprint: f32) -> (Vec2, f32);
}

/// Both sets of a surface. It knows no others: pictures that are laid by a place get one of these.
impl Uvs for [Vec2; 2] {
    #[inline(always)]
    fn of(&self, _: &Scene, map: &TextureMap, footprint: f32) -> (Vec2, f32) {
        (self[usize::from(map.uv_set & 1)], footprint)
    }
}

impl TextureMap {
    /// The mapping that says where its coordinates are; `None`: the surface does.
    #[inline(always)]
    pub fn mapping<'a>(&self, scene: &'a Scene) -> Option<&'a Mapping> {
        let index = self.uv_set.checked_sub(SURFACE_UV_SETS)?;
        Some(&scene.mappings[usize::from(index)])
    }
}

impl ColorParam {
    /// The colour at a point with these texture coordinates; `footprint` as for
    /// [`Image::eval`](crate::Image::eval). Panics when the texture's image is not in the scene, which
    /// [`Scene::validate`] excludes.
    pub fn eval(&self, scene: &Scene, uvs: impl Uvs, footprint: f32) -> Spectrum {
        match &self.texture {
            None => self.factor,
            Some(map) => self.factor * look_up(scene, map, uvs, footprint).truncate(),
        }
    }
}

impl ScalarParam {
    /// The number at a point; see [`ColorParam::eval`].
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
    /// Probability that the surface is there, in [0, 1]: 0 or 1 where the material masks.
    ///
    /// - `vertex_alpha`: interpolated from [`Mesh::colors`](crate::Mesh::colors); 1 where there are none.
    /// - `uvs`, `footprint`: as for [`ColorParam::eval`].
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
