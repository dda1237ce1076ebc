//! Layers of an OpenEXR file beside its color, each as a picture.

use std::{io::Cursor, path::Path};

use crate::{
    Aov, Canvas, ColorMap, ExrOptions, ImageError, Metadata, Picture, Rect, ToneMap,
    exr_read::{self, WantedChannels},
    exr_write::picture_exr_bytes,
    limits::ReadLimits,
    source::{PictureSource, guarded},
};

/// Channels of the color if they have no layer.
const OF_COLOR: [&str; 7] = ["R", "G", "B", "A", "X", "Y", "Z"];
/// The order of channels within a layer.
const ORDER: &str = "RGBXYZ";
/// Quantile of a number layer that gets the brightest color; larger values share it.
const WHITE_SHARE: f64 = 0.999;

/// The kind of a layer's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerKind {
    /// Light or reflectance: red, green and blue.
    Color,
    /// A direction: x, y and z, in [−1, 1].
    Direction,
    /// A vector in the picture, in pixels to the right and up.
    Vector,
    /// A single number.
    Number,
    /// Ranks of a Cryptomatte: identity and coverage of one part, then of another.
    Matte,
}

/// A layer of an OpenEXR file: its name, kind and channels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileLayer {
    /// Name, such as `albedo`.
    pub name: String,
    /// Kind of the layer's values.
    pub kind: LayerKind,
    /// Full names of its channels.
    channels: Vec<String>,
}

/// A layer with its pixels.
#[derive(Clone, Debug)]
pub struct LayerPicture {
    /// The layer and its channels.
    pub layer: FileLayer,
    /// The values of the layer; a single channel is repeated in all three.
    pub picture: Picture,
}

/// The channels of a layer, one after the other.
#[derive(Clone, Debug)]
pub struct LayerPlanes {
    /// The values of each channel, row by row from the top.
    pub planes: Vec<Vec<f32>>,
    /// Width and height in pixels.
    pub size: [u32; 2],
}

impl FileLayer {
    /// Lists the layers of an OpenEXR file, sorted by name, without its color. Files of other formats have none.
    ///
    /// - `name`: file name, for errors.
    /// - `bytes`: the whole file.
    ///
    /// # Errors
    ///
    /// The file is not a valid OpenEXR file, or uses an unsupported feature.
    pub fn all(name: impl AsRef<Path>, bytes: &[u8]) -> Result<Vec<Self>, ImageError> {
        if !bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            return Ok(Vec::new());
        }
        let source = PictureSource::new(name.as_ref(), ReadLimits::default());
        let channels = guarded(&source, "EXR", || exr_read::channel_names(&source, Cursor::new(bytes)))?;
        Ok(layers_of(&channels))
    }

    /// Reads the layer from its file for display: at most three channels; one of a [`LayerKind::Number`].
    ///
    /// - `name`: file name, for errors.
    /// - `bytes`: the whole file.
    ///
    /// # Errors
    ///
    /// The file is damaged, has no color or no such layer, uses an unsupported feature, or exceeds [`ReadLimits::default`].
    pub fn read(&self, name: impl AsRef<Path>, bytes: &[u8]) -> Result<LayerPicture, ImageError> {
        let most = match self.kind {
            LayerKind::Number => 1,
            LayerKind::Vector => 2,
            LayerKind::Color | LayerKind::Direction | LayerKind::Matte => 3,
        };
        let LayerPlanes { planes, size: [width, height] } = self.read_channels(name, bytes, most)?;
        let value = |channel: usize, pixel: usize| match (planes.get(channel), self.kind) {
            (Some(plane), _) => plane[pixel],
            (None, LayerKind::Number) => planes[0][pixel],
            (None, _) => 0.0,
        };
        let count = width as usize * height as usize;
        let data = (0..count).map(|pixel| [0, 1, 2].map(|channel| value(channel, pixel))).collect();
        Ok(LayerPicture { layer: self.clone(), picture: Picture { width, height, data } })
    }

    /// Reads all channels of the layer from its file; parameters as for [`Self::read`].
    ///
    /// # Errors
    ///
    /// As for [`Self::read`].
    pub fn read_planes(&self, name: impl AsRef<Path>, bytes: &[u8]) -> Result<LayerPlanes, ImageError> {
        self.read_channels(name, bytes, self.channels.len())
    }

    fn read_channels(&self, name: impl AsRef<Path>, bytes: &[u8], most: usize) -> Result<LayerPlanes, ImageError> {
        let source = PictureSource::new(name.as_ref(), ReadLimits::default());
        let names = &self.channels[..most.min(self.channels.len())];
        let wanted = WantedChannels { names, alpha: false };
        let read = guarded(&source, "EXR", || exr_read::read(&source, Cursor::new(bytes), wanted))?;
        let planes: Option<Vec<Vec<f32>>> = read.planes.into_iter().collect();
        let mut planes = planes.ok_or_else(|| source.malformed("EXR", format!("it has no layer `{}`", self.name)))?;
        // Light and reflectance have the color space of the picture, a share of light has none
        let is_plain = read.conversion.is_none() || self.name == Aov::ShadowCatcher.file_name();
        if let (LayerKind::Color, false, [red, green, blue]) = (self.kind, is_plain, &mut planes[..]) {
            for ((red, green), blue) in red.iter_mut().zip(green).zip(blue) {
                let mut color = [[*red, *green, *blue]];
                read.conversion.apply(&mut color);
                [[*red, *green, *blue]] = color;
            }
        }
        let Picture { width, height, .. } = read.file.picture;
        Ok(LayerPlanes { planes, size: [width, height] })
    }
}

