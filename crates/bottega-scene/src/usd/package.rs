//! Packages: `.usdz`, a ZIP file whose members are stored as they are (USD specification of the usdz file format).
//!
//! Only stored members are read, so a package cannot unfold into more bytes than it has.

use std::collections::BTreeMap;
use std::ops::Range;

/// A fault of a package, as a clause about it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum PackageFault {
    #[error("it is not a ZIP archive, or cut off: its directory is missing")]
    NoDirectory,
    #[error("the directory of its archive is damaged")]
    Damaged,
    #[error("its member `{0}` is compressed or encrypted; store it as it is, as usdz requires")]
    Compressed(String),
    #[error("it has no layer (.usd, .usda or .usdc)")]
    NoLayer,
}

/// The members of a package.
#[derive(Debug)]
pub(super) struct Package {
    bytes: Vec<u8>,
    /// Place of the bytes of each member, by its name.
    members: BTreeMap<String, Range<usize>>,
    /// The first layer in the order of the directory.
    first_layer: Option<String>,
}

const END: &[u8] = b"PK\x05\x06";
const ENTRY: &[u8] = b"PK\x01\x02";
const LOCAL: &[u8] = b"PK\x03\x04";

impl Package {
    /// Reads the directory of a package.
    pub(super) fn new(bytes: Vec<u8>) -> Result<Self, PackageFault> {
        // The end record is 22 bytes long, with a comment of up to 65,535 bytes behind
        let from = bytes.len().saturating_sub(22 + 0xffff);
        let tail = &bytes[from..];
        let end = (0..tail.len().saturating_sub(21))
            .rev()
            .find(|&at| tail[at..].starts_with(END))
            .ok_or(PackageFault::NoDirectory)?;
        let end = from + end;
        let count = u16_at(&bytes, end + 10).ok_or(PackageFault::NoDirectory)?;
        let mut at = u32_at(&bytes, end + 16).ok_or(PackageFault::NoDirectory)?;
        let mut members = BTreeMap::new();
        let mut first_layer = None;
        for _ in 0..count {
            let (name, range, next) = entry(&bytes, at)?;
            at = next;
            let is_layer = [".usd", ".usda", ".usdc"].iter().any(|end| name.to_ascii_lowercase().ends_with(end));
            if is_layer && first_layer.is_none() {
                first_layer = Some(name.clone());
            }
            members.insert(name, range);
        }
        Ok(Self { bytes, members, first_layer })
    }

    /// Returns the name of the layer that stands for the package.
    pub(super) fn first_layer(&self) -> Result<&str, PackageFault> {
        self.first_layer.as_deref().ok_or(PackageFault::NoLayer)
    }

    /// Returns the bytes of a member; `None`: there is none of that name.
    pub(super) fn member(&self, name: &str) -> Option<&[u8]> {
        self.members.get(name).map(|range| &self.bytes[range.clone()])
    }
}

/// Reads an entry of the directory. Returns the member's name, the place of its bytes, and that of the next entry.
fn entry(bytes: &[u8], at: usize) -> Result<(String, Range<usize>, usize), PackageFault> {
    let damaged = || PackageFault::Damaged;
    if !bytes.get(at..).is_some_and(|rest| rest.starts_with(ENTRY)) {
        return Err(PackageFault::Damaged);
    }
    let short = |offset: usize| u16_at(bytes, at + offset).ok_or_else(damaged);
    let (flags, method) = (short(8)?, short(10)?);
    let size = u32_at(bytes, at + 20).ok_or_else(damaged)?;
    let (name_length, extra, comment) = (short(28)?, short(30)?, short(32)?);
    let local = u32_at(bytes, at + 42).ok_or_else(damaged)?;
    let name = bytes.get(at + 46..at + 46 + name_length).ok_or_else(damaged)?;
    let name = String::from_utf8_lossy(name).replace('\\', "/");
    if method != 0 || flags & 1 != 0 {
        return Err(PackageFault::Compressed(crate::text::shortened(&name).into_owned()));
    }
    if !bytes.get(local..).is_some_and(|rest| rest.starts_with(LOCAL)) {
        return Err(PackageFault::Damaged);
    }
    let lengths = u16_at(bytes, local + 26).zip(u16_at(bytes, local + 28));
    let (local_name, local_extra) = lengths.ok_or_else(damaged)?;
    let start = local + 30 + local_name + local_extra;
    let range = start..start.checked_add(size).ok_or_else(damaged)?;
    if range.end > bytes.len() {
        return Err(PackageFault::Damaged);
    }
    Ok((name, range, at + 46 + name_length + extra + comment))
}

fn u16_at(bytes: &[u8], at: usize) -> Option<usize> {
    Some(usize::from(u16::from_le_bytes(*bytes.get(at..)?.first_chunk()?)))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    usize::try_from(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a package of stored members.
    fn zip(members: &[(&str, &[u8])]) -> Vec<u8> {
        let (mut file, mut directory) = (Vec::new(), Vec::new());
        for (name, bytes) in members {
            let local = file.len() as u32;
            let sizes = [0_u32, bytes.len() as u32, bytes.len() as u32].map(u32::to_le_bytes).concat();
            let lengths = [name.len() as u16, 0].map(u16::to_le_bytes).concat();
            file.extend([LOCAL, &[20, 0, 0, 0, 0, 0, 0, 0, 0, 0], &sizes, &lengths, name.as_bytes(), bytes].concat());
            let head = [ENTRY, &[20, 0, 20, 0, 0, 0, 0, 0, 0, 0, 0, 0], &sizes, &lengths, &[0; 10]].concat();
            directory.extend([&head[..], &local.to_le_bytes(), name.as_bytes()].concat());
        }
        let count = (members.len() as u16).to_le_bytes();
        let places = [directory.len() as u32, file.len() as u32].map(u32::to_le_bytes).concat();
        file.extend(&directory);
        file.extend([END, &[0; 4], &count, &count, &places, &[0, 0]].concat());
        file
    }

    #[test]
    fn members_are_found_by_name() {
        let file = zip(&[("picture.png", b"pixels"), ("a.usda", b"#usda 1.0"), ("b.usdc", b"PXR-USDC")]);
        let package = Package::new(file).unwrap();
        assert_eq!(package.first_layer(), Ok("a.usda"));
        assert_eq!(package.member("picture.png"), Some(&b"pixels"[..]));
        assert_eq!(package.member("other.png"), None);
    }

    #[test]
    fn damaged_packages_are_refused() {
        let file = zip(&[("a.usda", b"#usda 1.0")]);
        for length in 0..file.len() {
            assert!(Package::new(file[..length].to_vec()).is_err(), "{length}");
        }
        for at in 0..file.len() {
            let mut damaged = file.clone();
            damaged[at] ^= 0xff;
            // Must return
            let _ = Package::new(damaged).map(|package| package.member("a.usda").map(<[u8]>::len));
        }
        let mut compressed = file.clone();
        let entry = compressed.windows(4).position(|window| window == ENTRY).unwrap();
        compressed[entry + 10] = 8;
        assert_eq!(Package::new(compressed).unwrap_err(), PackageFault::Compressed("a.usda".into()));
        assert_eq!(Package::new(zip(&[("a.png", b"")])).unwrap().first_layer(), Err(PackageFault::NoLayer));
    }
}
