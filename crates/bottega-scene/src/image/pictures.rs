//! The pictures that a scene refers to by name: asked for one by one, decoded all at once.

use std::collections::BTreeMap;

use bottega_image::{WhitePoint, printable_path};
use rayon::prelude::*;

use super::{DecodedImage, Encoding, Image, PictureFault, PictureHeader};
use crate::error::Warnings;
use crate::options::LoadOptions;
use crate::resource::{Location, Resources};
use crate::text::shortened;
use crate::{ImageId, SceneError};

/// What a picture is used for. It says what stands for the picture where it is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum PictureUse {
    /// Colours.
    Color,
    /// Numbers that multiply others.
    Number,
    /// Normals of the surface.
    Normals,
}

impl PictureUse {
    /// What stands for a missing picture, in words and as a picture.
    fn stand_in(self, name: &str) -> (&'static str, Image) {
        match self {
            Self::Color => ("magenta", Image::missing(name)),
            Self::Number => ("1", Image::from_gray8(name, 1, 1, vec![255], false)),
            Self::Normals => ("a flat surface", Image::from_linear_rgb(name, 1, 1, vec![[0.5, 0.5, 1.0]])),
        }
    }
}

/// How a picture is read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PictureKind {
    /// What its codes of 8 bits mean.
    pub(crate) encoding: Encoding,
    pub(crate) purpose: PictureUse,
}

impl PictureKind {
    /// Colours, encoded as sRGB.
    pub(crate) const COLORS: Self = Self { encoding: Encoding::Srgb, purpose: PictureUse::Color };
    /// Numbers as they are.
    pub(crate) const NUMBERS: Self = Self { encoding: Encoding::Linear, purpose: PictureUse::Number };
    /// A normal map.
    pub(crate) const NORMALS: Self = Self { encoding: Encoding::Linear, purpose: PictureUse::Normals };
}

/// Pictures in files beside the scene. The same file for the same use is one image, however often it is asked for.
pub(crate) struct Pictures<'a> {
    resources: &'a Resources<'a>,
    pixels_max: u64,
    white_point: WhitePoint,
    wanted: Vec<WantedPicture>,
    id_of: BTreeMap<(Location, bool, PictureChange, PictureUse), ImageId>,
    /// Pictures that are there already: where they go in the list.
    made: Vec<(usize, Image)>,
}

/// What is done to a picture after it is decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum PictureChange {
    None,
    /// Its luminance in all channels.
    Gray,
    /// An edge of black texels around it.
    Framed,
    /// Beside itself turned by half a turn, so that the two repeated go on as an octahedron does.
    Octahedral,
}

/// A picture with an edge of black texels around it.
pub(crate) struct FramedTexture {
    pub(crate) id: ImageId,
    /// Columns and rows without the edge.
    pub(crate) size: (u32, u32),
}

struct WantedPicture {
    location: Location,
    kind: PictureKind,
    change: PictureChange,
    /// Where it was first asked for.
    place: String,
}

impl<'a> Pictures<'a> {
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

    /// Colours of files whose white is another than ours become ours so.
    pub(crate) fn with_white_point(self, white_point: WhitePoint) -> Self {
        Self { white_point, ..self }
    }

    /// Asks for a picture. Its id is its index in what [`load`](Self::load) returns.
    ///
    /// - `reference`: relative to the folder of the scene; see [`Resources::locate`] for what is refused.
    /// - `place`: where the reference stands, for messages.
    pub(crate) fn want(&mut self, reference: &str, kind: PictureKind, place: &str) -> Result<ImageId, SceneError> {
        self.want_in(&[""], reference, kind, place)
    }

    /// The same for a reference that is relative to one of several folders; see [`Resources::locate_in`].
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

    /// Asks for a picture whose place is known; see [`want`](Self::want).
    ///
    /// - `gray`: its luminance (Rec. 709) is wanted in all channels.
    pub(crate) fn want_at(&mut self, location: Location, kind: PictureKind, gray: bool, place: &str) -> ImageId {
        self.want_changed(location, kind, if gray { PictureChange::Gray } else { PictureChange::None }, place)
    }

