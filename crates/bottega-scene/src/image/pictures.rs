//! The pictures that a scene refers to: requested one by one, decoded in parallel.

use std::collections::BTreeMap;
use std::path::Path;

use bottega_image::{WhitePoint, printable_path};
use rayon::prelude::*;

use super::Image;
use super::decode::{DecodedImage, PictureHeader};
use super::error::PictureError;
use super::pyramid::Encoding;
use crate::error::{SceneError, Warnings};
use crate::options::LoadOptions;
use crate::resource::{Location, Resources};
use crate::text::shortened;
use crate::texture::ImageId;

/// The use of a picture, which selects its replacement if it is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum PictureUse {
    /// Colours; the replacement is magenta.
    Color,
    /// Numeric factors; the replacement is 1.
    Number,
    /// Surface normals; the replacement is a flat surface.
    Normals,
}

impl PictureUse {
    /// Returns the replacement of a missing picture, as words and as a picture.
    fn stand_in(self, name: &str) -> (&'static str, Image) {
        match self {
            Self::Color => ("magenta", Image::missing(name)),
            Self::Number => ("1", Image::from_gray8(name, 1, 1, vec![255], false)),
            Self::Normals => ("a flat surface", Image::from_linear_rgb(name, 1, 1, vec![[0.5, 0.5, 1.0]])),
        }
    }
}

/// The interpretation of a picture file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PictureKind {
    /// Encoding of 8-bit codes.
    pub(crate) encoding: Encoding,
    pub(crate) purpose: PictureUse,
}

impl PictureKind {
    /// Colours encoded as sRGB.
    pub(crate) const COLORS: Self = Self { encoding: Encoding::Srgb, purpose: PictureUse::Color };
    /// Linear numbers, such as roughness.
    pub(crate) const NUMBERS: Self = Self { encoding: Encoding::Linear, purpose: PictureUse::Number };
    /// A normal map.
    pub(crate) const NORMALS: Self = Self { encoding: Encoding::Linear, purpose: PictureUse::Normals };
}

/// Requested pictures. The same file with the same use is one image, however often it is requested.
pub(crate) struct Pictures<'a> {
    resources: &'a Resources<'a>,
    pixels_max: u64,
    white_point: WhitePoint,
    wanted: Vec<WantedPicture>,
    id_of: BTreeMap<(Location, bool, PictureChange, PictureUse), ImageId>,
    /// Index and image of the pictures that are not in files.
    made: Vec<(usize, Image)>,
}

/// A change to a picture after decoding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum PictureChange {
    None,
    /// Luminance in all channels.
    Gray,
    /// A border of black texels.
    Framed,
    /// One period of an octahedral map; see [`Image::octahedral_period`].
    Octahedral,
}

/// A picture with a border of black texels.
pub(crate) struct FramedTexture {
    pub(crate) id: ImageId,
    /// Columns and rows without the border.
    pub(crate) size: (u32, u32),
}

struct WantedPicture {
    location: Location,
    kind: PictureKind,
    change: PictureChange,
    /// Location of the first request.
    place: String,
}

impl<'a> Pictures<'a> {
    /// Makes an empty list of requests.
    pub(crate) fn new(resources: &'a Resources<'a>, options: &LoadOptions) -> Self {
        Self {
            resources,
            pixels_max: options.max_image_pixels,
            white_point: WhitePoint::default(),
            wanted: Vec::new(),
            id_of: BTreeMap::new(),
            made: Vec::new(),
        }
    }

    /// Sets the white point from which colours are adapted.
    pub(crate) fn with_white_point(self, white_point: WhitePoint) -> Self {
        Self { white_point, ..self }
    }

    /// Requests a picture. Its id is its index in the result of [`load`](Self::load).
    ///
    /// - `reference`: relative to the folder of the scene; see [`Resources::locate`] for forbidden ones.
    /// - `place`: location of the reference, for messages.
    pub(crate) fn want(&mut self, reference: &str, kind: PictureKind, place: &str) -> Result<ImageId, SceneError> {
        self.want_in(&[""], reference, kind, place)
    }

    /// Requests a picture relative to one of several folders; see [`Resources::locate_in`].
    pub(crate) fn want_in(
        &mut self,
        folders: &[&str],
        reference: &str,
        kind: PictureKind,
        place: &str,
    ) -> Result<ImageId, SceneError> {
        let location = self.resources.locate_in(folders, reference, place)?;
        Ok(self.want_at(location, kind, false, place))
    }

    /// Requests a picture at a resolved location; see [`want`](Self::want).
    ///
    /// - `gray`: replace all channels by the luminance (Rec. 709).
    pub(crate) fn want_at(&mut self, location: Location, kind: PictureKind, gray: bool, place: &str) -> ImageId {
        self.want_changed(location, kind, if gray { PictureChange::Gray } else { PictureChange::None }, place)
    }

    /// Requests a picture with a border of black texels; see [`want`](Self::want). `None`: it cannot be read.
    pub(crate) fn want_framed(
        &mut self,
        reference: &str,
        kind: PictureKind,
        place: &str,
    ) -> Result<Option<FramedTexture>, SceneError> {
        let location = self.resources.locate(reference, place)?;
        let Ok(bytes) = self.resources.read(&location) else { return Ok(None) };
        let Ok(header) = PictureHeader::read(&bytes, self.pixels_max) else { return Ok(None) };
        let id = self.want_changed(location, kind, PictureChange::Framed, place);
        Ok(Some(FramedTexture { id, size: header.size() }))
    }

