//! Materials: surface scattering, emission, opacity, relief and adjacent media.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::color::Spectrum;
use crate::displacement::{Displacement, DisplacementSource};
use crate::emission::EmissionProfile;
use crate::measured::Measured;
use crate::medium::MediumId;
use crate::param::{ColorParam, ScalarParam};
use crate::surface::{Layered, Surface};
use crate::texture::{ImageId, TextureMap};

/// The interpretation of a material's opacity, as in glTF.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Opaque where alpha is at or above the cutoff, absent elsewhere.
    Mask {
        /// The cutoff, in [0, 1] in practice.
        cutoff: f32,
    },
    /// Present with probability alpha.
    Blend,
    /// Absent: rays pass without a hit. Its emission is not reduced, and only next-event estimation finds it (pbrt's
    /// area light on a shape with alpha 0).
    Absent,
}

/// Sides of a surface. The front is the side from which its triangles are counter-clockwise, and the outside of a
/// sphere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sides {
    /// The front only.
    Front,
    /// The back only.
    Back,
    /// Front and back.
    #[default]
    Both,
}

impl Sides {
    /// Returns true if the front (`front`) or the back (`!front`) is among the sides.
    pub fn has(self, front: bool) -> bool {
        match self {
            Self::Front => front,
            Self::Back => !front,
            Self::Both => true,
        }
    }

    /// Returns the sides after front and back were exchanged.
    pub(crate) fn turned(self) -> Self {
        match self {
            Self::Front => Self::Back,
            Self::Back => Self::Front,
            Self::Both => Self::Both,
        }
    }

    /// Returns the number of sides, 1 or 2.
    pub fn count(self) -> u32 {
        if self == Self::Both { 2 } else { 1 }
    }
}

/// The scattering on the back of a surface.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Back {
    /// Equal to the front: two equal sides of an opaque or thin surface, or the two sides of a solid's boundary.
    #[default]
    Same,
    /// Nothing: the back is black.
    Black,
    /// Another surface, which may transmit light even if the front does not.
    Other(Box<Surface>),
}

/// Fine surface detail by a normal map or bump map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Relief {
    /// The normal map or heights.
    pub source: ReliefSource,
    /// The treatment of directions that lie on opposite sides of the perturbed normal and of the surface.
    pub rule: ReliefRule,
}

/// The map that describes a relief: of normals or of heights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReliefSource {
    /// A tangent-space normal map, and the scale of its x and y (glTF).
    Normals(TextureMap, f32),
    /// A bump map: height above the surface along its normal, in scene units.
    Heights(ScalarParam),
}

/// The treatment of directions that lie on opposite sides of the perturbed normal and of the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReliefRule {
    /// A shading normal that faces away from the viewer is bent until it faces it.
    #[default]
    Bent,
    /// The rules of Mitsuba 3.
    Mitsuba {
        /// `true`: a shading normal that faces away from the viewer is mirrored at the unperturbed normal. `false`: the
        /// surface is black from there.
        turns: bool,
        /// `true`: light at grazing angles is reduced, as if the relief cast shadows.
        shadows: bool,
        /// `true`: the back has the same heights above it as the front, mirrored. `false`: dents of the front are bumps
        /// of the back.
        mirrored: bool,
    },
}

impl Relief {
    /// Returns a relief by a tangent-space normal map, whose x and y are multiplied by `scale`.
    pub fn normals(map: TextureMap, scale: f32) -> Self {
        Self { source: ReliefSource::Normals(map, scale), rule: ReliefRule::Bent }
    }

    /// Returns a relief by heights above the surface, in scene units.
    pub fn heights(height: ScalarParam) -> Self {
        Self { source: ReliefSource::Heights(height), rule: ReliefRule::Bent }
    }

    /// Returns the texture of the relief; `None`: heights without a texture.
    pub fn texture(&self) -> Option<&TextureMap> {
        match &self.source {
            ReliefSource::Normals(map, _) => Some(map),
            ReliefSource::Heights(height) => height.texture.as_ref().map(|(map, _)| map),
        }
    }
}

