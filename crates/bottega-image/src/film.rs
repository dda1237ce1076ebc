//! The film: the whole picture, composed of tiles.

use std::ops::Range;

use crate::{
    Aov, Combine, Layer, LayersError, Layout, Picture, Rect, Tile,
    matte::{self, Blend},
    picture::luminance,
};

/// The picture, or its crop window, composed of tiles by weighted means.
///
/// The film holds only the current mean and the sum of weights of every pixel: `4 × (stride + 1)` bytes per pixel, however
/// many tiles were added.
///
/// **Invariant:** if all tiles added to a pixel agree on its mean, bit for bit, the film has that mean bit for bit,
/// whatever the weights and the order. Two different tiles give the same bits in either order; with three or more the
/// order affects the last bit, so add them in the order of their zones.
#[derive(Clone, Debug)]
pub struct Film {
    rect: Rect,
    picture_size: (u32, u32),
    layout: Layout,
    /// Values, `[area × (stride + 1)]`. The layout of a tile, with means instead of sums, the standard error of the
    /// mean luminance instead of the sum of squares, and the sum of weights as the last value.
    values: Vec<f32>,
}

impl Film {
    /// Returns an empty film.
    ///
    /// - `rect`: the crop window, or the whole picture, in picture coordinates.
    ///
    /// The whole picture ends where `rect` ends; change that by [`with_picture_size`](Self::with_picture_size).
    /// Allocates [`bytes`](Self::bytes).
    pub fn new(rect: Rect, layout: Layout) -> Self {
        let length = rect.area() as usize * (layout.stride() + 1);
        Self { rect, picture_size: (rect.x1, rect.y1), layout, values: vec![0.0; length] }
    }

    /// Returns the memory of a film, in bytes: check it before starting a picture of a user's size.
    pub fn bytes(rect: Rect, layout: &Layout) -> u64 {
        rect.area().saturating_mul(4 * (layout.stride() as u64 + 1))
    }

    /// Returns the film as the crop window of a whole picture of this size, in pixels.
    ///
    /// # Panics
    ///
    /// If the film is not inside the picture.
    #[must_use]
    pub fn with_picture_size(self, width: u32, height: u32) -> Self {
        assert!(Rect::of_size(width, height).encloses(&self.rect), "film outside its picture");
        Self { picture_size: (width, height), ..self }
    }

    /// Returns the rectangle of the film's pixels, in picture coordinates.
    pub fn rect(&self) -> Rect {
        self.rect
    }

    /// Returns width and height of the whole picture, in pixels.
    pub fn picture_size(&self) -> (u32, u32) {
        self.picture_size
    }

    /// Returns the layout of a pixel.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Adds each pixel of `tile` that is within the film, has samples, and for which `weight(x, y)` is greater than 0.
    ///
    /// # Panics
    ///
    /// If the layouts differ.
    pub fn add_tile(&mut self, tile: &Tile, mut weight: impl FnMut(u32, u32) -> f32) {
        assert_eq!(&self.layout, tile.layout(), "tile and film of different layouts");
        let Some(shared) = self.rect.intersection(&tile.rect()) else { return };
        let (sums_end, mattes) = (self.layout.sums_end(), self.layout.mattes());
        for (x, y) in shared.pixels() {
            let sums = tile.pixel(x, y);
            let weight = weight(x, y);
            if weight > 0.0 && sums[Layout::SAMPLE_COUNT] > 0.0 {
                let (sums, values) = sums.split_at(sums_end);
                let pixel = self.pixel_mut(x, y);
                pick(pixel, values, weight);
                for ranks in mattes.clone().step_by(matte::FLOATS).map(|start| start..start + matte::FLOATS) {
                    let before = Blend { weight: pixel[pixel.len() - 1], other: weight };
                    matte::blend(&mut pixel[ranks.clone()], &sums[ranks], sums[Layout::SAMPLE_COUNT], before);
                }
                blend(pixel, sums, weight, &mattes);
            }
        }
    }

