//! Detection of colour profiles and gammas in integer pictures, which are ignored: colours count as sRGB.

use image::{ImageDecoder, ImageFormat};

/// Describes a profile or gamma that differs from sRGB, as a clause about "it"; `None`: there is none.
///
/// glTF ignores them, and so do other renderers' formats, so a difference is only reported.
pub(super) fn left_out(bytes: &[u8], format: ImageFormat, decoder: &mut impl ImageDecoder) -> Option<String> {
    let profile = decoder.icc_profile().ok().flatten();
    if let Some(name) = profile.as_deref().and_then(profile_name) {
        let plain: String = name.to_ascii_lowercase().chars().filter(char::is_ascii_alphanumeric).collect();
        return (!plain.contains("srgb") && !plain.contains("gray") && !plain.contains("grey"))
            .then(|| format!("its colour profile `{name}` is left out: its colours are read as sRGB"));
    }
    (format == ImageFormat::Png).then(|| png_gamma(bytes)).flatten()
}

/// Returns the name of an ICC profile: its `desc` tag, in ASCII or UTF-16.
fn profile_name(profile: &[u8]) -> Option<String> {
    let word = |at: usize| Some(u32::from_be_bytes(*profile.get(at..)?.first_chunk()?) as usize);
    let count = word(128)?.min(200);
    let tag = (0..count).map(|index| 132 + 12 * index).find(|&at| profile.get(at..at + 4) == Some(b"desc"))?;
    let start = word(tag + 4)?;
    let text = match profile.get(start..start.checked_add(4)?)? {
        b"desc" => {
            let length = word(start + 8)?.min(80);
            String::from_utf8_lossy(profile.get(start + 12..start + 12 + length)?).into_owned()
        }
        b"mluc" => {
            let (length, offset) = (word(start + 20)?.min(160), word(start + 24)?);
            let from = start.checked_add(offset)?;
            let letters = profile.get(from..from.checked_add(length)?)?.as_chunks::<2>().0;
            String::from_utf16_lossy(&letters.iter().map(|letter| u16::from_be_bytes(*letter)).collect::<Vec<_>>())
        }
        _ => return None,
    };
    let text: String = text.chars().filter(|letter| !letter.is_control()).collect();
    (!text.trim().is_empty()).then(|| text.trim().to_owned())
}

/// Describes a PNG's gamma that is not that of sRGB, unless an sRGB chunk comes first.
fn png_gamma(bytes: &[u8]) -> Option<String> {
    let mut at = 8;
    loop {
        let length = u32::from_be_bytes(*bytes.get(at..)?.first_chunk()?) as usize;
        match bytes.get(at + 4..at + 8)? {
            b"sRGB" | b"IDAT" => return None,
            b"gAMA" => {
                let gamma = f64::from(u32::from_be_bytes(*bytes.get(at + 8..)?.first_chunk()?)) / 100_000.0;
                return ((gamma - 1.0 / 2.2).abs() > 0.01)
                    .then(|| format!("its gamma of {gamma} is left out: its colours are read as sRGB"));
            }
            _ => at = at.checked_add(length)?.checked_add(12)?,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A profile with one tag.
    fn profile(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
        let mut profile = vec![0; 128];
        profile.extend(1_u32.to_be_bytes());
        profile.extend(b"desc");
        profile.extend(144_u32.to_be_bytes());
        profile.extend((data.len() as u32 + 8).to_be_bytes());
        profile.extend(kind);
        profile.extend([0; 4]);
        profile.extend(data);
        profile
    }

    #[test]
    fn profiles_are_known_by_their_names() {
        let old = profile(b"desc", &[&11_u32.to_be_bytes()[..], b"Adobe RGB\0\0"].concat());
        assert_eq!(profile_name(&old).as_deref(), Some("Adobe RGB"));
        let text: Vec<u8> = "Display P3".encode_utf16().flat_map(u16::to_be_bytes).collect();
        let words: Vec<u8> = [1_u32, 12, 0, 20, 28].iter().flat_map(|word| word.to_be_bytes()).collect();
        let new = profile(b"mluc", &[words, text].concat());
        assert_eq!(profile_name(&new).as_deref(), Some("Display P3"));
        for length in 0..new.len() {
            // A truncated profile must not panic.
            let _ = profile_name(&new[..length]);
        }
    }

    #[test]
    fn an_unusual_gamma_is_reported() {
        let png = |chunks: &[(&[u8; 4], u32)]| {
            let mut file = vec![0; 8];
            for (name, value) in chunks {
                file.extend(4_u32.to_be_bytes());
                file.extend(*name);
                file.extend(value.to_be_bytes());
                file.extend([0; 4]);
            }
            file
        };
        assert!(png_gamma(&png(&[(b"gAMA", 100_000)])).unwrap().contains("gamma of 1 "));
        assert_eq!(png_gamma(&png(&[(b"gAMA", 45_455)])), None);
        assert_eq!(png_gamma(&png(&[(b"sRGB", 0), (b"gAMA", 100_000)])), None);
        assert_eq!(png_gamma(&png(&[(b"pHYs", 0)])), None);
    }
}