/// Groups channels into layers.
fn layers_of(channels: &[String]) -> Vec<FileLayer> {
    let mut layers: Vec<FileLayer> = Vec::new();
    for full in channels {
        let (layer, channel) = full.rsplit_once('.').unwrap_or((full, ""));
        if (channel.is_empty() && OF_COLOR.contains(&layer)) || (channel == "A" && !is_matte(layer)) {
            continue;
        }
        match layers.iter_mut().find(|known| known.name == layer) {
            Some(known) => known.channels.push(full.clone()),
            None => {
                let (name, channels) = (layer.to_owned(), vec![full.clone()]);
                layers.push(FileLayer { name, kind: LayerKind::Number, channels });
            }
        }
    }
    for layer in &mut layers {
        let place = |full: &String| ORDER.find(full.rsplit('.').next().unwrap_or_default()).unwrap_or(ORDER.len());
        layer.channels.sort_by_key(place);
        if is_matte(&layer.name) {
            layer.kind = LayerKind::Matte;
            continue;
        }
        let is_vector = layer.channels.iter().map(|full| full.rsplit('.').next().unwrap_or_default()).eq(["u", "v"]);
        layer.kind = match layer.channels.iter().map(place).collect::<Vec<_>>()[..] {
            [0, 1, 2] => LayerKind::Color,
            [3, 4, 5] => LayerKind::Direction,
            _ if is_vector => LayerKind::Vector,
            _ => LayerKind::Number,
        };
    }
    layers.sort_by(|a, b| a.name.cmp(&b.name));
    layers
}

/// Returns true for the name of a Cryptomatte's layer, such as `CryptoObject00` or `crypto_object00`.
fn is_matte(name: &str) -> bool {
    let is_numbered = name.len() > 2 && name.chars().rev().take(2).all(|digit| digit.is_ascii_digit());
    is_numbered && name.get(..6).is_some_and(|start| start.eq_ignore_ascii_case("crypto"))
}

/// Returns the display color of a part: one of its own, as bright as its coverage.
fn matte_color([identity, coverage, _]: [f32; 3]) -> [u8; 3] {
    let [red, green, blue, _] = identity.to_bits().wrapping_mul(0x9e37_79b1).to_be_bytes();
    [red, green, blue].map(|value| ((64.0 + 0.75 * f32::from(value)) * coverage.clamp(0.0, 1.0)) as u8)
}

impl LayerPicture {
    /// Returns a picture of the layer for display: colors tone mapped, directions and vectors as colors, numbers in false
    /// colors, the first part of each pixel of a Cryptomatte in a color of its own.
    ///
    /// - `tone`: for colors that may exceed 1.
    pub fn canvas(&self, tone: ToneMap) -> Canvas {
        let Picture { width, height, data } = &self.picture;
        match self.layer.kind {
            LayerKind::Color => {
                let is_bounded = data.iter().flatten().all(|value| (0.0..=1.0).contains(value));
                Canvas::of_picture(&self.picture, 0.0, if is_bounded { ToneMap::Linear } else { tone })
            }
            LayerKind::Direction => {
                let shade = |value: f32| ((0.5 * value + 0.5).clamp(0.0, 1.0) * 255.0).round() as u8;
                Canvas { width: *width, height: *height, pixels: data.iter().map(|it| it.map(shade)).collect() }
            }
            LayerKind::Vector => {
                let longest =
                    white(&data.iter().map(|it| (it[0] * it[0] + it[1] * it[1]).sqrt()).collect::<Vec<_>>()).max(1e-6);
                let shade = |value: f32| ((0.5 * value / longest + 0.5).clamp(0.0, 1.0) * 255.0).round() as u8;
                Canvas { width: *width, height: *height, pixels: data.iter().map(|it| it.map(shade)).collect() }
            }
            LayerKind::Matte => {
                Canvas { width: *width, height: *height, pixels: data.iter().map(|&it| matte_color(it)).collect() }
            }
            LayerKind::Number => {
                let values: Vec<f32> = data.iter().map(|it| it[0]).collect();
                Canvas::heat_map(*width, *height, &values, white(&values), ColorMap::Inferno)
            }
        }
    }

