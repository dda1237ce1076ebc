//! Material parameters: a constant, optionally multiplied by a texture.

use serde::{Deserialize, Serialize};

use crate::color::Spectrum;
use crate::texture::{Channel, TextureMap};

/// A colour of a material: a factor, multiplied by a texture if there is one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ColorParam {
    /// Factor of the texture; the colour itself without a texture.
    #[serde(with = "crate::numbers")]
    pub factor: Spectrum,
    /// The texture, of which RGB is used; `None`: the colour is the factor.
    pub texture: Option<TextureMap>,
}

/// A number of a material: a factor, multiplied by one channel of a texture if there is one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScalarParam {
    /// Factor of the texture; the number itself without a texture.
    pub factor: f32,
    /// The texture, and the channel that is used; `None`: the number is the factor.
    pub texture: Option<(TextureMap, Channel)>,
}

impl Default for ColorParam {
    /// Returns black, without a texture.
    fn default() -> Self {
        Spectrum::ZERO.into()
    }
}

impl Default for ScalarParam {
    /// Returns 1, without a texture.
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
