//! Pictures from files of any format that is read.

use std::{
    fs::File,
    io::{BufRead, BufReader, Read, Seek, SeekFrom},
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

use crate::{
    ImageError, Metadata, Picture, WhitePoint,
    exr_read::{self, Planes, Wanted},
    limits::ReadLimits,
    png_read, radiance_read,
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

/// Reads a picture: OpenEXR, PNG or Radiance HDR, told apart by their first bytes. 8- and 16-bit values are decoded by
/// the sRGB curve, or the gamma that the file names; alpha is left out. Colors of other primaries than ours, which the files
/// name, become linear Rec. 709, and white stays white.
///
/// Of an EXR file it is the color that a viewer shows first: the channels R, G, B of no layer, else those of a layer,
/// else X, Y and Z, or the gray of Y or of the only channel. Accepts what [`ReadLimits::default`] allows.
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
    read_from(&Source::new(path, limits), BufReader::new(file), &[]).map(|(file, _)| file)
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
    read_from(&Source::new(path, limits), BufReader::new(file), names)
}

/// As [`read_image`], of the bytes of a file; `name` stands in errors.
pub fn read_image_bytes(name: impl AsRef<Path>, bytes: &[u8], limits: ReadLimits) -> Result<ImageFile, ImageError> {
    read_from(&Source::new(name.as_ref(), limits), std::io::Cursor::new(bytes), &[]).map(|(file, _)| file)
}

/// What the readers of all formats need to know.
pub(crate) struct Source<'a> {
    pub(crate) path: &'a Path,
    pub(crate) limits: ReadLimits,
    pub(crate) white_point: WhitePoint,
}

impl<'a> Source<'a> {
    pub(crate) fn new(path: &'a Path, limits: ReadLimits) -> Self {
        Self { path, limits, white_point: WhitePoint::default() }
    }

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
    let start = start_of(source, &mut input)?;
    // Other formats have no channels but the color's.
    let alone = |file| (file, vec![None; names.len()]);
    match start.as_slice() {
        [0x76, 0x2f, 0x31, 0x01, ..] => guarded(source, "EXR", || {
            exr_read::read(source, input, Wanted { names, alpha: false }).map(|read| (read.file, read.planes))
        }),
        [0x89, b'P', b'N', b'G', ..] => guarded(source, "PNG", || png_read::read(source, input)).map(alone),
        start if radiance_read::recognizes(start) => {
            let bytes = file_bytes(source, &mut input)?;
            radiance_read::read(source, input, bytes).map(|(file, _)| alone(file))
        }
        _ => Err(ImageError::UnknownFormat { path: source.path.to_owned() }),
    }
}

/// The first bytes of a file, which stays at its beginning.
fn start_of<R: BufRead + Seek>(source: &Source<'_>, input: &mut R) -> Result<Vec<u8>, ImageError> {
    let mut start = Vec::new();
    let read =
        input.by_ref().take(radiance_read::MARK_BYTES as u64).read_to_end(&mut start).and_then(|_| input.rewind());
    read.map_err(|error| ImageError::read(source.path, error))?;
    Ok(start)
}

/// How long a file is, which stays at its beginning.
pub(crate) fn file_bytes<R: Seek>(source: &Source<'_>, input: &mut R) -> Result<u64, ImageError> {
    let length = input.seek(SeekFrom::End(0)).and_then(|length| input.rewind().map(|()| length));
    length.map_err(|error| ImageError::read(source.path, error))
}

/// The decoders are other people's, and fuzzing has found panics in such before: one becomes an error of the file.
pub(crate) fn guarded<T>(
    source: &Source<'_>,
    format: &'static str,
    read: impl FnOnce() -> Result<T, ImageError>,
) -> Result<T, ImageError> {
    // Nothing that `read` leaves half changed outlives it, so unwinding out of it is safe.
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err(source.malformed(format, "its decoder gave up")))
}
