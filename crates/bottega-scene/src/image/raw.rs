//! Texels as they are in memory, for copying, for example to a GPU.

use super::pyramid::{Encoding, Pyramid, Texel};
use super::{Image, Texels, srgb, with_pyramid};

/// The texels of one mip level, row-major from the upper row, in the format in which the picture keeps them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LevelTexels<'a> {
    /// 8-bit gray codes, opaque.
    Gray8(&'a [u8]),
    /// 8-bit RGB codes, opaque.
    Rgb8(&'a [[u8; 3]]),
    /// 8-bit RGBA codes; alpha is linear.
    Rgba8(&'a [[u8; 4]]),
    /// 16-bit linear RGBA; 65535 is 1.
    Rgba16(&'a [[u16; 4]]),
    /// Linear RGB floats, opaque.
    Rgb32(&'a [[f32; 3]]),
    /// Linear RGBA floats.
    Rgba32(&'a [[f32; 4]]),
}

impl Image {
    /// Makes an image of the texels of its finest level, as they are.
    ///
    /// # Panics
    ///
    /// Unless there are `width × height` texels, at least one.
    pub(crate) fn of_level(name: &str, size: (u32, u32), texels: LevelTexels<'_>, encoding: Encoding) -> Self {
        fn pyramid<T: Texel>((width, height): (u32, u32), texels: &[T], encoding: Encoding) -> Pyramid<T> {
            Pyramid::new(width, height, texels.to_vec(), encoding)
        }
        let texels = match texels {
            LevelTexels::Gray8(texels) => Texels::Gray8(pyramid(size, texels, encoding)),
            LevelTexels::Rgb8(texels) => Texels::Rgb8(pyramid(size, texels, encoding)),
            LevelTexels::Rgba8(texels) => Texels::Rgba8(pyramid(size, texels, encoding)),
            LevelTexels::Rgba16(texels) => Texels::Rgba16(pyramid(size, texels, encoding)),
            LevelTexels::Rgb32(texels) => Texels::Rgb32(pyramid(size, texels, encoding)),
            LevelTexels::Rgba32(texels) => Texels::Rgba32(pyramid(size, texels, encoding)),
        };
        Self { name: name.to_owned(), texels }
    }

    /// Returns the texels of a mip level; level 0 is the finest. Panics if there is no such level.
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

    /// Returns true if the colours of an 8-bit picture are sRGB codes, which convert by [`linear_of_srgb_codes`]; false
    /// if its values are linear.
    pub fn is_srgb(&self) -> bool {
        with_pyramid!(&self.texels, pyramid => pyramid.encoding == Encoding::Srgb)
    }
}

/// Returns the table of the linear values of all 8-bit sRGB codes, by code.
pub fn linear_of_srgb_codes() -> &'static [f32; 256] {
    &srgb::LINEAR_OF_SRGB
}
