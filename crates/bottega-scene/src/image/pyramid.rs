//! Texels in memory, and mip levels.

use glam::Vec4;
use rayon::prelude::*;

use super::srgb;

/// The encoding of a picture's 8-bit codes. Other formats are linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// Colour channels by the sRGB transfer function, alpha linear.
    Srgb,
    /// All channels linear.
    Linear,
}

impl Encoding {
    fn table(self) -> &'static [f32; 256] {
        const SRGB: &[f32; 256] = &srgb::LINEAR_OF_SRGB;
        const UNORM: &[f32; 256] = &srgb::LINEAR_OF_UNORM;
        match self {
            Self::Srgb => SRGB,
            Self::Linear => UNORM,
        }
    }

    fn color_code(self, linear: f32) -> u8 {
        match self {
            Self::Srgb => srgb::srgb_of_linear(linear),
            Self::Linear => unorm8(linear),
        }
    }
}

fn unorm8(linear: f32) -> u8 {
    (linear * 255.0 + 0.5) as u8
}

fn unorm16(linear: f32) -> u16 {
    (linear * 65535.0 + 0.5) as u16
}

/// A texel in memory.
pub(super) trait Texel: Copy + Send + Sync {
    /// Converts to linear RGBA. `table` holds the linear values of 8-bit colour codes.
    fn decode(self, table: &[f32; 256]) -> Vec4;
    /// Converts from linear RGBA, rounding to nearest.
    fn encode(linear: Vec4, encoding: Encoding) -> Self;
}

impl Texel for u8 {
    #[inline]
    fn decode(self, table: &[f32; 256]) -> Vec4 {
        let gray = table[self as usize];
        Vec4::new(gray, gray, gray, 1.0)
    }

    fn encode(linear: Vec4, encoding: Encoding) -> Self {
        encoding.color_code(linear.x)
    }
}

impl Texel for [u8; 3] {
    #[inline]
    fn decode(self, table: &[f32; 256]) -> Vec4 {
        Vec4::new(table[self[0] as usize], table[self[1] as usize], table[self[2] as usize], 1.0)
    }

    fn encode(linear: Vec4, encoding: Encoding) -> Self {
        [linear.x, linear.y, linear.z].map(|value| encoding.color_code(value))
    }
}

impl Texel for [u8; 4] {
    #[inline]
    fn decode(self, table: &[f32; 256]) -> Vec4 {
        let alpha = srgb::LINEAR_OF_UNORM[self[3] as usize];
        Vec4::new(table[self[0] as usize], table[self[1] as usize], table[self[2] as usize], alpha)
    }

    fn encode(linear: Vec4, encoding: Encoding) -> Self {
        let [r, g, b] = <[u8; 3]>::encode(linear, encoding);
        [r, g, b, unorm8(linear.w)]
    }
}

/// Always linear: 16 bits lose nothing by converting early.
impl Texel for [u16; 4] {
    #[inline]
    fn decode(self, _: &[f32; 256]) -> Vec4 {
        Vec4::from_array(self.map(f32::from)) / 65535.0
    }

    fn encode(linear: Vec4, _: Encoding) -> Self {
        linear.to_array().map(unorm16)
    }
}

impl Texel for [f32; 3] {
    #[inline]
    fn decode(self, _: &[f32; 256]) -> Vec4 {
        Vec4::new(self[0], self[1], self[2], 1.0)
    }

    fn encode(linear: Vec4, _: Encoding) -> Self {
        linear.truncate().to_array()
    }
}

impl Texel for [f32; 4] {
    #[inline]
    fn decode(self, _: &[f32; 256]) -> Vec4 {
        Vec4::from_array(self)
    }

    fn encode(linear: Vec4, _: Encoding) -> Self {
        linear.to_array()
    }
}

/// One mip level, row-major, the upper row first.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Level<T> {
    /// Width, in texels.
    pub(super) width: u32,
    /// Height, in texels.
    pub(super) height: u32,
    /// Texels, `[width × height]`, never empty.
    pub(super) texels: Vec<T>,
}

/// A picture and its mip levels: each half as wide and high (rounded down, at least 1) as the one before.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pyramid<T> {
    pub(super) encoding: Encoding,
    /// Mip levels, at least one; the last has one texel.
    pub(super) levels: Vec<Level<T>>,
}

impl<T: Texel> Pyramid<T> {
    /// Computes the mip levels. Panics unless `texels` has `width × height` elements, at least one.
    pub(super) fn new(width: u32, height: u32, texels: Vec<T>, encoding: Encoding) -> Self {
        assert!(width > 0 && height > 0, "a picture of {width} × {height} has no texel");
        assert_eq!(texels.len(), width as usize * height as usize, "texels of a {width} × {height} picture");
        let mut levels = vec![Level { width, height, texels }];
        while let Some(last) = levels.last()
            && (last.width > 1 || last.height > 1)
        {
            let next = halve(last, encoding);
            levels.push(next);
        }
        Self { encoding, levels }
    }