/// A material: scattering, emission, opacity and adjacent media of a surface, with textures that vary them from point
/// to point.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// The name in the file; may be empty.
    pub name: String,
    /// The scattering of the front, and of the back if `back` is [`Back::Same`].
    pub surface: Surface,
    /// The scattering of the back.
    pub back: Back,
    /// Alpha in [0, 1]; multiplied by the alpha of vertex colours.
    pub opacity: ScalarParam,
    /// The interpretation of alpha.
    pub alpha_mode: AlphaMode,
    /// `true`: the camera sees through it from behind, as in glTF viewers that cull backfaces. Light does not.
    pub culls_back: bool,
    /// Emitted radiance, in W·sr⁻¹·m⁻².
    pub emission: ColorParam,
    /// Sides that emit.
    pub emission_sides: Sides,
    /// Directions into which the sides emit.
    #[serde(default)]
    pub emission_profile: EmissionProfile,
    /// Perturbation of the shading normal; `None`: smooth.
    pub relief: Option<Relief>,
    /// Displacement of the points of meshes; `None`, too, once these are displaced. Spheres and curves stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub displacement: Option<Displacement>,
    /// The medium behind the front; `None`: vacuum. Only meaningful if the surface transmits.
    pub interior: Option<MediumId>,
    /// The medium before the front; `None`: vacuum.
    pub exterior: Option<MediumId>,
    /// `true`: light that passes straight through a smooth thin sheet does not count as a bounce, and lights without
    /// extent are visible through it (Mitsuba's `volpath`). `false`: the sheet hides them like any surface.
    pub see_through: bool,
}

impl From<Surface> for Material {
    /// Makes an opaque material that does not emit and is the same on both sides.
    fn from(surface: Surface) -> Self {
        Self { surface, ..Self::default() }
    }
}

impl From<Layered> for Material {
    fn from(layered: Layered) -> Self {
        Surface::from(layered).into()
    }
}

impl Material {
    /// Returns an opaque Lambertian material, the same on both sides, with a constant reflectance in [0, 1].
    pub fn matte(reflectance: Spectrum) -> Self {
        Surface::matte(reflectance).into()
    }

    /// Returns a black surface that emits constant radiance, in W·sr⁻¹·m⁻², from its front.
    pub fn emitter(radiance: Spectrum) -> Self {
        Self { emission: radiance.into(), emission_sides: Sides::Front, ..Self::matte(Spectrum::ZERO) }
    }

    /// Exchanges what lies before and behind the surface, for a shape turned inside out: media and emission, not the
    /// surface itself.
    pub(crate) fn turn_sides(&mut self) {
        std::mem::swap(&mut self.interior, &mut self.exterior);
        self.emission_sides = self.emission_sides.turned();
    }

    /// Returns true if opacity may let rays pass through the surface. If not, [`opacity`](Self::opacity_at) is 1.
    pub fn has_opacity(&self) -> bool {
        self.alpha_mode != AlphaMode::Opaque
    }

    /// Returns true if opacity scales emission.
    pub fn dims_emission(&self) -> bool {
        !matches!(self.alpha_mode, AlphaMode::Opaque | AlphaMode::Absent)
    }

    /// Returns true if the material emits light: its emission is not black, or it is unlit.
    pub fn is_emissive(&self) -> bool {
        matches!(self.surface, Surface::Unlit(_)) || self.emission.factor.max_element() > 0.0
    }

    /// Returns the surface of the front if it is glTF's layered one; `None`: it is another.
    pub fn layered(&self) -> Option<&Layered> {
        if let Surface::Layered(layered) = &self.surface { Some(layered) } else { None }
    }

    /// Returns the surface of the front (`front`) or of the back (`!front`); `None`: that side is black.
    pub fn surface_of(&self, front: bool) -> Option<&Surface> {
        match &self.back {
            Back::Black if !front => None,
            Back::Other(surface) if !front => Some(surface),
            _ => Some(&self.surface),
        }
    }

