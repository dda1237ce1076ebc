//! Picture files to texels: PNG, JPEG, Radiance HDR, OpenEXR.
//!
//! The header alone decides how much memory a picture will take, so that whoever asks for it can refuse before a few
//! bytes of file unfold to gigabytes.

use std::io::Cursor;

use bytemuck::Pod;
use image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use super::{Encoding, Image};

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PictureFault {
    /// It is larger than allowed.
    TooLarge {
        /// How large, and what the limit is.
        problem: String,
    },
    /// The bytes are no picture in a known format.
    Unreadable {
        /// What is wrong.
        problem: String,
    },
}

/// What a picture says of itself before it is decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    format: Format,
    width: u32,
    height: u32,
    texel_bytes: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Png,
    Jpeg,
    Hdr,
    Exr,
}

impl Format {
    fn of(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [0x89, b'P', b'N', b'G', ..] => Some(Self::Png),
            [0xff, 0xd8, 0xff, ..] => Some(Self::Jpeg),
            [b'#', b'?', ..] => Some(Self::Hdr),
            [0x76, 0x2f, 0x31, 0x01, ..] => Some(Self::Exr),
            _ => None,
        }
    }

    fn library_format(self) -> Option<ImageFormat> {
        match self {
            Self::Png => Some(ImageFormat::Png),
            Self::Jpeg => Some(ImageFormat::Jpeg),
            Self::Hdr => Some(ImageFormat::Hdr),
            Self::Exr => None,
        }
    }
}

/// What a file that we cannot read seems to be.
fn describe(bytes: &[u8]) -> &'static str {
    match bytes {
        [] => "it is empty",
        [0xab, b'K', b'T', b'X', ..] => "it is a KTX picture; use PNG or JPEG",
        [b'R', b'I', b'F', b'F', ..] => "it is a WebP picture; use PNG or JPEG",
        [b'G', b'I', b'F', ..] => "it is a GIF picture; use PNG or JPEG",
        [b'B', b'M', ..] => "it is a BMP picture; use PNG or JPEG",
        [b'D', b'D', b'S', ..] => "it is a DDS picture; use PNG or JPEG",
        _ => "it is no picture in a format that can be read (PNG, JPEG, HDR, EXR)",
    }
}

impl Header {
    /// Reads the header of a file, whose bytes these are. More than `pixels_max` pixels are refused.
    pub(crate) fn read(bytes: &[u8], pixels_max: u64) -> Result<Self, PictureFault> {
        let unreadable = |problem: String| PictureFault::Unreadable { problem };
        let format = Format::of(bytes).ok_or_else(|| unreadable(describe(bytes).into()))?;
        let (width, height, texel_bytes) = match format.library_format() {
            None => exr_header(bytes).map_err(unreadable)?,
            Some(library_format) => {
                let decoder = decoder(bytes, library_format).map_err(|error| unreadable(explain(&error)))?;
                let (width, height) = decoder.dimensions();
                (width, height, usize::from(decoder.color_type().bytes_per_pixel()))
            }
        };
        let pixels = u64::from(width) * u64::from(height);
        if pixels == 0 {
            return Err(unreadable(format!("it has {width} × {height} pixels")));
        }
        if pixels > pixels_max {
            let problem = format!("the picture has {width} × {height} pixels, more than the limit of {pixels_max}");
            return Err(PictureFault::TooLarge { problem });
        }
        let header = Self { format, width, height, texel_bytes };
        header.check_plausible(bytes.len()).map_err(unreadable)?;
        Ok(header)
    }

    /// A file cannot hold more than its compression can unfold: 1032 : 1 for the deflate of PNG, 1 byte for 32 pixels of one
    /// channel for the runs of HDR. A picture that announces more was cut off, or lies.
    fn check_plausible(&self, file_bytes: usize) -> Result<(), String> {
        let pixels = self.width as usize * self.height as usize;
        let needed = match self.format {
            // At 1 bit a pixel.
            Format::Png => pixels / 8 / 1032,
            Format::Hdr => pixels / 32,
            Format::Jpeg | Format::Exr => 0,
        };
        if file_bytes < needed {
            let (width, height) = (self.width, self.height);
            return Err(format!("it announces {width} × {height} pixels, but has only {file_bytes} bytes"));
        }
        Ok(())
    }

    /// Bytes that the picture takes in memory, its mip levels included.
    pub(crate) fn memory_bytes(&self) -> usize {
        (self.width as usize * self.height as usize).saturating_mul(self.texel_bytes.max(1)).saturating_mul(4) / 3
    }
}

