//! Textures: pictures mapped onto surfaces.

use glam::{Affine2, Affine3A};
use serde::{Deserialize, Serialize};

use crate::noise::{Noise, Octaves};

/// Index into [`Scene::images`](crate::Scene::images).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct ImageId(pub u32);

/// The treatment of texture coordinates outside of [0, 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wrap {
    /// Repeats the picture.
    #[default]
    Repeat,
    /// Repeats the picture, mirrored at each edge.
    Mirror,
    /// Extends the edge of the picture.
    Clamp,
}

/// The channel of a picture from which a number is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// The red channel.
    R,
    /// The green channel.
    G,
    /// The blue channel.
    B,
    /// The alpha channel.
    A,
}

/// The number of texture coordinate sets that belong to a surface; a [`TextureMap::uv_set`] from this number on means a
/// [`Mapping`].
pub const SURFACE_UV_SETS: u8 = 2;

/// Texture coordinates by world position, independent of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mapping {
    /// The formula from the mapping's own space to texture coordinates.
    pub kind: MappingKind,
    /// Transformation from world space to the space of the formula; may be singular.
    #[serde(with = "crate::numbers")]
    pub mapping_from_world: Affine3A,
}

/// The formula of texture coordinates by position (x, y, z); v runs downwards. The picture of a mapping with v = ½ is a
/// ramp: it makes a value or a color of u.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MappingKind {
    /// u = x, v = 1 − y.
    Planar,
    /// u = θ / π, with θ the angle from +z; v = 1 − φ / 2π, with φ the angle around z, from +x towards +y.
    Spherical,
    /// u = ½ + φ / 2π with φ in (−π, π], from +x towards +y; v = 1 − z.
    Cylindrical,
    /// u = x, v = 1 − y − ⌊z⌋. ⌊u⌋ + ⌊1 − v⌋ is even where ⌊x⌋ + ⌊y⌋ + ⌊z⌋ is, so a 2D checkerboard becomes a 3D one.
    Cells,
    /// u = noise at the position; v = ½.
    Noise(Noise),
    /// u = ½ + ½ sin(y + variation · fBm), as the veins of marble; v = ½.
    Veins {
        /// Octaves of the fBm.
        octaves: Octaves,
        /// Factor of the fBm.
        variation: f32,
    },
    /// u = 1 within a dot of the plane (x, y), else 0; see [`is_within_dot`](crate::is_within_dot). v = ½.
    Dots {
        /// `true`: (x, y, z) is transformed from the first texture coordinates (u, v, 0) of the surface, not from world
        /// space.
        on_surface: bool,
    },
    /// u = |z| of the surface's normal; v = ½.
    Facing,
}

impl MappingKind {
    /// Returns true if the parameters are finite, and octaves at most [`OCTAVES_MAX`](crate::OCTAVES_MAX).
    pub(crate) fn is_sound(&self) -> bool {
        match self {
            Self::Noise(Noise::Fbm(octaves) | Noise::Turbulence(octaves)) => octaves.is_sound(),
            Self::Veins { octaves, variation } => octaves.is_sound() && variation.is_finite(),
            _ => true,
        }
    }
}

/// A picture on a surface: its texture coordinates, and the lookup beyond its edges and between its texels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TextureMap {
    /// The picture that is mapped.
    pub image: ImageId,
    /// Set of texture coordinates: 0 or 1, those of the surface; from [`SURFACE_UV_SETS`] on, those of
    /// [`Scene::mappings`](crate::Scene::mappings).
    pub uv_set: u8,
    /// Transformation of the texture coordinates before lookup (KHR_texture_transform).
    #[serde(with = "crate::numbers")]
    pub picture_from_uv: Affine2,
    /// Wrap mode along u.
    pub wrap_u: Wrap,
    /// Wrap mode along v.
    pub wrap_v: Wrap,
    /// `true`: texels are interpolated. `false`: nearest texel.
    pub smooth: bool,
}

impl TextureMap {
    /// Returns the mapping of a picture by the first set of texture coordinates, repeated and interpolated.
    pub fn new(image: ImageId) -> Self {
        Self {
            image,
            uv_set: 0,
            picture_from_uv: Affine2::IDENTITY,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            smooth: true,
        }
    }
}