    /// Replaces the film's pixels in the rectangle of `tile` by those of the tile; pixels without samples become empty.
    ///
    /// # Panics
    ///
    /// If the layouts differ.
    pub fn replace_tile(&mut self, tile: &Tile) {
        if let Some(shared) = self.rect.intersection(&tile.rect()) {
            for (x, y) in shared.pixels() {
                self.pixel_mut(x, y).fill(0.0);
            }
        }
        self.add_tile(tile, |_, _| 1.0);
    }

    /// Returns all values, `[height × width × (stride + 1)]`: those that [`Layout::parts`] names, then the weight of
    /// the pixel.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Returns true if anything was added to pixel (x, y), in picture coordinates. The pixel must be in the film; the
    /// same holds for all other functions of a pixel.
    pub fn is_painted(&self, x: u32, y: u32) -> bool {
        self.weight(x, y) > 0.0
    }

    /// Returns the sum of the weights with which tiles were added to pixel (x, y).
    pub fn weight(&self, x: u32, y: u32) -> f32 {
        self.pixel(x, y)[self.layout.stride()]
    }

    /// Returns mean radiance R G B and alpha of pixel (x, y); 0 if nothing was added.
    pub fn color(&self, x: u32, y: u32) -> [f32; 4] {
        let pixel = self.pixel(x, y);
        [pixel[0], pixel[1], pixel[2], pixel[Layout::ALPHA]]
    }

    /// Returns the mean of an AOV at pixel (x, y); 0 if nothing was added, the AOV is not kept, or it lacks that
    /// component. For [`Aov::SampleCount`], the weighted mean over the tiles; for a Cryptomatte, identity and coverage of
    /// the first rank, and identity of the second.
    pub fn aov(&self, aov: Aov, x: u32, y: u32) -> [f32; 3] {
        let mut value = [0.0; 3];
        if let Some(offset) = self.layout.offset(aov) {
            let count = aov.channel_count().clamp(1, value.len());
            value[..count].copy_from_slice(&self.pixel(x, y)[offset..offset + count]);
        }
        value
    }

    /// Returns the variance of the mean luminance of pixel (x, y); infinite for fewer than two samples.
    ///
    /// Samples of overlapping tiles are assumed fully correlated, as with equal seeds: exact for tiles that share
    /// samples, an upper bound for others.
    pub fn variance_of_mean(&self, x: u32, y: u32) -> f32 {
        if !self.is_painted(x, y) {
            return f32::INFINITY;
        }
        let standard_error = self.pixel(x, y)[Layout::LUMINANCE_SQUARED];
        standard_error * standard_error
    }

    /// Returns the RGB means, as a picture of the size of [`rect`](Self::rect).
    pub fn to_picture(&self) -> Picture {
        let data = self.values.chunks_exact(self.layout.stride() + 1).map(|p| [p[0], p[1], p[2]]).collect();
        Picture { width: self.rect.width(), height: self.rect.height(), data }
    }

    /// Returns the film with another color, and its former color as layer `kept`, unless that layer already exists.
    ///
    /// - `color`: of the size of [`rect`](Self::rect).
    ///
    /// # Errors
    ///
    /// The film has no room for another layer, or `kept` is not a valid name of a layer, or names a kept AOV with such
    /// channels.
    ///
    /// # Panics
    ///
    /// If the color has another size.
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
        // New offset, old offset and channel count of each layer; the new layer comes from the color.
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

    /// Returns the film of a picture whose last tile was added. With [`Aov::ShadowCatcher`], the light on shadow catchers is
    /// divided by the light that they have without the other objects, 1 where they have none; and the alpha of a pixel
    /// grows by what its catchers lack of that light, so that a plate below the picture gets darker there.
    #[must_use]
    pub fn finished(mut self) -> Self {
        let offsets = Aov::CATCHERS.map(|aov| self.layout.offset(aov));
        let [Some(caught), Some(without)] = offsets else { return self };
        for pixel in self.values.chunks_exact_mut(self.layout.stride() + 1) {
            let mut lacking = 0.0;
            for channel in 0..3 {
                let (with, without) = (pixel[caught + channel], pixel[without + channel]);
                let ratio = if without > 0.0 { (with / without).max(0.0) } else { 1.0 };
                pixel[caught + channel] = ratio;
                lacking += (1.0 - ratio) / 3.0;
            }
            pixel[Layout::ALPHA] += pixel[caught + 3] * lacking.clamp(0.0, 1.0);
        }
        self
    }

