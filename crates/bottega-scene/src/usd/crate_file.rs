//! Binary layers (`.usdc`): checks of what the USD library allocates and follows without looking.
//!
//! The library believes the counts of a file, and a count that is too large ends the process. So all counts are compared
//! with the bytes that are there, and the memory of every value with the limit of the scene; the tree of paths must not lead
//! in circles. Other damage makes the library return an error, or panic, which is caught. The layout is that of
//! `pxr/usd/usd/crateFile.cpp` of OpenUSD.

use std::collections::HashMap;

use super::names;

/// A fault of a binary layer, as a clause about it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum CrateFault {
    #[error("it is cut off, or a place in it lies beyond its end")]
    CutOff,
    #[error("it has the version {0}.{1}.{2} of the format, and 0.4.0 to 0.12 can be read")]
    Version(u8, u8, u8),
    #[error("its section `{0}` is damaged")]
    Section(&'static str),
    #[error("a value of it is damaged: the file has fewer bytes than it says")]
    Value,
    #[error("a value of it takes more memory than the scene may have")]
    TooLarge,
    #[error("its paths lead in circles, or are too long")]
    Paths,
    #[error("a name in it has other characters than names have")]
    Name,
    #[error("its values are nested too deep, or too many")]
    Nested,
}

/// The check of a name.
type NameCheck = fn(&str) -> bool;

/// Returns the check of the names in a field; `None`: the field holds no names.
fn name_check(field: &[u8]) -> Option<NameCheck> {
    match field {
        b"primChildren" | b"variantSetChildren" => Some(names::is_prim),
        b"properties" => Some(names::is_property),
        b"variantChildren" => Some(|name| !name.is_empty() && names::is_variant(name)),
        _ => None,
    }
}

/// The most bytes that one byte of LZ4 can become.
const LZ4_RATIO: usize = 255;

/// Most levels of paths.
const LEVELS_MAX: usize = 1024;

/// Most levels of dictionaries.
const DEPTH_MAX: u32 = 32;

/// Most values that are visited.
const VALUES_MAX: usize = 50_000_000;

type Checked<T> = Result<T, CrateFault>;

/// Checks a file.
///
/// - `limit`: memory of one value, and of all paths, in bytes.
pub(super) fn check(bytes: &[u8], limit: usize) -> Checked<()> {
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
    let mut values = Values { bytes, minor, limit, tokens, strings, sizes: HashMap::new(), visited: 0 };
    for (name, rep) in fields {
        values.size(rep, 0)?;
        if let Some(is_name) = values.tokens.get(name).and_then(name_check) {
            values.check_names(rep, is_name)?;
        }
    }
    Ok(())
}

/// The tokens of a file: texts, one after another.
#[derive(Default)]
struct Tokens {
    text: Vec<u8>,
    /// Start of each token; each ends with a zero.
    starts: Vec<usize>,
}

impl Tokens {
    fn new(text: Vec<u8>) -> Self {
        let after = text.iter().enumerate().filter(|(_, byte)| **byte == 0).map(|(at, _)| at + 1);
        let starts: Vec<usize> = std::iter::once(0).chain(after).filter(|&start| start < text.len()).collect();
        Self { text, starts }
    }

    fn get(&self, index: usize) -> Option<&[u8]> {
        let start = *self.starts.get(index)?;
        self.text[start..].split(|byte| *byte == 0).next()
    }

    /// Returns the length of a token; 0 if there is none.
    fn length(&self, index: usize) -> usize {
        self.get(index).map_or(0, <[u8]>::len)
    }

    /// Returns a token as text; `None`: it is none.
    fn name(&self, index: usize) -> Option<&str> {
        std::str::from_utf8(self.get(index)?).ok()
    }
}

/// Returns the names and starts of the sections.
fn sections(bytes: &[u8]) -> Checked<Vec<(String, usize)>> {
    let toc = u64_at(bytes, 16)?;
    let count = u64_at(bytes, toc)?;
    if count == 0 || count >= 64 {
        return Err(CrateFault::Section("table of contents"));
    }
    let entry = |index: usize| {
        let at = toc + 8 + 32 * index;
        let name = bytes.get(at..at + 16).ok_or(CrateFault::CutOff)?;
        let name = name.split(|byte| *byte == 0).next().unwrap_or_default();
        Ok((String::from_utf8_lossy(name).into_owned(), u64_at(bytes, at + 16)?))
    };
    (0..count).map(entry).collect()
}

