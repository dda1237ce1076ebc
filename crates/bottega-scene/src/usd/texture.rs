//! Pictures of textures and lights, decoded together at the end.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::files::Files;
use super::source::{NamedFile, StageSource};
use crate::error::SceneError;
use crate::image::Image;
use crate::image::decode::{DecodedImage, PictureHeader};
use crate::image::error::PictureError;
use crate::image::pictures::{too_large, unreadable};
use crate::image::pyramid::Encoding;
use crate::import::request::ImportRequest;
use crate::text::shortened;
use crate::texture::ImageId;

/// The encoding of a picture (`sourceColorSpace`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum SourceSpace {
    /// sRGB for 8-bit pictures with three or four channels, else linear.
    Auto,
    Raw,
    Srgb,
}

/// The replacement of a picture that cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum StandIn {
    /// A colour, linear RGB, as bits.
    Color([u32; 3]),
    /// A normal map without relief.
    Flat,
}

/// A change of all texels: their product with a scale, and a bias (`inputs:scale`, `inputs:bias`), RGBA, as bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct TexelChange {
    scale: [u32; 4],
    bias: [u32; 4],
    /// `true`: the result is a normal, which is stored as a picture stores it.
    is_normal: bool,
}

impl TexelChange {
    /// Makes a change.
    pub(super) fn new(scale: [f32; 4], bias: [f32; 4], is_normal: bool) -> Self {
        Self { scale: scale.map(f32::to_bits), bias: bias.map(f32::to_bits), is_normal }
    }

    fn apply(&self, image: &Image) -> Image {
        let (width, height) = image.size();
        let (scale, bias) = (self.scale.map(f32::from_bits), self.bias.map(f32::from_bits));
        let texel = |index: usize| {
            let (x, y) = (index as u32 % width, index as u32 / width);
            let texel = image.texel(x, y).to_array();
            let changed: [f32; 4] = std::array::from_fn(|channel| texel[channel] * scale[channel] + bias[channel]);
            if self.is_normal { changed.map(|value| 0.5 * value + 0.5) } else { changed }
        };
        let texels = (0..width as usize * height as usize).into_par_iter().map(texel);
        if self.is_normal {
            Image::from_numbers(&*image.name, width, height, texels.map(|[r, g, b, _]| [r, g, b]).collect())
        } else {
            Image::from_linear_rgba(&*image.name, width, height, texels.collect())
        }
    }
}

/// A picture that is needed.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct WantedTexture {
    /// Name among the files of the stage, or the reference if there is no such file.
    name: String,
    is_there: bool,
    pub(super) space: SourceSpace,
    pub(super) change: Option<TexelChange>,
    pub(super) stand_in: StandIn,
}

impl WantedTexture {
    /// Makes the request for a file without changes.
    pub(super) fn new(file: &NamedFile, space: SourceSpace, stand_in: StandIn) -> Self {
        let name = file.name.clone().unwrap_or_else(|| file.reference.clone());
        Self { name, is_there: file.name.is_some(), space, change: None, stand_in }
    }
}

/// Requested pictures; equal requests are one image.
pub(super) struct Textures<'a> {
    request: &'a ImportRequest<'a>,
    files: &'a Files<'a>,
    /// Requests, and the place of the first of each.
    wanted: Vec<(WantedTexture, String)>,
    id_of: BTreeMap<WantedTexture, ImageId>,
    /// Pictures that were made, not read, by their number.
    made: BTreeMap<u32, Image>,
}

impl<'a> Textures<'a> {
    /// Makes an empty list of requests.
    pub(super) fn new(source: &StageSource<'a>) -> Self {
        Self {
            request: source.request,
            files: source.files,
            wanted: Vec::new(),
            id_of: BTreeMap::new(),
            made: BTreeMap::new(),
        }
    }

    /// Requests a picture. Its id is its index in the result of [`load`](Self::load).
    pub(super) fn want(&mut self, wanted: WantedTexture, place: &str) -> ImageId {
        if let Some(&id) = self.id_of.get(&wanted) {
            return id;
        }
        let id = ImageId(self.wanted.len() as u32);
        self.wanted.push((wanted.clone(), place.to_owned()));
        self.id_of.insert(wanted, id);
        id
    }

    /// Adds a picture that is not read from a file of pictures, unless there is one of this name. `None`: it takes more memory
    /// than there is, with a warning.
    pub(super) fn add(
        &mut self,
        source: &StageSource<'_>,
        place: &str,
        name: &str,
        make: impl FnOnce() -> Image,
    ) -> Option<ImageId> {
        let file = NamedFile { reference: format!("made: {name}"), name: None };
        let wanted = WantedTexture::new(&file, SourceSpace::Raw, StandIn::Flat);
        if let Some(&id) = self.id_of.get(&wanted) {
            return Some(id);
        }
        let image = make();
        if let Err(error) = source.take(place, image.memory_bytes()) {
            source.unsupported(place, format!("{error}; it is left out"));
            return None;
        }
        let id = self.want(wanted, place);
        self.made.insert(id.0, image);
        Some(id)
    }

