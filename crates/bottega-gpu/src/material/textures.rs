//! Encoding of images and texture maps as words.
//!
//! - First the 256 linear values of the sRGB codes.
//! - An image: an [`ImageRecord`], and a [`LevelRecord`] per level. 8-bit colours take one word per texel, 8-bit gray one byte,
//!   16-bit colours two words, floats one word per channel.
//! - A [`MapRecord`] at a multiple of [`MAP_ALIGNMENT`]. Its place with a [`Channel`] in the lowest bits is its handle.

use bottega_render::flat::Portable as _;
use bottega_scene::{Channel, Image, LevelTexels, Material, Scene, TextureMap, Wrap, linear_of_srgb_codes};

use super::word_buffer::{WordBuffer, finite};
use crate::shared::materials::*;

/// The encoded textures of a scene.
#[derive(Debug)]
pub(super) struct EncodedTextures {
    pub(super) words: WordBuffer,
    /// The place of each of the scene's images; 0: no material uses it.
    images: Vec<usize>,
    /// The columns and rows of each image.
    sizes: Vec<(u32, u32)>,
}

impl EncodedTextures {
    /// Encodes the images that materials and the extra maps use.
    pub(super) fn new(scene: &Scene, extra: &[TextureMap]) -> Self {
        let mut is_used = vec![false; scene.images.len()];
        for map in scene.materials.iter().flat_map(Material::textures).chain(extra) {
            is_used[map.image.0 as usize] = true;
        }
        let mut words = WordBuffer::default();
        words.numbers(linear_of_srgb_codes());
        let mut images = vec![0; scene.images.len()];
        for (image, place) in
            scene.images.iter().zip(&mut images).zip(is_used).filter_map(|(of, used)| used.then_some(of))
        {
            *place = add_image(&mut words, image);
        }
        words.align(MAP_ALIGNMENT as usize);
        Self { words, images, sizes: scene.images.iter().map(Image::size).collect() }
    }

    /// Returns the handle of a map for one channel.
    pub(super) fn scalar(&mut self, map: &TextureMap, channel: Channel) -> u32 {
        self.add_map(map) | channel as u32
    }

    /// Returns the handle of a map for all colour channels.
    pub(super) fn color(&mut self, map: &TextureMap) -> u32 {
        self.add_map(map) | CHANNEL_RGB
    }

    fn add_map(&mut self, map: &TextureMap) -> u32 {
        let (words, image) = (&mut self.words, map.image.0 as usize);
        words.align(MAP_ALIGNMENT as usize);
        let wrap = |wrap: Wrap| match wrap {
            Wrap::Repeat => TEXTURE_WRAP_REPEAT,
            Wrap::Mirror => TEXTURE_WRAP_MIRROR,
            Wrap::Clamp => TEXTURE_WRAP_CLAMP,
        };
        let wraps = wrap(map.wrap_u) << MAP_WRAP_U_SHIFT | wrap(map.wrap_v) << MAP_WRAP_V_SHIFT;
        let uv_set = if map.uv_set & 1 == 1 { MAP_UV_SET } else { 0 };
        let smooth = if map.smooth { MAP_SMOOTH } else { 0 };
        let linear = map.picture_from_uv.matrix2;
        let (width, height) = self.sizes[image];
        let columns = linear.row(0).length_squared() * (width as f32 * width as f32);
        let rows = linear.row(1).length_squared() * (height as f32 * height as f32);
        words.record(&MapRecord {
            image: self.images[image] as u32,
            flags: uv_set | smooth | wraps,
            x_axis: linear.x_axis.map(finite),
            y_axis: linear.y_axis.map(finite),
            offset: map.picture_from_uv.translation.map(finite),
            texels_squared: finite(columns.max(rows)),
        })
    }
}

/// Writes an image and returns the place of its record.
fn add_image(words: &mut WordBuffer, image: &Image) -> usize {
    let record = words.place();
    let count = image.level_count();
    let format = match image.level_texels(0) {
        LevelTexels::Gray8(_) => TEXTURE_GRAY8,
        LevelTexels::Rgb8(_) | LevelTexels::Rgba8(_) => TEXTURE_RGBA8,
        LevelTexels::Rgba16(_) => TEXTURE_RGBA16,
        LevelTexels::Rgb32(_) => TEXTURE_RGB32,
        LevelTexels::Rgba32(_) => TEXTURE_RGBA32,
    };
    let format = format | u32::from(image.is_srgb()) << IMAGE_SRGB_SHIFT;
    let levels =
        words.record(&ImageRecord { format, level_count: count as u32 }) as usize + ImageRecord::WORDS as usize;
    let place_of = |level: usize| levels + LevelRecord::WORDS as usize * level;
    words.fill_to(place_of(count));
    for level in 0..count {
        let (width, height) = image.level_size(level);
        let texels = words.place() as u32;
        words.put(place_of(level), &LevelRecord { texels, width, height });
        add_texels(words, image.level_texels(level));
    }
    record
}

fn add_texels(words: &mut WordBuffer, texels: LevelTexels<'_>) {
    let words = &mut words.0;
    match texels {
        LevelTexels::Gray8(codes) => words.extend(codes.chunks(4).map(|codes| {
            let mut bytes = [0; 4];
            bytes[..codes.len()].copy_from_slice(codes);
            u32::from_le_bytes(bytes)
        })),
        LevelTexels::Rgb8(codes) => words.extend(codes.iter().map(|&[r, g, b]| u32::from_le_bytes([r, g, b, 255]))),
        LevelTexels::Rgba8(codes) => words.extend(codes.iter().map(|&codes| u32::from_le_bytes(codes))),
        LevelTexels::Rgba16(codes) => {
            let pair = |low: u16, high: u16| u32::from(low) | u32::from(high) << 16;
            words.extend(codes.iter().flat_map(|&[r, g, b, a]| [pair(r, g), pair(b, a)]));
        }
        LevelTexels::Rgb32(values) => words.extend(values.iter().flatten().map(|value| value.to_bits())),
        LevelTexels::Rgba32(values) => words.extend(values.iter().flatten().map(|value| value.to_bits())),
    }
}
