//! Text files of many lines, split into blocks for several threads.

use rayon::prelude::*;

use crate::text::column;

/// Approximate size of a block, in bytes.
const BLOCK_BYTES: usize = 1 << 20;

/// A block of whole lines.
#[derive(Clone, Copy, Debug)]
pub(super) struct LineBlock<'a> {
    /// Bytes of the lines, with their line breaks.
    pub(super) text: &'a [u8],
    /// Number of the first line in the file, counted from 1.
    pub(super) first_line: usize,
}

/// An error at a part of a text.
#[derive(Debug)]
pub(super) struct LineFault<'t> {
    /// The invalid word, or the position of a missing one.
    pub(super) at: &'t [u8],
    /// The error, for the message.
    pub(super) problem: String,
}

impl<'t> LineFault<'t> {
    /// Makes a fault at a part of a text.
    pub(super) fn new(at: &'t [u8], problem: impl Into<String>) -> Self {
        Self { at, problem: problem.into() }
    }
}

/// An error at a line and column of a file, counted from 1.
#[derive(Debug)]
pub(super) struct LocatedFault {
    pub(super) line: usize,
    pub(super) column: usize,
    /// The error, for the message.
    pub(super) problem: String,
}

/// Splits a text, whose first line has the number `first_line`, into blocks.
///
/// - `continues`: a trailing backslash continues a line; such lines stay together.
pub(super) fn blocks(text: &[u8], first_line: usize, continues: bool) -> Vec<LineBlock<'_>> {
    let mut pieces = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        let mut end = rest.len().min(BLOCK_BYTES);
        loop {
            let Some(step) = rest[end..].iter().position(|&byte| byte == b'\n') else {
                end = rest.len();
                break;
            };
            end += step + 1;
            if !(continues && ends_with_backslash(&rest[..end - 1])) {
                break;
            }
        }
        let (piece, others) = rest.split_at(end);
        pieces.push(piece);
        rest = others;
    }
    let counts: Vec<usize> = pieces.par_iter().map(|piece| newline_count(piece)).collect();
    let mut line = first_line;
    let block = |(text, count): (_, usize)| {
        let block = LineBlock { text, first_line: line };
        line += count;
        block
    };
    pieces.into_iter().zip(counts).map(block).collect()
}

/// Returns true if a line, without its newline, continues on the next one.
pub(super) fn ends_with_backslash(line: &[u8]) -> bool {
    line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\")
}

fn newline_count(text: &[u8]) -> usize {
    // Sums of at most 255 fit into a byte, so the compiler can vectorize them.
    text.chunks(255).map(|chunk| usize::from(chunk.iter().map(|&byte| u8::from(byte == b'\n')).sum::<u8>())).sum()
}

impl<'a> LineBlock<'a> {
    /// Iterates over the lines with their numbers, trimmed.
    pub(super) fn lines(self) -> impl Iterator<Item = (usize, &'a [u8])> {
        let text = self.text.strip_suffix(b"\n").unwrap_or(self.text);
        let lines = text.split(|&byte| byte == b'\n');
        lines.enumerate().map(move |(index, line)| (self.first_line + index, line.trim_ascii()))
    }
}

impl LineBlock<'_> {
    /// Returns the position of a fault. `line`: reported instead if its part is not in this text, as in joined lines.
    pub(super) fn locate(self, line: usize, fault: LineFault<'_>) -> LocatedFault {
        let LineFault { at, problem } = fault;
        let offset = at.as_ptr().addr().checked_sub(self.text.as_ptr().addr());
        let Some(before) = offset.and_then(|length| self.text.get(..length)) else {
            return LocatedFault { line, column: 1, problem };
        };
        let start = before.iter().rposition(|&byte| byte == b'\n').map_or(0, |newline| newline + 1);
        LocatedFault { line: self.first_line + newline_count(before), column: column(&self.text[start..], at), problem }
    }

    /// Visits the lines, joined where a backslash continues them, without comments, which end with their line. `visit`
    /// gets the number of the first line.
    pub(super) fn for_each_statement(
        self,
        mut visit: impl for<'t> FnMut(usize, &'t [u8]) -> Result<(), LineFault<'t>>,
    ) -> Result<(), LocatedFault> {
        let mut lines = self.lines();
        while let Some((number, line)) = lines.next() {
            if line.starts_with(b"#") {
                continue;
            }
            let whole;
            let line = if ends_with_backslash(line) && !has_comment(line) {
                let mut joined = line[..line.len() - 1].to_vec();
                for (_, next) in lines.by_ref() {
                    joined.push(b' ');
                    let goes_on = ends_with_backslash(next) && !has_comment(next);
                    joined.extend(if goes_on { &next[..next.len() - 1] } else { next });
                    if !goes_on {
                        break;
                    }
                }
                whole = joined;
                &whole[..]
            } else {
                line
            };
            if !line.is_empty() {
                visit(number, line).map_err(|fault| self.locate(number, fault))?;
            }
        }
        Ok(())
    }
}