    /// Decodes all pictures. One that cannot be read is replaced, with a warning.
    pub(super) fn load(self, source: &StageSource<'_>) -> Result<Vec<Image>, SceneError> {
        let (request, files) = (self.request, self.files);
        // Book the memory of all before any is decoded
        let check = |(wanted, place): &(WantedTexture, String)| check(request, files, wanted, place);
        let headers: Vec<_> = self.wanted.par_iter().map(check).collect::<Result<_, SceneError>>()?;
        let read = |((wanted, _), header): (&(WantedTexture, String), Result<PictureHeader, PictureError>)| {
            let bytes = files.read(&wanted.name).map_err(|error| unreadable(&error));
            header.and_then(|header| decode(wanted, header, &bytes?))
        };
        let decoded: Vec<_> = self.wanted.par_iter().zip(headers).map(read).collect();
        let mut made = self.made;
        let finish = |(number, ((wanted, place), decoded)): (u32, (&(WantedTexture, String), DecodedPicture))| {
            if let Some(image) = made.remove(&number) {
                return image;
            }
            let name = shortened(&wanted.name).into_owned();
            match decoded {
                Ok((image, notes)) => {
                    notes.iter().for_each(|note| source.warn(place, format!("the picture `{name}`: {note}")));
                    image
                }
                Err(problem) => {
                    let (what, image) = stand_in(wanted, &name);
                    source.unsupported(place, format!("the picture `{name}`: {problem}; {what} replaces it"));
                    image
                }
            }
        };
        Ok((0..).zip(self.wanted.iter().zip(decoded)).map(finish).collect())
    }
}

fn stand_in(wanted: &WantedTexture, name: &str) -> (&'static str, Image) {
    match wanted.stand_in {
        StandIn::Flat => ("a flat surface", Image::from_linear_rgb(name, 1, 1, vec![[0.5, 0.5, 1.0]])),
        StandIn::Color(color) => {
            ("its fallback colour", Image::from_linear_rgb(name, 1, 1, vec![color.map(f32::from_bits)]))
        }
    }
}

/// Reads the header of a picture and books its memory. The inner error is only a warning.
fn check(
    request: &ImportRequest<'_>,
    files: &Files<'_>,
    wanted: &WantedTexture,
    place: &str,
) -> Result<Result<PictureHeader, PictureError>, SceneError> {
    if !wanted.is_there {
        return Ok(Err(PictureError::UnreadableFile("there is no such file".into())));
    }
    let bytes = match files.read(&wanted.name) {
        Ok(bytes) => bytes,
        Err(error) => return Ok(Err(unreadable(&error))),
    };
    match PictureHeader::read(&bytes, request.options.max_image_pixels) {
        Ok(header) => {
            // A changed picture has floats, with the original still in memory
            let factor = if wanted.change.is_some() { 9 } else { 1 };
            request.resources.budget().take(request.path, place, header.memory_bytes().saturating_mul(factor))?;
            Ok(Ok(header))
        }
        Err(error @ PictureError::TooManyPixels { .. }) => Err(too_large(request.path, place.into(), &error)),
        Err(error) => Ok(Err(error)),
    }
}

/// A decoded picture, and notes for warnings.
type DecodedPicture = Result<(Image, Vec<String>), PictureError>;

/// Decodes a picture.
fn decode(wanted: &WantedTexture, header: PictureHeader, bytes: &[u8]) -> DecodedPicture {
    let mut decoded = DecodedImage::read(bytes, header)?;
    let notes = decoded.take_notes();
    let encoding = match wanted.space {
        SourceSpace::Srgb => Encoding::Srgb,
        SourceSpace::Raw => Encoding::Linear,
        SourceSpace::Auto if decoded.has_one_channel() => Encoding::Linear,
        SourceSpace::Auto => Encoding::Srgb,
    };
    let image = decoded.into_image(&wanted.name, encoding);
    Ok((wanted.change.map_or_else(|| image.clone(), |change| change.apply(&image)), notes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_are_scaled_and_shifted() {
        let image = Image::from_linear_rgba("a", 1, 1, vec![[0.25, 0.5, 1.0, 0.5]]);
        let change = TexelChange::new([2.0, 1.0, 0.5, 1.0], [0.5, 0.0, 0.25, 0.25], false);
        assert_eq!(change.apply(&image).texel(0, 0).to_array(), [1.0, 0.5, 0.75, 0.75]);
        // A normal map whose y points down
        let turned = TexelChange::new([2.0, -2.0, 2.0, 1.0], [-1.0, 1.0, -1.0, 0.0], true);
        assert_eq!(turned.apply(&image).texel(0, 0).truncate().to_array(), [0.25, 0.5, 1.0]);
    }
}