/// A decoded picture that does not know yet whether its codes are sRGB.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Decoded {
    width: u32,
    height: u32,
    texels: DecodedTexels,
}

#[derive(Clone, Debug, PartialEq)]
enum DecodedTexels {
    Gray8(Vec<u8>),
    Rgb8(Vec<[u8; 3]>),
    Rgba8(Vec<[u8; 4]>),
    Rgba16(Vec<[u16; 4]>),
    Rgb32(Vec<[f32; 3]>),
    Rgba32(Vec<[f32; 4]>),
}

impl Decoded {
    /// Decodes the file whose header was read. An error says what is wrong with it.
    pub(crate) fn read(bytes: &[u8], header: Header) -> Result<Self, String> {
        let texels = match header.format.library_format() {
            None => exr_texels(bytes, header)?,
            Some(format) => library_texels(bytes, format, header)?,
        };
        Ok(Self { width: header.width, height: header.height, texels })
    }

    /// Makes an image of it. Pictures of high dynamic range are linear whatever `encoding` says.
    pub(crate) fn into_image(self, name: &str, encoding: Encoding) -> Image {
        let (width, height, srgb) = (self.width, self.height, encoding == Encoding::Srgb);
        match self.texels {
            DecodedTexels::Gray8(texels) => Image::from_gray8(name, width, height, texels, srgb),
            DecodedTexels::Rgb8(texels) => Image::from_rgb8(name, width, height, texels, srgb),
            DecodedTexels::Rgba8(texels) => Image::from_rgba8(name, width, height, texels, srgb),
            DecodedTexels::Rgba16(texels) => Image::from_rgba16(name, width, height, texels, srgb),
            DecodedTexels::Rgb32(texels) => Image::from_linear_rgb(name, width, height, texels),
            DecodedTexels::Rgba32(texels) => Image::from_linear_rgba(name, width, height, texels),
        }
    }

    /// Width, height and alpha, 255 where there is none.
    pub(crate) fn into_alpha8(self) -> (u32, u32, Vec<u8>) {
        let count = self.width as usize * self.height as usize;
        let alpha = match self.texels {
            DecodedTexels::Rgba8(texels) => texels.into_iter().map(|texel| texel[3]).collect(),
            DecodedTexels::Rgba16(texels) => texels.into_iter().map(|texel| (texel[3] >> 8) as u8).collect(),
            DecodedTexels::Rgba32(texels) => texels.into_iter().map(|texel| (texel[3] * 255.0 + 0.5) as u8).collect(),
            _ => vec![255; count],
        };
        (self.width, self.height, alpha)
    }
}

fn decoder(bytes: &[u8], format: ImageFormat) -> Result<impl ImageDecoder + '_, ImageError> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    // The size of the picture itself is limited by our caller, who knows why; this is for what decoders need besides.
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(1 << 40);
    reader.limits(limits);
    reader.into_decoder()
}

fn explain(error: &ImageError) -> String {
    format!("it is damaged or of an unknown kind ({error})")
}

fn library_texels(bytes: &[u8], format: ImageFormat, header: Header) -> Result<DecodedTexels, String> {
    let decoder = decoder(bytes, format).map_err(|error| explain(&error))?;
    let color_type = decoder.color_type();
    if decoder.dimensions() != (header.width, header.height) {
        return Err("it changed while it was read".into());
    }
    let count = header.width as usize * header.height as usize;
    Ok(match color_type {
        ColorType::L8 => DecodedTexels::Gray8(read(decoder, count)?),
        ColorType::Rgb8 => DecodedTexels::Rgb8(read(decoder, count)?),
        ColorType::Rgba8 => DecodedTexels::Rgba8(read(decoder, count)?),
        ColorType::La8 => {
            let texels: Vec<[u8; 2]> = read(decoder, count)?;
            DecodedTexels::Rgba8(texels.into_iter().map(|[gray, alpha]| [gray, gray, gray, alpha]).collect())
        }
        ColorType::L16 => {
            let texels: Vec<u16> = read(decoder, count)?;
            DecodedTexels::Rgba16(texels.into_iter().map(|gray| [gray, gray, gray, u16::MAX]).collect())
        }
        ColorType::La16 => {
            let texels: Vec<[u16; 2]> = read(decoder, count)?;
            DecodedTexels::Rgba16(texels.into_iter().map(|[gray, alpha]| [gray, gray, gray, alpha]).collect())
        }
        ColorType::Rgb16 => {
            let texels: Vec<[u16; 3]> = read(decoder, count)?;
            DecodedTexels::Rgba16(texels.into_iter().map(|[r, g, b]| [r, g, b, u16::MAX]).collect())
        }
        ColorType::Rgba16 => DecodedTexels::Rgba16(read(decoder, count)?),
        ColorType::Rgb32F => DecodedTexels::Rgb32(read(decoder, count)?),
        ColorType::Rgba32F => DecodedTexels::Rgba32(read(decoder, count)?),
        other => return Err(format!("its texels are of the unknown kind {other:?}")),
    })
}

