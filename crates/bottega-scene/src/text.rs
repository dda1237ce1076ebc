//! Decoding of text files, and shortened text for messages.
//!
//! All text readers use [`decode`] or [`decode_xml`], which return UTF-8 without a byte order mark and with newlines as
//! line ends. The encoding is given by a byte order mark, the zeros of UTF-16, or an XML declaration. Formats that
//! specify no encoding are read as windows-1252 if they are not UTF-8, as older programs wrote them, with a warning.

use std::borrow::Cow;
use std::path::Path;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

use crate::budget::MemoryBudget;
use crate::error::SceneError;

/// The remedy in errors about text that cannot be decoded.
const REMEDY: &str = "save it as UTF-8";

/// A decoded file.
#[derive(Debug, PartialEq)]
pub(crate) struct Text<'a> {
    pub(crate) text: Cow<'a, str>,
    /// Line and warning, if the encoding was guessed.
    pub(crate) guess: Option<(usize, String)>,
}

/// The encoding of a file without a byte order mark.
#[derive(Clone, Copy)]
enum DefaultEncoding {
    /// UTF-8, or windows-1252 if it is not valid UTF-8.
    Guessed,
    /// This encoding; other bytes are an error.
    Known(&'static Encoding),
}

/// Decodes a file of a format that specifies no encoding.
///
/// - `path`: for errors.
pub(crate) fn decode<'a>(path: &Path, bytes: &'a [u8], budget: &MemoryBudget) -> Result<Text<'a>, SceneError> {
    decode_as(path, bytes, DefaultEncoding::Guessed, budget)
}

/// Decodes a file that is UTF-8 by its format, such as JSON, unless a byte order mark says otherwise.
pub(crate) fn decode_utf8<'a>(path: &Path, bytes: &'a [u8], budget: &MemoryBudget) -> Result<Cow<'a, str>, SceneError> {
    decode_as(path, bytes, DefaultEncoding::Known(UTF_8), budget).map(|text| text.text)
}

/// Decodes XML: by its byte order mark, its declaration, or else as UTF-8.
pub(crate) fn decode_xml<'a>(path: &Path, bytes: &'a [u8], budget: &MemoryBudget) -> Result<Cow<'a, str>, SceneError> {
    let encoding = match declared(bytes) {
        None => UTF_8,
        Some(label) => match Encoding::for_label(label) {
            // Without zeros it is not UTF-16: the text was converted, but its declaration kept.
            Some(encoding) if encoding == UTF_16LE || encoding == UTF_16BE => UTF_8,
            Some(encoding) => encoding,
            None => {
                let label = String::from_utf8_lossy(label);
                let problem = format!("the encoding `{}` is unknown; {REMEDY}", shortened(&label));
                return Err(SceneError::Text { path: path.into(), line: 1, column: 1, problem });
            }
        },
    };
    decode_as(path, bytes, DefaultEncoding::Known(encoding), budget).map(|text| text.text)
}

/// Returns the encoding that an XML declaration names.
fn declared(bytes: &[u8]) -> Option<&[u8]> {
    let end = bytes.iter().take(1024).position(|&byte| byte == b'>')?;
    let declaration = bytes[..end].strip_prefix(b"<?xml")?;
    let start = declaration.windows(8).position(|window| window == b"encoding")? + 8;
    let value = declaration[start..].trim_ascii_start().strip_prefix(b"=")?.trim_ascii_start();
    let (&quote, value) = value.split_first().filter(|(quote, _)| matches!(quote, b'"' | b'\''))?;
    value.split(|&byte| byte == quote).next()
}

