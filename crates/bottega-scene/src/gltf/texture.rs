//! Textures: images, samplers and transformations. glTF 2.0, section 3.8.

use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::{Affine2, Mat2, Vec2};
use rayon::prelude::*;

use super::accessor::{find, view_bytes};
use super::document;
use super::source::GltfSource;
use super::uri::{Reference, resolve};
use crate::error::{SceneError, Warnings};
use crate::image::Image;
use crate::image::decode::{DecodedImage, PictureHeader};
use crate::image::error::PictureError;
use crate::image::pictures::{too_large, unreadable};
use crate::image::pyramid::Encoding;
use crate::material::Material;
use crate::surface::Surface;
use crate::text::shortened;
use crate::texture::{ImageId, TextureMap, Wrap};

/// The use of a picture. A picture with several uses is decoded once and stored once per use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Use {
    /// Colours encoded as sRGB.
    Color,
    /// Linear numbers, such as roughness or normals.
    Data,
    /// Roughness, 1 − factor × glossiness, from the alpha channel of KHR_materials_pbrSpecularGlossiness.
    RoughnessOfGlossiness { factor_bits: u32 },
}

/// The pictures that materials use, loaded together at the end.
pub(super) struct Textures<'a> {
    source: &'a GltfSource<'a>,
    /// Index of the image in the document (`None`: the replacement of a missing one) and its use.
    wanted: Vec<(Option<usize>, Use)>,
    id_of: BTreeMap<(Option<usize>, Use), ImageId>,
    /// For each image of the document, the first one with the same source.
    first: Vec<usize>,
}

impl<'a> Textures<'a> {
    /// Makes an empty collection.
    pub(super) fn new(source: &'a GltfSource<'a>) -> Self {
        // Some exporters write an image for each use of a file.
        let mut known = BTreeMap::new();
        let images = source.document.images.iter().enumerate();
        let first = images.map(|(index, image)| match (&image.uri, image.buffer_view) {
            (None, None) => index,
            key => *known.entry((key, &image.mime_type)).or_insert(index),
        });
        Self { source, wanted: Vec::new(), id_of: BTreeMap::new(), first: first.collect() }
    }

