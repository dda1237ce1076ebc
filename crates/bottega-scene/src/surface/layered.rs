//! The layered material of glTF and its extensions.

use serde::{Deserialize, Serialize};

use crate::color::Spectrum;
use crate::param::{ColorParam, ScalarParam};
use crate::subsurface::Subsurface;
use crate::texture::{Channel, TextureMap};

/// The anisotropic highlights of [`Layered`] (KHR_materials_anisotropy).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Anisotropy {
    /// Strength, in [0, 1].
    pub strength: f32,
    /// Direction, counter-clockwise from the tangent, in radians.
    pub rotation: f32,
    /// Red and green: direction in [−1, 1]; blue: factor of the strength. `None`: both are the same everywhere.
    pub texture: Option<TextureMap>,
}

/// A thin film on [`Layered`] (KHR_materials_iridescence).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Iridescence {
    /// Strength, in [0, 1].
    pub factor: ScalarParam,
    /// Index of refraction of the film.
    pub ior: f32,
    /// Thickness of the film in nanometres where the texture is 0, and where it is 1 or there is none.
    pub thickness: [f32; 2],
    /// Texture and channel of the thickness; `None`: the film has the second of [`Self::thickness`].
    pub thickness_texture: Option<(TextureMap, Channel)>,
}

/// A layered surface: glTF 2.0's metallic-roughness model with its extensions, and subsurface scattering; similar to
/// Dassault Systèmes' Enterprise PBR and OpenPBR. From the outside in: sheen over coat over base; the base is a mix of
/// metal, transmitting dielectric and diffuse dielectric.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Layered {
    /// Reflectance of the diffuse and metal base, tint of the transmission. Vertex colours multiply it.
    pub base_color: ColorParam,
    /// 0: dielectric, 1: metal.
    pub metallic: ScalarParam,
    /// Perceptual roughness: the microfacet α is its square.
    pub roughness: ScalarParam,
    /// Anisotropy of the highlights; `None`: they are isotropic.
    pub anisotropy: Option<Anisotropy>,
    /// Index of refraction of the dielectric; 0: total reflection (KHR_materials_ior).
    pub ior: f32,
    /// Dispersion: 20 over the Abbe number (KHR_materials_dispersion); 0: none.
    pub dispersion: f32,
    /// Strength of the dielectric's specular reflection (KHR_materials_specular).
    pub specular: ScalarParam,
    /// Tint of the dielectric's reflection at normal incidence (KHR_materials_specular).
    pub specular_color: ColorParam,
    /// Share of the light entering the dielectric that is transmitted instead of scattered diffusely.
    pub transmission: ScalarParam,
    /// Share of the diffusely scattered light that is transmitted (KHR_materials_diffuse_transmission).
    pub diffuse_transmission: ScalarParam,
    /// Colour of the diffusely transmitted light.
    pub diffuse_transmission_color: ColorParam,
    /// Scattering of the diffuse light below the surface; `None`: it leaves where it arrives. Takes the place of
    /// `diffuse_transmission`, and is ignored for thin sheets and where light is refracted.
    pub subsurface: Option<Box<Subsurface>>,
    /// `true`: a thin sheet without volume (light passes straight through). `false`: the boundary of a solid.
    pub thin: bool,
    /// A thin film on the base; `None`: there is none.
    pub iridescence: Option<Iridescence>,
    /// Strength of the clear coat, in [0, 1].
    pub coat: ScalarParam,
    /// Perceptual roughness of the clear coat.
    pub coat_roughness: ScalarParam,
    /// Normal map of the clear coat, and the scale of its x and y; `None`: the coat has the mesh's normals. The
    /// material's own relief does not affect the coat.
    pub coat_normal: Option<(TextureMap, f32)>,
    /// Colour of the sheen; black: none.
    pub sheen_color: ColorParam,
    /// Perceptual roughness of the sheen.
    pub sheen_roughness: ScalarParam,
}

impl Default for Layered {
    /// Returns glTF's default material, but dielectric: white and rough.
    fn default() -> Self {
        Self {
            base_color: Spectrum::ONE.into(),
            metallic: 0.0.into(),
            roughness: 1.0.into(),
            anisotropy: None,
            ior: 1.5,
            dispersion: 0.0,
            specular: 1.0.into(),
            specular_color: Spectrum::ONE.into(),
            transmission: 0.0.into(),
            diffuse_transmission: 0.0.into(),
            diffuse_transmission_color: Spectrum::ONE.into(),
            subsurface: None,
            thin: false,
            iridescence: None,
            coat: 0.0.into(),
            coat_roughness: 0.0.into(),
            coat_normal: None,
            sheen_color: Spectrum::ZERO.into(),
            sheen_roughness: 0.0.into(),
        }
    }
}
