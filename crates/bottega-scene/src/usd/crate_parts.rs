//! The parts of a binary layer: numbers, compressed integers and tokens.

/// A fault of a binary layer, as a clause about it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum CrateFault {
    #[error("it is truncated, or an offset in it lies beyond its end")]
    CutOff,
    #[error("it has the version {0}.{1}.{2} of the format, and 0.4.0 to 0.12 can be read")]
    Version(u8, u8, u8),
    #[error("its section `{0}` is damaged")]
    Section(&'static str),
    #[error("a value of it is damaged: it names more bytes than the file has")]
    Value,
    #[error("a value of it takes more memory than the scene may have")]
    TooLarge,
    #[error("its paths are circular, or too long")]
    Paths,
    #[error("a name in it has other characters than names have")]
    Name,
    #[error("its values are nested too deep, or too many")]
    Nested,
}

/// The result of a check.
pub(super) type CheckResult<T> = Result<T, CrateFault>;

/// The most bytes that one byte of LZ4 can become.
const LZ4_RATIO: usize = 255;

/// The tokens of a file: texts, one after another.
#[derive(Default)]
pub(super) struct Tokens {
    text: Vec<u8>,
    /// Start of each token; each ends with a zero.
    starts: Vec<usize>,
}

impl Tokens {
    pub(super) fn new(text: Vec<u8>) -> Self {
        let after = text.iter().enumerate().filter(|(_, byte)| **byte == 0).map(|(at, _)| at + 1);
        let starts: Vec<usize> = std::iter::once(0).chain(after).filter(|&start| start < text.len()).collect();
        Self { text, starts }
    }

    /// Returns the number of tokens.
    pub(super) fn count(&self) -> usize {
        self.starts.len()
    }

    pub(super) fn get(&self, index: usize) -> Option<&[u8]> {
        let start = *self.starts.get(index)?;
        self.text[start..].split(|byte| *byte == 0).next()
    }

    /// Returns the length of a token; 0 if there is none.
    pub(super) fn length(&self, index: usize) -> usize {
        self.get(index).map_or(0, <[u8]>::len)
    }

    /// Returns a token as text; `None`: it does not exist, or is not UTF-8.
    pub(super) fn name(&self, index: usize) -> Option<&str> {
        std::str::from_utf8(self.get(index)?).ok()
    }
}

/// Returns a number of a file as a size; a number too large for a size is an offset beyond the end.
pub(super) fn u64_at(bytes: &[u8], at: usize) -> CheckResult<usize> {
    let chunk = bytes.get(at..).and_then(<[u8]>::first_chunk).ok_or(CrateFault::CutOff)?;
    let number = u64::from_le_bytes(*chunk);
    // Sums of two places must not overflow
    usize::try_from(number).ok().filter(|number| *number <= isize::MAX as usize).ok_or(CrateFault::CutOff)
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> CheckResult<usize> {
    let chunk = bytes.get(at..).and_then(<[u8]>::first_chunk).ok_or(CrateFault::CutOff)?;
    Ok(u32::from_le_bytes(*chunk) as usize)
}

/// Returns true if a block can hold a number of integers: each takes two bits at least.
pub(super) fn is_count_of_integers(count: usize, block: usize, limit: usize) -> bool {
    count <= block.saturating_mul(4 * LZ4_RATIO) && count.saturating_mul(16) <= limit
}

/// Returns the greatest size of encoded integers of 32 bits.
pub(super) fn encoded_size(count: usize) -> usize {
    if count == 0 { 0 } else { 4 + count.div_ceil(4) + 4 * count }
}

/// Decompresses a block of one chunk; `None`: it is damaged, or takes too much memory.
pub(super) fn decompress(block: &[u8], size: usize, limit: usize) -> Option<Vec<u8>> {
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
pub(super) fn integers(encoded: &[u8], count: usize) -> Option<Vec<i32>> {
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
