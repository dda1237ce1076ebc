//! Tokenizer, with locations.

use std::borrow::Cow;

use crate::import::text_place::{TextFault, TextPlace};

/// A token of a pbrt file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Token<'a> {
    /// A directive, a number, `true` or `false`.
    Word(Cow<'a, str>),
    /// A text in quotes.
    Text(Cow<'a, str>),
    /// An opening bracket, `[`.
    Open,
    /// A closing bracket, `]`.
    Close,
}

/// A tokenizer of a file.
pub(super) struct Tokens<'a> {
    bytes: &'a [u8],
    position: usize,
    file: u32,
    line: u32,
    line_start: usize,
    peeked: Option<Option<(Token<'a>, TextPlace)>>,
}

/// Maximal length of a word or text.
const LENGTH_MAX: usize = 1 << 16;

impl<'a> Tokens<'a> {
    /// Makes a tokenizer of a text.
    pub(super) fn new(file: u32, text: &'a str) -> Self {
        Self { bytes: text.as_bytes(), position: 0, file, line: 1, line_start: 0, peeked: None }
    }

    /// Returns the location of the next byte.
    pub(super) fn here(&self) -> TextPlace {
        let column = self.position - self.line_start + 1;
        TextPlace { file: self.file, line: self.line, column: u32::try_from(column).unwrap_or(u32::MAX) }
    }

    /// Takes the next token; `None` at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<(Token<'a>, TextPlace)>, TextFault> {
        match self.peeked.take() {
            Some(token) => Ok(token),
            None => self.scan(),
        }
    }

    /// Returns the next token without taking it; `None`: the text has ended.
    pub(super) fn peek(&mut self) -> Result<Option<&(Token<'a>, TextPlace)>, TextFault> {
        if self.peeked.is_none() {
            self.peeked = Some(self.scan()?);
        }
        Ok(self.peeked.as_ref().and_then(Option::as_ref))
    }

    fn scan(&mut self) -> Result<Option<(Token<'a>, TextPlace)>, TextFault> {
        self.skip_blank();
        let at = self.here();
        let Some(&first) = self.bytes.get(self.position) else { return Ok(None) };
        let token = match first {
            b'[' | b']' => {
                self.position += 1;
                if first == b'[' { Token::Open } else { Token::Close }
            }
            b'"' => self.scan_text(at)?,
            _ => {
                let rest = &self.bytes[self.position..];
                let is_end = |byte: &u8| matches!(byte, b' ' | b'\t' | b'\r' | b'\n' | b'"' | b'[' | b']');
                let length = rest.iter().position(is_end).unwrap_or(rest.len());
                self.position += length;
                if length > LENGTH_MAX {
                    return Err(at.fault("a word is too long; the file is damaged, or is not text"));
                }
                Token::Word(String::from_utf8_lossy(&rest[..length]))
            }
        };
        Ok(Some((token, at)))
    }

    fn skip_blank(&mut self) {
        while let Some(&byte) = self.bytes.get(self.position) {
            match byte {
                b'\n' => {
                    self.position += 1;
                    self.line += 1;
                    self.line_start = self.position;
                }
                b' ' | b'\t' | b'\r' => self.position += 1,
                b'#' => {
                    let rest = &self.bytes[self.position..];
                    self.position += rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
                }
                _ => return,
            }
        }
    }

    /// Scans from the opening quote to behind the closing one.
    fn scan_text(&mut self, at: TextPlace) -> Result<Token<'a>, TextFault> {
        let start = self.position + 1;
        let mut escaped: Option<Vec<u8>> = None;
        let mut end = start;
        loop {
            let byte = *self.bytes.get(end).ok_or_else(|| at.fault("the file ends within quotes"))?;
            match byte {
                b'"' => break,
                b'\n' => return Err(at.fault("the closing quote is missing on this line")),
                b'\\' => {
                    let text = escaped.get_or_insert_with(|| self.bytes[start..end].to_vec());
                    end += 1;
                    text.push(match self.bytes.get(end) {
                        Some(b'n') => b'\n',
                        Some(b't') => b'\t',
                        Some(b'r') => b'\r',
                        Some(b'b') => 8,
                        Some(b'f') => 12,
                        Some(&byte @ (b'\\' | b'\'' | b'"')) => byte,
                        _ => {
                            return Err(at.fault("a backslash is followed by an unknown character; write \\\\ for one"));
                        }
                    });
                }
                byte => {
                    if let Some(text) = &mut escaped {
                        text.push(byte);
                    }
                }
            }
            end += 1;
            if end - start > LENGTH_MAX {
                return Err(at.fault("the text in quotes is too long"));
            }
        }
        self.position = end + 1;
        Ok(Token::Text(match escaped {
            None => String::from_utf8_lossy(&self.bytes[start..end]),
            Some(text) => Cow::Owned(String::from_utf8_lossy(&text).into_owned()),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type LocatedToken<'a> = (Token<'a>, (u32, u32));

    fn all(text: &str) -> Result<Vec<LocatedToken<'_>>, TextFault> {
        let mut tokens = Tokens::new(0, text);
        let mut list = Vec::new();
        while let Some((token, at)) = tokens.next()? {
            list.push((token, (at.line, at.column)));
        }
        Ok(list)
    }

    fn word(text: &str) -> Token<'_> {
        Token::Word(text.into())
    }

    #[test]
    fn tokens_know_their_places() {
        let tokens = all("Shape \"plymesh\" # a comment\n \"float r\"[1 -2.5]\r\n\tWorldBegin").unwrap();
        let expected = vec![
            (word("Shape"), (1, 1)),
            (Token::Text("plymesh".into()), (1, 7)),
            (Token::Text("float r".into()), (2, 2)),
            (Token::Open, (2, 11)),
            (word("1"), (2, 12)),
            (word("-2.5"), (2, 14)),
            (Token::Close, (2, 18)),
            (word("WorldBegin"), (3, 2)),
        ];
        assert_eq!(tokens, expected);
    }

    #[test]
    fn quotes_may_hold_escapes_and_must_end() {
        assert_eq!(all(r#""a\"b\\c""#).unwrap()[0].0, Token::Text("a\"b\\c".into()));
        for bad in ["\"abc", "\"ab\nc\"", r#""a\qb""#, "\"a\\"] {
            assert_eq!(all(bad).unwrap_err().at, TextPlace { file: 0, line: 1, column: 1 }, "{bad:?}");
        }
    }
}
