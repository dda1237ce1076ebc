//! Cryptomatte 1.2: identities of names, and the metadata by which a program finds them.
//!
//! Source: Psyop, *Cryptomatte Specification*, version 1.2.0.

use std::fmt::Write;

use crate::{Aov, Metadata};

/// Returns the 32-bit MurmurHash3 of `bytes` with seed 0.
///
/// Source: Appleby 2011, `MurmurHash3_x86_32`.
pub fn murmur3(bytes: &[u8]) -> u32 {
    const MULTIPLIERS: [u32; 2] = [0xcc9e_2d51, 0x1b87_3593];
    let mix = |block: u32| block.wrapping_mul(MULTIPLIERS[0]).rotate_left(15).wrapping_mul(MULTIPLIERS[1]);
    let (blocks, tail) = bytes.as_chunks::<4>();
    // Mix in blocks of four bytes, then the rest
    let mut hash = blocks.iter().fold(0u32, |hash, block| {
        (hash ^ mix(u32::from_le_bytes(*block))).rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64)
    });
    let rest = tail.iter().rev().fold(0u32, |rest, &byte| rest << 8 | u32::from(byte));
    hash ^= mix(rest);
    // Mix in the length, and spread the bits
    hash ^= bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

/// Returns the identity of a name in a Cryptomatte: its hash as the bits of a float. Exponents of 0 and 255 are flipped
/// in their lowest bit, so that it is neither zero, denormal, infinite nor NaN.
pub fn identity(name: &str) -> f32 {
    const LOWEST_OF_EXPONENT: u32 = 1 << 23;
    let hash = murmur3(name.as_bytes());
    let exponent = hash >> 23 & 0xff;
    f32::from_bits(if matches!(exponent, 0 | 255) { hash ^ LOWEST_OF_EXPONENT } else { hash })
}

/// Returns the manifest of names: a JSON object from each name to the bits of its identity, eight hexadecimal digits.
/// Equal names count once; the order is that of the names' bytes.
pub fn manifest<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let mut names: Vec<&str> = names.into_iter().collect();
    names.sort_unstable();
    names.dedup();
    let mut json = "{".to_owned();
    for (index, name) in names.into_iter().enumerate() {
        json.push_str(if index > 0 { ",\"" } else { "\"" });
        for character in name.chars() {
            match character {
                '"' | '\\' => json.extend(['\\', character]),
                control if control.is_control() => {
                    let _ = write!(json, "\\u{:04x}", control as u32);
                }
                other => json.push(other),
            }
        }
        let _ = write!(json, "\":\"{:08x}\"", identity(name).to_bits());
    }
    json.push('}');
    json
}

/// Adds the entries of a Cryptomatte to the metadata of a file.
///
/// - `matte`: one of [`Aov::MATTES`].
/// - `manifest`: result of [`manifest`].
pub fn set_matte(metadata: &mut Metadata, matte: Aov, manifest: String) {
    let layer = matte.file_name();
    let key = format!("cryptomatte/{:.7}", format!("{:08x}", identity(layer).to_bits()));
    metadata.set(&format!("{key}/name"), layer);
    metadata.set(&format!("{key}/hash"), "MurmurHash3_32");
    metadata.set(&format!("{key}/conversion"), "uint32_to_float32");
    metadata.set(&format!("{key}/manifest"), manifest);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_of_the_reference() {
        for (text, hash) in [
            ("", 0),
            ("test", 0xba6b_d213),
            ("Hello, world!", 0xc036_3e43),
            ("The quick brown fox jumps over the lazy dog", 0x2e4f_f723),
        ] {
            assert_eq!(murmur3(text.as_bytes()), hash, "{text}");
        }
    }

    #[test]
    fn an_identity_is_a_finite_float_whose_bits_are_the_hash_but_for_the_exponent() {
        let mut flipped = 0;
        for number in 0..4000 {
            let name = format!("part.{number}");
            let (identity, hash) = (identity(&name), murmur3(name.as_bytes()));
            assert!(identity.is_normal(), "{name}");
            let difference = identity.to_bits() ^ hash;
            assert!(matches!(difference, 0 | 0x0080_0000), "{name}");
            flipped += u32::from(difference != 0);
        }
        assert!(flipped > 0, "no exponent was flipped");
    }

    #[test]
    fn a_manifest_is_json_of_all_names() {
        let text = manifest(["b", "a\"\\\n", "b", "ü"]);
        let bits = |name| format!("{:08x}", identity(name).to_bits());
        let wanted = format!(r#"{{"a\"\\\u000a":"{}","b":"{}","ü":"{}"}}"#, bits("a\"\\\n"), bits("b"), bits("ü"));
        assert_eq!(text, wanted);
        assert_eq!(manifest([]), "{}");
    }
}
