//! The errors of a text, each with its place.

use std::fmt;

/// A place in a text. Both count from 1; columns count characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Position {
    /// The line.
    pub line: usize,
    /// The character of the line.
    pub column: usize,
}

impl Position {
    /// Where the word, number or mark at this place stands in its text, in bytes. A place behind the text has none.
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

/// The first mistake of a text.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{at}: {kind}")]
pub struct FclError {
    /// Where.
    pub at: Position,
    /// What.
    pub kind: FclErrorKind,
}

/// Kinds of mistakes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FclErrorKind {
    /// A character that belongs to no token.
    #[error("the character {0:?} means nothing here")]
    StrayCharacter(char),
    /// `(*` without `*)`.
    #[error("the comment that begins here does not end")]
    OpenComment,
    /// Something else stands where something is needed.
    #[error("expected {expected}, found {found}{}", did_you_mean(.suggestion))]
    Unexpected {
        /// What is needed.
        expected: String,
        /// What stands there.
        found: String,
        /// A word near to what stands there.
        suggestion: Option<String>,
    },
    /// A digit string that is no finite number.
    #[error("`{0}` is not a number that can be used")]
    BadNumber(String),
    /// A name that is not declared.
    #[error("there is no {what} `{name}`{}", did_you_mean(.suggestion))]
    Unknown {
        /// What kind of thing it would be.
        what: String,
        /// Its name.
        name: String,
        /// A declared name near to it.
        suggestion: Option<String>,
    },
    /// A name or clause that is there already.
    #[error("{what} `{name}` is declared twice")]
    Twice {
        /// What kind of thing it is.
        what: &'static str,
        /// Its name.
        name: String,
    },
    /// A declared variable lacks something.
    #[error("{what} `{name}` {lacks}")]
    Incomplete {
        /// What kind of thing it is.
        what: &'static str,
        /// Its name.
        name: String,
        /// What it lacks.
        lacks: &'static str,
    },
    /// Points of a term whose x falls.
    #[error("the points are out of order: x falls from {0} to {1}")]
    PointsOutOfOrder(f64, f64),
    /// A degree or weight that is none.
    #[error("{what} {value} lies outside of 0 to 1")]
    OutsideUnit {
        /// What it is.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A range that is empty.
    #[error("the range from {0} to {1} is empty: are its ends swapped?")]
    EmptyRange(f64, f64),
    /// Singletons under a method that needs areas, areas under COGS, or both in one variable.
    #[error("METHOD {method} does not fit the terms: {reason}")]
    MethodDoesNotFit {
        /// The method.
        method: &'static str,
        /// Why.
        reason: &'static str,
    },
    /// AND and OR that are not dual.
    #[error("AND : {and} goes with OR : {}, not with OR : {or}", .dual)]
    NotDual {
        /// The norm.
        and: &'static str,
        /// The conorm.
        or: &'static str,
        /// The conorm that fits.
        dual: &'static str,
    },
    /// More of something than is allowed.
    #[error("too many {what}: at most {max}")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// How many may be.
        max: usize,
    },
    /// The text holds another number of blocks than one.
    #[error("expected one function block, found {0}")]
    BlockCount(usize),
}

fn did_you_mean(suggestion: &Option<String>) -> String {
    suggestion.as_ref().map_or_else(String::new, |word| format!("; did you mean `{word}`?"))
}

/// The word nearest to `found`, if it is near enough to be meant.
pub(super) fn nearest<'a>(found: &str, words: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let near = |word: &&str| distance(found, word) <= (found.len().max(word.len()) / 3).max(1);
    words.into_iter().filter(near).min_by_key(|word| distance(found, word)).map(str::to_owned)
}

/// How many letters must be put in, left out, exchanged or swapped with a neighbor, without case.
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
