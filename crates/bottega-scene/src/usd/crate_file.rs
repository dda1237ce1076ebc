//! Binary layers (`.usdc`): checks of what the USD library allocates and follows without looking.
//!
//! The library believes the counts of a file, and a count that is too large ends the process. So all counts are compared
//! with the bytes that are there, and the memory of every value with the limit of the scene; the tree of paths must not lead
//! in circles. Other damage makes the library return an error, or panic, which is caught. The layout is that of
//! `pxr/usd/usd/crateFile.cpp` of OpenUSD.

use super::crate_parts::{
    CheckResult, CrateFault, Tokens, decompress, encoded_size, integers, is_count_of_integers, u64_at,
};
use super::crate_values::CrateValues;
use super::names;

/// Most levels of paths.
const LEVELS_MAX: usize = 1024;

/// Checks a file.
///
/// - `limit`: memory of one value, and of all paths, in bytes.
pub(super) fn check(bytes: &[u8], limit: usize) -> CheckResult<()> {
    let [major, minor, patch] = [8, 9, 10].map(|at| bytes.get(at).copied().unwrap_or(0));
    if major != 0 || !(4..=12).contains(&minor) {
        return Err(CrateFault::Version(major, minor, patch));
    }
    let sections = sections(bytes)?;
    let section = |name: &'static str| {
        let start = sections.iter().find(|(known, _)| known == name).map(|(_, start)| *start);
        start.map(|at| Cursor { bytes, at, limit, section: name })
    };
    let tokens = section("TOKENS").map(|mut cursor| cursor.tokens()).transpose()?.unwrap_or_default();
    let strings = section("STRINGS").map(|mut cursor| cursor.strings()).transpose()?.unwrap_or_default();
    let fields = section("FIELDS").map(|mut cursor| cursor.fields()).transpose()?.unwrap_or_default();
    if let Some(mut cursor) = section("FIELDSETS") {
        let count = cursor.count()?;
        cursor.integers(count)?;
    }
    if let Some(mut cursor) = section("PATHS") {
        cursor.paths(&tokens)?;
    }
    if let Some(mut cursor) = section("SPECS") {
        let count = cursor.count()?;
        (0..3).try_for_each(|_| cursor.integers(count).map(drop))?;
    }
    let mut values = CrateValues::new(bytes, minor, limit, tokens, strings);
    fields.into_iter().try_for_each(|(name, rep)| values.check_field(name, rep))
}

/// Returns the names and starts of the sections.
fn sections(bytes: &[u8]) -> CheckResult<Vec<(String, usize)>> {
    let toc = u64_at(bytes, 16)?;
    let count = u64_at(bytes, toc)?;
    if count == 0 || count >= 64 {
        return Err(CrateFault::Section("table of contents"));
    }
    let entry = |index: usize| {
        let at = toc + 8 + 32 * index;
        let name = bytes.get(at..at + 32).ok_or(CrateFault::CutOff)?;
        let name = name[..16].split(|byte| *byte == 0).next().unwrap_or_default();
        Ok((String::from_utf8_lossy(name).into_owned(), u64_at(bytes, at + 16)?))
    };
    (0..count).map(entry).collect()
}

/// A place within a section.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    limit: usize,
    section: &'static str,
}

impl<'a> Cursor<'a> {
    fn damaged(&self) -> CrateFault {
        CrateFault::Section(self.section)
    }

    fn count(&mut self) -> CheckResult<usize> {
        let count = u64_at(self.bytes, self.at)?;
        self.at += 8;
        Ok(count)
    }

