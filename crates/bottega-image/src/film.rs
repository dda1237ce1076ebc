//! The whole picture, composed of tiles.

use crate::{Aov, Combine, Layer, LayersError, Layout, Picture, Rect, Tile, picture::luminance};

/// The picture, or the crop window of it, composed of tiles by weighted means.
///
/// It holds the present mean and the sum of weights of every pixel, and nothing else: `4 × (stride + 1)` bytes a pixel,
/// however many tiles were added.
///
/// **Invariant:** where all tiles that were added to a pixel agree on its mean, bit for bit, the film has that mean bit
/// for bit, whatever the weights and the order. Two tiles that differ give the same bits in either order; of three and
/// more the order shows in the last bit, so add them in the order of their zones.
#[derive(Clone, Debug)]
pub struct Film {
    rect: Rect,
    picture_size: (u32, u32),
    layout: Layout,
    /// `[area × (stride + 1)]`. The layout of a tile, but means in place of sums, the standard error of the mean
    /// luminance in place of the sum of squares, and the sum of weights behind the last value.
    values: Vec<f32>,
}

impl Film {
    /// An unpainted film.
    ///
    /// - `rect`: the crop window, or the whole picture, in picture coordinates.
    ///
    /// The whole picture is taken to end where `rect` ends; see [`with_picture_size`](Self::with_picture_size). What is
    /// allocated is [`bytes`](Self::bytes).
    pub fn new(rect: Rect, layout: Layout) -> Self {
        let length = rect.area() as usize * (layout.stride() + 1);
        Self { rect, picture_size: (rect.x1, rect.y1), layout, values: vec![0.0; length] }
    }

    /// The memory that a film takes: to be checked before a picture of a user's size is begun.
    pub fn bytes(rect: Rect, layout: &Layout) -> u64 {
        rect.area().saturating_mul(4 * (layout.stride() as u64 + 1))
    }

    /// Says how large the picture is of which this film is the crop window. Panics when the film does not lie in it.
    #[must_use]
    pub fn with_picture_size(self, width: u32, height: u32) -> Self {
        assert!(Rect::of_size(width, height).encloses(&self.rect), "film outside its picture");
        Self { picture_size: (width, height), ..self }
    }

    /// The pixels that it holds, in picture coordinates.
    pub fn rect(&self) -> Rect {
        self.rect
    }

    /// Width and height of the whole picture.
    pub fn picture_size(&self) -> (u32, u32) {
        self.picture_size
    }

    /// Which values a pixel holds.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Adds each pixel of `tile` that lies in the film, has samples, and for which `weight(x, y)` is greater than 0.
    ///
    /// Panics when the layouts differ.
    pub fn add_tile(&mut self, tile: &Tile, mut weight: impl FnMut(u32, u32) -> f32) {
        assert_eq!(&self.layout, tile.layout(), "tile and film of different layouts");
        let Some(shared) = self.rect.intersection(&tile.rect()) else { return };
        let sums_end = self.layout.sums_end();
        for (x, y) in shared.pixels() {
            let sums = tile.pixel(x, y);
            let weight = weight(x, y);
            if weight > 0.0 && sums[Layout::SAMPLE_COUNT] > 0.0 {
                let (sums, values) = sums.split_at(sums_end);
                let pixel = self.pixel_mut(x, y);
                pick(pixel, values, weight);
                blend(pixel, sums, weight);
            }
        }
    }

    /// All values, `[height × width × (stride + 1)]`: what [`Layout::parts`] names, then the weight of the pixel.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Whether anything was added to the pixel (x, y).
    pub fn is_painted(&self, x: u32, y: u32) -> bool {
        self.weight(x, y) > 0.0
    }

    /// The sum of the weights with which tiles were added to the pixel (x, y).
    pub fn weight(&self, x: u32, y: u32) -> f32 {
        self.pixel(x, y)[self.layout.stride()]
    }

    /// Mean radiance R G B and alpha of the pixel (x, y); 0 where nothing was painted.
    pub fn color(&self, x: u32, y: u32) -> [f32; 4] {
        let pixel = self.pixel(x, y);
        [pixel[0], pixel[1], pixel[2], pixel[Layout::ALPHA]]
    }

    /// Mean of an AOV at the pixel (x, y); 0 where nothing was painted, where it is not kept, and in the components
    /// that it does not have. Of [`Aov::SampleCount`] it is the weighted mean over the tiles.
    pub fn aov(&self, aov: Aov, x: u32, y: u32) -> [f32; 3] {
        let mut value = [0.0; 3];
        if let Some(offset) = self.layout.offset(aov) {
            let count = aov.channel_count().max(1);
            value[..count].copy_from_slice(&self.pixel(x, y)[offset..offset + count]);
        }
        value
    }

