//! Decoding of picture files to texels: PNG, JPEG, TGA, BMP, TIFF, WebP, PNM, PFM, Radiance HDR, OpenEXR, KTX2.
//!
//! The header alone gives the memory of a picture, so the caller can reject a file before a few bytes unpack to
//! gigabytes.

use std::io::Cursor;

use bottega_image::{
    ImageError as FloatError, Packing, ReadLimits, WhitePoint, WholeHeader, check_announced, is_float_picture,
    read_whole,
};
use bytemuck::Pod;
use image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use super::error::PictureError;
use super::pyramid::Encoding;
use super::texels::{DecodedTexels, zeroed};
use super::{Image, color_space, ktx2, pfm};

/// The header of a picture: its size and format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PictureHeader {
    format: Format,
    /// Width, in texels.
    pub(super) width: u32,
    /// Height, in texels.
    pub(super) height: u32,
    texel_bytes: usize,
    /// Adaptation of the file's white point to ours.
    white_point: WhitePoint,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Library(ImageFormat),
    /// OpenEXR or Radiance HDR.
    Float,
    Pfm,
    Ktx2,
}

impl Format {
    fn of(bytes: &[u8]) -> Option<Self> {
        Some(Self::Library(match bytes {
            [0x89, b'P', b'N', b'G', ..] => ImageFormat::Png,
            [0xff, 0xd8, 0xff, ..] => ImageFormat::Jpeg,
            bytes if is_float_picture(bytes) => return Some(Self::Float),
            [b'P', b'F' | b'f', b'\n' | b'\r' | b' ', ..] => return Some(Self::Pfm),
            [b'P', b'1'..=b'7', b'\n' | b'\r' | b' ' | b'\t', ..] => ImageFormat::Pnm,
            [b'B', b'M', ..] => ImageFormat::Bmp,
            [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..] => ImageFormat::Tiff,
            [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => ImageFormat::WebP,
            _ if bytes.starts_with(ktx2::MAGIC) => return Some(Self::Ktx2),
            bytes if looks_like_tga(bytes) => ImageFormat::Tga,
            _ => return None,
        }))
    }
}

/// Recognizes TGA, which has no magic number, by the few valid headers: a known pixel type, with or without a palette.
fn looks_like_tga(bytes: &[u8]) -> bool {
    let Some(header) = bytes.first_chunk::<18>() else { return false };
    let [_, palette, kind, .., depth, _] = *header;
    let is_known = match palette {
        0 => matches!(kind, 2 | 3 | 10 | 11),
        1 => matches!(kind, 1 | 2 | 9 | 10),
        _ => false,
    };
    is_known && matches!(depth, 8 | 15 | 16 | 24 | 32)
}

/// Describes a file in an unsupported format.
fn describe(bytes: &[u8]) -> &'static str {
    match bytes {
        [] => "it is empty",
        [0xab, b'K', b'T', b'X', ..] => "it is a KTX picture of version 1; use KTX2, PNG or JPEG",
        [b'G', b'I', b'F', ..] => "it is a GIF picture; use PNG or JPEG",
        [b'D', b'D', b'S', ..] => "it is a DDS picture; use PNG or JPEG",
        _ => {
            "it is not a picture in a format that can be read (PNG, JPEG, TGA, BMP, TIFF, WebP, PNM, PFM, HDR, EXR, KTX2)"
        }
    }
}

impl PictureHeader {
    /// Reads the header of a file, of which `bytes` are the whole. Rejects more than `pixels_max` pixels.
    pub(crate) fn read(bytes: &[u8], pixels_max: u64) -> Result<Self, PictureError> {
        let format = Format::of(bytes).ok_or_else(|| PictureError::UnknownFormat { found: describe(bytes) })?;
        let (width, height, texel_bytes) = match format {
            Format::Float => {
                let header = WholeHeader::read("", bytes, ReadLimits { max_pixels: pixels_max });
                let WholeHeader { width, height, has_alpha } = header.map_err(|error| float_error(&error))?;
                (width, height, if has_alpha { 16 } else { 12 })
            }
            Format::Ktx2 => ktx2::header(bytes)?,
            Format::Pfm => pfm::header(bytes)?.size(),
            Format::Library(library_format) => {
                let decoder = decoder(bytes, library_format).map_err(|error| damaged(&error))?;
                let (width, height) = decoder.dimensions();
                (width, height, kept_bytes(decoder.color_type()))
            }
        };
        let pixels = u64::from(width) * u64::from(height);
        if pixels == 0 {
            return Err(PictureError::NoPixels { width, height });
        }
        if pixels > pixels_max {
            let (width, height) = (u64::from(width), u64::from(height));
            return Err(PictureError::TooManyPixels { width, height, max: pixels_max });
        }
        let (pixel_bits, packing) = stored(format, bytes, texel_bytes);
        check_announced((u64::from(width), u64::from(height)), pixel_bits, packing, bytes.len() as u64)
            .map_err(PictureError::TooShort)?;
        Ok(Self { format, width, height, texel_bytes, white_point: WhitePoint::default() })
    }

