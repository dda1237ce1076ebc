//! PFM, portable float maps: `PF` for colours or `Pf` for gray, the size, a scale whose sign gives the byte order, and
//! rows of floats, the lowest row first.

use super::error::PictureError;
use super::texels::{DecodedTexels, zeroed};

/// The header of a PFM file.
#[derive(Clone, Copy, Debug)]
pub(super) struct PfmHeader {
    width: u32,
    height: u32,
    is_color: bool,
    /// Factor of all values.
    scale: f32,
    big_endian: bool,
    /// Offset of the first row.
    body: usize,
}

/// Parses the header and checks the length of the file.
pub(super) fn header(bytes: &[u8]) -> Result<PfmHeader, PictureError> {
    let mut at = 0;
    let mut word = || {
        // A header word ends at one white space; no header is longer than 64 bytes from here.
        let rest = bytes.get(at..bytes.len().min(at + 64))?;
        let start = rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let end = start + rest[start..].iter().position(u8::is_ascii_whitespace)?;
        at += end + 1;
        std::str::from_utf8(&rest[start..end]).ok()
    };
    let kind = word();
    let mut size = || word().and_then(|word| word.parse::<u32>().ok()).ok_or(PictureError::PfmWithoutSize);
    let (width, height) = (size()?, size()?);
    let scale: f32 = word().and_then(|word| word.parse().ok()).unwrap_or(0.0);
    if !scale.is_normal() {
        return Err(PictureError::PfmWithoutScale);
    }
    let is_color = kind == Some("PF");
    let header = PfmHeader { width, height, is_color, scale: scale.abs(), big_endian: scale > 0.0, body: at };
    let needed = u128::from(width) * u128::from(height) * if is_color { 12 } else { 4 };
    let there = bytes.len().saturating_sub(at);
    if (there as u128) < needed {
        return Err(PictureError::PfmTooShort { width, height, bytes: there });
    }
    Ok(header)
}

impl PfmHeader {
    /// Returns width, height and bytes per texel in memory.
    pub(super) fn size(&self) -> (u32, u32, usize) {
        (self.width, self.height, 12)
    }
}

/// Decodes the texels.
pub(super) fn texels(bytes: &[u8]) -> Result<DecodedTexels, PictureError> {
    let header = header(bytes)?;
    let float = |bytes: &[u8]| {
        let chunk = bytes.first_chunk().copied().unwrap_or_default();
        header.scale * if header.big_endian { f32::from_be_bytes(chunk) } else { f32::from_le_bytes(chunk) }
    };
    let (width, size) = (header.width as usize, if header.is_color { 12 } else { 4 });
    let mut texels: Vec<[f32; 3]> = zeroed(width * header.height as usize)?;
    let rows = bytes[header.body..].chunks_exact((width * size).max(1));
    for (row, line) in texels.chunks_exact_mut(width.max(1)).rev().zip(rows) {
        for (texel, bytes) in row.iter_mut().zip(line.chunks_exact(size)) {
            *texel = if header.is_color {
                [float(bytes), float(&bytes[4..]), float(&bytes[8..])]
            } else {
                [float(bytes); 3]
            };
        }
    }
    Ok(DecodedTexels::Rgb32(texels))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, values: &[f32], big_endian: bool) -> Vec<u8> {
        let mut file = header.as_bytes().to_vec();
        file.extend(values.iter().flat_map(|value| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() }));
        file
    }

    #[test]
    fn rows_run_upwards_and_the_scale_tells_the_order_of_bytes() {
        let values = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let gray = DecodedTexels::Rgb32([[4.0; 3], [5.0; 3], [6.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]].to_vec());
        assert_eq!(texels(&file("Pf\n3 2\n-1\n", &values, false)).unwrap(), gray);
        assert_eq!(texels(&file("Pf 3 2 1.0\n", &values, true)).unwrap(), gray);
        let color = DecodedTexels::Rgb32(vec![[8.0, 10.0, 12.0], [2.0, 4.0, 6.0]]);
        assert_eq!(texels(&file("PF\n1 2\n-2.0\n", &values, false)).unwrap(), color);
    }

    #[test]
    fn damaged_headers_are_refused() {
        for header in [
            "PF\n1 2\n-1\n",
            "PF\n1\n",
            "PF\n1 2\n0\n",
            "PF\n1 2\nnan\n",
            "PF\n-1 2\n1\n",
            "PF\n4294967295 4294967295\n1\n",
        ] {
            assert!(texels(&file(header, &[1.0; 5], false)).is_err(), "{header}");
        }
        assert!(header(b"PF").is_err());
    }
}
