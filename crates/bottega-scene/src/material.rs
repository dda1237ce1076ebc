//! Materials: how a surface scatters, what it emits, where it is absent, and what it bounds.

use crate::{ColorParam, Layered, MediumId, ScalarParam, Spectrum, Surface, TextureMap};

/// The reading of opacity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Alpha at or above the cutoff is opaque, below it the surface is not there.
    Mask {
        /// The cutoff.
        cutoff: f32,
    },
    /// The surface is there with probability alpha.
    Blend,
    /// The surface is not there: no ray meets it, and none is stopped by it. What it emits goes out whole, and is found by looking for
    /// lights alone (pbrt's area light on a shape whose alpha is 0).
    Absent,
}

/// Sides of a surface. The front is the side from which its triangles run counter-clockwise, and the outside of a
/// sphere.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sides {
    /// The front alone.
    Front,
    /// The back alone.
    Back,
    /// Both.
    #[default]
    Both,
}

impl Sides {
    /// Whether that side is one of them.
    pub fn has(self, front: bool) -> bool {
        match self {
            Self::Front => front,
            Self::Back => !front,
            Self::Both => true,
        }
    }

    /// How many they are.
    pub fn count(self) -> u32 {
        if self == Self::Both { 2 } else { 1 }
    }
}

/// The scattering on the back of a surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Back {
    /// The same as on the front: two equal sides of an opaque or thin surface, two sides of one boundary of a solid.
    #[default]
    Same,
    /// Nothing: it is black.
    Black,
    /// Something else, which may let light through whatever the front does.
    Other(Box<Surface>),
}

/// Unevenness too fine for the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Relief {
    /// What is known of it.
    pub source: ReliefSource,
    /// What becomes of directions that its normal and the surface without it do not see from the same side.
    pub rule: ReliefRule,
}

/// The source of a relief.
#[derive(Clone, Debug, PartialEq)]
pub enum ReliefSource {
    /// A tangent-space normal map, and the factor of its x and y (glTF).
    Normals(TextureMap, f32),
    /// Height above the surface along its normal, in scene units.
    Heights(ScalarParam),
}

/// The rule for directions that the normal of a relief and the surface without it do not see from the same side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReliefRule {
    /// A normal turned away from who looks is bent until it is seen.
    #[default]
    Bent,
    /// Mitsuba 3.
    Mitsuba {
        /// Whether a normal turned away from who looks is tilted to the other side of the surface's own; else the surface
        /// is black from there.
        turns: bool,
        /// Whether light that comes in low is weakened, as if the relief threw shadows.
        shadows: bool,
        /// Whether the back has the same heights above it as the front, as in a mirror, and not its dents as bumps.
        mirrored: bool,
    },
}

impl Relief {
    /// By a normal map, and the factor of its x and y.
    pub fn normals(map: TextureMap, scale: f32) -> Self {
        Self { source: ReliefSource::Normals(map, scale), rule: ReliefRule::Bent }
    }

    /// By heights in scene units.
    pub fn heights(height: ScalarParam) -> Self {
        Self { source: ReliefSource::Heights(height), rule: ReliefRule::Bent }
    }

    /// The texture that tells of it.
    pub fn texture(&self) -> Option<&TextureMap> {
        match &self.source {
            ReliefSource::Normals(map, _) => Some(map),
            ReliefSource::Heights(height) => height.texture.as_ref().map(|(map, _)| map),
        }
    }
}

/// A material.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Material {
    /// The name in the file; may be empty.
    pub name: String,
    /// What scatters on the front, and on the back where `back` says so.
    pub surface: Surface,
    /// What scatters on the back.
    pub back: Back,
    /// Alpha; multiplied with the alpha of vertex colours.
    pub opacity: ScalarParam,
    /// How alpha is read.
    pub alpha_mode: AlphaMode,
    /// Whether the camera sees through it from behind, as viewers of glTF that cull backfaces do. Light does not.
    pub culls_back: bool,
    /// Radiance that the surface emits.
    pub emission: ColorParam,
    /// From where it is emitted.
    pub emission_sides: Sides,
    /// Perturbs the shading normal.
    pub relief: Option<Relief>,
    /// What fills the space behind the front; `None`: vacuum. Only where light may go through.
    pub interior: Option<MediumId>,
    /// What fills the space before the front; `None`: vacuum.
    pub exterior: Option<MediumId>,
    /// Whether light that goes straight through a smooth sheet goes on as if nothing was there: it is no bounce, and lamps
    /// without extent are seen through the sheet (Mitsuba's `volpath`). Else the sheet hides them as any surface does.
    pub see_through: bool,
}