    /// Encodes the layer alone as an OpenEXR file, with the channels `R G B`.
    ///
    /// # Errors
    ///
    /// The layer has no pixels.
    pub fn to_exr(&self) -> Result<Vec<u8>, ImageError> {
        picture_exr_bytes(&self.picture, &Metadata::new(), ExrOptions::default())
    }

    /// Returns the rectangle of all its pixels.
    pub fn rect(&self) -> Rect {
        Rect::of_size(self.picture.width, self.picture.height)
    }
}

/// Returns the value of the brightest color.
fn white(values: &[f32]) -> f32 {
    let mut sound: Vec<f32> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sound.sort_by(f32::total_cmp);
    let place = (sound.len() as f64 * WHITE_SHARE) as usize;
    sound.get(place.min(sound.len().saturating_sub(1))).copied().unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AovSet, Film, Layout, SampleValues, Tile, read_image_bytes, write_exr};

    fn names(channels: &[&str]) -> Vec<(String, LayerKind, usize)> {
        let channels: Vec<String> = channels.iter().map(|&name| name.to_owned()).collect();
        layers_of(&channels).into_iter().map(|it| (it.name, it.kind, it.channels.len())).collect()
    }

    #[test]
    fn channels_are_taken_together_by_layers() {
        let found = names(&[
            "A",
            "B",
            "CryptoObject00.A",
            "CryptoObject00.B",
            "CryptoObject00.G",
            "CryptoObject00.R",
            "G",
            "R",
            "albedo.B",
            "albedo.G",
            "albedo.R",
            "cost",
            "depth.Z",
            "forward.u",
            "forward.v",
            "n.A",
            "n.X",
            "n.Y",
            "n.Z",
        ]);
        let of = |name: &str, kind, count| (name.to_owned(), kind, count);
        let wanted = [
            of("CryptoObject00", LayerKind::Matte, 4),
            of("albedo", LayerKind::Color, 3),
            of("cost", LayerKind::Number, 1),
            of("depth", LayerKind::Number, 1),
            of("forward", LayerKind::Vector, 2),
            of("n", LayerKind::Direction, 3),
        ];
        assert_eq!(found, wanted);
    }

    #[test]
    fn a_layer_of_a_film_is_read_shown_and_written() {
        let rect = Rect::of_size(2, 1);
        let layout = Layout::new(AovSet::NONE.with(Aov::Albedo).with(Aov::Depth));
        let mut tile = Tile::new(rect, layout.clone());
        for (x, albedo) in [(0, [0.2, 0.4, 0.6]), (1, [0.0, 1.0, 0.5])] {
            tile.add(x, 0, &SampleValues { albedo, depth: 1.0 + x as f32, ..SampleValues::default() });
        }
        let mut film = Film::new(rect, layout);
        film.add_tile(&tile, |_, _| 1.0);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.exr");
        write_exr(&path, &film, &Metadata::new(), ExrOptions::default()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let layers = FileLayer::all("p.exr", &bytes).unwrap();
        assert_eq!(layers.iter().map(|it| &*it.name).collect::<Vec<_>>(), ["albedo", "depth"]);
        let albedo = layers[0].read("p.exr", &bytes).unwrap();
        assert_eq!(albedo.picture.data, [[0.2, 0.4, 0.6], [0.0, 1.0, 0.5]]);
        let depth = layers[1].read("p.exr", &bytes).unwrap();
        assert_eq!((depth.picture.data[1], depth.rect()), ([2.0; 3], rect));
        let shown = depth.canvas(ToneMap::Agx).pixels;
        assert!(shown[0] != shown[1], "{shown:?}");
        let again = read_image_bytes("albedo.exr", &albedo.to_exr().unwrap(), ReadLimits::default()).unwrap();
        assert_eq!(again.picture.data, albedo.picture.data);
        assert!(FileLayer::all("a.png", b"\x89PNG").unwrap().is_empty());
        assert!(FileLayer::all("a.exr", &bytes[..200]).is_err());
    }
}