    /// Asks for a picture with an edge of black texels around it; see [`want`](Self::want). `None`: it cannot be read, and
    /// would be replaced.
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

    /// Asks for one period of what an octahedral picture of a sphere is beyond its edges: itself, and beside and below it
    /// itself turned by half a turn; see [`want`](Self::want).
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

    /// Adds a picture that is in no file.
    pub(crate) fn add(&mut self, image: Image) -> ImageId {
        let id = self.wanted.len() + self.made.len();
        self.made.push((id, image));
        ImageId(id as u32)
    }

    /// Puts another picture in the place of one that was [added](Self::add).
    pub(crate) fn replace(&mut self, id: ImageId, image: Image) {
        if let Some((_, known)) = self.made.iter_mut().find(|(index, _)| *index == id.0 as usize) {
            *known = image;
        }
    }

    /// Decodes all that was asked for, in parallel, after all of their headers have passed the limits. One that cannot be
    /// read is replaced by what its use says, with a warning.
    pub(crate) fn load(self, warnings: &mut Warnings) -> Result<Vec<Image>, SceneError> {
        let checked: Vec<Result<PictureHeader, String>> =
            self.wanted.par_iter().map(|wanted| self.check(wanted)).collect::<Result<_, SceneError>>()?;
        let white_point = self.white_point;
        let decoded: Vec<Result<(Image, Vec<String>), String>> = (self.wanted.par_iter().zip(checked))
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
        let finish = |(wanted, decoded): (&WantedPicture, Result<(Image, Vec<String>), String>)| {
            let name = shortened(&wanted.location.name).into_owned();
            let told = decoded.map(|(image, notes)| {
                for note in notes {
                    warnings.add(wanted.place.as_str(), format!("the picture `{name}`: {note}"));
                }
                image
            });
            told.unwrap_or_else(|problem| {
                let (stand_in, image) = wanted.kind.purpose.stand_in(&name);
                let message = format!("the picture `{name}`: {problem}; {stand_in} stands for it");
                warnings.unsupported(wanted.place.as_str(), message);
                image
            })
        };
        let mut images: Vec<Image> = self.wanted.iter().zip(decoded).map(finish).collect();
        self.made.into_iter().for_each(|(index, image)| images.insert(index, image));
        Ok(images)
    }

    /// Reads the header of a picture and books its memory. The inner error is worth a warning.
    fn check(&self, wanted: &WantedPicture) -> Result<Result<PictureHeader, String>, SceneError> {
        let bytes = match self.resources.read(&wanted.location) {
            Ok(bytes) => bytes,
            Err(error) => return Ok(Err(unreadable(&error))),
        };
        match PictureHeader::read(&bytes, self.pixels_max) {
            Ok(header) => {
                let factor = match wanted.change {
                    PictureChange::None => 1,
                    // What becomes gray is kept as floats.
                    PictureChange::Gray => 12,
                    // A single texel becomes nine, beside itself on the way.
                    PictureChange::Framed => 10,
                    // Four times as many texels, beside itself on the way.
                    PictureChange::Octahedral => 5,
                };
                let bytes = header.memory_bytes().saturating_mul(factor);
                let taken = self.resources.budget().take(wanted.location.path(), "", bytes);
                self.resources.attribute(&wanted.location, taken)?;
                Ok(Ok(header))
            }
            Err(PictureFault::TooLarge { problem }) => {
                self.resources.attribute(&wanted.location, Err(too_large(wanted.location.path(), problem)))
            }
            Err(PictureFault::Unreadable { problem }) => Ok(Err(problem)),
        }
    }
}

/// A picture that exceeds the limit of pixels.
pub(crate) fn too_large(path: &std::path::Path, problem: String) -> SceneError {
    SceneError::Limit {
        path: path.into(),
        place: String::new(),
        problem,
        remedy: "scale the picture down, or allow more pixels for each picture",
    }
}

/// Why a picture's file could not be read, for a warning that the scene goes on without it.
pub(crate) fn unreadable(error: &SceneError) -> String {
    match error {
        SceneError::Read { path, source, .. } => format!("cannot read `{}` ({source})", printable_path(path)),
        error => error.to_string(),
    }
}