    /// Returns the header with another white point.
    pub(crate) fn with_white_point(self, white_point: WhitePoint) -> Self {
        Self { white_point, ..self }
    }

    /// Returns columns and rows.
    pub(crate) fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Returns the memory of the decoded picture with its mip levels, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        (self.width as usize * self.height as usize).saturating_mul(self.texel_bytes.max(1)).saturating_mul(4) / 3
    }
}

/// Converts an error of a float picture to one about "it".
fn float_error(error: &FloatError) -> PictureError {
    match error {
        FloatError::TooLarge { width, height, max_pixels, .. } => {
            PictureError::TooManyPixels { width: *width, height: *height, max: *max_pixels }
        }
        FloatError::Malformed { detail, .. } if detail.starts_with("it announces") => {
            PictureError::TooShort(detail.clone())
        }
        FloatError::Malformed { detail, .. } => PictureError::Damaged(detail.clone()),
        FloatError::Unsupported { format, detail, .. } => {
            PictureError::UnsupportedFeature { format, detail: detail.clone() }
        }
        FloatError::NoColor { found, .. } => PictureError::NoColor { found: found.clone() },
        other => PictureError::Float(other.to_string()),
    }
}

/// Returns a lower bound of the bits per stored pixel, and the greatest compression ratio of the format.
fn stored(format: Format, bytes: &[u8], texel_bytes: usize) -> (u64, Packing) {
    let byte = |at: usize| bytes.get(at).copied().unwrap_or(0);
    let texel_bits = 8 * texel_bytes as u64;
    match format {
        // These are checked when their header is read.
        Format::Float | Format::Pfm => (0, Packing::None),
        Format::Library(ImageFormat::Png) => (1, Packing::DEFLATE),
        Format::Library(ImageFormat::Jpeg) => (8, Packing::JPEG),
        Format::Library(ImageFormat::Tiff) => (1, Packing::LZW),
        // A bitmap has one bit per pixel.
        Format::Library(ImageFormat::Pnm) => (1, Packing::None),
        // Types 9 to 11 are run-length encoded; palette indices have one byte.
        Format::Library(ImageFormat::Tga) if byte(2) >= 9 => (8, Packing::Ratio(128)),
        Format::Library(ImageFormat::Tga) => (u64::from(byte(16)), Packing::None),
        // Headers of 40 bytes or more give the compression and the bits per pixel.
        Format::Library(ImageFormat::Bmp) if byte(14) >= 40 && byte(30) == 0 => (u64::from(byte(28)), Packing::None),
        // A uniform picture may compress to almost nothing.
        _ => (texel_bits, Packing::Unbounded),
    }
}

/// Returns the bytes per texel in memory: gray with alpha becomes RGBA, and so do all 16-bit formats.
fn kept_bytes(color_type: ColorType) -> usize {
    match color_type {
        ColorType::La8 => 4,
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 => 8,
        other => usize::from(other.bytes_per_pixel()),
    }
}

/// A decoded picture, before its encoding is chosen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct DecodedImage {
    width: u32,
    height: u32,
    texels: DecodedTexels,
    notes: Vec<String>,
}

impl DecodedImage {
    /// Decodes the file of a header.
    pub(crate) fn read(bytes: &[u8], header: PictureHeader) -> Result<Self, PictureError> {
        let mut notes = Vec::new();
        let mut texels = match header.format {
            Format::Float => float_texels(bytes, header, &mut notes)?,
            Format::Ktx2 => DecodedTexels::Rgba8(ktx2::texels(bytes)?),
            Format::Pfm => pfm::texels(bytes)?,
            Format::Library(format) => library_texels(bytes, format, header, &mut notes)?,
        };
        notes.extend(texels.mend());
        Ok(Self { width: header.width, height: header.height, texels, notes })
    }

    /// Takes the notes about choices, changes and omissions of decoding, as clauses about "it".
    pub(crate) fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }

    /// Converts the picture to an image. Float pictures are linear, whatever `encoding` is.
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

    /// Returns true for an 8-bit picture with one channel.
    pub(crate) fn has_one_channel(&self) -> bool {
        matches!(self.texels, DecodedTexels::Gray8(_))
    }

    /// Returns width, height and alpha; 255 if the picture has none.
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

