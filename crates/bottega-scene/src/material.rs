//! The one layered surface material. It is a superset of glTF 2.0's metallic-roughness model and its extensions, in
//! the manner of the Dielectric Specular / OpenPBR family.

use glam::{Vec2, Vec4};

use crate::{Channel, Scene, Spectrum, TextureMap};

/// A colour: factor × texture.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorParam {
    /// Multiplies the texture, or stands alone.
    pub factor: Spectrum,
    /// RGB.
    pub texture: Option<TextureMap>,
}

/// A number: factor × one channel of a texture.
#[derive(Clone, Debug, PartialEq)]
pub struct ScalarParam {
    /// Multiplies the texture, or stands alone.
    pub factor: f32,
    /// The texture and which of its channels.
    pub texture: Option<(TextureMap, Channel)>,
}

impl ColorParam {
    /// The colour at a point with these two sets of texture coordinates; `footprint` as for
    /// [`Image::eval`](crate::Image::eval). Panics when the texture's image is not in the scene, which
    /// [`Scene::validate`] excludes.
    pub fn eval(&self, scene: &Scene, uvs: [Vec2; 2], footprint: f32) -> Spectrum {
        match &self.texture {
            None => self.factor,
            Some(map) => self.factor * look_up(scene, map, uvs, footprint).truncate(),
        }
    }
}

impl ScalarParam {
    /// The number at a point; see [`ColorParam::eval`].
    pub fn eval(&self, scene: &Scene, uvs: [Vec2; 2], footprint: f32) -> f32 {
        match &self.texture {
            None => self.factor,
            Some((map, channel)) => self.factor * look_up(scene, map, uvs, footprint)[*channel as usize],
        }
    }
}

fn look_up(scene: &Scene, map: &TextureMap, uvs: [Vec2; 2], footprint: f32) -> Vec4 {
    scene.images[map.image.0 as usize].eval(map, uvs[usize::from(map.uv_set & 1)], footprint)
}

impl From<Spectrum> for ColorParam {
    fn from(factor: Spectrum) -> Self {
        Self { factor, texture: None }
    }
}

impl From<f32> for ScalarParam {
    fn from(factor: f32) -> Self {
        Self { factor, texture: None }
    }
}

/// How opacity is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Alpha at or above the cutoff is opaque, below it the surface is not there.
    Mask {
        /// The cutoff.
        cutoff: f32,
    },
    /// The surface is there with probability alpha.
    Blend,
}

/// A surface material. From the outside in: sheen over coat over base; the base is a mix of metal, transmitting
/// dielectric and diffuse dielectric.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the file; may be empty.
    pub name: String,
    /// Reflectance of the diffuse and metal base, tint of the transmission. Its texture's alpha is the opacity.
    pub base_color: ColorParam,
    /// Multiplied with the alpha of the base colour's texture and of the vertex colours.
    pub alpha: f32,
    /// How opacity is read.
    pub alpha_mode: AlphaMode,
    /// 0: dielectric, 1: metal.
    pub metallic: ScalarParam,
    /// Perceptual roughness: the microfacet α is its square.
    pub roughness: ScalarParam,
    /// Index of refraction of the dielectric. 0 stands for total reflection (KHR_materials_ior).
    pub ior: f32,
    /// Strength of the dielectric's specular reflection (KHR_materials_specular).
    pub specular: ScalarParam,
    /// Tint of the dielectric's reflection at normal incidence (KHR_materials_specular).
    pub specular_color: ColorParam,
    /// Share of light that enters the dielectric and is transmitted instead of scattered diffusely.
    pub transmission: ScalarParam,
    /// Whether the surface is a sheet without volume (light goes straight through), or bounds a solid.
    pub thin: bool,
    /// Distance after which white light has the colour `attenuation_color` within the solid; infinite: no absorption.
    pub attenuation_distance: f32,
    /// See `attenuation_distance`.
    pub attenuation_color: Spectrum,
    /// Strength of the clear coat.
    pub coat: ScalarParam,
    /// Perceptual roughness of the clear coat.
    pub coat_roughness: ScalarParam,
    /// Normal map of the clear coat.
    pub coat_normal: Option<(TextureMap, f32)>,
    /// Colour of the sheen; black: none.
    pub sheen_color: ColorParam,
    /// Perceptual roughness of the sheen.
    pub sheen_roughness: ScalarParam,
    /// Radiance that the surface emits, on its front (both sides where `double_sided`).
    pub emission: ColorParam,
    /// Tangent-space normal map and its scale.
    pub normal: Option<(TextureMap, f32)>,
    /// Whether the back is shaded like the front (else a non-transmitting back is still shaded, but emits nothing).
    pub double_sided: bool,
    /// KHR_materials_unlit: the base colour is emitted as it is, and nothing is reflected.
    pub unlit: bool,
}