    /// Resolves a reference to a texture, and requests its picture.
    pub(super) fn map(
        &mut self,
        place: &str,
        info: &document::TextureInfo,
        picture: Use,
        warnings: &mut Warnings,
    ) -> Result<TextureMap, SceneError> {
        let document = self.source.document;
        let invalid = |problem| self.source.invalid(place, problem);
        let texture = find("texture", &document.textures, info.index).map_err(invalid)?;
        let default = document::Sampler::default();
        let sampler = match texture.sampler {
            None => &default,
            Some(index) => find("sampler", &document.samplers, index).map_err(invalid)?,
        };
        if let Some(image) = texture.picture() {
            find("image", &document.images, image).map_err(invalid)?;
        } else {
            let message =
                format!("texture {} has no picture in a format that can be read; {REPLACES_MISSING}", info.index);
            warnings.unsupported(place, message);
        }
        let transform = info.extensions.transform.as_deref();
        let uv_set = transform.and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord);
        if uv_set > 1 {
            warnings
                .unsupported(place, format!("only two sets of texture coordinates are kept; set 0 replaces {uv_set}"));
        }
        Ok(TextureMap {
            image: self.id(texture.picture().map(|image| self.first[image]), picture),
            uv_set: if uv_set == 1 { 1 } else { 0 },
            picture_from_uv: transform.map_or(Affine2::IDENTITY, picture_from_uv),
            wrap_u: wrap(sampler.wrap_s),
            wrap_v: wrap(sampler.wrap_t),
            smooth: sampler.mag_filter != Some(9728),
        })
    }

    fn id(&mut self, image: Option<usize>, picture: Use) -> ImageId {
        *self.id_of.entry((image, picture)).or_insert_with(|| {
            self.wanted.push((image, picture));
            ImageId(self.wanted.len() as u32 - 1)
        })
    }

    /// Decodes all requested pictures, after all limits are checked.
    pub(super) fn load(self, warnings: &mut Warnings) -> Result<LoadedImages, SceneError> {
        // Group the uses of each picture, in document order.
        let mut uses: BTreeMap<usize, Vec<(Use, usize)>> = BTreeMap::new();
        for (number, &(image, picture)) in self.wanted.iter().enumerate() {
            if let Some(image) = image {
                uses.entry(image).or_default().push((picture, number));
            }
        }
        let source = self.source;
        let mut headers = Vec::with_capacity(uses.len());
        for (&index, uses) in &uses {
            headers.push((index, uses, check(source, index, uses.len())?));
        }
        let loaded: Vec<_> = headers
            .into_par_iter()
            .map(|(index, uses, header)| {
                let loaded = header.and_then(|header| load_picture(source, index, header, uses));
                (index, uses, loaded)
            })
            .collect();

        let mut images: Vec<Option<Image>> = vec![None; self.wanted.len()];
        for (index, uses, loaded) in loaded {
            match loaded {
                Ok((loaded, notes)) => {
                    for note in notes {
                        let picture = format!("the picture `{}`: {note}", name(source, index));
                        warnings.add(format!("images[{index}]"), picture);
                    }
                    for ((_, number), image) in uses.iter().zip(loaded) {
                        images[*number] = Some(image);
                    }
                }
                Err(problem) => {
                    warnings.unsupported(format!("images[{index}]"), format!("{problem}; {REPLACES_MISSING}"));
                }
            }
        }
        let is_missing = images.iter().map(Option::is_none).collect();
        let finish = |(image, (index, picture)): (Option<Image>, &(Option<usize>, Use))| {
            let name = || index.map_or_else(|| "no picture".into(), |index| name(source, index));
            image.unwrap_or_else(|| match picture {
                Use::Color => Image::missing(name()),
                // White, so that only the numeric factors have an effect.
                Use::Data | Use::RoughnessOfGlossiness { .. } => Image::from_gray8(name(), 1, 1, vec![255], false),
            })
        };
        let images = images.into_iter().zip(&self.wanted).map(finish).collect();
        Ok(LoadedImages { images, is_missing })
    }
}

const REPLACES_MISSING: &str = "magenta replaces its colours, 1 its numbers, a flat surface its normals";

/// The pictures of a scene.
pub(super) struct LoadedImages {
    pub(super) images: Vec<Image>,
    /// For each picture, true if it is a replacement of an unreadable one.
    is_missing: Vec<bool>,
}

impl LoadedImages {
    /// Removes unreadable normal and direction maps, whose replacement bends the surface.
    pub(super) fn remove_missing_directions(&self, materials: &mut [Material]) {
        let is_there = |map: &TextureMap| !self.is_missing[map.image.0 as usize];
        for material in materials {
            material.relief = material.relief.take().filter(|relief| relief.texture().is_none_or(is_there));
            if let Surface::Layered(layered) = &mut material.surface {
                layered.coat_normal = layered.coat_normal.take().filter(|(map, _)| is_there(map));
                if let Some(anisotropy) = &mut layered.anisotropy {
                    anisotropy.texture = anisotropy.texture.take().filter(is_there);
                }
            }
        }
    }
}

