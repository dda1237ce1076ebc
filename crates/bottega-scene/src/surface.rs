//! The scattering models of surfaces: a closed set that covers those of the supported file formats.

mod facets;
mod gloss;
mod layered;
mod params;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

pub use facets::{Distribution, Facets, RoughnessScale, Shadowing};
pub use gloss::{Phong, Ward, WardVariant};
pub use layered::{Anisotropy, Iridescence, Layered};

use crate::color::Spectrum;
use crate::hair::{Hair, Strand};
use crate::measured::{Measured, Symmetry};
use crate::param::{ColorParam, ScalarParam};

/// The scattering model of a surface: one of a closed set that covers the materials of the supported formats.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Surface {
    /// No scattering; the surface only separates two media (Mitsuba `null`, pbrt `interface`).
    Null,
    /// Emits its colour unchanged, but at most 1, and scatters nothing (KHR_materials_unlit).
    Unlit(ColorParam),
    /// Diffuse reflection, Lambertian or rough.
    Diffuse(Diffuse),
    /// Diffuse reflection and transmission, as of paper or a leaf.
    DiffuseTransmission {
        /// Share of light that is reflected.
        reflectance: ColorParam,
        /// Share of light that is transmitted.
        transmittance: ColorParam,
    },
    /// Metal, by its complex index of refraction.
    Conductor(Conductor),
    /// The boundary of a clear solid, or a thin sheet of it.
    Dielectric(Dielectric),
    /// A diffuse base below a dielectric boundary, as in Mitsuba's `plastic`, `roughplastic` and `pplastic`.
    Plastic(Plastic),
    /// A base below a dielectric boundary with all interreflections, as in pbrt's `coateddiffuse` and
    /// `coatedconductor`.
    Coated(Box<Coated>),
    /// A base below a dielectric boundary whose inner reflections are lost, as in Mitsuba 0.6's `coating` and
    /// `roughcoating`. See [`varnished`](Self::varnished).
    Varnished(Box<Varnished>),
    /// A diffuse surface with Phong's highlights, as in Mitsuba 0.6's `phong`.
    Phong(Phong),
    /// A diffuse surface with Ward's highlights, as in Mitsuba 0.6's `ward`.
    Ward(Ward),
    /// Disney's material, as in Mitsuba's `principled` and `principledthin`.
    Principled(Box<Principled>),
    /// The layered material of glTF and its extensions.
    Layered(Box<Layered>),
    /// Fibres of hair or fur, as in pbrt's and Mitsuba's `hair`.
    Hair(Box<Hair>),
    /// A reflectance that was measured, as in pbrt's and Mitsuba's `measured`.
    #[serde(with = "crate::measured::stored")]
    Measured(Arc<Measured>),
    /// A mix of two surfaces; see [`blend`](Self::blend).
    Blend {
        /// Share of the second surface, in [0, 1].
        weight: ScalarParam,
        /// The two surfaces; neither is [`Null`](Self::Null).
        surfaces: Box<[Surface; 2]>,
    },
    /// The sum of what two surfaces scatter, which may be more than arrives; neither is [`Null`](Self::Null). See
    /// [`sum`](Self::sum).
    Sum(Box<[Surface; 2]>),
}

/// A matte surface: Lambertian, or Oren and Nayar's if it is rough.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Diffuse {
    /// Share of light that is reflected.
    pub reflectance: ColorParam,
    /// Standard deviation of the slope angle of its facets, in radians; 0: Lambertian.
    pub roughness: ScalarParam,
}

/// The surface of a metal, by its complex index of refraction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Conductor {
    /// Real part η of the index of refraction.
    pub eta: ColorParam,
    /// Imaginary part k. Both 0: a perfect mirror.
    pub k: ColorParam,
    /// Factor of the reflection.
    pub reflectance: ColorParam,
    /// Microfacets of the metal.
    pub facets: Facets,
}

/// The boundary of a clear solid, or a thin sheet of it: glass, water or a window pane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dielectric {
    /// Index of refraction behind the front over that before it.
    pub eta: f32,
    /// Factor of the reflection.
    pub reflectance: ColorParam,
    /// Factor of the transmission.
    pub transmittance: ColorParam,
    /// Microfacets of the boundary.
    pub facets: Facets,
    /// `true`: a thin sheet with two parallel boundaries. Light passes straight through, with all interreflections.
    pub thin: bool,
}