    /// Reads the bytes of a compressed block.
    fn block(&mut self) -> CheckResult<&'a [u8]> {
        let size = self.count()?;
        let block = self.bytes.get(self.at..self.at + size).ok_or(CrateFault::CutOff)?;
        self.at += size;
        Ok(block)
    }

    /// Decompresses a block.
    ///
    /// - `size`: greatest number of bytes.
    fn decompressed(&mut self, size: usize) -> CheckResult<Vec<u8>> {
        let block = self.block()?;
        decompress(block, size, self.limit).ok_or_else(|| self.damaged())
    }

    /// Reads compressed integers of 32 bits.
    fn integers(&mut self, count: usize) -> CheckResult<Vec<i32>> {
        let block = self.block()?;
        if !is_count_of_integers(count, block.len(), self.limit) {
            return Err(self.damaged());
        }
        let encoded = decompress(block, encoded_size(count), self.limit).ok_or_else(|| self.damaged())?;
        integers(&encoded, count).ok_or_else(|| self.damaged())
    }

    /// Returns the tokens.
    fn tokens(&mut self) -> CheckResult<Tokens> {
        let count = self.count()?;
        let size = self.count()?;
        let text = self.decompressed(size)?;
        let is_whole = text.len() == size;
        let tokens = Tokens::new(text);
        if is_whole && count <= tokens.count() { Ok(tokens) } else { Err(self.damaged()) }
    }

    /// Returns the tokens of the strings.
    fn strings(&mut self) -> CheckResult<Vec<usize>> {
        let count = self.count()?;
        let bytes = self.bytes.get(self.at..).and_then(|rest| rest.get(..count.checked_mul(4)?));
        let bytes = bytes.ok_or_else(|| self.damaged())?;
        Ok(bytes.as_chunks::<4>().0.iter().map(|chunk| u32::from_le_bytes(*chunk) as usize).collect())
    }

    /// Returns the token of the name, and the value, of all fields.
    fn fields(&mut self) -> CheckResult<Vec<(usize, u64)>> {
        let count = self.count()?;
        let names = self.integers(count)?;
        let size = count.checked_mul(8).ok_or_else(|| self.damaged())?;
        let reps = self.decompressed(size)?;
        let reps = reps.as_chunks::<8>().0.iter().map(|chunk| u64::from_le_bytes(*chunk));
        Ok(names.into_iter().map(|name| usize::try_from(name).unwrap_or(usize::MAX)).zip(reps).collect())
    }

    /// Checks the tree of paths: it must visit each at most once, and all texts together must fit into the limit.
    fn paths(&mut self, tokens: &Tokens) -> CheckResult<()> {
        let path_count = self.count()?;
        let count = self.count()?;
        let indices = self.integers(count)?;
        let names = self.integers(count)?;
        let jumps = self.integers(count)?;
        if path_count > count.saturating_mul(2).saturating_add(16) {
            return Err(CrateFault::Paths);
        }
        let mut pending = vec![(0_usize, 0_usize, 0_usize)];
        let (mut visited, mut text) = (0, 0_usize);
        while let Some((mut index, mut length, mut level)) = pending.pop() {
            if count == 0 {
                break;
            }
            loop {
                let (Some(&path), Some(&name), Some(&jump)) = (indices.get(index), names.get(index), jumps.get(index))
                else {
                    return Err(CrateFault::Paths);
                };
                let token = name.unsigned_abs() as usize;
                let element = tokens.name(token).unwrap_or_default();
                let is_sound = match name < 0 {
                    true => names::is_property(element),
                    false => names::is_prim(element) || names::is_selection(element),
                };
                if index > 0 && !is_sound {
                    return Err(CrateFault::Name);
                }
                let own = if index == 0 { 1 } else { length + 1 + tokens.length(token) };
                visited += 1;
                text = text.saturating_add(own + 64);
                let is_path = usize::try_from(path).is_ok_and(|path| path < path_count);
                if !is_path || visited > count || level > LEVELS_MAX || text > self.limit {
                    return Err(CrateFault::Paths);
                }
                let (has_child, has_sibling) = (jump > 0 || jump == -1, jump >= 0);
                if has_child && has_sibling {
                    pending.push((index + jump as usize, length, level));
                }
                if has_child {
                    (length, level) = (own, level + 1);
                }
                if !has_child && !has_sibling {
                    break;
                }
                index += 1;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor as Bytes;

    use openusd::{usda, usdc};

    use super::*;

    /// A binary layer with values of several kinds.
    fn layer() -> Vec<u8> {
        let points: Vec<String> = (0..40).map(|i| format!("({i}, {}, 0.5)", i * i)).collect();
        let text = format!(
            "#usda 1.0\ndef Mesh \"a\" (\n references = </b>\n customData = {{ dictionary d = {{ string s = \"t\" }} }}\n) {{\n\
             point3f[] points = [{}]\nint[] faceVertexIndices = [0, 1, 2, 3, 4, 5, 6, 7, 8]\ntoken[] t = [\"x\", \"y\"]\n\
             double3 xformOp:translate.timeSamples = {{ 0: (0, 0, 0), 1: (1, 2, 3) }}\nrel r = </b>\n}}\ndef \"b\" {{}}\n",
            points.join(", ")
        );
        let mut bytes = Bytes::new(Vec::new());
        usdc::CrateWriter::write(&usda::parse(&text).unwrap(), &mut bytes).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn sound_layers_pass_and_damaged_ones_end() {
        let file = layer();
        assert_eq!(check(&file, 1 << 20), Ok(()));
        assert!(check(&file, 64).is_err(), "a limit of 64 bytes");
        for length in 0..file.len() {
            assert!(check(&file[..length], 1 << 20).is_err(), "{length}");
        }
        for at in 0..file.len() {
            let mut damaged = file.clone();
            damaged[at] = damaged[at].wrapping_add(0x7f);
            // Must return
            let _ = check(&damaged, 1 << 20);
        }
        let mut newer = file;
        newer[9] = 13;
        assert_eq!(check(&newer, 1 << 20), Err(CrateFault::Version(0, 13, newer[10])));
    }
}
