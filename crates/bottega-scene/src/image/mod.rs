//! Pictures with mip levels: decoding, storage, lookup.

mod color_space;
pub(crate) mod decode;
pub(crate) mod error;
mod ktx2;
mod lookup;
mod pfm;
pub(crate) mod pictures;
pub(crate) mod pyramid;
pub(crate) mod raw;
mod srgb;
mod texels;

use glam::Vec4;

use pyramid::{Encoding, Pyramid, Texel};

use crate::color::LUMINANCE;
use crate::values::VALUE_MAX;

/// A picture with mip levels, decoded to linear values on lookup.
///
/// Row 0 is the upper row, with v = 0 at its upper edge (glTF's convention). It keeps the precision of its file: 8-bit
/// pictures take 1, 3 or 4 bytes per texel, 16-bit ones 8, float ones 12 or 16; the mip levels add a third.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// The source of the image (a file or a name within one), for messages.
    pub name: String,
    texels: Texels,
}

/// The texels, in one of the supported formats.
#[derive(Clone, Debug, PartialEq)]
enum Texels {
    Gray8(Pyramid<u8>),
    Rgb8(Pyramid<[u8; 3]>),
    Rgba8(Pyramid<[u8; 4]>),
    Rgba16(Pyramid<[u16; 4]>),
    Rgb32(Pyramid<[f32; 3]>),
    Rgba32(Pyramid<[f32; 4]>),
}

/// Evaluates an expression on the pyramid, generic over its format.
macro_rules! with_pyramid {
    ($texels:expr, $pyramid:ident => $body:expr) => {
        match $texels {
            Texels::Gray8($pyramid) => $body,
            Texels::Rgb8($pyramid) => $body,
            Texels::Rgba8($pyramid) => $body,
            Texels::Rgba16($pyramid) => $body,
            Texels::Rgb32($pyramid) => $body,
            Texels::Rgba32($pyramid) => $body,
        }
    };
}
use with_pyramid;

/// Makes an image of the same format from a method of the pyramid.
macro_rules! rearranged {
    ($image:expr, $method:ident) => {{
        let texels = match &$image.texels {
            Texels::Gray8(pyramid) => Texels::Gray8(pyramid.$method()),
            Texels::Rgb8(pyramid) => Texels::Rgb8(pyramid.$method()),
            Texels::Rgba8(pyramid) => Texels::Rgba8(pyramid.$method()),
            Texels::Rgba16(pyramid) => Texels::Rgba16(pyramid.$method()),
            Texels::Rgb32(pyramid) => Texels::Rgb32(pyramid.$method()),
            Texels::Rgba32(pyramid) => Texels::Rgba32(pyramid.$method()),
        };
        Self { name: $image.name, texels }
    }};
}

impl Image {
    /// Returns a picture of linear RGB without alpha, row-major from the upper row. Negative values and values that are
    /// not finite become 0; values above [`VALUE_MAX`] become [`VALUE_MAX`].
    ///
    /// # Panics
    ///
    /// Unless `texels` has `width × height` elements, at least one.
    pub fn from_linear_rgb(name: impl Into<String>, width: u32, height: u32, mut texels: Vec<[f32; 3]>) -> Self {
        texels.iter_mut().flatten().for_each(make_radiance);
        Self { name: name.into(), texels: Texels::Rgb32(Pyramid::new(width, height, texels, Encoding::Linear)) }
    }

    /// Returns a picture of three numbers per texel, row-major from the upper row. They are kept as they are, and may
    /// be negative.
    ///
    /// # Panics
    ///
    /// Unless `texels` has `width × height` elements, at least one.
    pub fn from_numbers(name: impl Into<String>, width: u32, height: u32, texels: Vec<[f32; 3]>) -> Self {
        Self { name: name.into(), texels: Texels::Rgb32(Pyramid::new(width, height, texels, Encoding::Linear)) }
    }