impl Dielectric {
    /// Returns true if the dielectric is a smooth thin sheet.
    fn is_clear_sheet(&self) -> bool {
        self.thin && self.facets.is_smooth()
    }
}

/// The treatment of light that a [`Plastic`]'s boundary reflects back to the base.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InnerReflection {
    /// The light comes back white at each reflection.
    #[default]
    Linear,
    /// The light is multiplied by the colour of the base at each reflection.
    Nonlinear,
    /// The light is lost, and the base is seen as through a smooth boundary, however rough the facets (Mitsuba's `pplastic`,
    /// after Baek and others 2018, Simultaneous Acquisition of Polarimetric SVBRDF and Normals).
    Lost,
}

/// A diffuse base below a dielectric boundary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plastic {
    /// Index of refraction of the inside over the outside.
    pub eta: f32,
    /// Reflectance of the diffuse base.
    pub diffuse: ColorParam,
    /// Factor of the reflection of the boundary.
    pub specular: ColorParam,
    /// Treatment of internal reflection.
    pub inner: InnerReflection,
    /// Microfacets of the boundary.
    pub facets: Facets,
}

/// The base below a [`Coated`] surface's layer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(clippy::large_enum_variant, reason = "it lies in a box as it is")]
pub enum CoatedBase {
    /// A diffuse base.
    Diffuse(Diffuse),
    /// A metal base.
    Conductor(Conductor),
}

/// A base, a layer above it that may absorb and scatter, and the layer's dielectric boundary.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Coated {
    /// Index of refraction of the layer over that of the outside.
    pub eta: f32,
    /// Microfacets of the boundary.
    pub facets: Facets,
    /// Thickness of the layer, in mean free paths.
    pub thickness: ScalarParam,
    /// Single-scattering albedo within the layer; black: nothing scatters.
    pub albedo: ColorParam,
    /// Henyey-Greenstein asymmetry g within the layer, in (−1, 1).
    pub g: ScalarParam,
    /// Maximal number of scattering events within the layer.
    pub max_depth: u32,
    /// The base below the layer.
    pub base: CoatedBase,
}

/// A base, a clear layer above it, and the layer's dielectric boundary. Light that the boundary reflects back to the base
/// is lost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Varnished {
    /// Index of refraction of the layer over that of the outside.
    pub eta: f32,
    /// Microfacets of the boundary.
    pub facets: Facets,
    /// Factor of the reflection of the boundary.
    pub specular: ColorParam,
    /// Optical thickness of the layer per channel: absorption coefficient times thickness.
    pub absorption: ColorParam,
    /// The base below the layer: diffuse, metal, plastic, Phong's, Ward's, or Disney's without transmission.
    pub base: Surface,
}

/// The parameters of Disney's material (Burley 2012 and 2015).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Principled {
    /// Colour of the base, in [0, 1].
    pub base_color: ColorParam,
    /// Perceptual roughness: α is its square.
    pub roughness: ScalarParam,
    /// Anisotropy of the main lobes, in [0, 1].
    pub anisotropic: ScalarParam,
    /// 0: dielectric, 1: metal.
    pub metallic: ScalarParam,
    /// Share of the dielectric's light that is transmitted.
    pub spec_trans: ScalarParam,
    /// Index of refraction.
    pub eta: f32,
    /// Tint of the specular reflection by the base colour, in [0, 1].
    pub spec_tint: ScalarParam,
    /// Strength of the sheen.
    pub sheen: ScalarParam,
    /// Tint of the sheen by the base colour, in [0, 1].
    pub sheen_tint: ScalarParam,
    /// Blend from the diffuse lobe, 0, to approximate subsurface scattering, 1.
    pub flatness: ScalarParam,
    /// Strength of the clear coat.
    pub clearcoat: ScalarParam,
    /// Gloss of the clear coat; 1: sharp.
    pub clearcoat_gloss: ScalarParam,
    /// Diffuse transmission of a thin sheet, in [0, 2]: twice the share of diffuse light that is transmitted.
    pub diff_trans: ScalarParam,
    /// `true`: a thin sheet without volume.
    pub thin: bool,
}

impl Default for Surface {
    fn default() -> Self {
        Layered::default().into()
    }
}

impl From<Layered> for Surface {
    fn from(layered: Layered) -> Self {
        Self::Layered(Box::new(layered))
    }
}

impl Surface {
    /// Returns a Lambertian surface of a constant reflectance in [0, 1].
    pub fn matte(reflectance: Spectrum) -> Self {
        Self::Diffuse(Diffuse { reflectance: reflectance.into(), roughness: 0.0.into() })
    }