fn decode_as<'a>(
    path: &Path,
    bytes: &'a [u8],
    unmarked: DefaultEncoding,
    budget: &MemoryBudget,
) -> Result<Text<'a>, SceneError> {
    let fault = |line, column, problem| SceneError::Text { path: path.into(), line, column, problem };
    let (encoding, body) = match (Encoding::for_bom(bytes), utf16_without_mark(bytes), unmarked) {
        (Some((encoding, length)), ..) => (encoding, &bytes[length..]),
        (None, Some(encoding), _) => (encoding, bytes),
        (None, None, DefaultEncoding::Known(encoding)) => (encoding, bytes),
        (None, None, DefaultEncoding::Guessed) => (UTF_8, bytes),
    };
    let mut guess = None;
    let text = if encoding == UTF_8 {
        match std::str::from_utf8(body) {
            Ok(text) => Cow::Borrowed(text),
            Err(error) => {
                let (line, column) = line_and_column(body, error.valid_up_to());
                let byte = body[error.valid_up_to()];
                let may_guess = matches!(unmarked, DefaultEncoding::Guessed) && body.len() == bytes.len();
                if !may_guess || body.iter().any(|&byte| is_no_text(byte)) {
                    let problem = format!("the byte {byte:#04x} is neither UTF-8 nor other text; {REMEDY}");
                    return Err(fault(line, column, problem));
                }
                guess = Some((line, "this is not UTF-8; the file is read as windows-1252".into()));
                // A byte becomes at most three bytes of UTF-8.
                budget.check(path, body.len().saturating_mul(3))?;
                WINDOWS_1252.decode_without_bom_handling(body).0
            }
        }
    } else {
        budget.check(path, body.len().saturating_mul(3))?;
        let (text, has_errors) = encoding.decode_without_bom_handling(body);
        if has_errors {
            let (line, column) = line_and_column(text.as_bytes(), text.find('\u{fffd}').unwrap_or(0));
            return Err(fault(line, column, format!("this is no {}; {REMEDY}", encoding.name())));
        }
        text
    };
    // Check for zeros quickly before locating one.
    if text.as_bytes().contains(&0) {
        let offset = text.find('\0').unwrap_or(0);
        let (line, column) = line_and_column(text.as_bytes(), offset);
        return Err(fault(
            line,
            column,
            format!("a zero byte: this is not text, or its encoding is unknown; {REMEDY}"),
        ));
    }
    Ok(Text { text: with_newlines(text), guess })
}

/// Returns true for bytes that occur in no text, whatever its encoding.
fn is_no_text(byte: u8) -> bool {
    byte < b' ' && !matches!(byte, b'\t' | b'\n' | b'\r' | 0x0b | 0x0c | 0x1a | 0x1b)
}

/// Detects UTF-16 by the zeros of its first two characters.
fn utf16_without_mark(bytes: &[u8]) -> Option<&'static Encoding> {
    match bytes {
        [a, 0, b, 0, ..] if *a != 0 && *b != 0 => Some(UTF_16LE),
        [0, a, 0, b, ..] if *a != 0 && *b != 0 => Some(UTF_16BE),
        _ => None,
    }
}

