//! The file names of the pictures of an animation.

use std::path::{Path, PathBuf};

/// Number of digits of the frame number if the output's name does not give it.
const DIGITS: usize = 4;
/// Largest number of digits that a name can ask for: file systems limit names to 255 bytes.
const DIGITS_MAX: usize = 64;

/// The name of an output, with a place for the frame number.
///
/// The place is the last run of `#`, one digit each (`film.####.exr`), or a printf field (`film.%04d.exr`, `film.%d.exr`; `%%`
/// then stands for a percent sign). Without either, the number is put before the extension. A negative number is a sign
/// followed by the usual number of digits (`film.-0012.exr`), as in Blender and Maya.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FrameName {
    output: PathBuf,
    before: String,
    after: String,
    digits: usize,
}

/// The reason why a name has no valid place for a frame number.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum NameError {
    #[error("`{name}` has several places for the number of a frame")]
    SeveralPlaces { name: String },
    #[error("`{field}` in `{name}` is not a place for a frame number")]
    NoPlace { name: String, field: String },
    #[error("the name of the output is not Unicode, so it has no place for the number of a frame")]
    NotUnicode,
}

/// A printf field in a name: its byte range, and the number of digits.
struct Field {
    start: usize,
    end: usize,
    digits: usize,
}

impl FrameName {
    pub(crate) fn new(output: &Path) -> Result<Self, NameError> {
        let name = output.file_name().unwrap_or_default().to_str().ok_or(NameError::NotUnicode)?;
        let part = |before: &str, after: &str, digits: usize| Self {
            output: output.to_owned(),
            before: before.to_owned(),
            after: after.to_owned(),
            digits,
        };
        let hashes = name.rfind('#').map(|end| (name[..end].trim_end_matches('#').len(), end + 1));
        match (field(name)?, hashes) {
            (Some(_), Some(_)) => Err(NameError::SeveralPlaces { name: name.to_owned() }),
            (Some(Field { start, end, digits }), None) => {
                let plain = |text: &str| text.replace("%%", "%");
                Ok(part(&plain(&name[..start]), &plain(&name[end..]), digits))
            }
            (None, Some((start, end))) => Ok(part(&name[..start], &name[end..], end - start)),
            (None, None) => match name.rfind('.') {
                Some(dot) => Ok(part(&format!("{}.", &name[..dot]), &name[dot..], DIGITS)),
                None => Ok(part(&format!("{name}."), "", DIGITS)),
            },
        }
    }

    /// Returns the file of a frame's picture.
    pub(crate) fn of(&self, frame: i32) -> PathBuf {
        let Self { output, before, after, digits } = self;
        let sign = if frame < 0 { "-" } else { "" };
        output.with_file_name(format!("{before}{sign}{:0digits$}{after}", frame.unsigned_abs()))
    }
}

/// Finds the printf field of a name; `None`: it has none.
fn field(name: &str) -> Result<Option<Field>, NameError> {
    let bytes = name.as_bytes();
    let mut found = None;
    let mut at = 0;
    while at < bytes.len() {
        let start = at;
        at += 1;
        if bytes[start] != b'%' {
            continue;
        }
        if bytes.get(at) == Some(&b'%') {
            at += 1;
            continue;
        }
        let width_end = at + bytes[at..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        let (width, end) = (&name[at..width_end], width_end + 1);
        if !matches!(bytes.get(width_end), Some(b'd' | b'i' | b'u')) {
            // A name such as `50%.exr` has a percent sign but no field.
            continue;
        }
        let digits = match width {
            "" => Some(1),
            width if width.starts_with('0') => width.parse().ok().filter(|digits| (1..=DIGITS_MAX).contains(digits)),
            // Fields padded with spaces are not supported.
            _ => None,
        };
        let no_place = || NameError::NoPlace { name: name.to_owned(), field: name[start..end].to_owned() };
        let field = Field { start, end, digits: digits.ok_or_else(no_place)? };
        if found.replace(field).is_some() {
            return Err(NameError::SeveralPlaces { name: name.to_owned() });
        }
        at = end;
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(output: &str, frame: i32) -> Result<String, NameError> {
        FrameName::new(Path::new(output)).map(|name| name.of(frame).to_str().expect("Unicode").to_owned())
    }

    #[test]
    fn a_picture_has_the_number_of_its_frame() {
        for (output, frame, expected) in [
            ("a/b.exr", 12, "a/b.0012.exr"),
            ("a/b", 12, "a/b.0012"),
            ("a/b-##.exr", 12, "a/b-12.exr"),
            ("a/b-##.exr", 1234, "a/b-1234.exr"),
            ("###/b_#####_c.png", 12, "###/b_00012_c.png"),
            ("#-##.png", 12, "#-12.png"),
            ("pct.%04d.exr", 12, "pct.0012.exr"),
            ("pct.%d.exr", 12, "pct.12.exr"),
            ("%03d.png", 1234, "1234.png"),
            ("100%%-%02d.png", 7, "100%-07.png"),
            ("%04d/p.%04d.exr", 7, "%04d/p.0007.exr"),
            // A name without a field stays unchanged.
            ("50%.exr", 7, "50%.0007.exr"),
            ("50%%.exr", 7, "50%%.0007.exr"),
            ("50%.####.exr", 7, "50%.0007.exr"),
            ("a.%x.exr", 7, "a.%x.0007.exr"),
        ] {
            assert_eq!(name(output, frame).as_deref(), Ok(expected), "{output}");
        }
    }

    #[test]
    fn a_number_below_zero_is_its_sign_and_then_as_many_digits() {
        for (output, frame, expected) in [
            ("b.exr", -12, "b.-0012.exr"),
            ("b.####.exr", -12, "b.-0012.exr"),
            ("b.%04d.exr", -12, "b.-0012.exr"),
            ("b.%d.exr", -12, "b.-12.exr"),
            ("b.##.exr", -123, "b.-123.exr"),
            ("b.####.exr", 0, "b.0000.exr"),
        ] {
            assert_eq!(name(output, frame).as_deref(), Ok(expected), "{output}");
        }
    }

    #[test]
    fn a_place_that_is_none_is_refused() {
        for (output, words) in [
            ("a.%04d.####.exr", "several"),
            ("a.%04d.%04d.exr", "several"),
            ("a.%4d.exr", "`%4d`"),
            ("a.%0d.exr", "`%0d`"),
            ("a.%0999999999999999999999d.exr", "not a place"),
            ("a.%0500d.exr", "not a place"),
        ] {
            let error = name(output, 1).expect_err(output).to_string();
            assert!(error.contains(words), "{output}: {error}");
        }
    }
}