impl Default for Material {
    /// glTF's default material, but dielectric and double-sided: white, rough.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Spectrum::ONE.into(),
            alpha: 1.0,
            alpha_mode: AlphaMode::Opaque,
            metallic: 0.0.into(),
            roughness: 1.0.into(),
            ior: 1.5,
            specular: 1.0.into(),
            specular_color: Spectrum::ONE.into(),
            transmission: 0.0.into(),
            thin: false,
            attenuation_distance: f32::INFINITY,
            attenuation_color: Spectrum::ONE,
            coat: 0.0.into(),
            coat_roughness: 0.0.into(),
            coat_normal: None,
            sheen_color: Spectrum::ZERO.into(),
            sheen_roughness: 0.0.into(),
            emission: Spectrum::ZERO.into(),
            normal: None,
            double_sided: true,
            unlit: false,
        }
    }
}

impl Material {
    /// Whether the surface may let rays pass as if it were not there. Where not, [`opacity`](Self::opacity) is 1.
    pub fn has_opacity(&self) -> bool {
        self.alpha_mode != AlphaMode::Opaque
    }

    /// Probability that the surface is there, in [0, 1]: 0 or 1 where the material masks.
    ///
    /// - `vertex_alpha`: interpolated from [`Mesh::colors`](crate::Mesh::colors); 1 where there are none.
    /// - `uvs`, `footprint`: as for [`ColorParam::eval`].
    pub fn opacity(&self, scene: &Scene, uvs: [Vec2; 2], footprint: f32, vertex_alpha: f32) -> f32 {
        let alpha = || {
            let texture = self.base_color.texture.as_ref().map_or(1.0, |map| {
                let uv = uvs[usize::from(map.uv_set & 1)];
                scene.images[map.image.0 as usize].alpha(map, uv, footprint)
            });
            self.alpha * vertex_alpha * texture
        };
        match self.alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask { cutoff } => f32::from(u8::from(alpha() >= cutoff)),
            AlphaMode::Blend => alpha().clamp(0.0, 1.0),
        }
    }

    /// Whether it shines: its emission is not black, or it is unlit.
    pub fn is_emissive(&self) -> bool {
        self.unlit || self.emission.factor.max_element() > 0.0
    }

    /// Every texture that the material refers to.
    pub fn textures(&self) -> impl Iterator<Item = &TextureMap> {
        let colors = [&self.base_color, &self.specular_color, &self.sheen_color, &self.emission];
        let scalars = [
            &self.metallic,
            &self.roughness,
            &self.specular,
            &self.transmission,
            &self.coat,
            &self.coat_roughness,
            &self.sheen_roughness,
        ];
        let normals = [&self.normal, &self.coat_normal];
        colors
            .into_iter()
            .filter_map(|color| color.texture.as_ref())
            .chain(scalars.into_iter().filter_map(|scalar| scalar.texture.as_ref().map(|(map, _)| map)))
            .chain(normals.into_iter().filter_map(|normal| normal.as_ref().map(|(map, _)| map)))
    }
}