    /// Returns a thin sheet that scatters nothing and lets a share of the light, in [0, 1], pass straight through.
    pub fn clear_sheet(transmittance: ColorParam) -> Self {
        Self::Dielectric(Dielectric {
            eta: 1.0,
            reflectance: Spectrum::ONE.into(),
            transmittance,
            facets: Facets::smooth(),
            thin: true,
        })
    }

    /// Returns a mix of two surfaces; `weight` is the share of the second, in [0, 1]. A part that is
    /// [`Null`](Self::Null) is replaced by a clear sheet: rays ignore null surfaces, but must hit a blend.
    pub fn blend(weight: ScalarParam, surfaces: [Self; 2]) -> Self {
        Self::Blend { weight, surfaces: Box::new(surfaces.map(Self::met)) }
    }

    /// Returns a surface that scatters what both surfaces scatter together. [`Null`](Self::Null) becomes a clear sheet,
    /// as in a blend.
    pub fn sum(surfaces: [Self; 2]) -> Self {
        Self::Sum(Box::new(surfaces.map(Self::met)))
    }

    /// Returns the surface below a varnish, which `over` makes of a base and a factor of the boundary's reflection. Each
    /// part of a blend or a sum gets its own varnish, which scatters the same in total. `None`: the surface cannot be a
    /// base.
    pub fn varnished(self, over: &impl Fn(Self, f32) -> Varnished) -> Option<Self> {
        self.varnished_by(1.0, over)
    }

    fn varnished_by(self, share: f32, over: &impl Fn(Self, f32) -> Varnished) -> Option<Self> {
        Some(match self {
            Self::Blend { weight, surfaces } => {
                let [first, second] = *surfaces;
                Self::blend(weight, [first.varnished_by(share, over)?, second.varnished_by(share, over)?])
            }
            // The boundary reflects once: half with each part
            Self::Sum(surfaces) => {
                let [first, second] = *surfaces;
                Self::sum([first.varnished_by(0.5 * share, over)?, second.varnished_by(0.5 * share, over)?])
            }
            base if base.is_base() => Self::Varnished(Box::new(over(base, share))),
            _ => return None,
        })
    }

    /// Returns true if the surface may be the base of a [`Varnished`].
    fn is_base(&self) -> bool {
        match self {
            Self::Diffuse(_) | Self::Conductor(_) | Self::Plastic(_) | Self::Phong(_) | Self::Ward(_) => true,
            Self::Principled(principled) => !principled.thin && !self.transmits(),
            _ => false,
        }
    }

    /// Returns true unless a varnish lies on a surface that cannot be its base.
    pub(crate) fn has_sound_varnish(&self) -> bool {
        match self {
            Self::Varnished(varnished) => varnished.base.is_base(),
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().all(Self::has_sound_varnish),
            _ => true,
        }
    }

    /// Returns the surface as one that rays meet.
    fn met(self) -> Self {
        if self == Self::Null { Self::clear_sheet(Spectrum::ONE.into()) } else { self }
    }

    /// Returns true if light may pass to the other side.
    pub fn transmits(&self) -> bool {
        match self {
            Self::Null | Self::Dielectric(_) | Self::DiffuseTransmission { .. } | Self::Hair(_) => true,
            Self::Unlit(_) | Self::Diffuse(_) | Self::Conductor(_) | Self::Plastic(_) | Self::Coated(_) => false,
            Self::Varnished(_) | Self::Phong(_) | Self::Ward(_) | Self::Measured(_) => false,
            Self::Principled(p) => p.spec_trans.factor > 0.0 || (p.thin && p.diff_trans.factor > 0.0),
            Self::Layered(l) => l.transmission.factor > 0.0 || l.diffuse_transmission.factor > 0.0,
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().any(Self::transmits),
        }
    }

    /// Returns true if the surface is a thin sheet: transmitted light does not enter a solid.
    pub fn is_thin(&self) -> bool {
        match self {
            Self::Dielectric(dielectric) => dielectric.thin,
            Self::Principled(principled) => principled.thin,
            Self::Layered(layered) => layered.thin,
            Self::DiffuseTransmission { .. } | Self::Hair(_) => true,
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().all(Self::is_thin),
            _ => false,
        }
    }