/// Replaces carriage returns that end a line on their own with newlines.
fn with_newlines(text: Cow<'_, str>) -> Cow<'_, str> {
    let bytes = text.as_bytes();
    let is_alone = |&index: &usize| bytes[index] == b'\r' && bytes.get(index + 1) != Some(&b'\n');
    if !bytes.contains(&b'\r') {
        return text;
    }
    let alone: Vec<usize> = (0..bytes.len()).filter(is_alone).collect();
    if alone.is_empty() {
        return text;
    }
    let mut whole = text.into_owned().into_bytes();
    alone.into_iter().for_each(|index| whole[index] = b'\n');
    // Only single-byte characters were replaced.
    Cow::Owned(String::from_utf8(whole).unwrap_or_default())
}

/// Returns line and column of a byte, counted from 1; the column in characters.
fn line_and_column(bytes: &[u8], offset: usize) -> (usize, usize) {
    let before = &bytes[..offset.min(bytes.len())];
    let start = before.iter().rposition(|&byte| byte == b'\n').map_or(0, |newline| newline + 1);
    let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
    (line, column(&before[start..], &before[before.len()..]))
}

/// Returns the column of a part of a line, counted from 1 in characters. A part that is not within this line counts as
/// its start.
pub(crate) fn column(line: &[u8], part: &[u8]) -> usize {
    let before = part.as_ptr().addr().checked_sub(line.as_ptr().addr()).and_then(|length| line.get(..length));
    1 + before.map_or(0, |before| String::from_utf8_lossy(before).chars().count())
}

/// Shortens text of a file for a message and replaces its control characters.
pub(crate) fn shortened(text: &str) -> Cow<'_, str> {
    const LENGTH: usize = 80;
    if text.len() <= LENGTH && !text.contains(char::is_control) {
        return Cow::Borrowed(text);
    }
    let start: String = text.chars().take(LENGTH).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if start.len() < text.len() { Cow::Owned(start + "…") } else { Cow::Owned(start) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn budget() -> MemoryBudget {
        MemoryBudget::new(1 << 20)
    }

    fn decoded(bytes: &[u8]) -> String {
        decode(Path::new("a"), bytes, &budget()).unwrap().text.into_owned()
    }

    fn utf16(text: &str, big: bool) -> Vec<u8> {
        text.encode_utf16().flat_map(|unit| if big { unit.to_be_bytes() } else { unit.to_le_bytes() }).collect()
    }

    #[test]
    fn marks_say_the_encoding_and_are_skipped() {
        let text = "vé 𝄞\n";
        assert_eq!(decoded(text.as_bytes()), text);
        for marked in [format!("\u{feff}{text}").into_bytes(), utf16(&format!("\u{feff}{text}"), false)] {
            assert_eq!(decoded(&marked), text);
        }
        assert_eq!(decoded(&utf16(&format!("\u{feff}{text}"), true)), text);
        // Without a mark, UTF-16 is known by its zeros.
        assert_eq!((decoded(&utf16("v 1", false)), decoded(&utf16("v 1", true))), ("v 1".into(), "v 1".into()));
    }

    #[test]
    fn lines_may_end_with_a_return_alone() {
        assert_eq!(decoded(b"a\rb\r\nc\n\rd\r"), "a\nb\r\nc\n\nd\n");
    }

    #[test]
    fn old_encodings_are_reported() {
        let text = decode(Path::new("a"), b"# one\nusemtl W\xe4nde\n", &budget()).unwrap();
        assert_eq!(text.text, "# one\nusemtl Wände\n");
        assert_eq!(text.guess.unwrap().0, 2);
    }

    #[test]
    fn binary_data_is_an_error_with_its_place() {
        for (bytes, place) in [
            (&b"a\nb\xff\x00c"[..], "line 2, column 2"),
            (b"a\n\x00", "line 2, column 1"),
            (b"ab\xe4\x01", "line 1, column 3"),
            (b"\xef\xbb\xbfa\xe4", "line 1, column 2"),
            (b"\xff\xfea\x00\x00\xd8b\x00", "line 1, column 2"),
            (b"\xff\xfe\x00\x00a\x00\x00\x00", "line 1, column 1"),
        ] {
            let error = decode(Path::new("a"), bytes, &budget()).unwrap_err().to_string();
            assert!(error.contains(place) && error.contains("save it as UTF-8"), "{bytes:?}: {error}");
        }
        assert!(decode_utf8(Path::new("a"), b"{\"a\": \"\xe4\"}", &budget()).is_err());
    }

    #[test]
    fn xml_declares_its_encoding() {
        let read = |bytes: &[u8]| decode_xml(Path::new("a"), bytes, &budget()).map(Cow::into_owned);
        for label in ["ISO-8859-1", "windows-1252", "latin1"] {
            let text = [format!("<?xml version='1.0' encoding = '{label}'?><a>").as_bytes(), b"\xfc</a>"].concat();
            assert!(read(&text).unwrap().ends_with("<a>ü</a>"), "{label}");
        }
        assert!(read(b"<?xml version=\"1.0\" encoding=\"KOI8-R\"?>\xc1").unwrap().ends_with('а'));
        let marked = "\u{feff}<?xml version='1.0' encoding='UTF-16'?><a/>";
        assert_eq!(read(&utf16(marked, false)).unwrap(), marked[3..]);
        assert_eq!(read(&utf16(&marked[3..], true)).unwrap(), marked[3..]);
        assert_eq!(read(&marked.as_bytes()[3..]).unwrap(), marked[3..]);
        assert!(read(b"<a>\xfc</a>").unwrap_err().to_string().contains("line 1, column 4"));
        assert!(read(b"<?xml encoding='klingon'?><a/>").unwrap_err().to_string().contains("klingon"));
    }
}
