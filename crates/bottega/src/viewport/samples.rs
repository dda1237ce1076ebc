//! The samples of a look from several processes, merged pixel by pixel.

use bottega_image::{Layout, Rect, Tile};

/// Samples of a look that another process has rendered: their means in a rectangle.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewportSamples {
    /// Number of the look.
    pub look: u64,
    /// The pixels, in coordinates of the picture.
    pub rect: Rect,
    /// Number of samples of each pixel.
    pub samples: u32,
    /// Mean radiance R G B and alpha, `[height × width]`, the upper row first.
    pub means: Vec<[f32; 4]>,
}

/// The sums of the samples of one look.
#[derive(Debug, Default)]
pub(super) struct SamplePool {
    look: u64,
    region: Option<Rect>,
    /// Sums of this process: R G B alpha, number of samples; `[height × width]` of the region.
    own: Vec<[f32; 5]>,
    /// Sums of all other processes, of the same shape.
    others: Vec<[f32; 5]>,
    has_others: bool,
}

impl SamplePool {
    /// Begins with a look, without samples.
    pub(super) fn begin(&mut self, look: u64, region: Rect) {
        let area = region.area() as usize;
        *self = Self {
            look,
            region: Some(region),
            own: vec![[0.0; 5]; area],
            others: vec![[0.0; 5]; area],
            has_others: false,
        };
    }

    /// Takes over the running sums of this process in a rectangle.
    pub(super) fn take_own(&mut self, look: u64, tile: &Tile) {
        let Some(region) = self.region.filter(|_| look == self.look) else { return };
        let Some(shared) = region.intersection(&tile.rect()) else { return };
        for (x, y) in shared.pixels() {
            let sums = tile.pixel(x, y);
            self.own[region.index(x, y)] = [sums[0], sums[1], sums[2], sums[Layout::ALPHA], sums[Layout::SAMPLE_COUNT]];
        }
    }

    /// Adds samples of another process. Returns false for another look, and for pixels outside of the region.
    pub(super) fn add(&mut self, samples: &ViewportSamples) -> bool {
        let Some(region) = self.region.filter(|region| region.encloses(&samples.rect)) else { return false };
        if samples.look != self.look || samples.means.len() as u64 != samples.rect.area() {
            return false;
        }
        let count = samples.samples as f32;
        for ((x, y), mean) in samples.rect.pixels().zip(&samples.means) {
            let sums = &mut self.others[region.index(x, y)];
            sums.iter_mut().zip(mean).for_each(|(sum, mean)| *sum += count * mean);
            sums[4] += count;
        }
        self.has_others = true;
        true
    }

    /// Returns the means of all samples of a look in a rectangle, as sums of one sample per pixel; pixels without samples have none.
    /// `None`: there are no samples of other processes.
    pub(super) fn merged(&self, look: u64, rect: Rect, layout: Layout) -> Option<Tile> {
        let mut tile = (look == self.look && self.has_others).then(|| Tile::new(rect, layout))?;
        self.merge_into(&mut tile);
        Some(tile)
    }

    /// Replaces radiance and alpha of a tile by those of all samples. The number of its samples stays, because it counts other layers
    /// too; pixels without own samples get one.
    pub(super) fn merge_into(&self, tile: &mut Tile) {
        let Some(region) = self.region.filter(|_| self.has_others) else { return };
        let Some(shared) = region.intersection(&tile.rect()) else { return };
        let (rect, stride) = (tile.rect(), tile.layout().stride());
        let sums = tile.sums_mut();
        for (x, y) in shared.pixels() {
            let (own, others) = (&self.own[region.index(x, y)], &self.others[region.index(x, y)]);
            let total = own[4] + others[4];
            if total > 0.0 {
                let pixel = &mut sums[rect.index(x, y) * stride..][..stride];
                let count = pixel[Layout::SAMPLE_COUNT].max(1.0);
                for (channel, place) in [0, 1, 2, Layout::ALPHA].into_iter().enumerate() {
                    pixel[place] = (own[channel] + others[channel]) / total * count;
                }
                pixel[Layout::SAMPLE_COUNT] = count;
            }
        }
    }

    /// Returns the samples from other processes that each pixel has at least.
    pub(super) fn others_min(&self) -> u32 {
        if !self.has_others {
            return 0;
        }
        self.others.iter().map(|sums| sums[4]).fold(f32::INFINITY, f32::min) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bottega_image::{AovSet, SampleValues};

    #[test]
    fn a_merged_pixel_is_the_mean_of_all_samples() {
        let region = Rect::new(1, 0, 3, 1);
        let layout = Layout::new(AovSet::NONE);
        let mut pool = SamplePool::default();
        pool.begin(4, region);
        let mut own = Tile::new(region, layout.clone());
        for radiance in [1.0, 3.0] {
            own.add(1, 0, &SampleValues { radiance: [radiance; 3], alpha: 1.0, ..SampleValues::default() });
        }
        pool.take_own(4, &own);
        let from = |look, rect: Rect, value: f32| ViewportSamples {
            look,
            rect,
            samples: 6,
            means: vec![[value, value, value, 0.5]; rect.area() as usize],
        };
        assert!(!pool.add(&from(3, region, 9.0)), "another look");
        assert!(!pool.add(&from(4, Rect::new(0, 0, 2, 1), 9.0)), "outside of the region");
        assert!(!pool.add(&ViewportSamples { means: Vec::new(), ..from(4, region, 9.0) }), "pixels are missing");
        assert_eq!(pool.others_min(), 0);
        assert!(pool.add(&from(4, Rect::new(1, 0, 2, 1), 4.0)));
        assert_eq!(pool.others_min(), 0, "the second pixel has none");
        assert!(pool.add(&from(4, Rect::new(2, 0, 3, 1), 5.0)));
        assert_eq!(pool.others_min(), 6);
        pool.merge_into(&mut own);
        // (1 + 3 + 6 × 4) / 8 samples, as sums of the two samples of the tile
        assert_eq!(own.pixel(1, 0)[..4], [7.0, 7.0, 7.0, 2.0 * (2.0 + 3.0) / 8.0]);
        assert_eq!(own.pixel(1, 0)[Layout::SAMPLE_COUNT], 2.0);
        assert_eq!(own.pixel(2, 0)[..4], [5.0, 5.0, 5.0, 0.5]);
        assert_eq!(own.pixel(2, 0)[Layout::SAMPLE_COUNT], 1.0, "the tile itself had none");
        assert_eq!(pool.merged(4, region, layout.clone()).unwrap().pixel(2, 0)[..4], [5.0, 5.0, 5.0, 0.5]);
        assert!(pool.merged(5, region, layout).is_none());
    }
}