/// Returns true if a line of numbers has a comment. Names may contain `#`.
fn has_comment(line: &[u8]) -> bool {
    let mut words = line;
    let may_have_one = matches!(next_word(&mut words), Some(word) if !word.first().is_some_and(u8::is_ascii_alphabetic))
        || matches!(line, [b'v' | b'f' | b'l' | b'p', b' ' | b'\t', ..] | [b'v', b't' | b'n', b' ' | b'\t', ..]);
    may_have_one && std::iter::from_fn(|| next_word(&mut words)).any(|word| word.starts_with(b"#"))
}

/// Takes the next word off a line of numbers; `None` at a comment or the end.
pub(super) fn next_number<'a>(line: &mut &'a [u8]) -> Option<&'a [u8]> {
    let mut rest = *line;
    let word = next_word(&mut rest).filter(|word| !word.starts_with(b"#"))?;
    *line = rest;
    Some(word)
}

/// Takes the next word off a line; `None` at the end.
pub(super) fn next_word<'a>(line: &mut &'a [u8]) -> Option<&'a [u8]> {
    let start = line.iter().position(|byte| !byte.is_ascii_whitespace())?;
    let rest = &line[start..];
    let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
    *line = &rest[end..];
    Some(&rest[..end])
}

/// Parses a decimal number, rounded to the nearest `f32`; `None`: it is not one.
pub(super) fn float(word: &[u8]) -> Option<f32> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// Parses an integer of at most 18 digits; `None`: it is not one.
pub(super) fn integer(word: &[u8]) -> Option<i64> {
    let (digits, negative) = match word {
        [b'-', digits @ ..] => (digits, true),
        [b'+', digits @ ..] => (digits, false),
        digits => (digits, false),
    };
    // 18 digits always fit.
    if digits.is_empty() || digits.len() > 18 {
        return None;
    }
    let value = digits
        .iter()
        .try_fold(0i64, |value, &digit| digit.is_ascii_digit().then(|| value * 10 + i64::from(digit - b'0')))?;
    Some(if negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_whole_lines_that_know_their_number() {
        let text: String = (1..300_000).map(|line| format!("line {line}\n")).collect();
        let blocks = blocks(text.as_bytes(), 1, false);
        assert!(blocks.len() > 1);
        let mut expected = 1;
        for (number, line) in blocks.iter().flat_map(|block| block.lines()) {
            assert_eq!((number, line), (expected, format!("line {expected}").as_bytes()));
            expected += 1;
        }
        assert_eq!(expected, 300_000);
    }

    #[test]
    fn a_continued_line_is_never_cut() {
        let text = "word \\\r\n".repeat(400_000) + "end\nnext";
        let blocks = blocks(text.as_bytes(), 1, true);
        assert_eq!(blocks.len(), 2);
        assert_eq!((blocks[1].text, blocks[1].first_line), (&b"next"[..], 400_002));
    }

    #[test]
    fn the_place_of_a_word_is_its_line_and_column() {
        let text = "one\n  zwölf  two\nthree \\\n four five\n";
        let block = LineBlock { text: text.as_bytes(), first_line: 7 };
        let place = |wanted: &[u8]| {
            let found = block.for_each_statement(|_, mut line| {
                while let Some(word) = next_word(&mut line) {
                    if word == wanted {
                        return Err(LineFault::new(word, ""));
                    }
                }
                Ok(())
            });
            found.map_err(|found| (found.line, found.column)).unwrap_err()
        };
        assert_eq!((place(b"one"), place(b"two")), ((7, 1), (8, 10)));
        // For joined lines, the number of the first one.
        assert_eq!(place(b"five"), (9, 1));
    }

    #[test]
    fn numbers_are_whole_words() {
        assert_eq!((integer(b"-12"), integer(b"+7"), integer(b"")), (Some(-12), Some(7), None));
        assert_eq!((integer(b"1x"), integer(b"99999999999999999999"), integer(b"-")), (None, None, None));
        assert_eq!((float(b"1e-3"), float(b"0x1"), float(b"")), (Some(1e-3), None, None));
        let mut line = &b"  a\tbc  "[..];
        assert_eq!(
            (next_word(&mut line), next_word(&mut line), next_word(&mut line)),
            (Some(&b"a"[..]), Some(&b"bc"[..]), None)
        );
    }
}
