//! Tiles: running sums of samples.

use crate::{Aov, Layout, Rect, matte};

/// The values of one sample of a pixel. They must be finite: the sums of [`Tile::add`] keep infinity and NaN.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleValues {
    /// Radiance, linear Rec. 709 RGB.
    pub radiance: [f32; 3],
    /// 1 where a surface covers the sample, 0 where the environment is seen.
    pub alpha: f32,
    /// Reflectance; see [`Aov::Albedo`].
    pub albedo: [f32; 3],
    /// Shading normal; see [`Aov::Normal`].
    pub normal: [f32; 3],
    /// Distance; see [`Aov::Depth`].
    pub depth: f32,
    /// Cost; see [`Aov::Cost`].
    pub cost: f32,
    /// Radiance that scattered once at most; see [`Aov::Direct`]. The rest is [`Aov::Indirect`].
    pub direct: [f32; 3],
}

/// The first surface that a sample meets, or its first scattering in a medium. All zero if there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceValues {
    /// Position; see [`Aov::Position`].
    pub position: [f32; 3],
    /// Geometric normal; see [`Aov::GeometricNormal`].
    pub geometric_normal: [f32; 3],
    /// Texture coordinates; see [`Aov::Uv`].
    pub uv: [f32; 2],
    /// Motion vectors, forward and backward; see [`Aov::Motion`].
    pub motion: [f32; 4],
    /// Cryptomatte identities of object, material and asset, in the order of [`Aov::MATTES`]; 0: none.
    pub identities: [f32; 3],
    /// Weight of the sample by the pixel filter, with mean 1; below 0 where the filter is.
    pub weight: f32,
}

/// The light on a shadow catcher that a sample sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CaughtLight {
    /// Light with all objects; see [`Aov::ShadowCatcher`].
    pub with: [f32; 3],
    /// Light without those that are no catchers; see [`Aov::CatcherLight`].
    pub without: [f32; 3],
}

/// Running sums over the samples of a rectangle of pixels, row-major, [`Layout::stride`] floats per pixel.
///
/// The sums of a pixel are a left fold over its samples in index order. So a tile may pass from one worker to another
/// between samples, and its final sums are bit-identical.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    rect: Rect,
    layout: Layout,
    sums: Vec<f32>,
}

impl Tile {
    /// Returns a tile without samples.
    pub fn new(rect: Rect, layout: Layout) -> Self {
        let sums = vec![0.0; rect.area() as usize * layout.stride()];
        Self { rect, layout, sums }
    }

    /// Returns the rectangle of the tile's pixels, in picture coordinates.
    pub fn rect(&self) -> Rect {
        self.rect
    }

    /// Returns the layout of a pixel.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Returns all sums, `[area × stride]`.
    pub fn sums(&self) -> &[f32] {
        &self.sums
    }

    /// Returns all sums, mutably: for readers of stored tiles.
    pub fn sums_mut(&mut self) -> &mut [f32] {
        &mut self.sums
    }

    /// Returns the sums of pixel (x, y), `[stride]`. The pixel, in picture coordinates, must be in the tile; the same
    /// holds for the functions that add to a pixel.
    pub fn pixel(&self, x: u32, y: u32) -> &[f32] {
        let stride = self.layout.stride();
        let start = self.rect.index(x, y) * stride;
        &self.sums[start..start + stride]
    }

    /// Adds one sample to pixel (x, y).
    pub fn add(&mut self, x: u32, y: u32, values: &SampleValues) {
        let stride = self.layout.stride();
        let start = self.rect.index(x, y) * stride;
        let pixel = &mut self.sums[start..start + stride];
        let [r, g, b] = values.radiance;
        let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
        pixel[Layout::COLOR] += r;
        pixel[Layout::COLOR + 1] += g;
        pixel[Layout::COLOR + 2] += b;
        pixel[Layout::ALPHA] += values.alpha;
        // Clamp the sum, used only for the noise estimate: the square of very bright light may overflow.
        let squares = pixel[Layout::LUMINANCE_SQUARED] + luminance * luminance;
        pixel[Layout::LUMINANCE_SQUARED] = squares.min(f32::MAX);
        pixel[Layout::SAMPLE_COUNT] += 1.0;
        let mut put = |aov: Aov, channels: &[f32]| {
            if let Some(offset) = self.layout.offset(aov) {
                for (sum, value) in pixel[offset..].iter_mut().zip(channels) {
                    *sum += value;
                }
            }
        };
        put(Aov::Albedo, &values.albedo);
        put(Aov::Normal, &values.normal);
        put(Aov::Depth, &[values.depth]);
        put(Aov::Cost, &[values.cost]);
        put(Aov::Direct, &values.direct);
        put(Aov::Indirect, &[0, 1, 2].map(|channel| values.radiance[channel] - values.direct[channel]));
    }