    /// Returns all values of pixel (x, y), then its weight: `[stride + 1]`.
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

/// Replaces picked values by those of a tile with a greater weight than all before; call it before blending. At equal
/// weight the larger bits win, so the order of two tiles does not matter.
fn pick(pixel: &mut [f32], values: &[f32], weight: f32) {
    let (before, means) = pixel.split_last_mut().expect("a pixel has values");
    let start = means.len() - values.len();
    let picked = &mut means[start..];
    let is_larger = || values.iter().map(|value| value.to_bits()).gt(picked.iter().map(|value| value.to_bits()));
    if weight > *before || (weight == *before && is_larger()) {
        picked.copy_from_slice(values);
    }
}

/// Blends the means of one pixel of a tile into `pixel`, the film's values followed by its weight. Leaves the offsets
/// `mattes` as they are.
fn blend(pixel: &mut [f32], sums: &[f32], weight: f32, mattes: &Range<usize>) {
    let (total, means) = pixel.split_last_mut().expect("a pixel has values");
    let count = sums[Layout::SAMPLE_COUNT];
    let before = *total;
    let after = before + weight;
    *total = after;
    if before == 0.0 {
        for (offset, (mean, &sum)) in means.iter_mut().zip(sums).enumerate() {
            if !mattes.contains(&offset) {
                *mean = sum / count;
            }
        }
        means[Layout::LUMINANCE_SQUARED] = standard_error(sums);
        means[Layout::SAMPLE_COUNT] = count;
        return;
    }
    for (offset, (mean, &sum)) in means.iter_mut().zip(sums).enumerate() {
        let new = match offset {
            Layout::SAMPLE_COUNT => count,
            Layout::LUMINANCE_SQUARED => standard_error(sums),
            _ if mattes.contains(&offset) => continue,
            _ => sum / count,
        };
        if mean.to_bits() != new.to_bits() {
            *mean = (*mean * before + new * weight) / after;
        }
    }
}

/// Returns the standard error of the mean luminance; infinite for fewer than two samples.
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
    fn a_finished_film_has_the_share_of_light_on_catchers_and_shadows_in_alpha() {
        let layout = Layout::new(Aov::CATCHERS.into_iter().collect());
        let (rect, at) = (Rect::of_size(2, 1), layout.offset(Aov::ShadowCatcher).unwrap());
        let mut tile = Tile::new(rect, layout.clone());
        // One of four samples meets an object, two see a catcher in half and in all of its light
        for x in 0..2 {
            (0..4).for_each(|sample| {
                tile.add(x, 0, &SampleValues { alpha: f32::from(sample == 0), ..Default::default() });
            });
        }
        for with in [0.5, 1.0] {
            tile.add_caught(0, 0, &crate::CaughtLight { with: [with, with, with], without: [1.0, 1.0, 0.0] });
        }
        let mut film = Film::new(rect, layout);
        film.add_tile(&tile, |_, _| 1.0);
        let film = film.finished();
        assert_eq!(film.pixel(0, 0)[at..at + 7], [0.75, 0.75, 1.0, 0.5, 0.5, 0.5, 0.0]);
        assert!((film.color(0, 0)[3] - (0.25 + 0.5 * 0.5 / 3.0)).abs() < 1e-6);
        assert_eq!((&film.pixel(1, 0)[at..at + 4], film.color(1, 0)[3]), (&[1.0, 1.0, 1.0, 0.0][..], 0.25));
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
