//! The scattering models of surfaces: a closed set that covers those of the supported file formats.

use serde::{Deserialize, Serialize};

use crate::color::Spectrum;
use crate::hair::{Hair, Strand};
use crate::param::{ColorParam, ScalarParam};
use crate::subsurface::{Substance, Subsurface};
use crate::texture::{Channel, TextureMap};

/// The scattering model of a surface.
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
    /// Disney's material, as in Mitsuba's `principled` and `principledthin`.
    Principled(Box<Principled>),
    /// The layered material of glTF and its extensions.
    Layered(Box<Layered>),
    /// Fibres of hair or fur, as in pbrt's and Mitsuba's `hair`.
    Hair(Box<Hair>),
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

/// The distribution of a rough boundary's microfacet normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// GGX, of Trowbridge and Reitz.
    #[default]
    Ggx,
    /// Beckmann and Spizzichino's.
    Beckmann,
}

/// The masking-shadowing function of microfacets: the probability that a facet is visible from two directions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shadowing {
    /// Height-correlated: a facet visible from one direction is more likely visible from the other (pbrt).
    #[default]
    Correlated,
    /// Separable: visibility from the two directions is independent (Mitsuba).
    Separable,
}

/// The relation of a roughness parameter to the α of the distribution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RoughnessScale {
    /// The roughness is α.
    #[default]
    Alpha,
    /// α is the square root of the roughness (pbrt, with `remaproughness`).
    SquareRoot,
    /// α is the square of the roughness (glTF and Disney).
    Square,
}

/// The microfacets of a boundary. Single scattering: light that hits several facets is lost, as the formats define it.
/// ([`Layered`] compensates for it.)
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Facets {
    /// Distribution of the facet normals.
    pub distribution: Distribution,
    /// Masking-shadowing function of the facets.
    pub shadowing: Shadowing,
    /// Roughness along u and along v; both 0: smooth.
    pub roughness: [ScalarParam; 2],
    /// Relation of roughness to α.
    pub scale: RoughnessScale,
}

/// Metal, by its complex index of refraction.
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

/// The boundary of a clear solid.
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

/// Disney's material (Burley 2012 and 2015).
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

/// The anisotropic highlights of [`Layered`] (KHR_materials_anisotropy).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Anisotropy {
    /// Strength, in [0, 1].
    pub strength: f32,
    /// Direction, counter-clockwise from the tangent, in radians.
    pub rotation: f32,
    /// Red and green: direction in [−1, 1]; blue: factor of the strength.
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
    /// Texture and channel of the thickness.
    pub thickness_texture: Option<(TextureMap, Channel)>,
}

/// A superset of glTF 2.0's metallic-roughness model and its extensions, in the manner of the Dielectric Specular and
/// OpenPBR family. From the outside in: sheen over coat over base; the base is a mix of metal, transmitting dielectric
/// and diffuse dielectric.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Layered {
    /// Reflectance of the diffuse and metal base, tint of the transmission. Vertex colours multiply it.
    pub base_color: ColorParam,
    /// 0: dielectric, 1: metal.
    pub metallic: ScalarParam,
    /// Perceptual roughness: the microfacet α is its square.
    pub roughness: ScalarParam,
    /// Anisotropy of the highlights.
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
    /// A thin film on the base.
    pub iridescence: Option<Iridescence>,
    /// Strength of the clear coat.
    pub coat: ScalarParam,
    /// Perceptual roughness of the clear coat.
    pub coat_roughness: ScalarParam,
    /// Normal map of the clear coat, and its scale. (The material's own relief does not affect the coat.)
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

impl From<f32> for Facets {
    /// Returns GGX facets with the same α along u and v.
    fn from(alpha: f32) -> Self {
        Self { roughness: [alpha.into(), alpha.into()], ..Self::default() }
    }
}

impl Default for Facets {
    /// Returns no facets: a smooth boundary.
    fn default() -> Self {
        Self {
            distribution: Distribution::default(),
            shadowing: Shadowing::default(),
            roughness: [0.0.into(), 0.0.into()],
            scale: RoughnessScale::default(),
        }
    }
}

impl Facets {
    /// Returns no facets: a smooth boundary.
    pub fn smooth() -> Self {
        Self::default()
    }

    /// Returns true if the boundary is smooth everywhere.
    pub fn is_smooth(&self) -> bool {
        self.roughness.iter().all(|roughness| roughness.factor == 0.0)
    }
}

