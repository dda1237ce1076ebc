//! Parameters of the layered material at one point.

use bottega_scene::Spectrum;
use glam::Vec3;

/// The layered material after texture lookups, from which a [`Bsdf`](super::Bsdf) is built. Meanings as in
/// [`Layered`](bottega_scene::Layered). `Bsdf::new` clamps values outside their ranges, and NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceParams {
    /// Reflectance of the diffuse and metal base, tint of the transmission; in [0, 1].
    pub base_color: Spectrum,
    /// Share of metal, in [0, 1].
    pub metallic: f32,
    /// Perceptual roughness of the base, in [0, 1].
    pub roughness: f32,
    /// Stretch of highlights along x, in [0, 1].
    pub anisotropy: f32,
    /// Index of refraction, at least 1, clamped to 5; 0 stands for total reflection.
    pub ior: f32,
    /// Dispersion: 20 over the Abbe number; not negative.
    pub dispersion: f32,
    /// Strength of the dielectric reflection, in [0, 1].
    pub specular: f32,
    /// Tint of the dielectric reflection at normal incidence; not negative.
    pub specular_color: Spectrum,
    /// Share of refracted light among the dielectric's, in [0, 1].
    pub transmission: f32,
    /// Share of the diffuse light transmitted to the other side, in [0, 1]; ignored for solids that light enters.
    pub diffuse_transmission: f32,
    /// Colour of the diffuse transmission, in [0, 1].
    pub diffuse_transmission_color: Spectrum,
    /// `true`: a sheet without volume.
    pub thin: bool,
    /// Strength of a thin film on the base, in [0, 1].
    pub iridescence: f32,
    /// Index of refraction of the film, at least 1.
    pub iridescence_ior: f32,
    /// Thickness of the film in nanometres.
    pub iridescence_thickness: f32,
    /// Strength of the clear coat, in [0, 1].
    pub coat: f32,
    /// Perceptual roughness of the clear coat, in [0, 1].
    pub coat_roughness: f32,
    /// Normal of the coat in the local frame, above the surface; +z: that of the base. (In glTF a normal map of the base
    /// does not apply to the coat, which then uses the interpolated normal.)
    pub coat_normal: Vec3,
    /// Colour of the sheen, in [0, 1].
    pub sheen_color: Spectrum,
    /// Perceptual roughness of the sheen, in [0, 1].
    pub sheen_roughness: f32,
    /// `true`: wo is on the outside. Matters only for solids that light enters; opaque or thin surfaces have two equal
    /// sides.
    pub front: bool,
}

impl Default for SurfaceParams {
    /// Returns white plastic as in `Layered::default`, seen from outside.
    fn default() -> Self {
        Self {
            base_color: Spectrum::ONE,
            metallic: 0.0,
            roughness: 1.0,
            anisotropy: 0.0,
            ior: 1.5,
            dispersion: 0.0,
            specular: 1.0,
            specular_color: Spectrum::ONE,
            transmission: 0.0,
            diffuse_transmission: 0.0,
            diffuse_transmission_color: Spectrum::ONE,
            thin: false,
            iridescence: 0.0,
            iridescence_ior: 1.3,
            iridescence_thickness: 400.0,
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
    /// The parameters of a surface that scatters nothing, as of an unlit material.
    pub const BLACK: Self = Self {
        base_color: Spectrum::ZERO,
        metallic: 0.0,
        roughness: 1.0,
        anisotropy: 0.0,
        ior: 1.0,
        dispersion: 0.0,
        specular: 0.0,
        specular_color: Spectrum::ZERO,
        transmission: 0.0,
        diffuse_transmission: 0.0,
        diffuse_transmission_color: Spectrum::ONE,
        thin: false,
        iridescence: 0.0,
        iridescence_ior: 1.3,
        iridescence_thickness: 400.0,
        coat: 0.0,
        coat_roughness: 0.0,
        coat_normal: Vec3::Z,
        sheen_color: Spectrum::ZERO,
        sheen_roughness: 0.0,
        front: true,
    };

    /// Returns the same material with a roughness of at least `roughness` in base and coat. Paths that have left a
    /// diffuse surface use it, so that they do not find light that no other strategy finds.
    pub fn at_least_as_rough_as(self, roughness: f32) -> Self {
        Self { roughness: self.roughness.max(roughness), coat_roughness: self.coat_roughness.max(roughness), ..self }
    }

    /// Clamps everything to its range; NaN becomes the lower end.
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
            anisotropy: unit(self.anisotropy),
            dispersion: within(self.dispersion, 0.0, 20.0),
            transmission: unit(self.transmission),
            diffuse_transmission: unit(self.diffuse_transmission),
            diffuse_transmission_color: unit_color(self.diffuse_transmission_color),
            iridescence: unit(self.iridescence),
            iridescence_ior: within(self.iridescence_ior, 1.0, super::fresnel::IOR_MAX),
            iridescence_thickness: within(self.iridescence_thickness, 0.0, 1e5),
            coat: unit(self.coat),
            coat_roughness: unit(self.coat_roughness),
            coat_normal: self.coat_normal.try_normalize().filter(|n| n.z > 0.0).unwrap_or(Vec3::Z),
            sheen_color: unit_color(self.sheen_color),
            sheen_roughness: unit(self.sheen_roughness),
            ..self
        }
    }
}
