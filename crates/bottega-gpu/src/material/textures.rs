//! Pictures and how they are laid on surfaces, as words.
//!
//! - First the 256 linear values of the codes of sRGB.
//! - A picture: format (| 256: its codes are sRGB), number of levels, and of each level the place of its texels, columns, rows.
//!   8-bit colours take a word a texel, 8-bit gray a byte, 16-bit ones two words, floats one for each channel.
//! - A map, 16 words at a multiple of 8: place of the picture; flags (1: second set of coordinates, 2: smooth, from bit 2
//!   wrapping along u, from bit 4 along v); the columns of the linear part of the transformation and its translation; the
//!   square of the number of texels along a unit of uv. Its place with a [`Channel`] in the lowest bits is its handle.

use bottega_scene::{Channel, Image, LevelTexels, Material, Scene, TextureMap, Wrap, linear_of_srgb_codes};

use super::words::Words;

/// Marks a handle of all colours.
pub(super) const RGB: u32 = 4;

/// The textures of a scene.
#[derive(Debug)]
pub(super) struct EncodedTextures {
    pub(super) words: Words,
    /// Place of each of the scene's pictures; 0: no material uses it.
    images: Vec<usize>,
    /// Columns and rows of each.
    sizes: Vec<(u32, u32)>,
}

impl EncodedTextures {
    /// The pictures that materials use, and some more.
    pub(super) fn new(scene: &Scene, extra: &[TextureMap]) -> Self {
        let mut is_used = vec![false; scene.images.len()];
        for map in scene.materials.iter().flat_map(Material::textures).chain(extra) {
            is_used[map.image.0 as usize] = true;
        }
        let mut words = Words::default();
        words.numbers(linear_of_srgb_codes());
        let mut images = vec![0; scene.images.len()];
        for (image, place) in
            scene.images.iter().zip(&mut images).zip(is_used).filter_map(|(of, used)| used.then_some(of))
        {
            *place = add_image(&mut words, image);
        }
        words.align(8);
        Self { words, images, sizes: scene.images.iter().map(Image::size).collect() }
    }

    /// The handle of a map for one channel.
    pub(super) fn scalar(&mut self, map: &TextureMap, channel: Channel) -> u32 {
        self.add_map(map) | channel as u32
    }

    /// The handle of a map for all colours.
    pub(super) fn color(&mut self, map: &TextureMap) -> u32 {
        self.add_map(map) | RGB
    }

    fn add_map(&mut self, map: &TextureMap) -> u32 {
        let (words, image) = (&mut self.words, map.image.0 as usize);
        words.align(8);
        let place = words.place();
        words.word(self.images[image] as u32);
        let wrap = |wrap: Wrap| match wrap {
            Wrap::Repeat => 0,
            Wrap::Mirror => 1,
            Wrap::Clamp => 2,
        };
        words.word(
            u32::from(map.uv_set & 1) | u32::from(map.smooth) << 1 | wrap(map.wrap_u) << 2 | wrap(map.wrap_v) << 4,
        );
        let linear = map.picture_from_uv.matrix2;
        words.numbers(&linear.to_cols_array());
        words.numbers(&map.picture_from_uv.translation.to_array());
        let (width, height) = self.sizes[image];
        let columns = linear.row(0).length_squared() * (width as f32 * width as f32);
        let rows = linear.row(1).length_squared() * (height as f32 * height as f32);
        words.number(columns.max(rows));
        words.fill_to(place + 16);
        place as u32
    }
}

/// Returns the place of the picture's record.
fn add_image(words: &mut Words, image: &Image) -> usize {
    let record = words.place();
    let count = image.level_count();
    let format = match image.level_texels(0) {
        LevelTexels::Gray8(_) => 0,
        LevelTexels::Rgb8(_) | LevelTexels::Rgba8(_) => 1,
        LevelTexels::Rgba16(_) => 2,
        LevelTexels::Rgb32(_) => 3,
        LevelTexels::Rgba32(_) => 4,
    };
    words.word(format | u32::from(image.is_srgb()) << 8);
    words.word(count as u32);
    words.fill_to(record + 2 + 3 * count);
    for level in 0..count {
        let (width, height) = image.level_size(level);
        let at = record + 2 + 3 * level;
        let texels = words.place() as u32;
        words.0[at..at + 3].copy_from_slice(&[texels, width, height]);
        add_texels(words, image.level_texels(level));
    }
    record
}

fn add_texels(words: &mut Words, texels: LevelTexels<'_>) {
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