    /// Returns true if the surface of either side is a blend or a sum, one part of which is chosen at random per hit.
    pub fn is_blended(&self) -> bool {
        let is_blend = |surface: &Surface| matches!(surface, Surface::Blend { .. } | Surface::Sum(_));
        is_blend(&self.surface) || matches!(&self.back, Back::Other(surface) if is_blend(surface))
    }

    /// Returns true if either side is a sum of surfaces, or has one in it.
    pub fn has_sum(&self) -> bool {
        self.surface.has_sum() || matches!(&self.back, Back::Other(surface) if surface.has_sum())
    }

    /// Returns true if light may pass to the other side, other than by opacity.
    pub fn transmits(&self) -> bool {
        self.surface.transmits() || matches!(&self.back, Back::Other(surface) if surface.transmits())
    }

    /// Returns true if light that passes through enters another medium. Of surfaces without named media, only glTF's
    /// solids do; otherwise light stays in its medium, as in Mitsuba and pbrt.
    pub fn parts_media(&self) -> bool {
        let is_solid = matches!(&self.surface, Surface::Layered(layered) if !layered.thin);
        self.transmits() && (is_solid || self.interior.is_some() || self.exterior.is_some())
    }

    /// Returns true if light passes straight through a smooth thin sheet of the material without counting as a bounce;
    /// see [`see_through`](Self::see_through).
    pub fn is_seen_through(&self) -> bool {
        self.see_through && self.has_clear_sheet()
    }

    /// Returns true if either side is, or blends in, a smooth sheet of glass.
    pub fn has_clear_sheet(&self) -> bool {
        self.surface.has_clear_sheet() || matches!(&self.back, Back::Other(surface) if surface.has_clear_sheet())
    }

    /// Returns true if either side is hair, or blends it in.
    pub fn has_hair(&self) -> bool {
        self.surface.has_hair() || matches!(&self.back, Back::Other(surface) if surface.has_hair())
    }

    /// Returns true if light is scattered below either side.
    pub fn has_subsurface(&self) -> bool {
        self.surface.has_subsurface() || matches!(&self.back, Back::Other(surface) if surface.has_subsurface())
    }

    /// Returns true if shading needs the tangents of the texture coordinates.
    pub fn needs_tangents(&self) -> bool {
        let back = if let Back::Other(surface) = &self.back { surface.needs_tangents() } else { false };
        let is_along =
            |displacement: &Displacement| matches!(displacement.source, DisplacementSource::TangentVectors(_));
        let displaced = self.displacement.as_ref().is_some_and(is_along);
        self.relief.is_some() || displaced || self.surface.needs_tangents() || back
    }

    /// Appends the measured materials of both sides.
    pub(crate) fn add_measured<'a>(&'a self, found: &mut Vec<&'a Arc<Measured>>) {
        self.surface.add_measured(found);
        if let Back::Other(surface) = &self.back {
            surface.add_measured(found);
        }
    }

    /// Returns true if the material refers to a picture.
    pub(crate) fn uses_image(&self, image: ImageId) -> bool {
        let profile = match &self.emission_profile {
            EmissionProfile::Picture(picture) => Some(picture.image),
            _ => None,
        };
        profile == Some(image) || self.textures().iter().any(|map| map.image == image)
    }

    /// Returns every texture that the material refers to: those of both sides, of emission, opacity, relief and
    /// displacement.
    pub fn textures(&self) -> Vec<&TextureMap> {
        let mut maps = Vec::new();
        self.surface.add_textures(&mut maps);
        if let Back::Other(surface) = &self.back {
            surface.add_textures(&mut maps);
        }
        maps.extend(&self.emission.texture);
        maps.extend(self.opacity.texture.as_ref().map(|(map, _)| map));
        maps.extend(self.relief.as_ref().and_then(Relief::texture));
        maps.extend(self.displacement.as_ref().and_then(Displacement::texture));
        maps
    }
}
