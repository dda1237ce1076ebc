//! A material's parameters at one point.

use bottega_kernels::math;
use bottega_scene::{ColorParam, Material, ScalarParam, Scene, Spectrum};
use glam::{Vec2, Vec3, Vec4};

/// The layered material with its textures looked up: what [`Bsdf`](super::Bsdf) is made of. Meanings as in [`Material`]. Values
/// outside their ranges, and NaN, are clamped by `Bsdf::new`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceParams {
    /// Reflectance of the diffuse and metal base, tint of the transmission; in [0, 1].
    pub base_color: Spectrum,
    /// In [0, 1].
    pub metallic: f32,
    /// Perceptual, in [0, 1].
    pub roughness: f32,
    /// At least 1 and told apart up to 5; 0 stands for total reflection.
    pub ior: f32,
    /// In [0, 1].
    pub specular: f32,
    /// Not negative.
    pub specular_color: Spectrum,
    /// In [0, 1].
    pub transmission: f32,
    /// A sheet without volume.
    pub thin: bool,
    /// In [0, 1].
    pub coat: f32,
    /// Perceptual, in [0, 1].
    pub coat_roughness: f32,
    /// Normal of the coat in the local frame, above the surface; +z: that of the base. (In glTF a normal map of the base
    /// is not one of the coat, which then has the interpolated normal.)
    pub coat_normal: Vec3,
    /// In [0, 1].
    pub sheen_color: Spectrum,
    /// Perceptual, in [0, 1].
    pub sheen_roughness: f32,
    /// Whether wo is on the outside. Matters only where light enters a solid: an opaque or thin surface has two equal
    /// sides.
    pub front: bool,
}

impl Default for SurfaceParams {
    /// White plastic as in [`Material::default`], seen from outside.
    fn default() -> Self {
        Self {
            base_color: Spectrum::ONE,
            metallic: 0.0,
            roughness: 1.0,
            ior: 1.5,
            specular: 1.0,
            specular_color: Spectrum::ONE,
            transmission: 0.0,
            thin: false,
            coat: 0.0,
            coat_roughness: 0.0,
            coat_normal: Vec3::Z,
            sheen_color: Spectrum::ZERO,
            sheen_roughness: 0.0,
            front: true,
        }
    }
}

impl SurfaceParams {
    /// What scatters nothing: the surface of an unlit material.
    pub const BLACK: Self = Self {
        base_color: Spectrum::ZERO,
        metallic: 0.0,
        roughness: 1.0,
        ior: 1.0,
        specular: 0.0,
        specular_color: Spectrum::ZERO,
        transmission: 0.0,
        thin: false,
        coat: 0.0,
        coat_roughness: 0.0,
        coat_normal: Vec3::Z,
        sheen_color: Spectrum::ZERO,
        sheen_roughness: 0.0,
        front: true,
    };

    /// Looks up the textures of `material`, but for normal maps, which take a frame: see [`frame`](super::frame), and
    /// [`Self::coat_normal`].
    ///
    /// - `uvs`: both sets of texture coordinates. `vertex_color`: multiplies the base colour; white where a mesh has none.
    /// - `footprint`: width of the lookups in texture coordinates, 0 for sharp ones.
    /// - `front`: whether wo is on the side that the geometric normal points to.
    pub fn of(
        scene: &Scene,
        material: &Material,
        uvs: [Vec2; 2],
        vertex_color: Vec4,
        footprint: f32,
        front: bool,
    ) -> Self {
        if material.unlit {
            return Self::BLACK;
        }
        let color = |param: &ColorParam| param.eval(scene, uvs, footprint);
        let scalar = |param: &ScalarParam| param.eval(scene, uvs, footprint);
        Self {
            base_color: color(&material.base_color) * vertex_color.truncate(),
            metallic: scalar(&material.metallic),
            roughness: scalar(&material.roughness),
            ior: material.ior,
            specular: scalar(&material.specular),
            specular_color: color(&material.specular_color),
            transmission: scalar(&material.transmission),
            thin: material.thin,
            coat: scalar(&material.coat),
            coat_roughness: scalar(&material.coat_roughness),
            coat_normal: Vec3::Z,
            sheen_color: color(&material.sheen_color),
            sheen_roughness: scalar(&material.sheen_roughness),
            front,
        }
    }

    /// The same, no smoother than `roughness`: what a path may see that already left a diffuse surface, so that no light
    /// is found by it that it could not have found otherwise.
    pub fn at_least_as_rough_as(self, roughness: f32) -> Self {
        Self { roughness: self.roughness.max(roughness), coat_roughness: self.coat_roughness.max(roughness), ..self }
    }