fn float_texels(bytes: &[u8], header: PictureHeader, notes: &mut Vec<String>) -> Result<DecodedTexels, PictureError> {
    let limits = ReadLimits { max_pixels: u64::from(header.width) * u64::from(header.height) };
    let whole = read_whole("", bytes, limits, header.white_point).map_err(|error| float_error(&error))?;
    if whole.picture.size() != (header.width, header.height) {
        return Err(PictureError::Changed);
    }
    notes.extend(whole.notes);
    Ok(match whole.alpha {
        None => DecodedTexels::Rgb32(whole.picture.data),
        Some(alpha) => {
            let texels = whole.picture.data.into_iter().zip(alpha);
            DecodedTexels::Rgba32(texels.map(|([r, g, b], alpha)| [r, g, b, alpha]).collect())
        }
    })
}

fn decoder(bytes: &[u8], format: ImageFormat) -> Result<impl ImageDecoder + '_, ImageError> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    // The caller limits the size of the picture; this limits the decoder's other memory.
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(1 << 40);
    reader.limits(limits);
    reader.into_decoder()
}

fn damaged(error: &ImageError) -> PictureError {
    PictureError::Damaged(error.to_string())
}

fn library_texels(
    bytes: &[u8],
    format: ImageFormat,
    header: PictureHeader,
    notes: &mut Vec<String>,
) -> Result<DecodedTexels, PictureError> {
    let mut decoder = decoder(bytes, format).map_err(|error| damaged(&error))?;
    notes.extend(color_space::left_out(bytes, format, &mut decoder));
    let color_type = decoder.color_type();
    if decoder.dimensions() != (header.width, header.height) {
        return Err(PictureError::Changed);
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
        other => return Err(PictureError::UnknownTexels(format!("{other:?}"))),
    })
}

fn read<T: Pod>(decoder: impl ImageDecoder, count: usize) -> Result<Vec<T>, PictureError> {
    let mut texels = zeroed(count)?;
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut texels);
    if decoder.total_bytes() != bytes.len() as u64 {
        return Err(PictureError::WrongSize);
    }
    decoder.read_image(bytes).map_err(|error| damaged(&error))?;
    Ok(texels)
}

#[cfg(test)]
mod tests {
    use glam::Vec4;
    use image::{DynamicImage, ImageBuffer, Luma, LumaA, Rgb, Rgba};

    use super::*;
    use crate::values;

    fn encoded(picture: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        picture.write_to(&mut file, format).unwrap();
        file.into_inner()
    }

    fn read_image(file: &[u8], encoding: Encoding) -> Image {
        let header = PictureHeader::read(file, 1 << 20).unwrap();
        let image = DecodedImage::read(file, header).unwrap().into_image("test", encoding);
        assert!(image.memory_bytes() <= header.memory_bytes() + 64, "{header:?}");
        image
    }

    fn close(a: Vec4, b: [f32; 4]) -> bool {
        (a - Vec4::from_array(b)).abs().max_element() < 1e-4
    }

    #[test]
    fn every_kind_of_png_becomes_linear_rgba() {
        let half = srgb_half();
        let gray = DynamicImage::ImageLuma8(ImageBuffer::from_pixel(2, 3, Luma([188])));
        assert!(close(
            read_image(&encoded(&gray, ImageFormat::Png), Encoding::Srgb).texel(1, 2),
            [half, half, half, 1.0]
        ));
        let gray_alpha = DynamicImage::ImageLumaA8(ImageBuffer::from_pixel(2, 3, LumaA([188, 51])));
        let image = read_image(&encoded(&gray_alpha, ImageFormat::Png), Encoding::Srgb);
        assert!(close(image.texel(0, 0), [half, half, half, 0.2]) && image.has_alpha());
        let deep = DynamicImage::ImageRgba16(ImageBuffer::from_pixel(2, 3, Rgba([188 * 257, 65535, 0, 257])));
        let deep = encoded(&deep, ImageFormat::Png);
        assert!(close(read_image(&deep, Encoding::Srgb).texel(0, 0), [half, 1.0, 0.0, 1.0 / 255.0]));
        assert!(close(read_image(&deep, Encoding::Linear).texel(0, 0), [188.0 / 255.0, 1.0, 0.0, 1.0 / 255.0]));
        let deep_gray = DynamicImage::ImageLuma16(ImageBuffer::from_pixel(2, 3, Luma([1000])));
        let value = 1000.0 / 65535.0;
        let image = read_image(&encoded(&deep_gray, ImageFormat::Png), Encoding::Linear);
        assert!((image.texel(0, 0).x - value).abs() < 1e-6);
    }