    /// Adds the first surface of a sample to pixel (x, y). Call it beside [`Self::add`], once per sample.
    pub fn add_surface(&mut self, x: u32, y: u32, values: &SurfaceValues) {
        let stride = self.layout.stride();
        let start = self.rect.index(x, y) * stride;
        let pixel = &mut self.sums[start..start + stride];
        let mut put = |aov: Aov, channels: &[f32]| {
            if let Some(offset) = self.layout.offset(aov) {
                for (sum, value) in pixel[offset..].iter_mut().zip(channels) {
                    *sum += value;
                }
            }
        };
        put(Aov::Position, &values.position);
        put(Aov::GeometricNormal, &values.geometric_normal);
        put(Aov::Uv, &values.uv);
        put(Aov::Motion, &values.motion);
        for (aov, identity) in Aov::MATTES.into_iter().zip(values.identities) {
            if let Some(offset) = self.layout.offset(aov) {
                matte::add(&mut pixel[offset..offset + matte::FLOATS], identity, values.weight);
            }
        }
    }

    /// Adds the light on a shadow catcher that a sample sees to pixel (x, y). Call it beside [`Self::add`], once per sample
    /// that sees one.
    pub fn add_caught(&mut self, x: u32, y: u32, light: &CaughtLight) {
        let stride = self.layout.stride();
        let start = self.rect.index(x, y) * stride;
        let pixel = &mut self.sums[start..start + stride];
        let [r, g, b] = light.with;
        for (aov, values) in [(Aov::ShadowCatcher, &[r, g, b, 1.0][..]), (Aov::CatcherLight, &light.without)] {
            if let Some(offset) = self.layout.offset(aov) {
                pixel[offset..].iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
            }
        }
    }

    /// Adds the values of one sample to the averaged layers of pixel (x, y), in their order, beside [`Self::add`].
    pub fn add_layers<'v>(&mut self, x: u32, y: u32, values: impl IntoIterator<Item = &'v f32>) {
        let stride = self.layout.stride();
        let start = self.rect.index(x, y) * stride;
        let range = start + self.layout.mean_layers_start()..start + self.layout.sums_end();
        self.sums[range].iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
    }

    /// Estimates the relative error of the means of this tile: the root of the mean over all pixels and channels of
    /// variance / (mean² + 0.01), the measure of [`rel_mse`](crate::metrics::rel_mse).
    ///
    /// The variance is that between `before`, the same tile with fewer samples, and the samples since. The variance
    /// within a pixel is too high with a low-discrepancy sequence, whose sum converges faster than that of independent
    /// samples. If both parts are negatively correlated, as usual, the estimate is conservative. `None` if no samples
    /// were added, there were none before, or the tiles differ in rectangle or layout.
    pub fn relative_error(&self, before: &Self) -> Option<f64> {
        if self.rect != before.rect || self.layout != before.layout || self.rect.is_empty() {
            return None;
        }
        let stride = self.layout.stride();
        let mut sum = 0.0;
        for (all, first) in self.sums.chunks_exact(stride).zip(before.sums.chunks_exact(stride)) {
            let (count, first_count) = (f64::from(all[Layout::SAMPLE_COUNT]), f64::from(first[Layout::SAMPLE_COUNT]));
            let second_count = count - first_count;
            if first_count < 1.0 || second_count < 1.0 {
                return None;
            }
            for (all, first) in all[..Layout::ALPHA].iter().zip(first) {
                let (all, first) = (f64::from(*all), f64::from(*first));
                let difference = first / first_count - (all - first) / second_count;
                let mean = all / count;
                let variance = difference * difference * first_count * second_count / (count * count);
                sum += variance / (mean * mean + 1e-2);
            }
        }
        Some((sum / (Layout::ALPHA as f64 * self.rect.area() as f64)).sqrt())
    }

    /// Copies the sums of the pixels that both tiles have. Panics if the layouts differ.
    pub fn copy_from(&mut self, other: &Self) {
        assert_eq!(self.layout, other.layout, "tiles of different layouts");
        let Some(shared) = self.rect.intersection(&other.rect) else { return };
        let stride = self.layout.stride();
        let row = shared.width() as usize * stride;
        for y in shared.y0..shared.y1 {
            let to = self.rect.index(shared.x0, y) * stride;
            let from = other.rect.index(shared.x0, y) * stride;
            self.sums[to..to + row].copy_from_slice(&other.sums[from..from + row]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_whose_square_overflows_leaves_finite_sums() {
        let mut tile = Tile::new(Rect::of_size(1, 1), Layout::new(crate::AovSet::NONE));
        for _ in 0..4 {
            tile.add(0, 0, &SampleValues { radiance: [1e25; 3], alpha: 1.0, ..SampleValues::default() });
        }
        assert!(tile.sums().iter().all(|sum| sum.is_finite()), "{:?}", tile.sums());
        assert_eq!(tile.pixel(0, 0)[Layout::COLOR], 4e25);
    }
}