    /// Variance of the mean luminance of the pixel (x, y); infinite where fewer than two samples were taken.
    ///
    /// Where tiles overlap their samples are taken to be fully correlated, as equal seeds make them: exact for tiles
    /// that share their samples, an upper bound for all others.
    pub fn variance_of_mean(&self, x: u32, y: u32) -> f32 {
        if !self.is_painted(x, y) {
            return f32::INFINITY;
        }
        let standard_error = self.pixel(x, y)[Layout::LUMINANCE_SQUARED];
        standard_error * standard_error
    }

    /// The RGB means, as a picture of the size of [`rect`](Self::rect).
    pub fn to_picture(&self) -> Picture {
        let data = self.values.chunks_exact(self.layout.stride() + 1).map(|p| [p[0], p[1], p[2]]).collect();
        Picture { width: self.rect.width(), height: self.rect.height(), data }
    }

    /// The film with another color, and the one that it had as a layer of this name, unless it has such a layer already.
    /// Panics when the color is of another size.
    ///
    /// # Errors
    /// The film has no room for a further layer.
    pub fn with_color(&self, color: &Picture, kept: &str) -> Result<Self, LayersError> {
        assert_eq!(color.size(), (self.rect.width(), self.rect.height()), "a color of another size");
        let mut layers = self.layout.layers().to_vec();
        let is_new = layers.iter().all(|layer| layer.name != kept);
        if is_new {
            let channels = ["R", "G", "B"].map(str::to_owned).to_vec();
            layers.push(Layer { name: kept.to_owned(), channels, combine: Combine::Mean });
        }
        let layout = Layout::with_layers(self.layout.aovs(), layers)?;
        let place = |layer: &Layer| self.layout.placed_layers().find(|(_, other)| *other == layer).map(|(at, _)| at);
        // Of each layer: where it is, and where it was; that of the color is new.
        let moves: Vec<(usize, usize, usize)> = layout
            .placed_layers()
            .map(|(to, layer)| (to, place(layer).unwrap_or(Layout::COLOR), layer.channels.len()))
            .collect();
        let fixed = Layout::new(self.layout.aovs()).stride();
        let (old, new) = (self.layout.stride() + 1, layout.stride() + 1);
        let mut film = Self { values: vec![0.0; self.rect.area() as usize * new], layout, ..*self };
        let pixels = self.values.chunks_exact(old).zip(film.values.chunks_exact_mut(new));
        for ((from, to), color) in pixels.zip(&color.data) {
            to[..fixed].copy_from_slice(&from[..fixed]);
            moves.iter().for_each(|&(at, was, count)| to[at..at + count].copy_from_slice(&from[was..was + count]));
            to[new - 1] = from[old - 1];
            to[Layout::COLOR..Layout::COLOR + 3].copy_from_slice(color);
        }
        Ok(film)
    }

    /// All values of the pixel (x, y), then its weight: `[stride + 1]`.
    pub(crate) fn pixel(&self, x: u32, y: u32) -> &[f32] {
        let stride = self.layout.stride() + 1;
        let start = self.rect.index(x, y) * stride;
        &self.values[start..start + stride]
    }

    fn pixel_mut(&mut self, x: u32, y: u32) -> &mut [f32] {
        let stride = self.layout.stride() + 1;
        let start = self.rect.index(x, y) * stride;
        &mut self.values[start..start + stride]
    }
}

/// Picks the values of which there is no mean where they weigh more than all that was there, before that is blended: of two
/// tiles that weigh the same those with the larger bits, so that their order does not matter.
fn pick(pixel: &mut [f32], values: &[f32], weight: f32) {
    let (before, means) = pixel.split_last_mut().expect("a pixel has values");
    let start = means.len() - values.len();
    let picked = &mut means[start..];
    let is_larger = || values.iter().map(|value| value.to_bits()).gt(picked.iter().map(|value| value.to_bits()));
    if weight > *before || (weight == *before && is_larger()) {
        picked.copy_from_slice(values);
    }
}

/// Blends the means of one pixel of a tile into `pixel`, the film's values and behind them its weight.
fn blend(pixel: &mut [f32], sums: &[f32], weight: f32) {
    let (total, means) = pixel.split_last_mut().expect("a pixel has values");
    let count = sums[Layout::SAMPLE_COUNT];
    let before = *total;
    let after = before + weight;
    *total = after;
    if before == 0.0 {
        means.iter_mut().zip(sums).for_each(|(mean, &sum)| *mean = sum / count);
        means[Layout::LUMINANCE_SQUARED] = standard_error(sums);
        means[Layout::SAMPLE_COUNT] = count;
        return;
    }
    for (offset, (mean, &sum)) in means.iter_mut().zip(sums).enumerate() {
        let new = match offset {
            Layout::SAMPLE_COUNT => count,
            Layout::LUMINANCE_SQUARED => standard_error(sums),
            _ => sum / count,
        };
        if mean.to_bits() != new.to_bits() {
            *mean = (*mean * before + new * weight) / after;
        }
    }
}