impl From<Surface> for Material {
    /// Opaque, dark, both sides equal.
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
    /// Lambert's matte surface.
    pub fn matte(reflectance: Spectrum) -> Self {
        Surface::matte(reflectance).into()
    }

    /// A black surface that emits the same radiance everywhere, from its front.
    pub fn lamp(radiance: Spectrum) -> Self {
        Self { emission: radiance.into(), emission_sides: Sides::Front, ..Self::matte(Spectrum::ZERO) }
    }

    /// Whether the surface may let rays pass as if it were not there. Where not, [`opacity`](Self::opacity_at) is 1.
    pub fn has_opacity(&self) -> bool {
        self.alpha_mode != AlphaMode::Opaque
    }

    /// Whether less is emitted where less of the surface is there.
    pub fn dims_emission(&self) -> bool {
        !matches!(self.alpha_mode, AlphaMode::Opaque | AlphaMode::Absent)
    }

    /// Whether it shines: its emission is not black, or it is unlit.
    pub fn is_emissive(&self) -> bool {
        matches!(self.surface, Surface::Unlit(_)) || self.emission.factor.max_element() > 0.0
    }

    /// Its surface, if that is the layered one of glTF.
    pub fn layered(&self) -> Option<&Layered> {
        if let Surface::Layered(layered) = &self.surface { Some(layered) } else { None }
    }

    /// What scatters on that side; `None`: it is black.
    pub fn surface_of(&self, front: bool) -> Option<&Surface> {
        match &self.back {
            Back::Black if !front => None,
            Back::Other(surface) if !front => Some(surface),
            _ => Some(&self.surface),
        }
    }

    /// Whether chance decides at each point which of several surfaces is there.
    pub fn is_blended(&self) -> bool {
        let is_blend = |surface: &Surface| matches!(surface, Surface::Blend { .. });
        is_blend(&self.surface) || matches!(&self.back, Back::Other(surface) if is_blend(surface))
    }

    /// Whether light may go through to the other side, other than by opacity.
    pub fn transmits(&self) -> bool {
        self.surface.transmits() || matches!(&self.back, Back::Other(surface) if surface.transmits())
    }

    /// Whether light that goes through it comes into another medium. Of surfaces for which no medium is named, only the solids
    /// of glTF do that; elsewhere light stays in what it is in, as in Mitsuba and pbrt.
    pub fn parts_media(&self) -> bool {
        let is_solid = matches!(&self.surface, Surface::Layered(layered) if !layered.thin);
        self.transmits() && (is_solid || self.interior.is_some() || self.exterior.is_some())
    }

    /// Whether some of its light goes straight through, see [`see_through`](Self::see_through).
    pub fn is_seen_through(&self) -> bool {
        self.see_through && self.has_clear_sheet()
    }

    /// Whether it is a smooth sheet of glass, or partly one, on either side.
    pub fn has_clear_sheet(&self) -> bool {
        self.surface.has_clear_sheet() || matches!(&self.back, Back::Other(surface) if surface.has_clear_sheet())
    }

    /// Whether it depends on the directions of the texture coordinates on the surface.
    pub fn needs_tangents(&self) -> bool {
        let back = if let Back::Other(surface) = &self.back { surface.needs_tangents() } else { false };
        self.relief.is_some() || self.surface.needs_tangents() || back
    }

    /// Every texture that the material refers to.
    pub fn textures(&self) -> Vec<&TextureMap> {
        let mut maps = Vec::new();
        self.surface.add_textures(&mut maps);
        if let Back::Other(surface) = &self.back {
            surface.add_textures(&mut maps);
        }
        maps.extend(&self.emission.texture);
        maps.extend(self.opacity.texture.as_ref().map(|(map, _)| map));
        maps.extend(self.relief.as_ref().and_then(Relief::texture));
        maps
    }
}
