//! Pictures on surfaces.

use glam::Affine2;

/// Index into [`Scene::images`](crate::Scene::images).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ImageId(pub u32);

/// What lies outside [0, 1) in texture coordinates.
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

/// How a picture is laid on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureMap {
    /// The picture.
    pub image: ImageId,
    /// Which texture coordinates: 0 or 1.
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
