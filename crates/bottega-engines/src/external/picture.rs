//! What an engine wrote: looked at before it counts, cut to the window, and added to the zone's sums.

use bottega_image::{ImageFile, Layout, Picture, ReadLimits, Rect, Tile, luminance, read_image};

use super::{error::EngineFault, session::Written};

/// So large a share of pixels may lack finite values: an engine's own numerical accidents.
const NOT_FINITE_SHARE: f64 = 0.01;

/// A window that was painted and looked at.
#[derive(Debug)]
pub(super) struct Window {
    pub(super) picture: Picture,
    /// Pixels whose values were no finite numbers, and are black now.
    pub(super) dropped: usize,
}

/// Reads what an engine wrote and cuts out the window.
pub(super) fn read(written: &Written, window: Rect) -> Result<Window, EngineFault> {
    let Rect { x0, y0, .. } = written.shows;
    let wanted = (written.shows.width(), written.shows.height());
    let limits = ReadLimits { max_pixels: written.shows.area() };
    let file = read_image(&written.file, limits);
    let ImageFile { picture, .. } = match file {
        Ok(file) => file,
        Err(bottega_image::ImageError::TooLarge { width, height, .. }) => {
            let found = (u32::try_from(width).unwrap_or(u32::MAX), u32::try_from(height).unwrap_or(u32::MAX));
            return Err(EngineFault::Size { found, wanted, window });
        }
        Err(error) => return Err(EngineFault::Picture(error)),
    };
    if picture.size() != wanted {
        return Err(EngineFault::Size { found: picture.size(), wanted, window });
    }
    let mut picture = picture;
    if written.is_upside_down {
        let row = picture.width as usize;
        picture.data = picture.data.chunks(row).rev().flatten().copied().collect();
    }
    let cut = Rect::new(window.x0 - x0, window.y0 - y0, window.x1 - x0, window.y1 - y0);
    let mut picture = picture.cropped(cut);
    let mut dropped = 0;
    for pixel in &mut picture.data {
        if !pixel.iter().all(|value| value.is_finite()) {
            *pixel = [0.0; 3];
            dropped += 1;
        }
    }
    if dropped as f64 > NOT_FINITE_SHARE * window.area() as f64 {
        return Err(EngineFault::NotFinite { count: dropped });
    }
    // Read, and of no more use: a long picture must not fill the disk.
    let _ = std::fs::remove_file(&written.file);
    Ok(Window { picture, dropped })
}

impl Window {
    /// Whether every pixel is black.
    pub(super) fn is_black(&self) -> bool {
        self.picture.data.iter().all(|pixel| *pixel == [0.0; 3])
    }

    /// Adds the pixels to `tile`, as the mean of so many samples.
    ///
    /// The squares of single samples are not known: those of their mean stand for them, which are smaller.
    pub(super) fn add_to(&self, tile: &mut Tile, samples: u32) {
        let (rect, stride) = (tile.rect(), tile.layout().stride());
        let count = samples as f32;
        for ((x, y), color) in rect.pixels().zip(&self.picture.data) {
            let start = rect.index(x, y) * stride;
            let sums = &mut tile.sums_mut()[start..start + stride];
            for (sum, value) in sums[Layout::COLOR..].iter_mut().zip(color) {
                *sum += value * count;
            }
            let luminance = luminance(*color);
            sums[Layout::ALPHA] += count;
            sums[Layout::LUMINANCE_SQUARED] += luminance * luminance * count;
            sums[Layout::SAMPLE_COUNT] += count;
        }
    }
}

#[cfg(test)]
mod tests;