    /// Returns a picture of linear RGBA with straight alpha, row-major from the upper row. Values are limited as by
    /// [`from_linear_rgb`](Self::from_linear_rgb).
    ///
    /// # Panics
    ///
    /// Unless `texels` has `width × height` elements, at least one.
    pub fn from_linear_rgba(name: impl Into<String>, width: u32, height: u32, mut texels: Vec<[f32; 4]>) -> Self {
        texels.iter_mut().flatten().for_each(make_radiance);
        Self { name: name.into(), texels: Texels::Rgba32(Pyramid::new(width, height, texels, Encoding::Linear)) }
    }

    /// Returns a picture of 8-bit RGBA, row-major from the upper row. Alpha that is 255 everywhere is dropped.
    ///
    /// - `srgb`: `true`: the colours are encoded as sRGB; `false`: they are linear. Alpha is always linear.
    ///
    /// # Panics
    ///
    /// Unless `texels` has `width × height` elements, at least one.
    pub fn from_rgba8(name: impl Into<String>, width: u32, height: u32, texels: Vec<[u8; 4]>, srgb: bool) -> Self {
        let encoding = if srgb { Encoding::Srgb } else { Encoding::Linear };
        // Drop alpha if the picture is opaque.
        let texels = if texels.iter().all(|texel| texel[3] == 255) {
            let opaque = texels.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
            Texels::Rgb8(Pyramid::new(width, height, opaque, encoding))
        } else {
            Texels::Rgba8(Pyramid::new(width, height, texels, encoding))
        };
        Self { name: name.into(), texels }
    }

    /// Returns a picture of 8-bit RGB, row-major from the upper row; `srgb` as for [`from_rgba8`](Self::from_rgba8).
    ///
    /// # Panics
    ///
    /// Unless `texels` has `width × height` elements, at least one.
    pub fn from_rgb8(name: impl Into<String>, width: u32, height: u32, texels: Vec<[u8; 3]>, srgb: bool) -> Self {
        let encoding = if srgb { Encoding::Srgb } else { Encoding::Linear };
        Self { name: name.into(), texels: Texels::Rgb8(Pyramid::new(width, height, texels, encoding)) }
    }

    /// Returns a picture of 8-bit gray, row-major from the upper row; `srgb` as for [`from_rgba8`](Self::from_rgba8).
    ///
    /// # Panics
    ///
    /// Unless `texels` has `width × height` elements, at least one.
    pub fn from_gray8(name: impl Into<String>, width: u32, height: u32, texels: Vec<u8>, srgb: bool) -> Self {
        let encoding = if srgb { Encoding::Srgb } else { Encoding::Linear };
        Self { name: name.into(), texels: Texels::Gray8(Pyramid::new(width, height, texels, encoding)) }
    }

    /// Returns a picture of 16-bit RGBA, row-major from the upper row; `srgb`: the colours are encoded as sRGB, and are
    /// converted to linear here.
    ///
    /// # Panics
    ///
    /// Unless `texels` has `width × height` elements, at least one.
    pub fn from_rgba16(
        name: impl Into<String>,
        width: u32,
        height: u32,
        mut texels: Vec<[u16; 4]>,
        srgb: bool,
    ) -> Self {
        if srgb {
            let linear = |code: u16| (srgb::decode(f64::from(code) / 65535.0) * 65535.0 + 0.5) as u16;
            let table: Vec<u16> = (0..=u16::MAX).map(linear).collect();
            for code in texels.iter_mut().flat_map(|texel| &mut texel[..3]) {
                *code = table[*code as usize];
            }
        }
        Self { name: name.into(), texels: Texels::Rgba16(Pyramid::new(width, height, texels, Encoding::Linear)) }
    }

    /// Returns the replacement of a picture that cannot be read: one magenta texel.
    pub fn missing(name: impl Into<String>) -> Self {
        Self::from_rgb8(name, 1, 1, vec![[255, 0, 255]], false)
    }