    /// Requests one period of an octahedral map of a sphere; see [`Image::octahedral_period`] and [`want`](Self::want).
    pub(crate) fn want_octahedral(
        &mut self,
        reference: &str,
        kind: PictureKind,
        place: &str,
    ) -> Result<ImageId, SceneError> {
        let location = self.resources.locate(reference, place)?;
        Ok(self.want_changed(location, kind, PictureChange::Octahedral, place))
    }

    fn want_changed(&mut self, location: Location, kind: PictureKind, change: PictureChange, place: &str) -> ImageId {
        let next = ImageId((self.wanted.len() + self.made.len()) as u32);
        let key = (location, kind.encoding == Encoding::Srgb, change, kind.purpose);
        if let Some(&id) = self.id_of.get(&key) {
            return id;
        }
        self.wanted.push(WantedPicture { location: key.0.clone(), kind, change, place: place.into() });
        self.id_of.insert(key, next);
        next
    }

    /// Adds a picture that is not in a file.
    pub(crate) fn add(&mut self, image: Image) -> ImageId {
        let id = self.wanted.len() + self.made.len();
        self.made.push((id, image));
        ImageId(id as u32)
    }

    /// Replaces a picture that was [added](Self::add).
    pub(crate) fn replace(&mut self, id: ImageId, image: Image) {
        if let Some((_, known)) = self.made.iter_mut().find(|(index, _)| *index == id.0 as usize) {
            *known = image;
        }
    }

    /// Decodes all requested pictures in parallel, after all headers have passed the limits. An unreadable one is
    /// replaced according to its use, with a warning.
    pub(crate) fn load(self, warnings: &mut Warnings) -> Result<Vec<Image>, SceneError> {
        let checked: Vec<Result<PictureHeader, PictureError>> =
            self.wanted.par_iter().map(|wanted| self.check(wanted)).collect::<Result<_, SceneError>>()?;
        let white_point = self.white_point;
        let decoded: Vec<Result<(Image, Vec<String>), PictureError>> = (self.wanted.par_iter().zip(checked))
            .map(|(wanted, header)| {
                let bytes = self.resources.read(&wanted.location).map_err(|error| unreadable(&error))?;
                let mut decoded = DecodedImage::read(&bytes, header?.with_white_point(white_point))?;
                drop(bytes);
                let notes = decoded.take_notes();
                let image = decoded.into_image(&wanted.location.name, wanted.kind.encoding);
                let image = match wanted.change {
                    PictureChange::None => image,
                    PictureChange::Gray => image.luminance(),
                    PictureChange::Framed => image.framed(),
                    PictureChange::Octahedral => image.octahedral_period(),
                };
                Ok((image, notes))
            })
            .collect();
        let finish = |(wanted, decoded): (&WantedPicture, Result<(Image, Vec<String>), PictureError>)| {
            let name = shortened(&wanted.location.name).into_owned();
            let image = decoded.map(|(image, notes)| {
                for note in notes {
                    warnings.add(wanted.place.as_str(), format!("the picture `{name}`: {note}"));
                }
                image
            });
            image.unwrap_or_else(|problem| {
                let (stand_in, image) = wanted.kind.purpose.stand_in(&name);
                let message = format!("the picture `{name}`: {problem}; {stand_in} replaces it");
                warnings.unsupported(wanted.place.as_str(), message);
                image
            })
        };
        let mut images: Vec<Image> = self.wanted.iter().zip(decoded).map(finish).collect();
        self.made.into_iter().for_each(|(index, image)| images.insert(index, image));
        Ok(images)
    }

    /// Reads the header of a picture and books its memory. The inner error is only a warning.
    fn check(&self, wanted: &WantedPicture) -> Result<Result<PictureHeader, PictureError>, SceneError> {
        let bytes = match self.resources.read(&wanted.location) {
            Ok(bytes) => bytes,
            Err(error) => return Ok(Err(unreadable(&error))),
        };
        match PictureHeader::read(&bytes, self.pixels_max) {
            Ok(header) => {
                let factor = match wanted.change {
                    PictureChange::None => 1,
                    // Gray is stored as floats.
                    PictureChange::Gray => 12,
                    // A single texel becomes nine, with the original still in memory.
                    PictureChange::Framed => 10,
                    // Four times as many texels, with the original still in memory.
                    PictureChange::Octahedral => 5,
                };
                let bytes = header.memory_bytes().saturating_mul(factor);
                let taken = self.resources.budget().take(wanted.location.path(), "", bytes);
                self.resources.attribute(&wanted.location, taken)?;
                Ok(Ok(header))
            }
            Err(error @ PictureError::TooManyPixels { .. }) => self
                .resources
                .attribute(&wanted.location, Err(too_large(wanted.location.path(), String::new(), &error))),
            Err(error) => Ok(Err(error)),
        }
    }
}

/// Returns the error for a picture with too many pixels.
///
/// - `place`: location in the scene file; may be empty.
pub(crate) fn too_large(path: &Path, place: String, error: &PictureError) -> SceneError {
    SceneError::Limit {
        path: path.into(),
        place,
        problem: error.to_string(),
        remedy: "scale the picture down, or allow more pixels for each picture",
    }
}

/// Converts an error of reading a picture file, for a warning.
pub(crate) fn unreadable(error: &SceneError) -> PictureError {
    PictureError::UnreadableFile(match error {
        SceneError::Read { path, source, .. } => format!("cannot read `{}` ({source})", printable_path(path)),
        error => error.to_string(),
    })
}
