//! Pictures from files of any format that is read.

use std::{
    fs::File,
    io::{BufRead, BufReader, Read, Seek},
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

use crate::{
    ImageError, Metadata, Picture,
    exr_read::{self, Planes},
    png_read,
};

/// A picture and what its file says of it.
#[derive(Clone, Debug)]
pub struct ImageFile {
    /// The pixels that the file holds: of EXR, those of the data window.
    pub picture: Picture,
    /// Where the upper left pixel lies in the whole picture: other than (0, 0) for a crop.
    pub offset: (i32, i32),
    /// Width and height of the whole picture.
    pub full_size: (u32, u32),
    /// Text that the file carries.
    pub metadata: Metadata,
}

/// What [`read_image`] accepts.
#[derive(Clone, Copy, Debug)]
pub struct ReadLimits {
    /// The most pixels, compared with the header before anything is allocated.
    pub max_pixels: u64,
}

impl Default for ReadLimits {
    /// 16384 × 8192: the largest environment maps in use.
    fn default() -> Self {
        Self { max_pixels: 1 << 27 }
    }
}

/// Reads a picture: OpenEXR, PNG or Radiance HDR, told apart by their first bytes. 8- and 16-bit values are decoded by
/// the sRGB curve, or the gamma that the file names; alpha is left out.
///
/// Of an EXR file it is the color that a viewer shows first: the channels R, G, B of no layer, else those of a layer,
/// else the gray of Y. Accepts what [`ReadLimits::default`] allows.
pub fn read_picture(path: impl AsRef<Path>) -> Result<Picture, ImageError> {
    read_image(path, ReadLimits::default()).map(|file| file.picture)
}

/// As [`read_picture`], with the place of the picture, its metadata, and limits of the caller's choice.
pub fn read_image(path: impl AsRef<Path>, limits: ReadLimits) -> Result<ImageFile, ImageError> {
    let path = path.as_ref();
    let file = File::open(path).map_err(|error| ImageError::read(path, error))?;
    if file.metadata().is_ok_and(|found| found.is_dir()) {
        return Err(ImageError::read(path, std::io::ErrorKind::IsADirectory.into()));
    }
    read_from(&Source { path, limits }, BufReader::new(file), &[]).map(|(file, _)| file)
}

/// As [`read_image`], with further channels of an OpenEXR file by their full names, such as `depth.Z`: a plane each,
/// row by row from the top, in the order of `names`; `None` where the file has no such channel.
pub fn read_channels(
    path: impl AsRef<Path>,
    limits: ReadLimits,
    names: &[String],
) -> Result<(ImageFile, Planes), ImageError> {
    let path = path.as_ref();
    let file = File::open(path).map_err(|error| ImageError::read(path, error))?;
    read_from(&Source { path, limits }, BufReader::new(file), names)
}

/// As [`read_image`], of the bytes of a file; `name` stands in errors.
pub fn read_image_bytes(name: impl AsRef<Path>, bytes: &[u8], limits: ReadLimits) -> Result<ImageFile, ImageError> {
    read_from(&Source { path: name.as_ref(), limits }, std::io::Cursor::new(bytes), &[]).map(|(file, _)| file)
}

/// What the readers of all formats need to know.
pub(crate) struct Source<'a> {
    pub(crate) path: &'a Path,
    pub(crate) limits: ReadLimits,
}

impl Source<'_> {
    pub(crate) fn malformed(&self, format: &'static str, detail: impl Into<String>) -> ImageError {
        ImageError::malformed(self.path, format, detail)
    }

    /// To be asked with the size in the header, before anything is allocated by it.
    pub(crate) fn check_size(&self, width: u64, height: u64) -> Result<(), ImageError> {
        let max_pixels = self.limits.max_pixels;
        match width.checked_mul(height) {
            Some(0) => Err(ImageError::Malformed {
                path: self.path.to_owned(),
                format: "picture",
                detail: format!("it announces {width} × {height} pixels"),
            }),
            Some(pixels) if pixels <= max_pixels && width.max(height) <= u64::from(u32::MAX) => Ok(()),
            _ => Err(ImageError::TooLarge { path: self.path.to_owned(), width, height, max_pixels }),
        }
    }
}

fn read_from<R: BufRead + Seek>(
    source: &Source<'_>,
    mut input: R,
    names: &[String],
) -> Result<(ImageFile, Planes), ImageError> {
    let mut magic = Vec::new();
    input.by_ref().take(10).read_to_end(&mut magic).map_err(|error| ImageError::read(source.path, error))?;
    input.rewind().map_err(|error| ImageError::read(source.path, error))?;
    // Other formats have no channels but the color's.
    let alone = |file| (file, vec![None; names.len()]);
    match magic.as_slice() {
        [0x76, 0x2f, 0x31, 0x01, ..] => guarded(source, "EXR", || exr_read::read(source, input, names)),
        [0x89, b'P', b'N', b'G', ..] => guarded(source, "PNG", || png_read::read(source, input)).map(alone),
        [b'#', b'?', ..] => guarded(source, "HDR", || read_hdr(source, input)).map(alone),
        _ => Err(ImageError::UnknownFormat { path: source.path.to_owned() }),
    }
}

/// The decoders are other people's, and fuzzing has found panics in such before: one becomes an error of the file.
fn guarded<T>(
    source: &Source<'_>,
    format: &'static str,
    read: impl FnOnce() -> Result<T, ImageError>,
) -> Result<T, ImageError> {
    // Nothing that `read` leaves half changed outlives it, so unwinding out of it is safe.
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err(source.malformed(format, "its decoder gave up")))
}

fn read_hdr<R: BufRead>(source: &Source<'_>, input: R) -> Result<ImageFile, ImageError> {
    use image::ImageDecoder;
    let failed = |error: image::ImageError| match error {
        image::ImageError::IoError(io) if io.kind() != std::io::ErrorKind::UnexpectedEof => {
            ImageError::read(source.path, io)
        }
        image::ImageError::IoError(_) => source.malformed("HDR", "it ends too early; was it cut off?"),
        other => source.malformed("HDR", other.to_string()),
    };
    let decoder = image::codecs::hdr::HdrDecoder::new_nonstrict(input).map_err(failed)?;
    let (width, height) = decoder.dimensions();
    source.check_size(u64::from(width), u64::from(height))?;
    let mut picture = Picture::new(width, height);
    decoder.read_image(bytemuck::cast_slice_mut(&mut picture.data)).map_err(failed)?;
    Ok(ImageFile { picture, offset: (0, 0), full_size: (width, height), metadata: Metadata::default() })
}