impl Surface {
    /// Returns a Lambertian surface.
    pub fn matte(reflectance: Spectrum) -> Self {
        Self::Diffuse(Diffuse { reflectance: reflectance.into(), roughness: 0.0.into() })
    }

    /// Returns a thin sheet that scatters nothing and transmits a share of the light straight through.
    pub fn clear_sheet(transmittance: ColorParam) -> Self {
        Self::Dielectric(Dielectric {
            eta: 1.0,
            reflectance: Spectrum::ONE.into(),
            transmittance,
            facets: Facets::smooth(),
            thin: true,
        })
    }

    /// Blends two surfaces; `weight` is the share of the second. [`Null`](Self::Null) becomes a clear sheet, because
    /// rays cannot pass without a hit where another surface may be.
    pub fn blend(weight: ScalarParam, surfaces: [Self; 2]) -> Self {
        Self::Blend { weight, surfaces: Box::new(surfaces.map(Self::met)) }
    }

    /// Adds what two surfaces scatter. [`Null`](Self::Null) becomes a clear sheet, as in a blend.
    pub fn sum(surfaces: [Self; 2]) -> Self {
        Self::Sum(Box::new(surfaces.map(Self::met)))
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

    /// Returns true if the surface reflects or refracts specularly, at least in part: smooth metal, glass and coats.
    pub fn has_mirror(&self) -> bool {
        match self {
            Self::Conductor(conductor) => conductor.facets.is_smooth(),
            Self::Dielectric(dielectric) => dielectric.facets.is_smooth(),
            Self::Plastic(plastic) => plastic.facets.is_smooth(),
            Self::Coated(coated) => coated.facets.is_smooth(),
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
            Self::Principled(principled) => principled.anisotropic.factor > 0.0,
            Self::Layered(layered) => layered.anisotropy.is_some() || layered.coat_normal.is_some(),
            Self::Hair(_) => true,
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().any(Self::needs_tangents),
            Self::Null | Self::Unlit(_) | Self::Diffuse(_) | Self::DiffuseTransmission { .. } => false,
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

    /// Returns true if light is scattered below the surface; see [`Subsurface`].
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

    /// Returns all colour and number parameters of the surface, including those with textures.
    pub fn params(&self) -> (Vec<&ColorParam>, Vec<&ScalarParam>) {
        let (mut colors, mut scalars) = (Vec::new(), Vec::new());
        self.add_params(&mut colors, &mut scalars);
        (colors, scalars)
    }

    fn add_params<'a>(&'a self, colors: &mut Vec<&'a ColorParam>, scalars: &mut Vec<&'a ScalarParam>) {
        match self {
            Self::Null => {}
            Self::Unlit(color) => colors.push(color),
            Self::Diffuse(diffuse) => diffuse.add_params(colors, scalars),
            Self::DiffuseTransmission { reflectance, transmittance } => colors.extend([reflectance, transmittance]),
            Self::Conductor(conductor) => conductor.add_params(colors, scalars),
            Self::Dielectric(dielectric) => {
                colors.extend([&dielectric.reflectance, &dielectric.transmittance]);
                scalars.extend(&dielectric.facets.roughness);
            }
            Self::Plastic(plastic) => {
                colors.extend([&plastic.diffuse, &plastic.specular]);
                scalars.extend(&plastic.facets.roughness);
            }
            Self::Coated(coated) => {
                colors.push(&coated.albedo);
                scalars.extend([&coated.thickness, &coated.g]);
                scalars.extend(&coated.facets.roughness);
                match &coated.base {
                    CoatedBase::Diffuse(diffuse) => diffuse.add_params(colors, scalars),
                    CoatedBase::Conductor(conductor) => conductor.add_params(colors, scalars),
                }
            }
            Self::Principled(p) => {
                colors.push(&p.base_color);
                scalars.extend([&p.roughness, &p.anisotropic, &p.metallic, &p.spec_trans, &p.spec_tint, &p.sheen]);
                scalars.extend([&p.sheen_tint, &p.flatness, &p.clearcoat, &p.clearcoat_gloss, &p.diff_trans]);
            }
            Self::Layered(l) => {
                colors.extend([&l.base_color, &l.specular_color, &l.sheen_color, &l.diffuse_transmission_color]);
                scalars.extend([&l.metallic, &l.roughness, &l.specular, &l.transmission, &l.diffuse_transmission]);
                scalars.extend([&l.coat, &l.coat_roughness, &l.sheen_roughness]);
                scalars.extend(l.iridescence.as_ref().map(|film| &film.factor));
                if let Some(subsurface) = &l.subsurface {
                    scalars.push(&subsurface.weight);
                    match &subsurface.substance {
                        Substance::Colored { radius, .. } => colors.push(radius),
                        Substance::Coefficients { absorption, scattering } => colors.extend([absorption, scattering]),
                    }
                }
            }
            Self::Hair(hair) => hair.add_params(colors, scalars),
            Self::Blend { weight, surfaces } => {
                scalars.push(weight);
                surfaces.iter().for_each(|surface| surface.add_params(colors, scalars));
            }
            Self::Sum(surfaces) => surfaces.iter().for_each(|surface| surface.add_params(colors, scalars)),
        }
    }

    /// Returns every index of refraction that is a number rather than a colour, and the other plain numbers of
    /// [`Layered`]: dispersion, the film's thicknesses .
    pub(crate) fn indices_of_refraction(&self) -> Vec<f32> {
        match self {
            Self::Dielectric(dielectric) => vec![dielectric.eta],
            Self::Plastic(plastic) => vec![plastic.eta],
            Self::Coated(coated) => vec![coated.eta],
            Self::Principled(principled) => vec![principled.eta],
            Self::Hair(hair) => vec![hair.eta],
            Self::Layered(layered) => {
                let film = layered.iridescence.as_ref();
                let film = film.into_iter().flat_map(|film| [film.ior, film.thickness[0], film.thickness[1]]);
                let below = layered.subsurface.iter().map(|below| below.inner_eta);
                film.chain(below).chain([layered.ior, layered.dispersion]).collect()
            }
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => {
                surfaces.iter().flat_map(Self::indices_of_refraction).collect()
            }
            _ => Vec::new(),
        }
    }

    /// Returns true unless the scales of hair have an angle beyond [−90, 90] degrees.
    pub(crate) fn has_sound_scales(&self) -> bool {
        match self {
            Self::Hair(hair) => hair.alpha.abs() <= 90.0,
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().all(Self::has_sound_scales),
            _ => true,
        }
    }

    /// Returns true unless scattering below the surface has an asymmetry beyond (−1, 1).
    pub(crate) fn has_sound_subsurface(&self) -> bool {
        match self {
            Self::Layered(layered) => layered.subsurface.as_ref().is_none_or(|below| below.g.abs() < 1.0),
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().all(Self::has_sound_subsurface),
            _ => true,
        }
    }

    /// Appends every texture that the surface refers to.
    pub(crate) fn add_textures<'a>(&'a self, maps: &mut Vec<&'a TextureMap>) {
        let (colors, scalars) = self.params();
        maps.extend(colors.into_iter().filter_map(|color| color.texture.as_ref()));
        maps.extend(scalars.into_iter().filter_map(|scalar| scalar.texture.as_ref().map(|(map, _)| map)));
        self.add_maps(maps);
    }

    /// Appends the textures that are not of a colour or number parameter: normal maps, directions and thicknesses.
    fn add_maps<'a>(&'a self, maps: &mut Vec<&'a TextureMap>) {
        match self {
            Self::Layered(layered) => {
                maps.extend(layered.coat_normal.as_ref().map(|(map, _)| map));
                maps.extend(layered.anisotropy.as_ref().and_then(|anisotropy| anisotropy.texture.as_ref()));
                let film = layered.iridescence.as_ref();
                maps.extend(film.and_then(|film| film.thickness_texture.as_ref()).map(|(map, _)| map));
            }
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => {
                surfaces.iter().for_each(|surface| surface.add_maps(maps));
            }
            _ => {}
        }
    }
}

impl Diffuse {
    fn add_params<'a>(&'a self, colors: &mut Vec<&'a ColorParam>, scalars: &mut Vec<&'a ScalarParam>) {
        colors.push(&self.reflectance);
        scalars.push(&self.roughness);
    }
}

impl Conductor {
    fn add_params<'a>(&'a self, colors: &mut Vec<&'a ColorParam>, scalars: &mut Vec<&'a ScalarParam>) {
        colors.extend([&self.eta, &self.k, &self.reflectance]);
        scalars.extend(&self.facets.roughness);
    }
}