    /// Everything in its range; NaN becomes the lower end.
    pub(super) fn clamped(self) -> Self {
        let within = |x: f32, low: f32, high: f32| if x > low { x.min(high) } else { low };
        let unit = |x| within(x, 0.0, 1.0);
        let unit_color = |c: Spectrum| Spectrum::new(unit(c.x), unit(c.y), unit(c.z));
        let positive = |x| within(x, 0.0, 1e6);
        let tint = self.specular_color;
        Self {
            base_color: unit_color(self.base_color),
            metallic: unit(self.metallic),
            roughness: unit(self.roughness),
            ior: if self.ior == 0.0 { 0.0 } else { within(self.ior, 1.0, super::fresnel::IOR_MAX) },
            specular: unit(self.specular),
            specular_color: Spectrum::new(positive(tint.x), positive(tint.y), positive(tint.z)),
            transmission: unit(self.transmission),
            coat: unit(self.coat),
            coat_roughness: unit(self.coat_roughness),
            coat_normal: self.coat_normal.try_normalize().filter(|n| n.z > 0.0).unwrap_or(Vec3::Z),
            sheen_color: unit_color(self.sheen_color),
            sheen_roughness: unit(self.sheen_roughness),
            ..self
        }
    }
}

/// Absorption coefficient within the solid that `material` bounds, in m⁻¹: light is multiplied by exp(−σ d) after d metres
/// (KHR_materials_volume). Zero for a thin or clear material.
pub fn absorption(material: &Material) -> Spectrum {
    let distance = material.attenuation_distance;
    if material.thin || !(distance > 0.0 && distance < f32::INFINITY) {
        return Spectrum::ZERO;
    }
    // A black channel would be infinitely thick; e⁻⁸⁰ is as black as single precision needs.
    let coefficient = |color: f32| if color < 1e-30 { 80.0 } else { -math::ln(color.min(1.0)) } / distance;
    let color = material.attenuation_color;
    Spectrum::new(coefficient(color.x), coefficient(color.y), coefficient(color.z))
}

#[cfg(test)]
mod tests {
    use bottega_scene::{Channel, Image, ImageId, TextureMap, Wrap};
    use glam::Affine2;

    use super::*;

    fn picture(uv_set: u8) -> TextureMap {
        TextureMap {
            image: ImageId(0),
            uv_set,
            picture_from_uv: Affine2::IDENTITY,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            smooth: false,
        }
    }

    #[test]
    fn textures_and_vertex_colours_multiply_the_factors() {
        let texels = vec![[1.0, 0.5, 0.25], [0.0, 0.5, 1.0]];
        let scene = Scene { images: vec![Image::from_linear_rgb("two", 2, 1, texels)], ..Scene::default() };
        let material = Material {
            base_color: ColorParam { factor: Spectrum::new(0.5, 1.0, 1.0), texture: Some(picture(0)) },
            roughness: ScalarParam { factor: 0.5, texture: Some((picture(1), Channel::G)) },
            metallic: 1.0.into(),
            thin: true,
            ..Material::default()
        };
        let uvs = [Vec2::new(0.25, 0.5), Vec2::new(0.75, 0.5)];
        let params = SurfaceParams::of(&scene, &material, uvs, Vec4::new(1.0, 1.0, 0.5, 0.3), 0.0, false);
        assert!((params.base_color - Spectrum::new(0.5, 0.5, 0.125)).length() < 1e-3, "{}", params.base_color);
        assert!((params.roughness - 0.25).abs() < 1e-3, "{}", params.roughness);
        assert!(params.metallic == 1.0 && params.thin && !params.front);
    }

    #[test]
    fn an_unlit_material_scatters_nothing() {
        let material = Material { unlit: true, ..Material::default() };
        let params = SurfaceParams::of(&Scene::default(), &material, [Vec2::ZERO; 2], Vec4::ONE, 0.0, true);
        assert_eq!(params, SurfaceParams::BLACK);
    }

    #[test]
    fn light_has_the_attenuation_colour_after_the_attenuation_distance() {
        let color = Spectrum::new(0.9, 0.5, 0.0);
        let solid = Material { attenuation_distance: 2.0, attenuation_color: color, ..Material::default() };
        let left = absorption(&solid) * -2.0;
        assert!((math::exp(left.x) - 0.9).abs() < 1e-6 && (math::exp(left.y) - 0.5).abs() < 1e-6);
        assert!(math::exp(left.z) < 1e-30);
        assert_eq!(absorption(&Material { thin: true, ..solid }), Spectrum::ZERO);
        assert_eq!(absorption(&Material::default()), Spectrum::ZERO);
    }

    #[test]
    fn numbers_out_of_range_become_the_nearest_that_make_sense() {
        let params =
            SurfaceParams { roughness: f32::NAN, metallic: 2.0, ior: 0.5, ..SurfaceParams::default() }.clamped();
        assert_eq!((params.roughness, params.metallic, params.ior), (0.0, 1.0, 1.0));
        assert_eq!(SurfaceParams { ior: 0.0, ..SurfaceParams::default() }.clamped().ior, 0.0);
    }
}