    /// Returns true if the surface reflects or refracts specularly, at least in part: smooth metal or glass, or a
    /// smooth boundary above a base. The clear coats of [`Principled`] and [`Layered`] do not count.
    pub fn has_mirror(&self) -> bool {
        match self {
            Self::Conductor(conductor) => conductor.facets.is_smooth(),
            Self::Dielectric(dielectric) => dielectric.facets.is_smooth(),
            Self::Plastic(plastic) => plastic.facets.is_smooth(),
            Self::Coated(coated) => coated.facets.is_smooth(),
            Self::Varnished(varnished) => varnished.facets.is_smooth() || varnished.base.has_mirror(),
            Self::Phong(_) | Self::Ward(_) | Self::Measured(_) => false,
            Self::Principled(principled) => principled.roughness.factor == 0.0,
            Self::Layered(layered) => layered.roughness.factor == 0.0,
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().any(Self::has_mirror),
            Self::Null | Self::Unlit(_) | Self::Diffuse(_) | Self::DiffuseTransmission { .. } | Self::Hair(_) => false,
        }
    }

    /// Returns true if part of a blend or sum is [`Null`](Self::Null).
    pub(crate) fn blends_null(&self) -> bool {
        match self {
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => {
                surfaces.iter().any(|part| *part == Self::Null || part.blends_null())
            }
            _ => false,
        }
    }

    /// Returns true if the surface is a sum of surfaces, or blends one in.
    pub fn has_sum(&self) -> bool {
        match self {
            Self::Sum(_) => true,
            Self::Blend { surfaces, .. } => surfaces.iter().any(Self::has_sum),
            _ => false,
        }
    }

    /// Returns true if the surface is, or blends in, a smooth sheet of glass.
    pub fn has_clear_sheet(&self) -> bool {
        match self {
            Self::Dielectric(dielectric) => dielectric.is_clear_sheet(),
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().any(Self::has_clear_sheet),
            _ => false,
        }
    }

    /// Returns true if shading needs the tangents of the texture coordinates.
    pub fn needs_tangents(&self) -> bool {
        let is_stretched = |facets: &Facets| facets.roughness[0] != facets.roughness[1];
        match self {
            Self::Conductor(conductor) => is_stretched(&conductor.facets),
            Self::Dielectric(dielectric) => is_stretched(&dielectric.facets),
            Self::Plastic(plastic) => is_stretched(&plastic.facets),
            Self::Coated(coated) => {
                let base = match &coated.base {
                    CoatedBase::Conductor(conductor) => is_stretched(&conductor.facets),
                    CoatedBase::Diffuse(_) => false,
                };
                base || is_stretched(&coated.facets)
            }
            Self::Varnished(varnished) => is_stretched(&varnished.facets) || varnished.base.needs_tangents(),
            Self::Ward(ward) => ward.roughness[0] != ward.roughness[1],
            Self::Principled(principled) => principled.anisotropic.factor > 0.0,
            Self::Layered(layered) => layered.anisotropy.is_some() || layered.coat_normal.is_some(),
            Self::Hair(_) => true,
            Self::Measured(measured) => measured.symmetry() != Symmetry::Isotropic,
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().any(Self::needs_tangents),
            Self::Null | Self::Unlit(_) | Self::Diffuse(_) | Self::DiffuseTransmission { .. } | Self::Phong(_) => false,
        }
    }

    /// Returns true if the surface is hair, or blends hair in.
    pub fn has_hair(&self) -> bool {
        match self {
            Self::Hair(_) => true,
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().any(Self::has_hair),
            _ => false,
        }
    }

    /// Appends the measured materials of the surface.
    pub(crate) fn add_measured<'a>(&'a self, found: &mut Vec<&'a Arc<Measured>>) {
        match self {
            Self::Measured(measured) => found.push(measured),
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => {
                surfaces.iter().for_each(|surface| surface.add_measured(found));
            }
            _ => {}
        }
    }

    /// Returns true if light is scattered below the surface; see [`Subsurface`](crate::Subsurface).
    pub fn has_subsurface(&self) -> bool {
        match self {
            Self::Layered(layered) => layered.subsurface.is_some() && !layered.thin,
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().any(Self::has_subsurface),
            _ => false,
        }
    }

    /// Returns true if the fibres of the surface run along v of the texture coordinates; see [`Strand`].
    pub fn has_strands_along_v(&self) -> bool {
        match self {
            Self::Hair(hair) => hair.strand == Strand::AlongV,
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().any(Self::has_strands_along_v),
            _ => false,
        }
    }
}
