//! Errors in FCL texts, with their positions.

use std::fmt;

/// A position in a text. Both numbers count from 1; columns count characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Position {
    /// The line number.
    pub line: usize,
    /// The column, in characters.
    pub column: usize,
}

impl Position {
    /// Returns the byte range in `text` of the word, number or single character at this position; empty at the end of
    /// the text and beyond it.
    pub fn range_in(self, text: &str) -> std::ops::Range<usize> {
        let line_start = match self.line.checked_sub(2) {
            Some(before) => text.match_indices('\n').nth(before).map_or(text.len(), |(newline, _)| newline + 1),
            None => 0,
        };
        let line = &text[line_start..];
        let column = line.char_indices().nth(self.column.saturating_sub(1)).map_or(line.len(), |(at, _)| at);
        let rest = &line[column..];
        let of_word = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.');
        let length = rest.find(|c| !of_word(c)).unwrap_or(rest.len());
        let length = if length == 0 { rest.chars().next().map_or(0, char::len_utf8) } else { length };
        let start = line_start + column;
        start..start + length
    }
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

/// The first error in an FCL text, with its position.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{at}: {kind}")]
pub struct FclError {
    /// The line and column of the error.
    pub at: Position,
    /// The kind of error.
    pub kind: FclErrorKind,
}

/// The reason why an FCL text cannot be parsed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FclErrorKind {
    /// A character that is part of no token.
    #[error("the character {0:?} is not allowed here")]
    StrayCharacter(char),
    /// A comment `(*` without `*)`.
    #[error("the comment that begins here does not end")]
    OpenComment,
    /// An unexpected token.
    #[error("expected {expected}, found {found}{}", did_you_mean(.suggestion))]
    Unexpected {
        /// The expected tokens, for display.
        expected: String,
        /// The token found.
        found: String,
        /// A similar keyword, if any.
        suggestion: Option<String>,
    },
    /// A number that is too large for a 64-bit float, as written.
    #[error("`{0}` is not a usable number")]
    BadNumber(String),
    /// An undeclared name.
    #[error("there is no {what} `{name}`{}", did_you_mean(.suggestion))]
    Unknown {
        /// The kind of name that is expected, as text for display: `input`, `output`.
        what: String,
        /// The undeclared name.
        name: String,
        /// A similar declared name, if any.
        suggestion: Option<String>,
    },
    /// A name or clause that is declared twice.
    #[error("{what} `{name}` is declared twice")]
    Twice {
        /// The kind of thing, for display: `the variable`, `the term`, or a clause such as `RANGE`.
        what: &'static str,
        /// The name that is declared twice; for a clause, the name of its variable or rule block.
        name: String,
    },
    /// A variable has no `TERM`, no `METHOD` or no block of its own, or a rule uses it before that block.
    #[error("{what} `{name}` {lacks}")]
    Incomplete {
        /// The kind of variable, for display: `the input` or `the output`.
        what: &'static str,
        /// The name of the variable.
        name: String,
        /// The missing part, as the end of a sentence for display: `has no TERM`.
        lacks: &'static str,
    },
    /// The x of a point is less than that of the point before, or too far above it: the x before, and this x.
    #[error("the points are out of order: x falls from {0} to {1}")]
    PointsOutOfOrder(f64, f64),
    /// A degree or weight outside of 0..=1.
    #[error("{what} {value} lies outside of 0 to 1")]
    OutsideUnit {
        /// The name of the number, for display: `the degree`, `the weight`.
        what: &'static str,
        /// The value that was read.
        value: f64,
    },
    /// The lower end of a range is not below its upper end, or its width is not finite: the two ends.
    #[error("the range from {0} to {1} is empty: are its ends swapped?")]
    EmptyRange(f64, f64),
    /// Singletons with COG or COA, areas with COGS, both in one variable, or terms that together span no range or one
    /// that is not finite.
    #[error("METHOD {method} does not fit the terms: {reason}")]
    MethodDoesNotFit {
        /// The name of the METHOD.
        method: &'static str,
        /// The reason why it does not fit, for display.
        reason: &'static str,
    },
    /// AND and OR are not dual.
    #[error("AND : {and} goes with OR : {}, not with OR : {or}", .dual)]
    NotDual {
        /// The AND operator.
        and: &'static str,
        /// The OR operator.
        or: &'static str,
        /// The dual OR operator.
        dual: &'static str,
    },
    /// The text has more bytes, items or nested brackets than one of the [`Limits`](crate::Limits) allows.
    #[error("too many {what}: at most {max}")]
    TooMany {
        /// The kind of items, in the plural, for display.
        what: &'static str,
        /// The maximum number of items.
        max: usize,
    },
    /// The text does not contain exactly one function block: the number found.
    #[error("expected one function block, found {0}")]
    BlockCount(usize),
}

fn did_you_mean(suggestion: &Option<String>) -> String {
    suggestion.as_ref().map_or_else(String::new, |word| format!("; did you mean `{word}`?"))
}

/// Returns the word most similar to `found`; `None`: none is similar enough.
pub(super) fn nearest<'a>(found: &str, words: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let near = |word: &&str| distance(found, word) <= (found.len().max(word.len()) / 3).max(1);
    words.into_iter().filter(near).min_by_key(|word| distance(found, word)).map(str::to_owned)
}

/// Returns the edit distance without case: insertions, deletions, substitutions and swaps of neighbors.
fn distance(a: &str, b: &str) -> usize {
    let (a, b) = (a.to_ascii_uppercase().into_bytes(), b.to_ascii_uppercase().into_bytes());
    let mut rows: Vec<Vec<usize>> = vec![(0..=b.len()).collect()];
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let exchanged = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut least = exchanged.min(rows[i - 1][j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(rows[i - 2][j - 2] + 1);
            }
            row.push(least);
        }
        rows.push(row);
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_found_again_in_its_text() {
        let text = "é x\n  TERM a.5 := €;\n";
        let found = |line, column| &text[Position { line, column }.range_in(text)];
        assert_eq!([found(1, 1), found(1, 3), found(2, 3), found(2, 8)], ["é", "x", "TERM", "a.5"]);
        assert_eq!([found(2, 12), found(2, 15), found(2, 99), found(3, 1), found(9, 9)], [":", "€", "", "", ""]);
    }

    #[test]
    fn a_mistyped_word_finds_its_neighbor_and_a_foreign_one_does_not() {
        let words = ["TERM", "METHOD", "RANGE", "END_FUZZIFY"];
        assert_eq!(nearest("trem", words).as_deref(), Some("TERM"));
        assert_eq!(nearest("ENDFUZZIFY", words).as_deref(), Some("END_FUZZIFY"));
        assert_eq!(nearest("wheel", words), None);
    }
}