fn read<T: Pod>(decoder: impl ImageDecoder, count: usize) -> Result<Vec<T>, String> {
    let mut texels = zeroed(count)?;
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut texels);
    if decoder.total_bytes() != bytes.len() as u64 {
        return Err("its size contradicts its kind".into());
    }
    decoder.read_image(bytes).map_err(|error| explain(&error))?;
    Ok(texels)
}

fn zeroed<T: Pod>(count: usize) -> Result<Vec<T>, String> {
    let mut texels = Vec::new();
    texels.try_reserve_exact(count).map_err(|_| format!("there is no memory for {count} pixels"))?;
    texels.resize(count, T::zeroed());
    Ok(texels)
}

/// Width, height and bytes of a texel of the first layer.
fn exr_header(bytes: &[u8]) -> Result<(u32, u32, usize), String> {
    let metadata = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false);
    let metadata = metadata.map_err(|error| explain_exr(&error))?;
    let header = metadata.headers.first().ok_or("it has no layer")?;
    let size = |length: usize| u32::try_from(length).map_err(|_| "it is too large".to_owned());
    let texel_bytes = if has_channel(header, "A") { 16 } else { 12 };
    Ok((size(header.layer_size.0)?, size(header.layer_size.1)?, texel_bytes))
}

fn has_channel(header: &exr::meta::header::Header, name: &str) -> bool {
    header.channels.list.iter().any(|channel| channel.name.eq(name))
}

fn explain_exr(error: &exr::error::Error) -> String {
    format!("it is damaged or of an unknown kind ({error})")
}

/// The first layer that has R, G, B and perhaps A, or else Y alone.
fn exr_texels(bytes: &[u8], header: Header) -> Result<DecodedTexels, String> {
    let metadata = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false);
    let metadata = metadata.map_err(|error| explain_exr(&error))?;
    let layer = metadata.headers.first().ok_or("it has no layer")?;
    if !has_channel(layer, "R") && has_channel(layer, "Y") {
        let gray = exr_gray(bytes, header)?;
        Ok(DecodedTexels::Rgb32(gray.into_iter().map(|y| [y; 3]).collect()))
    } else if has_channel(layer, "A") {
        exr_color(bytes, header, |rgba| rgba).map(DecodedTexels::Rgba32)
    } else {
        exr_color(bytes, header, |[r, g, b, _]| [r, g, b]).map(DecodedTexels::Rgb32)
    }
}

fn exr_color<T: Pod>(bytes: &[u8], header: Header, texel: fn([f32; 4]) -> T) -> Result<Vec<T>, String> {
    use exr::prelude::{ReadChannels, ReadLayers};
    let (width, height) = (header.width as usize, header.height as usize);
    let set = move |texels: &mut Vec<T>, at: exr::math::Vec2<usize>, (r, g, b, a): (f32, f32, f32, f32)| {
        if let Some(to) = texels.get_mut(at.1 * width + at.0) {
            *to = texel([r, g, b, a]);
        }
    };
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(move |_, _| zeroed(width * height).unwrap_or_default(), set)
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| explain_exr(&error))?;
    whole(image.layer_data.channel_data.pixels, header)
}

fn exr_gray(bytes: &[u8], header: Header) -> Result<Vec<f32>, String> {
    use exr::prelude::{ReadChannels, ReadLayers, ReadSpecificChannel};
    let (width, height) = (header.width as usize, header.height as usize);
    let set = move |texels: &mut Vec<f32>, at: exr::math::Vec2<usize>, (y,): (f32,)| {
        if let Some(to) = texels.get_mut(at.1 * width + at.0) {
            *to = y;
        }
    };
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required("Y")
        .collect_pixels(move |_, _| zeroed(width * height).unwrap_or_default(), set)
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| explain_exr(&error))?;
    whole(image.layer_data.channel_data.pixels, header)
}

fn whole<T>(texels: Vec<T>, header: Header) -> Result<Vec<T>, String> {
    let count = header.width as usize * header.height as usize;
    if texels.len() == count { Ok(texels) } else { Err(format!("there is no memory for {count} pixels")) }
}
