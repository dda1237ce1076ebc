//! Limits on the headers of pictures, for all readers.
//!
//! A header of a few bytes can announce a picture of gigabytes, so every reader checks the header and the size of the
//! file here before it allocates.

/// The limits for reading pictures.
#[derive(Clone, Copy, Debug)]
pub struct ReadLimits {
    /// Maximal number of pixels, checked before anything is allocated.
    pub max_pixels: u64,
}

impl Default for ReadLimits {
    /// Returns a limit of 16384 × 8192: the largest environment maps in use.
    fn default() -> Self {
        Self { max_pixels: 1 << 27 }
    }
}

/// The compression of a picture's values: the limit on how many bytes of values a byte of the file can give.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    /// Uncompressed: the file is no smaller than its values.
    None,
    /// At most that many bytes of values per byte of the file.
    Ratio(u64),
    /// Unbounded: a picture of one color may take a few bytes, however large it is.
    Unbounded,
}

impl Packing {
    /// Run-length encoding: two bytes give at most 128.
    pub const RUNS: Self = Self::Ratio(64);
    /// Deflate, in PNG, TIFF and EXR: two bits give at most 258 bytes.
    pub const DEFLATE: Self = Self::Ratio(1032);
    /// LZW: 12 bits give a string of at most 4096 bytes.
    pub const LZW: Self = Self::Ratio(2732);
    /// JPEG: one bit gives at most the 64 values of a block.
    pub const JPEG: Self = Self::Ratio(512);
}

/// Pixels that a file with unbounded compression may announce at any size: 4096 × 4096.
const FREE_PIXELS: u64 = 1 << 24;
/// Further pixels per byte of such a file.
const PIXELS_OF_A_BYTE: u64 = 4096;

/// Checks that a file can hold the pixels that its header announces.
///
/// - `(width, height)`: announced size, in pixels.
/// - `pixel_bits`: bits per stored pixel, before compression.
/// - `packing`: compression of the file.
/// - `file_bytes`: size of the whole file.
///
/// # Errors
/// The file is too small; the text says that it was cut off or its header is wrong.
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