fn wrap(code: Option<u64>) -> Wrap {
    match code {
        Some(33071) => Wrap::Clamp,
        Some(33648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}

/// Converts KHR_texture_transform: translation × rotation × scale. Angles are counter-clockwise in a picture whose v
/// points down, hence the sign.
fn picture_from_uv(transform: &document::TextureTransform) -> Affine2 {
    let (sin, cos) = f64::from(transform.rotation).sin_cos();
    let (sin, cos) = (sin as f32, cos as f32);
    let [scale_u, scale_v] = transform.scale.unwrap_or([1.0; 2]);
    let map = Affine2 {
        matrix2: Mat2::from_cols(Vec2::new(cos, -sin) * scale_u, Vec2::new(sin, cos) * scale_v),
        translation: Vec2::from_array(transform.offset),
    };
    if map.is_finite() { map } else { Affine2::IDENTITY }
}

/// Returns the name of a picture, for messages.
fn name(source: &GltfSource<'_>, index: usize) -> String {
    let image = &source.document.images[index];
    match &image.uri {
        Some(uri) if !uri.starts_with("data:") => shortened(uri).into_owned(),
        _ if !image.name.is_empty() => shortened(&image.name).into_owned(),
        _ => format!("images[{index}]"),
    }
}

/// The bytes of a picture. The error is only a warning.
type PictureBytes<'a> = Result<Cow<'a, [u8]>, PictureError>;

fn bytes<'a>(source: &GltfSource<'a>, index: usize) -> Result<PictureBytes<'a>, SceneError> {
    let image = &source.document.images[index];
    let place = || format!("images[{index}]");
    if let Some(view) = image.buffer_view {
        let view = view_bytes(source.document, source.bytes, view);
        let (bytes, _) = view.map_err(|problem| source.invalid(place(), problem))?;
        return Ok(Ok(Cow::Borrowed(bytes)));
    }
    let Some(uri) = &image.uri else { return Ok(Err(PictureError::NoSource)) };
    match resolve(uri).map_err(|bad| bad.error(source.path, place(), uri))? {
        Reference::Data(bytes) => Ok(Ok(Cow::Owned(bytes))),
        Reference::File(file) => {
            let location = source.resources.locate(&file, &place())?;
            Ok(source.resources.read(&location).map(Cow::Owned).map_err(|error| unreadable(&error)))
        }
    }
}

/// Reads the header of a picture and books the memory of its uses. The inner error is only a warning.
fn check(
    source: &GltfSource<'_>,
    index: usize,
    uses: usize,
) -> Result<Result<PictureHeader, PictureError>, SceneError> {
    let place = format!("images[{index}]");
    let bytes = match bytes(source, index)? {
        Ok(bytes) => bytes,
        Err(problem) => return Ok(Err(problem)),
    };
    match PictureHeader::read(&bytes, source.options.max_image_pixels) {
        Ok(header) => {
            source.budget.take(source.path, &place, header.memory_bytes().saturating_mul(uses))?;
            Ok(Ok(header))
        }
        Err(error @ PictureError::TooManyPixels { .. }) => Err(too_large(source.path, place, &error)),
        Err(error) => Ok(Err(error)),
    }
}

/// Decodes a picture, once per use. Also returns notes for warnings.
fn load_picture(
    source: &GltfSource<'_>,
    index: usize,
    header: PictureHeader,
    uses: &[(Use, usize)],
) -> Result<(Vec<Image>, Vec<String>), PictureError> {
    let bytes = bytes(source, index).map_err(|error| PictureError::UnreadableFile(error.to_string()))??;
    let mut decoded = DecodedImage::read(&bytes, header)?;
    drop(bytes);
    let notes = decoded.take_notes();
    let name = name(source, index);
    let mut images = Vec::with_capacity(uses.len());
    let (last, others) = uses.split_last().ok_or(PictureError::NoUse)?;
    for (picture, _) in others {
        images.push(make(decoded.clone(), &name, *picture));
    }
    images.push(make(decoded, &name, last.0));
    Ok((images, notes))
}

fn make(decoded: DecodedImage, name: &str, picture: Use) -> Image {
    match picture {
        Use::Color => decoded.into_image(name, Encoding::Srgb),
        Use::Data => decoded.into_image(name, Encoding::Linear),
        Use::RoughnessOfGlossiness { factor_bits } => {
            let glossiness = f32::from_bits(factor_bits);
            let roughness = |alpha: u8| (255.0 - glossiness * f32::from(alpha) + 0.5) as u8;
            let (width, height, alpha) = decoded.into_alpha8();
            Image::from_gray8(name, width, height, alpha.into_iter().map(roughness).collect(), false)
        }
    }
}