    /// Returns the picture with a border of texels that are all 0.
    pub(super) fn framed(&self) -> Self {
        let Level { width, height, texels } = &self.levels[0];
        let nothing = T::encode(Vec4::ZERO, self.encoding);
        let columns = *width as usize + 2;
        let mut framed = vec![nothing; columns * (*height as usize + 2)];
        for (row, inside) in framed.chunks_exact_mut(columns).skip(1).zip(texels.chunks_exact(*width as usize)) {
            row[1..columns - 1].copy_from_slice(inside);
        }
        Self::new(width + 2, height + 2, framed, self.encoding)
    }

    /// Returns the picture, and beside and below it the picture rotated by 180°; see
    /// [`Image::octahedral_period`](super::Image::octahedral_period).
    pub(super) fn octahedral_period(&self) -> Self {
        let Level { width, height, texels } = &self.levels[0];
        let mut period = Vec::with_capacity(4 * texels.len());
        let rows = || texels.chunks_exact(*width as usize);
        for (row, turned) in rows().zip(rows().rev()) {
            period.extend(row.iter().chain(turned.iter().rev()));
        }
        for (row, turned) in rows().zip(rows().rev()) {
            period.extend(turned.iter().rev().chain(row));
        }
        Self::new(2 * width, 2 * height, period, self.encoding)
    }

    /// Returns the linear values of 8-bit colour codes.
    pub(super) fn table(&self) -> &'static [f32; 256] {
        self.encoding.table()
    }

    /// Returns the memory of all levels, in bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        self.levels.iter().map(|level| level.texels.len() * size_of::<T>()).sum()
    }
}

/// The up to three texels of a level that one texel of the next coarser level covers, and their weights.
#[derive(Clone, Copy)]
struct Taps {
    start: usize,
    count: usize,
    weights: [f32; 3],
}

/// Returns a box filter between sizes n and ⌊n/2⌋: exact also for odd n, where each texel covers 2 + 1/⌊n/2⌋ finer
/// ones.
fn taps(fine: u32) -> Vec<Taps> {
    let coarse = (fine / 2).max(1);
    (0..coarse)
        .map(|i| {
            let start = 2 * i as usize;
            match fine {
                1 => Taps { start: 0, count: 1, weights: [1.0, 0.0, 0.0] },
                _ if fine.is_multiple_of(2) => Taps { start, count: 2, weights: [0.5, 0.5, 0.0] },
                _ => {
                    let total = fine as f32;
                    let weights = [(coarse - i) as f32 / total, coarse as f32 / total, (i + 1) as f32 / total];
                    Taps { start, count: 3, weights }
                }
            }
        })
        .collect()
}

/// Returns the next coarser level: averages of linear values.
fn halve<T: Texel>(fine: &Level<T>, encoding: Encoding) -> Level<T> {
    let (columns, rows) = (taps(fine.width), taps(fine.height));
    let table = encoding.table();
    let average = |column: &Taps, row: &Taps| {
        let mut sum = Vec4::ZERO;
        for j in 0..row.count {
            let line = (row.start + j) * fine.width as usize + column.start;
            for i in 0..column.count {
                sum += fine.texels[line + i].decode(table) * (row.weights[j] * column.weights[i]);
            }
        }
        T::encode(sum, encoding)
    };
    let texels = rows.par_iter().flat_map_iter(|row| columns.iter().map(move |column| average(column, row))).collect();
    Level { width: columns.len() as u32, height: rows.len() as u32, texels }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mip_levels_average_in_linear_space() {
        // Black and white in a checkerboard are half as bright as white: sRGB code 188, not 128.
        let texels = vec![[0u8; 4], [255; 4], [255; 4], [0; 4]];
        let pyramid = Pyramid::new(2, 2, texels, Encoding::Srgb);
        assert_eq!(pyramid.levels[1].texels, vec![[188, 188, 188, 128]]);
    }

    #[test]
    fn every_level_keeps_the_mean_for_any_size() {
        for (width, height) in [(1, 1), (1, 7), (7, 1), (5, 3), (6, 9), (8, 4), (13, 31)] {
            let texels: Vec<[f32; 3]> = (0..width * height).map(|i| [(i * i % 17) as f32, 1.0, 0.0]).collect();
            let mean = |level: &Level<[f32; 3]>| {
                level.texels.iter().map(|texel| f64::from(texel[0])).sum::<f64>() / level.texels.len() as f64
            };
            let pyramid = Pyramid::new(width, height, texels, Encoding::Linear);
            let first = mean(&pyramid.levels[0]);
            for level in &pyramid.levels {
                assert!((mean(level) - first).abs() < 1e-4 * first.max(1.0), "{width} × {height}");
            }
            assert_eq!(pyramid.levels.last().map(|level| level.texels.len()), Some(1));
        }
    }
}
