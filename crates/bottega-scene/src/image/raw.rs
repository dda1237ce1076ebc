//! Texels as they lie in memory, for who copies them somewhere else.

use super::pyramid::Encoding;
use super::{Image, Texels, srgb, with_pyramid};

/// The texels of one mip level, row-major from the upper row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LevelTexels<'a> {
    /// Codes of gray, opaque.
    Gray8(&'a [u8]),
    /// Codes of red, green and blue, opaque.
    Rgb8(&'a [[u8; 3]]),
    /// The same with alpha, which is always linear.
    Rgba8(&'a [[u8; 4]]),
    /// Linear, 65535 for 1.
    Rgba16(&'a [[u16; 4]]),
    /// Linear, opaque.
    Rgb32(&'a [[f32; 3]]),
    /// Linear.
    Rgba32(&'a [[f32; 4]]),
}

impl Image {
    /// The texels of a mip level; level 0 is the finest. Panics when there is no such level.
    pub fn level_texels(&self, level: usize) -> LevelTexels<'_> {
        match &self.texels {
            Texels::Gray8(pyramid) => LevelTexels::Gray8(&pyramid.levels[level].texels),
            Texels::Rgb8(pyramid) => LevelTexels::Rgb8(&pyramid.levels[level].texels),
            Texels::Rgba8(pyramid) => LevelTexels::Rgba8(&pyramid.levels[level].texels),
            Texels::Rgba16(pyramid) => LevelTexels::Rgba16(&pyramid.levels[level].texels),
            Texels::Rgb32(pyramid) => LevelTexels::Rgb32(&pyramid.levels[level].texels),
            Texels::Rgba32(pyramid) => LevelTexels::Rgba32(&pyramid.levels[level].texels),
        }
    }

    /// Whether 8-bit codes of colours are to be read by [`linear_of_srgb_codes`].
    pub fn is_srgb(&self) -> bool {
        with_pyramid!(&self.texels, pyramid => pyramid.encoding == Encoding::Srgb)
    }
}

/// Linear value of each 8-bit code of sRGB.
pub fn linear_of_srgb_codes() -> &'static [f32; 256] {
    &srgb::LINEAR_OF_SRGB
}
