//! Pictures on surfaces.

use glam::{Affine2, Affine3A};

/// Index into [`Scene::images`](crate::Scene::images).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ImageId(pub u32);

/// The values outside [0, 1) in texture coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Wrap {
    /// The picture again.
    #[default]
    Repeat,
    /// The picture mirrored.
    Mirror,
    /// Its edge.
    Clamp,
}

/// One channel of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channel {
    /// Red.
    R,
    /// Green.
    G,
    /// Blue.
    B,
    /// Alpha.
    A,
}

/// How many sets of texture coordinates a surface has itself.
pub const SURFACE_UV_SETS: u8 = 2;

/// Texture coordinates that places of the world have, whatever surface is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapping {
    /// How they lie in the mapping's own space.
    pub kind: MappingKind,
    /// From world space to that space; may be singular.
    pub mapping_from_world: Affine3A,
}

/// The kind of texture coordinates in space; v runs downwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MappingKind {
    /// u = x, v = 1 − y.
    Planar,
    /// u = θ / π, the angle from +z; v = 1 − φ / 2π, the one around it, from +x towards +y.
    Spherical,
    /// u = ½ + φ / 2π with φ in (−π, π], from +x towards +y; v = 1 − z.
    Cylindrical,
    /// u = x, v = 1 − y − ⌊z⌋: ⌊u⌋ + ⌊1 − v⌋ is even where ⌊x⌋ + ⌊y⌋ + ⌊z⌋ is, so that a checkerboard of the plane is one of space.
    Cells,
}

/// The mapping of a picture onto a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureMap {
    /// The picture.
    pub image: ImageId,
    /// Which texture coordinates: 0 or 1, those of the surface; from [`SURFACE_UV_SETS`] on, those of
    /// [`Scene::mappings`](crate::Scene::mappings).
    pub uv_set: u8,
    /// Applied to the texture coordinates first (KHR_texture_transform).
    pub picture_from_uv: Affine2,
    /// Along u.
    pub wrap_u: Wrap,
    /// Along v.
    pub wrap_v: Wrap,
    /// Whether texels are interpolated (else the nearest one is taken).
    pub smooth: bool,
}

impl TextureMap {
    /// The picture as it is: first set of texture coordinates, repeated, interpolated.
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