/// Standard error of the mean luminance; infinite for fewer than two samples.
fn standard_error(sums: &[f32]) -> f32 {
    let count = f64::from(sums[Layout::SAMPLE_COUNT]);
    if count < 2.0 {
        return f32::INFINITY;
    }
    let mean = f64::from(luminance([sums[0], sums[1], sums[2]])) / count;
    let mean_of_squares = f64::from(sums[Layout::LUMINANCE_SQUARED]) / count;
    ((mean_of_squares - mean * mean).max(0.0) / (count - 1.0)).sqrt() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AovSet, SampleValues};
    use proptest::prelude::*;

    fn gray(value: f32) -> SampleValues {
        SampleValues { radiance: [value; 3], alpha: 1.0, depth: 2.0 * value, cost: 1.0, ..Default::default() }
    }

    fn all_aovs() -> Layout {
        Layout::new(Aov::ALL.into_iter().collect())
    }

    fn tile_of(rect: Rect, layout: Layout, samples: &[f32]) -> Tile {
        let mut tile = Tile::new(rect, layout);
        for (x, y) in rect.pixels() {
            samples.iter().for_each(|&value| tile.add(x, y, &gray(value)));
        }
        tile
    }

    #[test]
    fn an_unpainted_pixel_is_black_and_of_unknown_variance() {
        let film = Film::new(Rect::of_size(2, 2), all_aovs());
        assert_eq!(film.color(1, 1), [0.0; 4]);
        assert!(!film.is_painted(1, 1));
        assert_eq!(film.variance_of_mean(1, 1), f32::INFINITY);
    }

    #[test]
    fn a_tile_reaches_only_the_pixels_that_both_hold_and_that_have_weight() {
        let mut film = Film::new(Rect::new(2, 2, 6, 6), all_aovs());
        film.add_tile(&tile_of(Rect::new(0, 0, 4, 4), all_aovs(), &[1.0, 3.0]), |x, _| if x == 2 { 0.0 } else { 1.0 });
        assert!(!film.is_painted(2, 3));
        assert_eq!(film.color(3, 3), [2.0, 2.0, 2.0, 1.0]);
        assert!(!film.is_painted(4, 3));
        assert_eq!(film.aov(Aov::Depth, 3, 3), [4.0, 0.0, 0.0]);
        assert_eq!(film.aov(Aov::SampleCount, 3, 3)[0], 2.0);
    }

    #[test]
    fn the_weights_are_those_of_a_weighted_mean() {
        let rect = Rect::of_size(1, 1);
        let mut film = Film::new(rect, all_aovs());
        film.add_tile(&tile_of(rect, all_aovs(), &[1.0, 1.0]), |_, _| 0.25);
        film.add_tile(&tile_of(rect, all_aovs(), &[5.0, 5.0]), |_, _| 0.75);
        assert_eq!(film.color(0, 0), [4.0, 4.0, 4.0, 1.0]);
    }

    #[test]
    fn the_variance_of_the_mean_is_that_of_the_samples_over_their_number() {
        let rect = Rect::of_size(1, 1);
        let mut film = Film::new(rect, Layout::new(AovSet::NONE));
        film.add_tile(&tile_of(rect, Layout::new(AovSet::NONE), &[1.0, 2.0, 3.0, 6.0]), |_, _| 1.0);
        // Deviations from 3: 4 + 1 + 0 + 9 = 14; sample variance 14/3; of the mean 14/12.
        assert!((film.variance_of_mean(0, 0) - 14.0 / 12.0).abs() < 1e-5);
    }

    #[test]
    fn of_a_layer_without_a_mean_the_value_that_weighs_most_is_kept() {
        let layer = Layer { name: "id".to_owned(), channels: vec!["Y".to_owned()], combine: Combine::Pick };
        let layout = Layout::with_layers(AovSet::NONE, vec![layer]).unwrap();
        let rect = Rect::of_size(1, 1);
        let tile = |id: f32| {
            let mut tile = tile_of(rect, layout.clone(), &[id, id]);
            tile.sums_mut()[layout.sums_end()] = id;
            tile
        };
        let composed = |tiles: &[(f32, f32)]| {
            let mut film = Film::new(rect, layout.clone());
            tiles.iter().for_each(|&(id, weight)| film.add_tile(&tile(id), |_, _| weight));
            (film.color(0, 0)[0], film.pixel(0, 0)[layout.sums_end()])
        };
        assert_eq!(composed(&[(3.0, 1.0)]), (3.0, 3.0));
        assert_eq!(composed(&[(3.0, 0.25), (7.0, 0.75)]), (6.0, 7.0));
        assert_eq!(composed(&[(3.0, 0.75), (7.0, 0.25)]), (4.0, 3.0));
        assert_eq!(composed(&[(3.0, 0.5), (7.0, 0.5)]), composed(&[(7.0, 0.5), (3.0, 0.5)]));
    }

    #[test]
    fn a_new_color_leaves_the_old_one_as_a_layer() {
        let layer = |name: &str, combine| Layer { name: name.to_owned(), channels: vec!["Y".to_owned()], combine };
        let layers = vec![layer("z", Combine::Mean), layer("a", Combine::Pick)];
        let layout = Layout::with_layers(AovSet::NONE.with(Aov::Depth), layers).unwrap();
        let rect = Rect::of_size(2, 1);
        let mut tile = tile_of(rect, layout.clone(), &[3.0]);
        for ((offset, layer), value) in layout.placed_layers().zip([5.0, 9.0]) {
            assert_eq!(layer.combine == Combine::Pick, value == 9.0);
            tile.sums_mut().chunks_exact_mut(layout.stride()).for_each(|pixel| pixel[offset] = value);
        }
        let mut film = Film::new(rect, layout);
        film.add_tile(&tile, |_, _| 0.5);
        let new = film.with_color(&Picture::from_fn(2, 1, |x, _| [x as f32; 3]), "noisy").unwrap();
        assert_eq!((new.color(1, 0), new.aov(Aov::Depth, 1, 0)[0], new.weight(1, 0)), ([1.0; 4], 6.0, 0.5));
        let values: Vec<(&str, f32)> =
            new.layout().placed_layers().map(|(at, layer)| (layer.name.as_str(), new.pixel(1, 0)[at])).collect();
        assert_eq!(values, [("noisy", 3.0), ("z", 5.0), ("a", 9.0)]);
        let again = new.with_color(&Picture::new(2, 1), "noisy").unwrap();
        assert_eq!(again.layout(), new.layout());
        assert_eq!(again.pixel(1, 0)[new.layout().placed_layers().next().unwrap().0], 3.0);
    }

    proptest! {
        #[test]
        fn one_tile_of_weight_one_keeps_its_bits(samples in prop::collection::vec(-1e6f32..1e6, 1..20)) {
            let rect = Rect::of_size(1, 1);
            let tile = tile_of(rect, all_aovs(), &samples);
            let mut film = Film::new(rect, all_aovs());
            film.add_tile(&tile, |_, _| 1.0);
            let expected = tile.pixel(0, 0)[0] / samples.len() as f32;
            prop_assert_eq!(film.color(0, 0)[0].to_bits(), expected.to_bits());
            prop_assert_eq!(film.to_picture().data[0][0].to_bits(), expected.to_bits());
        }

        #[test]
        fn tiles_that_agree_keep_their_bits_under_any_weights(
            samples in prop::collection::vec(-1e6f32..1e6, 1..20),
            weights in prop::collection::vec(1e-6f32..1.0, 1..5),
        ) {
            let rect = Rect::of_size(1, 1);
            let tile = tile_of(rect, all_aovs(), &samples);
            let mut once = Film::new(rect, all_aovs());
            once.add_tile(&tile, |_, _| 1.0);
            let mut often = Film::new(rect, all_aovs());
            weights.iter().for_each(|&weight| often.add_tile(&tile, |_, _| weight));
            let stride = all_aovs().stride();
            prop_assert_eq!(&once.pixel(0, 0)[..stride], &often.pixel(0, 0)[..stride]);
        }

        #[test]
        fn two_tiles_blend_to_the_same_bits_in_either_order(a in -1e3f32..1e3, b in -1e3f32..1e3, w in 0.001f32..0.999) {
            let rect = Rect::of_size(1, 1);
            let compose = |tiles: [(f32, f32); 2]| {
                let mut film = Film::new(rect, all_aovs());
                for (value, weight) in tiles {
                    film.add_tile(&tile_of(rect, all_aovs(), &[value]), |_, _| weight);
                }
                film.color(0, 0).map(f32::to_bits)
            };
            prop_assert_eq!(compose([(a, w), (b, 1.0 - w)]), compose([(b, 1.0 - w), (a, w)]));
        }
    }
}
