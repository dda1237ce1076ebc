//! The lexer: splits a text into tokens.

use super::error::{FclError, FclErrorKind, Position};
use crate::limits::Limits;

/// A token of FCL (IEC 61131-7).
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token<'a> {
    /// A name or keyword.
    Word(&'a str),
    /// A number without sign, and its spelling.
    Number(f64, &'a str),
    /// One of the characters `; : , ( ) + -`.
    Mark(char),
    /// The sign `:=`.
    Assign,
    /// The sign `..`.
    Dots,
    End,
}

impl Token<'_> {
    /// Returns the token's name in error messages.
    pub(super) fn describe(&self) -> String {
        match self {
            Self::Word(word) => format!("`{word}`"),
            Self::Number(_, written) => format!("`{written}`"),
            Self::Mark(mark) => format!("`{mark}`"),
            Self::Assign => "`:=`".to_owned(),
            Self::Dots => "`..`".to_owned(),
            Self::End => "the end of the text".to_owned(),
        }
    }
}

/// Splits a text into tokens with their positions. The last one is [`Token::End`].
///
/// # Errors
/// A character is not allowed, a comment does not end, or a word or number is invalid.
pub(super) fn tokens(text: &str) -> Result<Vec<(Token<'_>, Position)>, FclError> {
    let mut lexer = Lexer { rest: text, at: Position { line: 1, column: 1 } };
    let mut tokens = Vec::new();
    loop {
        lexer.skip_blank()?;
        let at = lexer.at;
        let token = lexer.next()?;
        let last = token == Token::End;
        tokens.push((token, at));
        if last {
            return Ok(tokens);
        }
    }
}

struct Lexer<'a> {
    rest: &'a str,
    at: Position,
}

impl<'a> Lexer<'a> {
    /// Takes a number of bytes, which must end at a character boundary.
    fn take(&mut self, bytes: usize) -> &'a str {
        let (taken, rest) = self.rest.split_at(bytes);
        self.rest = rest;
        for character in taken.chars() {
            if character == '\n' {
                self.at = Position { line: self.at.line + 1, column: 1 };
            } else {
                self.at.column += 1;
            }
        }
        taken
    }

    fn skip_blank(&mut self) -> Result<(), FclError> {
        loop {
            let blank =
                self.rest.len() - self.rest.trim_start_matches(|c: char| c.is_whitespace() || c == '\u{feff}').len();
            self.take(blank);
            if self.rest.starts_with("//") {
                self.take(self.rest.find('\n').unwrap_or(self.rest.len()));
            } else if self.rest.starts_with("(*") {
                let Some(end) = self.rest[2..].find("*)") else {
                    return Err(FclError { at: self.at, kind: FclErrorKind::OpenComment });
                };
                self.take(2 + end + 2);
            } else if blank == 0 {
                return Ok(());
            }
        }
    }

    fn next(&mut self) -> Result<Token<'a>, FclError> {
        let bytes = self.rest.as_bytes();
        let Some(&first) = bytes.first() else { return Ok(Token::End) };
        let second_is_digit = bytes.get(1).is_some_and(u8::is_ascii_digit);
        match first {
            b'a'..=b'z' | b'A'..=b'Z' | b'_' => {
                let length = bytes.iter().take_while(|byte| byte.is_ascii_alphanumeric() || **byte == b'_').count();
                self.check_length(length)?;
                Ok(Token::Word(self.take(length)))
            }
            b'0'..=b'9' => self.number(),
            b'.' if second_is_digit => self.number(),
            b'.' if bytes.get(1) == Some(&b'.') => {
                self.take(2);
                Ok(Token::Dots)
            }
            b':' if bytes.get(1) == Some(&b'=') => {
                self.take(2);
                Ok(Token::Assign)
            }
            b';' | b':' | b',' | b'(' | b')' | b'+' | b'-' => {
                self.take(1);
                Ok(Token::Mark(char::from(first)))
            }
            _ => {
                let stray = self.rest.chars().next().unwrap_or_default();
                Err(FclError { at: self.at, kind: FclErrorKind::StrayCharacter(stray) })
            }
        }
    }

    fn check_length(&self, length: usize) -> Result<(), FclError> {
        if length <= Limits::WORD_MAX {
            return Ok(());
        }
        let kind = FclErrorKind::TooMany { what: "characters in one word or number", max: Limits::WORD_MAX };
        Err(FclError { at: self.at, kind })
    }

    fn number(&mut self) -> Result<Token<'a>, FclError> {
        let at = self.at;
        let bytes = self.rest.as_bytes();
        let digits = |from: usize| bytes[from..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        let mut length = digits(0);
        // `0..10` is a number, two dots and a number
        if bytes.get(length) == Some(&b'.') && bytes.get(length + 1) != Some(&b'.') {
            length += 1;
            length += digits(length);
        }
        if matches!(bytes.get(length), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(length + 1), Some(b'+' | b'-')));
            let exponent = digits((length + 1 + sign).min(bytes.len()));
            if exponent > 0 {
                length += 1 + sign + exponent;
            }
        }
        self.check_length(length)?;
        let written = self.take(length);
        match written.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Token::Number(number, written)),
            _ => Err(FclError { at, kind: FclErrorKind::BadNumber(written.to_owned()) }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<String> {
        tokens(text).unwrap().iter().map(|(token, _)| token.describe()).collect()
    }

    #[test]
    fn two_dots_are_no_part_of_a_number() {
        assert_eq!(words("(0..10)")[..5], ["`(`", "`0`", "`..`", "`10`", "`)`"]);
        assert_eq!(words("0 .. .5")[..3], ["`0`", "`..`", "`.5`"]);
        assert_eq!(words("3. 1.5e-3 2e x")[..5], ["`3.`", "`1.5e-3`", "`2`", "`e`", "`x`"]);
    }

    #[test]
    fn comments_of_both_kinds_vanish_and_places_are_kept() {
        let tokens = tokens("// é\n(* a\n b *) x").unwrap();
        assert_eq!(tokens[0], (Token::Word("x"), Position { line: 3, column: 7 }));
    }

    #[test]
    fn what_is_no_token_is_named_with_its_place() {
        let error = |text| tokens(text).unwrap_err().to_string();
        assert_eq!(error("a\n €"), "line 2, column 2: the character '€' is not allowed here");
        assert_eq!(error("x (* y"), "line 1, column 3: the comment that begins here does not end");
        assert_eq!(error("1e999"), "line 1, column 1: `1e999` is not a usable number");
    }
}
