//! The numbers of a material: constant, or multiplied by a texture.

use crate::{Channel, Spectrum, TextureMap};

/// A colour: factor × texture.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorParam {
    /// Multiplies the texture, or stands alone.
    pub factor: Spectrum,
    /// RGB.
    pub texture: Option<TextureMap>,
}

/// A number: factor × one channel of a texture.
#[derive(Clone, Debug, PartialEq)]
pub struct ScalarParam {
    /// Multiplies the texture, or stands alone.
    pub factor: f32,
    /// The texture and which of its channels.
    pub texture: Option<(TextureMap, Channel)>,
}

impl Default for ColorParam {
    /// Black.
    fn default() -> Self {
        Spectrum::ZERO.into()
    }
}

impl Default for ScalarParam {
    /// 1.
    fn default() -> Self {
        1.0.into()
    }
}

impl From<Spectrum> for ColorParam {
    fn from(factor: Spectrum) -> Self {
        Self { factor, texture: None }
    }
}

impl From<f32> for ScalarParam {
    fn from(factor: f32) -> Self {
        Self { factor, texture: None }
    }
}