/// Returns a number of a file as a size; one that no size holds is beyond the end.
fn u64_at(bytes: &[u8], at: usize) -> Checked<usize> {
    let chunk = bytes.get(at..).and_then(<[u8]>::first_chunk).ok_or(CrateFault::CutOff)?;
    let number = u64::from_le_bytes(*chunk);
    // Sums of two places must not overflow
    usize::try_from(number).ok().filter(|number| *number <= isize::MAX as usize).ok_or(CrateFault::CutOff)
}

fn u32_at(bytes: &[u8], at: usize) -> Checked<usize> {
    let chunk = bytes.get(at..).and_then(<[u8]>::first_chunk).ok_or(CrateFault::CutOff)?;
    Ok(u32::from_le_bytes(*chunk) as usize)
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

    fn count(&mut self) -> Checked<usize> {
        let count = u64_at(self.bytes, self.at)?;
        self.at += 8;
        Ok(count)
    }

    /// Reads the bytes of a compressed block.
    fn block(&mut self) -> Checked<&'a [u8]> {
        let size = self.count()?;
        let block = self.bytes.get(self.at..self.at + size).ok_or(CrateFault::CutOff)?;
        self.at += size;
        Ok(block)
    }

    /// Decompresses a block.
    ///
    /// - `size`: greatest number of bytes.
    fn decompressed(&mut self, size: usize) -> Checked<Vec<u8>> {
        let block = self.block()?;
        decompress(block, size, self.limit).ok_or_else(|| self.damaged())
    }

    /// Reads compressed integers of 32 bits.
    fn integers(&mut self, count: usize) -> Checked<Vec<i32>> {
        let block = self.block()?;
        if !is_count_of_integers(count, block.len(), self.limit) {
            return Err(self.damaged());
        }
        let encoded = decompress(block, encoded_size(count), self.limit).ok_or_else(|| self.damaged())?;
        integers(&encoded, count).ok_or_else(|| self.damaged())
    }

    /// Returns the tokens.
    fn tokens(&mut self) -> Checked<Tokens> {
        let count = self.count()?;
        let size = self.count()?;
        let text = self.decompressed(size)?;
        let is_whole = text.len() == size;
        let tokens = Tokens::new(text);
        if is_whole && count <= tokens.starts.len() { Ok(tokens) } else { Err(self.damaged()) }
    }

    /// Returns the tokens of the strings.
    fn strings(&mut self) -> Checked<Vec<usize>> {
        let count = self.count()?;
        let bytes = self.bytes.get(self.at..).and_then(|rest| rest.get(..count.checked_mul(4)?));
        let bytes = bytes.ok_or_else(|| self.damaged())?;
        Ok(bytes.as_chunks::<4>().0.iter().map(|chunk| u32::from_le_bytes(*chunk) as usize).collect())
    }

    /// Returns the token of the name, and the value, of all fields.
    fn fields(&mut self) -> Checked<Vec<(usize, u64)>> {
        let count = self.count()?;
        let names = self.integers(count)?;
        let size = count.checked_mul(8).ok_or_else(|| self.damaged())?;
        let reps = self.decompressed(size)?;
        let reps = reps.as_chunks::<8>().0.iter().map(|chunk| u64::from_le_bytes(*chunk));
        Ok(names.into_iter().map(|name| usize::try_from(name).unwrap_or(usize::MAX)).zip(reps).collect())
    }

    /// Checks the tree of paths: it must visit each at most once, and all texts together must fit into the limit.
    fn paths(&mut self, tokens: &Tokens) -> Checked<()> {
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

/// Returns true if a block can hold a number of integers: each takes two bits at least.
fn is_count_of_integers(count: usize, block: usize, limit: usize) -> bool {
    count <= block.saturating_mul(4 * LZ4_RATIO) && count.saturating_mul(16) <= limit
}

/// Returns the greatest size of encoded integers of 32 bits.
fn encoded_size(count: usize) -> usize {
    if count == 0 { 0 } else { 4 + count.div_ceil(4) + 4 * count }
}

/// Decompresses a block of one chunk; `None`: it is damaged, or takes too much memory.
fn decompress(block: &[u8], size: usize, limit: usize) -> Option<Vec<u8>> {
    let (&chunks, data) = block.split_first()?;
    if chunks != 0 || size > limit {
        return None;
    }
    let room = size.min(data.len().saturating_mul(LZ4_RATIO).saturating_add(64));
    let mut output = vec![0; room];
    let length = lz4_flex::block::decompress_into(data, &mut output).ok()?;
    output.truncate(length);
    Some(output)
}

/// Decodes integers: a common difference, two bits for each number that tell its size, and the differences.
fn integers(encoded: &[u8], count: usize) -> Option<Vec<i32>> {
    if count == 0 {
        return Some(Vec::new());
    }
    let common = i32::from_le_bytes(*encoded.first_chunk()?);
    let codes = encoded.get(4..4 + count.div_ceil(4))?;
    let mut rest = &encoded[4 + codes.len()..];
    let mut take = |length: usize| {
        let (taken, after) = rest.split_at_checked(length)?;
        rest = after;
        Some(taken)
    };
    let mut last = 0_i32;
    let mut numbers = Vec::with_capacity(count);
    for index in 0..count {
        let difference = match codes[index / 4] >> (2 * (index % 4)) & 3 {
            0 => common,
            1 => i32::from(take(1)?[0] as i8),
            2 => i32::from(i16::from_le_bytes(*take(2)?.first_chunk()?)),
            _ => i32::from_le_bytes(*take(4)?.first_chunk()?),
        };
        last = last.wrapping_add(difference);
        numbers.push(last);
    }
    Some(numbers)
}

/// The values of a file, and what they take.
struct Values<'a> {
    bytes: &'a [u8],
    /// Minor version of the file.
    minor: u8,
    limit: usize,
    /// The tokens, and the tokens of the strings.
    tokens: Tokens,
    strings: Vec<usize>,
    /// Memory of the values that were visited, in bytes.
    sizes: HashMap<u64, usize>,
    visited: usize,
}

