//! Reading of pictures in any supported format.

use std::{
    fs::File,
    io::{BufRead, BufReader, Read, Seek},
    path::Path,
};

use crate::{
    ImageError, Picture,
    exr_read::{self, Planes, WantedChannels},
    limits::ReadLimits,
    png_read, radiance_read,
    source::{ImageFile, PictureSource, file_bytes, guarded},
};

/// Reads a picture: OpenEXR, PNG or Radiance HDR, recognized by their first bytes. 8- and 16-bit values are decoded by
/// the sRGB curve, or the gamma that the file names; alpha is ignored. Colors of other primaries that the file names
/// are converted to linear Rec. 709; white stays white.
///
/// Of an EXR file, the color is what a viewer shows first: the channels R, G, B of no layer, else those of a layer,
/// else X, Y and Z, or the gray of Y or of the only channel. Accepts what [`ReadLimits::default`] allows.
///
/// # Errors
/// The file cannot be read, is not such a picture, is damaged, uses an unsupported feature, has no color or no pixels, or
/// exceeds the limits.
pub fn read_picture(path: impl AsRef<Path>) -> Result<Picture, ImageError> {
    read_image(path, ReadLimits::default()).map(|file| file.picture)
}

/// Reads a picture as [`read_picture`] does, with its position, its metadata, and the caller's limits.
///
/// # Errors
/// As for [`read_picture`].
pub fn read_image(path: impl AsRef<Path>, limits: ReadLimits) -> Result<ImageFile, ImageError> {
    let path = path.as_ref();
    let file = File::open(path).map_err(|error| ImageError::read(path, error))?;
    if file.metadata().is_ok_and(|found| found.is_dir()) {
        return Err(ImageError::read(path, std::io::ErrorKind::IsADirectory.into()));
    }
    read_from(&PictureSource::new(path, limits), BufReader::new(file), &[]).map(|(file, _)| file)
}

/// Reads a picture as [`read_image`] does, with further channels of an OpenEXR file by their full names, such as
/// `depth.Z`: a plane each, row by row from the top, in the order of `names`; `None` if the file has no such channel.
///
/// # Errors
/// As for [`read_picture`].
pub fn read_channels(
    path: impl AsRef<Path>,
    limits: ReadLimits,
    names: &[String],
) -> Result<(ImageFile, Planes), ImageError> {
    let path = path.as_ref();
    let file = File::open(path).map_err(|error| ImageError::read(path, error))?;
    read_from(&PictureSource::new(path, limits), BufReader::new(file), names)
}

/// Reads a picture as [`read_image`] does, from the bytes of a file.
///
/// - `name`: file name, for errors.
/// - `bytes`: the whole file.
///
/// # Errors
/// As for [`read_picture`].
pub fn read_image_bytes(name: impl AsRef<Path>, bytes: &[u8], limits: ReadLimits) -> Result<ImageFile, ImageError> {
    read_from(&PictureSource::new(name.as_ref(), limits), std::io::Cursor::new(bytes), &[]).map(|(file, _)| file)
}

fn read_from<R: BufRead + Seek>(
    source: &PictureSource<'_>,
    mut input: R,
    names: &[String],
) -> Result<(ImageFile, Planes), ImageError> {
    let start = start_of(source, &mut input)?;
    // Other formats have only color channels.
    let alone = |file| (file, vec![None; names.len()]);
    match start.as_slice() {
        [0x76, 0x2f, 0x31, 0x01, ..] => guarded(source, "EXR", || {
            exr_read::read(source, input, WantedChannels { names, alpha: false }).map(|read| (read.file, read.planes))
        }),
        [0x89, b'P', b'N', b'G', ..] => guarded(source, "PNG", || png_read::read(source, input)).map(alone),
        start if radiance_read::recognizes(start) => {
            let bytes = file_bytes(source, &mut input)?;
            radiance_read::read(source, input, bytes).map(|(file, _)| alone(file))
        }
        _ => Err(ImageError::UnknownFormat { path: source.path.to_owned() }),
    }
}

/// Reads the first bytes of a file, and rewinds it.
fn start_of<R: BufRead + Seek>(source: &PictureSource<'_>, input: &mut R) -> Result<Vec<u8>, ImageError> {
    let mut start = Vec::new();
    let read =
        input.by_ref().take(radiance_read::MARK_BYTES as u64).read_to_end(&mut start).and_then(|_| input.rewind());
    read.map_err(|error| ImageError::read(source.path, error))?;
    Ok(start)
}
