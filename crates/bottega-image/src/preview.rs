//! The preview of a picture during rendering.

use std::sync::atomic::{AtomicU32, Ordering};

use crate::{
    Canvas, ImageError, Layout, Picture, Rect, Tile, ToneMap, canvas::shown, png_write::png_bytes_rgb8,
    tone::exposure_factor,
};

/// A displayable picture, complete from the start: coarse at first, then refined block by block. It takes four bytes
/// per pixel and no lock: renderers write while others read.
#[derive(Debug)]
pub struct Preview {
    rect: Rect,
    exposure_stops: f32,
    tone: ToneMap,
    /// Pixels, `[height × width]`, row-major; sRGB in the three lower bytes. Each pixel is written and read atomically.
    pixels: Box<[AtomicU32]>,
}

impl Preview {
    /// Returns a black preview.
    ///
    /// - `rect`: the crop window, or the whole picture, in picture coordinates.
    /// - `exposure_stops`: exposure in stops; positive: brighter.
    pub fn new(rect: Rect, exposure_stops: f32, tone: ToneMap) -> Self {
        let pixels = (0..rect.area()).map(|_| AtomicU32::new(0)).collect();
        Self { rect, exposure_stops, tone, pixels }
    }

    /// Fills the preview from coarse cells, interpolating between their centers.
    ///
    /// - `coarse`: radiance, in cells that cover the pixels of `picture` evenly. Without cells, nothing changes.
    /// - `picture`: the pixels that the cells cover; those of the preview are among them.
    pub fn show_coarse(&self, coarse: &Picture, picture: Rect) {
        if coarse.data.is_empty() {
            return;
        }
        // Interpolate displayed values, not radiance: a light outshines the cells around it.
        let cells = Canvas::of_picture(coarse, self.exposure_stops, self.tone);
        let columns: Vec<_> =
            (self.rect.x0..self.rect.x1).map(|x| between(x - picture.x0, picture.width(), cells.width)).collect();
        let at = |column: u32, row: u32| cells.pixels[(row * cells.width + column) as usize].map(f32::from);
        let mut pixels = self.pixels.iter();
        for y in self.rect.y0..self.rect.y1 {
            let (top, bottom, down) = between(y - picture.y0, picture.height(), cells.height);
            for (&(left, right, along), pixel) in columns.iter().zip(&mut pixels) {
                let upper = mix(at(left, top), at(right, top), along);
                let lower = mix(at(left, bottom), at(right, bottom), along);
                pixel.store(packed(mix(upper, lower, down).map(|value| (value + 0.5) as u8)), Ordering::Relaxed);
            }
        }
    }

    /// Shows the pixels of a tile that have samples and are within the preview.
    pub fn show(&self, tile: &Tile) {
        let Some(shared) = self.rect.intersection(&tile.rect()) else { return };
        let factor = exposure_factor(self.exposure_stops);
        for (x, y) in shared.pixels() {
            let sums = tile.pixel(x, y);
            let count = sums[Layout::SAMPLE_COUNT];
            if count > 0.0 {
                let color = self.tone.apply([sums[0], sums[1], sums[2]].map(|sum| sum / count * factor));
                self.pixels[self.rect.index(x, y)].store(packed(shown(color)), Ordering::Relaxed);
            }
        }
    }

    /// Encodes the current state as a PNG file. Returns its bytes.
    ///
    /// # Errors
    /// The preview has no pixels, or more than a PNG file can have.
    pub fn to_png(&self) -> Result<Vec<u8>, ImageError> {
        let width = self.rect.width() as usize;
        png_bytes_rgb8((self.rect.width(), self.rect.height()), |row, out| {
            let pixels = &self.pixels[row as usize * width..][..width];
            out.extend(pixels.iter().flat_map(|pixel| {
                let [r, g, b, _] = pixel.load(Ordering::Relaxed).to_le_bytes();
                [r, g, b]
            }));
        })
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

fn packed([r, g, b]: [u8; 3]) -> u32 {
    u32::from_le_bytes([r, g, b, 0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AovSet, ReadLimits, SampleValues, read_image_bytes};

    fn seen(preview: &Preview) -> Vec<[u8; 3]> {
        let read = read_image_bytes("preview.png", &preview.to_png().unwrap(), ReadLimits::default()).unwrap();
        Canvas::of_picture(&read.picture, 0.0, ToneMap::Linear).pixels
    }

    #[test]
    fn a_coarse_picture_fills_every_pixel_and_is_mixed_in_between() {
        let preview = Preview::new(Rect::of_size(8, 2), 0.0, ToneMap::Linear);
        preview.show_coarse(&Picture { width: 2, height: 1, data: vec![[0.0; 3], [1.0; 3]] }, Rect::of_size(8, 2));
        let row = [0, 0, 32, 96, 159, 223, 255, 255].map(|value| [value; 3]);
        assert_eq!(seen(&preview), [row, row].concat());
    }

    #[test]
    fn a_crop_window_shows_its_part_of_the_coarse_picture() {
        let coarse = Picture::from_fn(5, 4, |x, y| [x as f32 / 5.0, y as f32 / 4.0, 0.3]);
        let (frame, crop) = (Rect::of_size(23, 17), Rect::new(4, 3, 20, 11));
        let (whole, part) = [frame, crop].map(|rect| Preview::new(rect, 0.5, ToneMap::Agx)).into();
        whole.show_coarse(&coarse, frame);
        part.show_coarse(&coarse, frame);
        let whole = seen(&whole);
        let expected: Vec<_> = crop.pixels().map(|(x, y)| whole[frame.index(x, y)]).collect();
        assert_eq!(seen(&part), expected);
    }

    #[test]
    fn what_is_painted_takes_the_place_of_what_was_guessed() {
        let preview = Preview::new(Rect::new(2, 0, 6, 1), 0.0, ToneMap::Linear);
        preview.show_coarse(&Picture { width: 1, height: 1, data: vec![[1.0; 3]] }, Rect::of_size(6, 1));
        // The tile extends beyond the preview, and one of its pixels has no samples.
        let mut tile = Tile::new(Rect::of_size(5, 1), Layout::new(AovSet::NONE));
        for x in [0, 2, 4, 4] {
            tile.add(x, 0, &SampleValues { radiance: [0.0; 3], ..Default::default() });
        }
        preview.show(&tile);
        assert_eq!(seen(&preview), [0, 255, 0, 255].map(|value| [value; 3]));
    }
}
