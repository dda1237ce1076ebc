//! The pictures that an engine writes: validated, cropped to the window, and added to the zone's sums.

use bottega_image::{ImageFile, Layout, Picture, Planes, ReadLimits, Rect, Tile, luminance, read_channels};

use super::{error::EngineFault, session::Written};

/// The largest share of pixels with non-finite values that counts as numerical accidents.
const NOT_FINITE_SHARE: f64 = 0.01;
/// Larger values in a layer count as invalid, so that the sums of all samples stay finite.
const LARGEST: f32 = 1e30;

/// The channels wanted in addition to the color, and their places in a pixel.
#[derive(Clone, Debug, Default)]
pub(super) struct ExtraChannels {
    /// Alpha, then the channels of the layers.
    names: Vec<String>,
    offsets: Vec<usize>,
}

impl ExtraChannels {
    /// Returns the further channels that a pixel layout needs.
    pub(super) fn of(layout: &Layout) -> Self {
        let aovs = layout.aovs().iter().filter(|aov| !aov.channels().is_empty());
        let aovs = aovs.filter_map(|aov| Some((layout.offset(aov)?, aov.full_names())));
        let layers = layout.placed_layers().map(|(offset, layer)| (offset, layer.full_names().collect()));
        let mut wanted = Self { names: vec!["A".to_owned()], offsets: vec![Layout::ALPHA] };
        for (offset, names) in aovs.chain(layers) {
            wanted.offsets.extend((0..names.len()).map(|index| offset + index));
            wanted.names.extend(names);
        }
        wanted
    }
}

/// A rendered and validated window.
#[derive(Debug)]
pub(super) struct PaintedWindow {
    pub(super) picture: Picture,
    /// Alpha and the layers: the place in a pixel, and the values.
    planes: Vec<(usize, Vec<f32>)>,
    /// The number of pixels with non-finite values, which are set to black.
    pub(super) dropped: usize,
}

/// Reads the color from an engine's file, and crops it to the window.
pub(super) fn read(written: &Written, window: Rect) -> Result<PaintedWindow, EngineFault> {
    read_wanted(written, window, &ExtraChannels::default())
}

/// Reads the color and further channels from an engine's file, and crops them to the window.
pub(super) fn read_wanted(
    written: &Written,
    window: Rect,
    wanted: &ExtraChannels,
) -> Result<PaintedWindow, EngineFault> {
    let (mut picture, planes) = load(written, window, &wanted.names)?;
    // Crop to the window
    let Rect { x0, y0, .. } = written.shows;
    let cut = Rect::new(window.x0 - x0, window.y0 - y0, window.x1 - x0, window.y1 - y0);
    let (row, height) = (picture.width, picture.height);
    let place = |(x, y): (u32, u32)| {
        let y = if written.is_upside_down { height - 1 - y } else { y };
        y as usize * row as usize + x as usize
    };
    let places: Vec<usize> = cut.pixels().map(place).collect();
    picture = Picture {
        width: cut.width(),
        height: cut.height(),
        data: places.iter().map(|&place| picture.data[place]).collect(),
    };
    // Replace non-finite colors by black, and refuse too many
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
    // Crop the further channels
    let sound = |value: f32| if value.abs() <= LARGEST { value } else { 0.0 };
    let mut kept = Vec::new();
    for ((name, &offset), plane) in wanted.names.iter().zip(&wanted.offsets).zip(planes) {
        match plane {
            Some(plane) => kept.push((offset, places.iter().map(|&place| sound(plane[place])).collect())),
            // A film may lack alpha.
            None if offset == Layout::ALPHA => {}
            None => return Err(EngineFault::Layer { channel: name.clone() }),
        }
    }
    // Delete the file, so that a long render does not fill the disk.
    let _ = std::fs::remove_file(&written.file);
    Ok(PaintedWindow { picture, planes: kept, dropped })
}

/// Reads all wanted channels of a file of the announced size.
fn load(written: &Written, window: Rect, names: &[String]) -> Result<(Picture, Planes), EngineFault> {
    let wanted = (written.shows.width(), written.shows.height());
    let limits = ReadLimits { max_pixels: written.shows.area() };
    let (ImageFile { picture, .. }, planes) = match read_channels(&written.file, limits, names) {
        Ok(read) => read,
        Err(bottega_image::ImageError::TooLarge { width, height, .. }) => {
            let found = (u32::try_from(width).unwrap_or(u32::MAX), u32::try_from(height).unwrap_or(u32::MAX));
            return Err(EngineFault::Size { found, wanted, window });
        }
        Err(error) => return Err(EngineFault::Picture(error)),
    };
    if picture.size() != wanted {
        return Err(EngineFault::Size { found: picture.size(), wanted, window });
    }
    Ok((picture, planes))
}

impl PaintedWindow {
    /// Returns true if every pixel is black.
    pub(super) fn is_black(&self) -> bool {
        self.picture.data.iter().all(|pixel| *pixel == [0.0; 3])
    }

    /// Adds the pixels to `tile`, as the mean of `samples` samples. Channels that are not summed keep the values of the
    /// pass with the most samples.
    ///
    /// The squares of single samples are unknown: those of the mean are used, which are smaller.
    pub(super) fn add_to(&self, tile: &mut Tile, samples: u32) {
        let (stride, sums_end) = (tile.layout().stride(), tile.layout().sums_end());
        let count = samples as f32;
        let has_alpha = self.planes.iter().any(|(offset, _)| *offset == Layout::ALPHA);
        let (summed, picked): (Vec<_>, Vec<_>) = self.planes.iter().partition(|(offset, _)| *offset < sums_end);
        for (index, (sums, color)) in tile.sums_mut().chunks_exact_mut(stride).zip(&self.picture.data).enumerate() {
            for (sum, value) in sums[Layout::COLOR..].iter_mut().zip(color) {
                *sum += value * count;
            }
            let luminance = luminance(*color);
            sums[Layout::LUMINANCE_SQUARED] += luminance * luminance * count;
            sums[Layout::SAMPLE_COUNT] += count;
            if !has_alpha {
                sums[Layout::ALPHA] += count;
            }
            for (offset, plane) in &summed {
                sums[*offset] += plane[index] * count;
            }
            if let Some(most) = sums[sums_end..].last().copied()
                && count > most
            {
                picked.iter().for_each(|(offset, plane)| sums[*offset] = plane[index]);
                sums[stride - 1] = count;
            }
        }
    }
}

#[cfg(test)]
mod tests;
