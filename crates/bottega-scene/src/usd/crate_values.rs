//! The values of a binary layer: the memory that each takes, and the names in them.

use std::collections::HashMap;

use super::crate_parts::{CheckResult, CrateFault, Tokens, is_count_of_integers, u32_at, u64_at};
use super::names;

/// The check of a name.
pub(super) type NameCheck = fn(&str) -> bool;

/// Returns the check of the names in a field; `None`: the field holds no names.
pub(super) fn name_check(field: &[u8]) -> Option<NameCheck> {
    match field {
        b"primChildren" | b"variantSetChildren" => Some(names::is_prim),
        b"properties" => Some(names::is_property),
        b"variantChildren" => Some(|name| !name.is_empty() && names::is_variant(name)),
        _ => None,
    }
}

/// Most levels of dictionaries.
const DEPTH_MAX: u32 = 32;

/// Most values that are visited.
const VALUES_MAX: usize = 50_000_000;

/// The values of a file, and what they take.
pub(super) struct CrateValues<'a> {
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

impl<'a> CrateValues<'a> {
    /// Makes the values of a file; none is visited.
    ///
    /// - `strings`: the token of each string.
    pub(super) fn new(bytes: &'a [u8], minor: u8, limit: usize, tokens: Tokens, strings: Vec<usize>) -> Self {
        Self { bytes, minor, limit, tokens, strings, sizes: HashMap::new(), visited: 0 }
    }

    /// Checks the value of a field.
    ///
    /// - `name`: token of the field's name.
    pub(super) fn check_field(&mut self, name: usize, rep: u64) -> CheckResult<()> {
        self.size(rep, 0)?;
        match self.tokens.get(name).and_then(name_check) {
            Some(is_name) => self.check_names(rep, is_name),
            None => Ok(()),
        }
    }

    /// Returns the memory that a value takes, in bytes.
    fn size(&mut self, rep: u64, depth: u32) -> CheckResult<usize> {
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

    fn measured(&mut self, rep: u64, depth: u32) -> CheckResult<usize> {
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
    fn list(&self, at: usize, least: usize) -> CheckResult<(usize, usize)> {
        let count = u64_at(self.bytes, at)?;
        self.has(at + 8, count, least)?;
        Ok((count, at + 8))
    }

    fn has(&self, at: usize, count: usize, size: usize) -> CheckResult<()> {
        let left = self.bytes.len().saturating_sub(at);
        if count.saturating_mul(size) <= left { Ok(()) } else { Err(CrateFault::Value) }
    }

    fn texts(&self, at: usize, are_strings: bool) -> CheckResult<usize> {
        let (count, start) = self.list(at, 4)?;
        self.indexed(start, count, are_strings)
    }

    /// Returns the memory of texts by their indices.
    fn indexed(&self, at: usize, count: usize, are_strings: bool) -> CheckResult<usize> {
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
    fn check_names(&self, rep: u64, is_name: NameCheck) -> CheckResult<()> {
        if (rep >> 48) as u8 != 41 || rep >> 62 & 1 != 0 {
            return Ok(());
        }
        let (count, start) = self.list((rep & ((1 << 48) - 1)) as usize, 4)?;
        let name = |index: &[u8; 4]| self.tokens.name(u32::from_le_bytes(*index) as usize);
        let mut indices = self.bytes[start..].as_chunks::<4>().0.iter().take(count);
        if indices.all(|index| name(index).is_some_and(is_name)) { Ok(()) } else { Err(CrateFault::Name) }
    }

    /// Returns the memory of selections of variants: pairs of strings.
    fn selections(&self, at: usize) -> CheckResult<usize> {
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
    fn array_count(&self, at: usize) -> CheckResult<(usize, usize)> {
        if at == 0 {
            return Ok((0, 0));
        }
        // Before version 0.5 the number of dimensions comes first
        let at = if self.minor < 5 { at + 4 } else { at };
        if self.minor < 7 { Ok((u32_at(self.bytes, at)?, at + 4)) } else { Ok((u64_at(self.bytes, at)?, at + 8)) }
    }

    fn array(&self, kind: u8, at: usize, is_compressed: bool) -> CheckResult<usize> {
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
    fn compressed_numbers(&self, kind: u8, start: usize) -> CheckResult<()> {
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
    fn dictionary(&mut self, at: usize, depth: u32) -> CheckResult<(usize, usize)> {
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
    fn nested(&self, at: usize) -> CheckResult<(u64, usize)> {
        let place = self.offset(at)?;
        let chunk = self.bytes.get(place..).and_then(<[u8]>::first_chunk).ok_or(CrateFault::CutOff)?;
        Ok((u64::from_le_bytes(*chunk), place + 8))
    }

    fn offset(&self, at: usize) -> CheckResult<usize> {
        let chunk = self.bytes.get(at..).and_then(<[u8]>::first_chunk).ok_or(CrateFault::CutOff)?;
        let place = i64::try_from(at).ok().and_then(|at| at.checked_add(i64::from_le_bytes(*chunk)));
        let place = place.and_then(|place| usize::try_from(place).ok()).filter(|place| *place < self.bytes.len());
        place.ok_or(CrateFault::CutOff)
    }

    fn time_samples(&mut self, at: usize, depth: u32) -> CheckResult<usize> {
        let (times, at) = self.nested(at)?;
        let mut size = self.size(times, depth + 1)?;
        let (count, start) = self.list(self.offset(at)?, 8)?;
        for chunk in self.bytes[start..].as_chunks::<8>().0.iter().take(count) {
            size = size.saturating_add(self.size(u64::from_le_bytes(*chunk), depth + 1)?);
        }
        Ok(size)
    }

    /// Returns the memory of a list operation: up to six lists.
    fn list_op(&mut self, kind: u8, at: usize, depth: u32) -> CheckResult<usize> {
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