/// The type of doubles.
const DOUBLE: u8 = 9;

/// Bytes of a value's own frame in the library.
const FRAME: usize = 64;

impl Values<'_> {
    /// Returns the memory that a value takes, in bytes.
    fn size(&mut self, rep: u64, depth: u32) -> Checked<usize> {
        self.visited += 1;
        if depth > DEPTH_MAX || self.visited > VALUES_MAX {
            return Err(CrateFault::Nested);
        }
        if let Some(&known) = self.sizes.get(&rep) {
            return Ok(known);
        }
        let size = self.measured(rep, depth)?.saturating_add(FRAME);
        if size > self.limit {
            return Err(CrateFault::TooLarge);
        }
        self.sizes.insert(rep, size);
        Ok(size)
    }

    fn measured(&mut self, rep: u64, depth: u32) -> Checked<usize> {
        let (is_array, is_inlined, is_compressed) = (rep >> 63 & 1 != 0, rep >> 62 & 1 != 0, rep >> 61 & 1 != 0);
        let kind = (rep >> 48) as u8;
        let at = (rep & ((1 << 48) - 1)) as usize;
        if is_inlined && !is_array {
            return Ok(self.tokens.length(at as u32 as usize));
        }
        match kind {
            // Arrays of strings and assets, and vectors of tokens and strings, are lists of indices
            10 | 12 if is_array => self.texts(at, true),
            50 => self.texts(at, true),
            41 => self.texts(at, false),
            11 if is_array => {
                let (count, start) = self.array_count(at)?;
                self.indexed(start, count, false)
            }
            48 => self.array(DOUBLE, at, is_compressed),
            56 if is_array => self.array(DOUBLE, at, is_compressed),
            57 if is_array => self.texts(at, true),
            1..=30 if is_array => self.array(kind, at, is_compressed),
            31 => self.dictionary(at, depth).map(|(size, _)| size),
            32..=39 | 54 | 55 => self.list_op(kind, at, depth),
            40 => self.list(at, 4).map(|(count, _)| count * FRAME),
            45 => self.selections(at),
            58 => self.list(at, 8).map(|(count, _)| count * 2 * FRAME),
            46 => self.time_samples(at, depth),
            49 => self.list(at, 16).map(|(count, _)| count * 16),
            _ => Ok(FRAME),
        }
    }

    /// Returns the number of elements of a list and where it starts. There are at least as many bytes as it needs.
    ///
    /// - `least`: least size of an element, in bytes.
    fn list(&self, at: usize, least: usize) -> Checked<(usize, usize)> {
        let count = u64_at(self.bytes, at)?;
        self.has(at + 8, count, least)?;
        Ok((count, at + 8))
    }

    fn has(&self, at: usize, count: usize, size: usize) -> Checked<()> {
        let left = self.bytes.len().saturating_sub(at);
        if count.saturating_mul(size) <= left { Ok(()) } else { Err(CrateFault::Value) }
    }

    fn texts(&self, at: usize, are_strings: bool) -> Checked<usize> {
        let (count, start) = self.list(at, 4)?;
        self.indexed(start, count, are_strings)
    }

    /// Returns the memory of texts by their indices.
    fn indexed(&self, at: usize, count: usize, are_strings: bool) -> Checked<usize> {
        self.has(at, count, 4)?;
        let mut size = 0_usize;
        for index in self.bytes[at..].as_chunks::<4>().0.iter().take(count) {
            let index = u32::from_le_bytes(*index) as usize;
            let token = if are_strings { self.strings.get(index).copied().unwrap_or(0) } else { index };
            size = size.saturating_add(FRAME + self.tokens.length(token));
        }
        Ok(size)
    }

    /// Checks that a vector of tokens holds names.
    fn check_names(&self, rep: u64, is_name: NameCheck) -> Checked<()> {
        if (rep >> 48) as u8 != 41 || rep >> 62 & 1 != 0 {
            return Ok(());
        }
        let (count, start) = self.list((rep & ((1 << 48) - 1)) as usize, 4)?;
        let name = |index: &[u8; 4]| self.tokens.name(u32::from_le_bytes(*index) as usize);
        let mut indices = self.bytes[start..].as_chunks::<4>().0.iter().take(count);
        if indices.all(|index| name(index).is_some_and(is_name)) { Ok(()) } else { Err(CrateFault::Name) }
    }

    /// Returns the memory of selections of variants: pairs of strings.
    fn selections(&self, at: usize) -> Checked<usize> {
        let (count, start) = self.list(at, 8)?;
        let name = |index: &[u8; 4]| self.tokens.name(*self.strings.get(u32::from_le_bytes(*index) as usize)?);
        for index in self.bytes[start..].as_chunks::<4>().0.iter().take(2 * count) {
            if !name(index).is_some_and(names::is_variant) {
                return Err(CrateFault::Name);
            }
        }
        Ok(count * 2 * FRAME)
    }

    /// Returns the number of elements of an array, and where they start.
    fn array_count(&self, at: usize) -> Checked<(usize, usize)> {
        if at == 0 {
            return Ok((0, 0));
        }
        // Before version 0.5 the number of dimensions comes first
        let at = if self.minor < 5 { at + 4 } else { at };
        if self.minor < 7 { Ok((u32_at(self.bytes, at)?, at + 4)) } else { Ok((u64_at(self.bytes, at)?, at + 8)) }
    }

    fn array(&self, kind: u8, at: usize, is_compressed: bool) -> Checked<usize> {
        let (count, start) = self.array_count(at)?;
        let element = match kind {
            1 | 2 => 1,
            7 => 2,
            25 => 6,
            5 | 6 | 9 | 18 | 20 | 22 | 29 => 8,
            24 | 26 => 12,
            17 | 19 | 28 | 30 => 16,
            23 => 24,
            13 | 16 | 27 => 32,
            14 => 72,
            15 => 128,
            _ => 4,
        };
        let is_number = matches!(kind, 3..=6) && self.minor >= 5 || matches!(kind, 7..=9) && self.minor >= 6;
        if is_compressed && is_number && count >= 4 {
            let left = self.bytes.len().saturating_sub(start);
            if !is_count_of_integers(count, left, self.limit) {
                return Err(CrateFault::Value);
            }
            self.compressed_numbers(kind, start)?;
        } else {
            self.has(start, count, element)?;
        }
        Ok(count.saturating_mul(element))
    }

    /// Checks the sizes within compressed numbers.
    fn compressed_numbers(&self, kind: u8, start: usize) -> Checked<()> {
        let mut at = start;
        if matches!(kind, 7..=9) {
            let code = *self.bytes.get(at).ok_or(CrateFault::CutOff)?;
            at += 1;
            if code == b't' {
                let count = u32_at(self.bytes, at)?;
                let size = [2, 4, 8][usize::from(kind - 7)];
                self.has(at + 4, count, size)?;
                at += 4 + count * size;
            }
        }
        let block = u64_at(self.bytes, at)?;
        self.has(at + 8, block, 1)
    }

    /// Returns the memory of a dictionary, and where it ends.
    fn dictionary(&mut self, at: usize, depth: u32) -> Checked<(usize, usize)> {
        let (count, mut at) = self.list(at, 12)?;
        let mut size = 0_usize;
        for _ in 0..count {
            let (rep, _) = self.nested(at + 4)?;
            size = size.saturating_add(FRAME + self.size(rep, depth + 1)?);
            // The library reads on behind the value
            at = self.nested(at + 4)?.1;
        }
        Ok((size, at))
    }

    /// Follows a relative offset to a value. Returns the value, and where it ends.
    fn nested(&self, at: usize) -> Checked<(u64, usize)> {
        let place = self.offset(at)?;
        let chunk = self.bytes.get(place..).and_then(<[u8]>::first_chunk).ok_or(CrateFault::CutOff)?;
        Ok((u64::from_le_bytes(*chunk), place + 8))
    }

    fn offset(&self, at: usize) -> Checked<usize> {
        let chunk = self.bytes.get(at..).and_then(<[u8]>::first_chunk).ok_or(CrateFault::CutOff)?;
        let place = i64::try_from(at).ok().and_then(|at| at.checked_add(i64::from_le_bytes(*chunk)));
        let place = place.and_then(|place| usize::try_from(place).ok()).filter(|place| *place < self.bytes.len());
        place.ok_or(CrateFault::CutOff)
    }

    fn time_samples(&mut self, at: usize, depth: u32) -> Checked<usize> {
        let (times, at) = self.nested(at)?;
        let mut size = self.size(times, depth + 1)?;
        let (count, start) = self.list(self.offset(at)?, 8)?;
        for chunk in self.bytes[start..].as_chunks::<8>().0.iter().take(count) {
            size = size.saturating_add(self.size(u64::from_le_bytes(*chunk), depth + 1)?);
        }
        Ok(size)
    }

    /// Returns the memory of a list operation: up to six lists.
    fn list_op(&mut self, kind: u8, at: usize, depth: u32) -> Checked<usize> {
        let flags = *self.bytes.get(at).ok_or(CrateFault::CutOff)?;
        let (mut at, mut size) = (at + 1, 0_usize);
        for _ in 0..(flags >> 1 & 0x3f).count_ones() {
            let least = match kind {
                35 => 32,
                37 | 39 | 55 => 8,
                _ => 4,
            };
            let (count, start) = self.list(at, least)?;
            at = start + count * least;
            let texts = match kind {
                32 => self.indexed(start, count, false)?,
                33 | 54 => self.indexed(start, count, true)?,
                _ => count * 4 * FRAME,
            };
            size = size.saturating_add(texts);
            if kind == 35 {
                at = start;
                for _ in 0..count {
                    // Asset, path, offset and scale of time, and a dictionary
                    let (custom, end) = self.dictionary(at + 24, depth + 1)?;
                    (at, size) = (end, size.saturating_add(custom));
                }
            }
            if kind == 55 && self.minor >= 8 {
                self.has(start, count, 24)?;
                at = start + count * 24;
            }
        }
        Ok(size)
    }
}