    fn srgb_half() -> f32 {
        super::super::srgb::LINEAR_OF_SRGB[188]
    }

    #[test]
    fn alpha_that_is_opaque_everywhere_is_not_kept() {
        let opaque = DynamicImage::ImageRgba8(ImageBuffer::from_pixel(4, 4, Rgba([1, 2, 3, 255])));
        let image = read_image(&encoded(&opaque, ImageFormat::Png), Encoding::Srgb);
        assert!(!image.has_alpha());
        assert_eq!(image.memory_bytes(), 3 * (16 + 4 + 1));
    }

    #[test]
    fn pictures_of_high_dynamic_range_are_linear_for_every_encoding() {
        let bright = DynamicImage::ImageRgb32F(ImageBuffer::from_pixel(4, 2, Rgb([4.0, 0.5, 1000.0])));
        let image = read_image(&encoded(&bright, ImageFormat::Hdr), Encoding::Srgb);
        let texel = image.texel(3, 1);
        assert!((texel - Vec4::new(4.0, 0.5, 1000.0, 1.0)).abs().max_element() < 8.0 && image.is_high_dynamic_range());
    }

    fn exr_file(channels: &[(&str, f32)]) -> Vec<u8> {
        use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, WritableImage};
        let channel = |&(name, value): &(&str, f32)| AnyChannel::new(name, FlatSamples::F32(vec![value; 6]));
        let channels = AnyChannels::sort(channels.iter().map(channel).collect());
        let mut file = Cursor::new(Vec::new());
        Image::from_channels((3, 2), channels).write().to_buffered(&mut file).unwrap();
        file.into_inner()
    }

    #[test]
    fn exr_files_may_have_colours_alpha_or_luminance() {
        let texel = |channels: &[(&str, f32)]| read_image(&exr_file(channels), Encoding::Linear).texel(2, 1);
        assert_eq!(texel(&[("R", 1.0), ("G", 2.0), ("B", 3.0)]), Vec4::new(1.0, 2.0, 3.0, 1.0));
        assert_eq!(texel(&[("R", 1.0), ("G", 2.0), ("B", 3.0), ("A", 0.5)]), Vec4::new(1.0, 2.0, 3.0, 0.5));
        assert_eq!(texel(&[("Y", 7.0)]), Vec4::new(7.0, 7.0, 7.0, 1.0));
        assert_eq!(texel(&[("R", 7.0)]), Vec4::new(7.0, 7.0, 7.0, 1.0));
        assert_eq!(texel(&[("b", 3.0), ("g", 2.0), ("r", 1.0)]), Vec4::new(1.0, 2.0, 3.0, 1.0));
        assert!(PictureHeader::read(&exr_file(&[("Z", 7.0), ("id", 1.0)]), 100).is_err());
        // Invalid radiance becomes black.
        assert_eq!(texel(&[("R", f32::NAN), ("G", -1.0), ("B", f32::INFINITY)]), Vec4::W);
    }

    #[test]
    fn values_that_are_not_finite_are_replaced_and_reported_in_every_float_format() {
        let bright = [f32::NAN, f32::INFINITY, 3.0, 1e30, -f32::INFINITY, 0.5];
        let exr = exr_file(&[("R", f32::INFINITY), ("G", 3.0), ("B", f32::NAN)]);
        let mut pfm = b"PF\n2 1\n-1\n".to_vec();
        pfm.extend(bright.iter().flat_map(|value| value.to_le_bytes()));
        let tiff = DynamicImage::ImageRgb32F(ImageBuffer::from_vec(2, 1, bright.to_vec()).unwrap());
        let hdr = [b"#?RADIANCE\nEXPOSURE=1e-30\n\n-Y 1 +X 2\n".to_vec(), vec![9, 9, 9, 255, 9, 9, 9, 40]].concat();
        for (name, file) in [("exr", exr), ("pfm", pfm), ("tiff", encoded(&tiff, ImageFormat::Tiff)), ("hdr", hdr)] {
            let header = PictureHeader::read(&file, 1 << 20).unwrap();
            let mut decoded = DecodedImage::read(&file, header).unwrap();
            let notes = decoded.take_notes().join(" ");
            assert!(notes.contains("infinite"), "{name}: {notes}");
            let image = decoded.into_image(name, Encoding::Linear);
            let texel = image.texel(0, 0);
            assert!(texel.is_finite() && texel.max_element() <= values::VALUE_MAX, "{name}: {texel}");
            assert!(image.mean().is_finite() && image.mean().max_element() > 0.0, "{name}");
        }
    }

    #[test]
    fn small_files_that_announce_much_are_refused_by_their_header() {
        let small = DynamicImage::ImageRgb8(ImageBuffer::from_pixel(2, 2, Rgb([1, 2, 3])));
        let patched = |format: ImageFormat, at: usize, big_endian: bool, bytes: usize| {
            let mut file = encoded(&small, format);
            for at in [at, at + bytes] {
                let side = 16_000_u32;
                let side = if big_endian { side.to_be_bytes() } else { side.to_le_bytes() };
                let side = if big_endian { &side[4 - bytes..] } else { &side[..bytes] };
                file[at..at + bytes].copy_from_slice(side);
            }
            file
        };
        let jpeg = encoded(&small, ImageFormat::Jpeg);
        let frame = jpeg.windows(2).position(|mark| mark == [0xff, 0xc0]).unwrap();
        let files = [
            ("jpeg", patched(ImageFormat::Jpeg, frame + 5, true, 2)),
            ("tga", patched(ImageFormat::Tga, 12, false, 2)),
            ("bmp", patched(ImageFormat::Bmp, 18, false, 4)),
            ("ppm", b"P6 16000 16000 255 \0".to_vec()),
            ("pfm", b"PF\n16000 16000\n-1\n\0".to_vec()),
            ("hdr", b"#?RADIANCE\n\n-Y 16000 +X 16000\n\x02\x02".to_vec()),
            ("webp", {
                // Lossless WebP of one colour; width − 1 and height − 1 take 14 bits each.
                let mut file = encoded(&small, ImageFormat::WebP);
                let at = file.windows(4).position(|name| name == b"VP8L").unwrap() + 9;
                let rest = u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) & !0xfff_ffff;
                file[at..at + 4].copy_from_slice(&(rest | (15_999 << 14) | 15_999).to_le_bytes());
                file
            }),
        ];
        for (name, file) in files {
            let start = std::time::Instant::now();
            let refused = PictureHeader::read(&file, 1 << 28);
            let is_reported = matches!(&refused, Err(error) if error.to_string().contains("announces"));
            assert!(is_reported, "{name}: {refused:?}");
            assert!(start.elapsed().as_millis() < 200, "{name}: {:?}", start.elapsed());
        }
    }

    #[test]
    fn other_formats_keep_rows_channels_and_precision() {
        let picture =
            DynamicImage::ImageRgb8(ImageBuffer::from_fn(3, 2, |x, y| Rgb([x as u8 * 100, y as u8 * 255, 7])));
        for format in [ImageFormat::Tga, ImageFormat::Bmp, ImageFormat::Tiff, ImageFormat::WebP, ImageFormat::Pnm] {
            let image = read_image(&encoded(&picture, format), Encoding::Linear);
            assert_eq!(image.size(), (3, 2), "{format:?}");
            assert!(close(image.texel(2, 1), [200.0 / 255.0, 1.0, 7.0 / 255.0, 1.0]), "{format:?}");
            assert!(close(image.texel(1, 0), [100.0 / 255.0, 0.0, 7.0 / 255.0, 1.0]), "{format:?}");
        }
        let deep = DynamicImage::ImageRgb16(ImageBuffer::from_pixel(2, 2, Rgb([1000, 0, 65535])));
        for format in [ImageFormat::Tiff, ImageFormat::Pnm] {
            let image = read_image(&encoded(&deep, format), Encoding::Linear);
            assert!((image.texel(0, 0).x - 1000.0 / 65535.0).abs() < 1e-6, "{format:?}");
        }
        let bright = DynamicImage::ImageRgb32F(ImageBuffer::from_pixel(2, 2, Rgb([100.0, 0.5, 0.0])));
        let image = read_image(&encoded(&bright, ImageFormat::Tiff), Encoding::Srgb);
        assert_eq!(image.texel(1, 1), Vec4::new(100.0, 0.5, 0.0, 1.0));
    }

    #[test]
    fn too_many_pixels_and_unknown_formats_are_different_errors() {
        let file = exr_file(&[("Y", 7.0)]);
        assert!(matches!(PictureHeader::read(&file, 5), Err(PictureError::TooManyPixels { .. })));
        assert!(
            matches!(PictureHeader::read(b"GIF89a....", 5), Err(PictureError::UnknownFormat { found }) if found.contains("GIF"))
        );
        assert!(matches!(PictureHeader::read(b"", 5), Err(PictureError::UnknownFormat { .. })));
    }
}