    /// Returns the picture with its luminance (Rec. 709) in all colour channels, without alpha; a gray picture is
    /// returned as it is, with its alpha.
    pub(crate) fn luminance(self) -> Self {
        let (width, height) = self.size();
        let texels = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| self.texel(x, y));
        if texels().all(|texel| texel.x == texel.y && texel.y == texel.z) {
            return self;
        }
        let texels = texels().map(|texel| [texel.truncate().dot(LUMINANCE.as_vec3()); 3]).collect();
        Self::from_linear_rgb(self.name, width, height, texels)
    }

    /// Returns the picture with a border of one transparent black texel.
    pub(crate) fn framed(self) -> Self {
        rearranged!(self, framed)
    }

    /// Returns one period of an octahedral map, twice as wide and high: itself at the upper left and lower right,
    /// rotated by 180° in the other two quadrants.
    pub(crate) fn octahedral_period(self) -> Self {
        rearranged!(self, octahedral_period)
    }

    /// Returns columns and rows of the finest level.
    pub fn size(&self) -> (u32, u32) {
        self.level_size(0)
    }

    /// Returns the number of mip levels, at least 1; the last one has a single texel.
    pub fn level_count(&self) -> usize {
        with_pyramid!(&self.texels, pyramid => pyramid.levels.len())
    }

    /// Returns columns and rows of a mip level; level 0 is the finest. Panics if there is no such level.
    pub fn level_size(&self, level: usize) -> (u32, u32) {
        with_pyramid!(&self.texels, pyramid => (pyramid.levels[level].width, pyramid.levels[level].height))
    }

    /// Returns the linear RGBA of one texel of the finest level. Panics outside of it.
    pub fn texel(&self, x: u32, y: u32) -> Vec4 {
        self.level_texel(0, x, y)
    }

    /// Returns the linear RGBA of one texel. Panics if the level, column or row does not exist.
    pub fn level_texel(&self, level: usize, x: u32, y: u32) -> Vec4 {
        with_pyramid!(&self.texels, pyramid => {
            let table = pyramid.table();
            let level = &pyramid.levels[level];
            assert!(x < level.width && y < level.height, "texel ({x}, {y}) of {} × {}", level.width, level.height);
            level.texels[y as usize * level.width as usize + x as usize].decode(table)
        })
    }

    /// Returns the mean of all texels, linear RGBA: the texel of the last mip level.
    pub fn mean(&self) -> Vec4 {
        self.level_texel(self.level_count() - 1, 0, 0)
    }

    /// Returns true if the image has a single channel, used for all colours.
    pub(crate) fn is_gray(&self) -> bool {
        matches!(self.texels, Texels::Gray8(_))
    }

    /// Returns true if the picture has an alpha channel, so that a texel may have an alpha below 1.
    pub fn has_alpha(&self) -> bool {
        matches!(self.texels, Texels::Rgba8(_) | Texels::Rgba16(_) | Texels::Rgba32(_))
    }

    /// Returns true if the picture has floating-point values, which may exceed 1.
    pub fn is_high_dynamic_range(&self) -> bool {
        matches!(self.texels, Texels::Rgb32(_) | Texels::Rgba32(_))
    }

    /// Returns the memory of all levels, in bytes.
    pub fn memory_bytes(&self) -> usize {
        with_pyramid!(&self.texels, pyramid => pyramid.memory_bytes())
    }
}

fn make_radiance(value: &mut f32) {
    *value = if value.is_finite() && *value > 0.0 { value.min(VALUE_MAX) } else { 0.0 };
}

/// Converts one channel in [0, 1] from sRGB to linear. Values at 8-bit codes have the bits of
/// [`linear_of_srgb_codes`](crate::linear_of_srgb_codes).
pub fn linear_of_srgb(encoded: f64) -> f64 {
    let code = encoded * 255.0;
    let nearest = code.round();
    if (code - nearest).abs() < 1e-9 {
        f64::from(srgb::LINEAR_OF_SRGB[nearest as usize & 255])
    } else {
        srgb::decode(encoded)
    }
}
