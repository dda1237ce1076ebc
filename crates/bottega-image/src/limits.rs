//! Limits on the header of a picture: one set for all readers of pictures.
//!
//! A header of some bytes can name a picture of gigabytes. So every reader asks here, with what the header says and with the
//! size of the file, before it allocates anything by it.

/// The limits of readers of pictures.
#[derive(Clone, Copy, Debug)]
pub struct ReadLimits {
    /// The most pixels, compared with the header before anything is allocated.
    pub max_pixels: u64,
}

impl Default for ReadLimits {
    /// 16384 × 8192: the largest environment maps in use.
    fn default() -> Self {
        Self { max_pixels: 1 << 27 }
    }
}

/// The packing of a picture's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    /// As they are.
    None,
    /// So many bytes of values for one byte of the file, at most.
    Ratio(u64),
    /// There is no bound: a picture of one color may take a few bytes, however large it is.
    Unbounded,
}

impl Packing {
    /// Runs of equal values: two bytes for 128.
    pub const RUNS: Self = Self::Ratio(64);
    /// Deflate, which PNG, TIFF and EXR use: 258 bytes for two bits.
    pub const DEFLATE: Self = Self::Ratio(1032);
    /// LZW: strings of at most 4096 bytes for 12 bits.
    pub const LZW: Self = Self::Ratio(2732);
    /// JPEG: one bit for the 64 values of a block.
    pub const JPEG: Self = Self::Ratio(512);
}

/// Pixels that a file of unbounded packing may announce however small it is: 4096 × 4096.
const FREE_PIXELS: u64 = 1 << 24;
/// Pixels for each byte of such a file beyond that.
const PIXELS_OF_A_BYTE: u64 = 4096;

/// Checks that a file can hold the pixels that its header announces: a picture that announces more was cut off, or lies. The
/// error says so.
///
/// - `pixel_bits`: of a pixel as it is stored, before it is packed.
/// - `file_bytes`: of the whole file.
pub fn check_announced(
    (width, height): (u64, u64),
    pixel_bits: u64,
    packing: Packing,
    file_bytes: u64,
) -> Result<(), String> {
    let pixels = width.saturating_mul(height);
    let bytes = pixels.saturating_mul(pixel_bits) / 8;
    let is_possible = match packing {
        Packing::None => bytes <= file_bytes,
        Packing::Ratio(ratio) => bytes / ratio.max(1) <= file_bytes,
        Packing::Unbounded => pixels <= FREE_PIXELS || pixels / PIXELS_OF_A_BYTE <= file_bytes,
    };
    if is_possible {
        Ok(())
    } else {
        Err(format!("it announces {width} × {height} pixels, but has only {file_bytes} bytes"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_cannot_announce_more_than_its_packing_unfolds_to() {
        let check = |size, bits, packing, bytes| check_announced(size, bits, packing, bytes).is_ok();
        assert!(check((10, 10), 24, Packing::None, 300) && !check((10, 10), 24, Packing::None, 299));
        assert!(check((10, 10), 1, Packing::None, 12) && !check((100, 10), 1, Packing::None, 12));
        assert!(check((1032, 10), 8, Packing::DEFLATE, 10) && !check((1032, 11), 8, Packing::DEFLATE, 10));
        assert!(check((4096, 4096), 24, Packing::Unbounded, 30) && !check((4096, 4097), 24, Packing::Unbounded, 30));
        assert!(check((16384, 16384), 24, Packing::Unbounded, 1 << 16));
        assert!(!check((u64::MAX, u64::MAX), u64::MAX, Packing::RUNS, 1 << 40));
        assert!(!check((u64::MAX, u64::MAX), u64::MAX, Packing::Unbounded, 1 << 40));
    }
}
