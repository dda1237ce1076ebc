//! The screen of a viewport: displayable pixels, and linear ones where they are wanted.

use std::sync::atomic::{AtomicU32, Ordering};

use bottega_image::{ImageError, Layout, Picture, Preview, Rect, Tile, ToneMap};

/// The pixels of a viewport. Renderers write while others read.
pub(super) struct ViewportScreen {
    preview: Preview,
    linear: Option<LinearFrame>,
    shows_pixels: bool,
}

/// Linear radiance and alpha of each pixel of a region. Each number is written and read atomically.
struct LinearFrame {
    region: Rect,
    /// Bits of R G B A, `[height × width × 4]`, the upper row first.
    values: Box<[AtomicU32]>,
}

impl ViewportScreen {
    /// Makes a black screen.
    ///
    /// - `shape`: the pixels of displayed frames.
    /// - `linear`: the region of linear frames, in pixels of the picture; `None`: there are none.
    /// - `shows_pixels`: true if `shape` is the region that is rendered; false: it is a coarse picture.
    pub(super) fn new(shape: Rect, (exposure, tone): (f32, ToneMap), linear: Option<Rect>, shows_pixels: bool) -> Self {
        Self { preview: Preview::new(shape, exposure, tone), linear: linear.map(LinearFrame::new), shows_pixels }
    }

    /// Fills the screen from cells, interpolating between their centers.
    ///
    /// - `shape`: the pixels of displayed frames that the cells cover.
    /// - `frame`: the pixels of the picture that they cover.
    pub(super) fn show_coarse(&self, cells: &Picture, shape: Rect, frame: Rect) {
        self.preview.show_coarse(cells, shape);
        if let Some(linear) = &self.linear {
            linear.show_coarse(cells, frame);
        }
    }

    /// Shows denoised colors; alpha stays.
    ///
    /// - `region`: the pixels of the picture that the colors belong to.
    pub(super) fn show_denoised(&self, colors: &Picture, region: Rect) {
        self.preview.show_coarse(colors, region);
        if let Some(linear) = &self.linear {
            for ((x, y), color) in region.pixels().zip(&colors.data) {
                linear.set_color(x, y, *color);
            }
        }
    }

    /// Returns true if it shows pixels of the picture, not cells of a coarse frame.
    pub(super) fn shows_pixels(&self) -> bool {
        self.shows_pixels
    }

    /// Shows the pixels of a tile that have samples.
    pub(super) fn show(&self, tile: &Tile) {
        self.preview.show(tile);
        if let Some(linear) = &self.linear {
            linear.show(tile);
        }
    }

    /// Encodes the displayable pixels as a PNG file.
    pub(super) fn to_png(&self) -> Result<Vec<u8>, ImageError> {
        self.preview.to_png()
    }

    /// Returns the region of the linear frame; `None`: there is none.
    pub(super) fn linear_region(&self) -> Option<Rect> {
        self.linear.as_ref().map(|linear| linear.region)
    }

    /// Copies the linear frame, the lowest row first.
    ///
    /// - `values`: R G B A, `[height × width × 4]` of the region.
    pub(super) fn copy_linear(&self, values: &mut [f32]) {
        let Some(LinearFrame { region, values: from }) = &self.linear else { return };
        let stride = 4 * region.width() as usize;
        for (to, from) in values.chunks_exact_mut(stride).zip(from.chunks_exact(stride).rev()) {
            for (to, from) in to.iter_mut().zip(from) {
                *to = f32::from_bits(from.load(Ordering::Relaxed));
            }
        }
    }
}

impl LinearFrame {
    fn new(region: Rect) -> Self {
        Self { region, values: (0..4 * region.area()).map(|_| AtomicU32::new(0)).collect() }
    }

    fn set(&self, x: u32, y: u32, [r, g, b, alpha]: [f32; 4]) {
        self.set_color(x, y, [r, g, b]);
        self.values[4 * self.region.index(x, y) + 3].store(alpha.to_bits(), Ordering::Relaxed);
    }

    fn set_color(&self, x: u32, y: u32, color: [f32; 3]) {
        let first = 4 * self.region.index(x, y);
        for (to, value) in self.values[first..first + 3].iter().zip(color) {
            to.store(value.to_bits(), Ordering::Relaxed);
        }
    }

    fn show_coarse(&self, cells: &Picture, frame: Rect) {
        if cells.data.is_empty() {
            return;
        }
        let at = |column: u32, row: u32| cells.data[(row * cells.width + column) as usize];
        for (x, y) in self.region.pixels() {
            let (left, right, along) = between(x - frame.x0, frame.width(), cells.width);
            let (top, bottom, down) = between(y - frame.y0, frame.height(), cells.height);
            let upper = mix(at(left, top), at(right, top), along);
            let [r, g, b] = mix(upper, mix(at(left, bottom), at(right, bottom), along), down);
            self.set(x, y, [r, g, b, 1.0]);
        }
    }

    fn show(&self, tile: &Tile) {
        let Some(shared) = self.region.intersection(&tile.rect()) else { return };
        for (x, y) in shared.pixels() {
            let sums = tile.pixel(x, y);
            let count = sums[Layout::SAMPLE_COUNT];
            if count > 0.0 {
                self.set(x, y, [sums[0], sums[1], sums[2], sums[Layout::ALPHA]].map(|sum| sum / count));
            }
        }
    }
}

/// Returns the two cells around the center of pixel `at` of `pixels`, and the weight of the second.
fn between(at: u32, pixels: u32, cells: u32) -> (u32, u32, f32) {
    let place = ((at as f32 + 0.5) * cells as f32 / pixels as f32 - 0.5).clamp(0.0, (cells - 1) as f32);
    let first = place as u32;
    (first, (first + 1).min(cells - 1), place - first as f32)
}

fn mix(a: [f32; 3], b: [f32; 3], share: f32) -> [f32; 3] {
    std::array::from_fn(|channel| a[channel] + (b[channel] - a[channel]) * share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bottega_image::{AovSet, SampleValues};

    #[test]
    fn a_linear_frame_begins_with_the_lowest_row_and_keeps_values_above_1() {
        let region = Rect::new(1, 0, 3, 2);
        let screen = ViewportScreen::new(region, (0.0, ToneMap::Linear), Some(region), true);
        let cells = Picture { width: 1, height: 2, data: vec![[0.0; 3], [8.0; 3]] };
        screen.show_coarse(&cells, region, Rect::of_size(4, 2));
        let mut tile = Tile::new(region, Layout::new(AovSet::NONE));
        tile.add(2, 0, &SampleValues { radiance: [5.0, 3.0, 0.0], alpha: 0.5, ..SampleValues::default() });
        screen.show(&tile);
        let mut values = [0.0; 16];
        screen.copy_linear(&mut values);
        assert_eq!(values[..8], [8.0, 8.0, 8.0, 1.0, 8.0, 8.0, 8.0, 1.0]);
        assert_eq!(values[8..], [0.0, 0.0, 0.0, 1.0, 5.0, 3.0, 0.0, 0.5]);
        assert_eq!(screen.linear_region(), Some(region));
    }
}
