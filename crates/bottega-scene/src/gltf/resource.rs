//! What a document refers to: buffers and pictures, in files beside it or within itself.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::document::Document;
use super::shortened;
use crate::SceneError;
use crate::file::read_file;
use crate::load::MemoryBudget;

/// Where the bytes of a reference are.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Reference {
    /// In a file below the folder of the scene.
    File(PathBuf),
    /// In the reference itself.
    Data(Vec<u8>),
}

/// Why a reference cannot be followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BadReference {
    Forbidden(&'static str),
    Malformed(&'static str),
}

const OUTSIDE: &str = "it lies outside the folder of the scene; copy it there and refer to it by a relative path";

/// Understands a URI of a document in `folder`. Only `data:` URIs and relative paths that stay within the folder pass.
pub(super) fn resolve(folder: &Path, uri: &str) -> Result<Reference, BadReference> {
    if let Some(rest) = strip_prefix_ignoring_case(uri, "data:") {
        return decode_data(rest).map(Reference::Data).map_err(BadReference::Malformed);
    }
    let scheme = uri.split(['/', '?', '#', '\\']).next().and_then(|start| start.split_once(':'));
    if let Some((scheme, _)) = scheme {
        let is_scheme =
            scheme.len() > 1 && scheme.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"+-.".contains(&byte));
        if is_scheme || scheme.len() == 1 {
            return Err(BadReference::Forbidden(
                "only files beside the scene are read; download it and refer to it by a relative path",
            ));
        }
    }
    let decoded = percent_decode(uri).ok_or(BadReference::Malformed("it is not valid percent-encoded UTF-8"))?;
    if decoded.contains('\0') {
        return Err(BadReference::Malformed("it contains a zero byte"));
    }
    // Files made on Windows may separate by backslashes.
    let decoded = decoded.replace('\\', "/");
    if decoded.starts_with('/') || decoded.as_bytes().get(1) == Some(&b':') {
        return Err(BadReference::Forbidden(OUTSIDE));
    }
    let mut parts: Vec<&str> = Vec::new();
    for part in decoded.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop().ok_or(BadReference::Forbidden(OUTSIDE))?;
            }
            part => parts.push(part),
        }
    }
    if parts.is_empty() {
        return Err(BadReference::Malformed("it names no file"));
    }
    Ok(Reference::File(parts.iter().fold(folder.to_path_buf(), |path, part| path.join(part))))
}

fn strip_prefix_ignoring_case<'a>(text: &'a str, prefix: &str) -> Option<&'a str> {
    let (head, rest) = text.split_at_checked(prefix.len())?;
    head.eq_ignore_ascii_case(prefix).then_some(rest)
}

/// The bytes of a `data:` URI after its scheme (RFC 2397).
fn decode_data(rest: &str) -> Result<Vec<u8>, &'static str> {
    const LENIENT: GeneralPurpose = GeneralPurpose::new(
        &base64::alphabet::STANDARD,
        GeneralPurposeConfig::new()
            .with_decode_padding_mode(DecodePaddingMode::Indifferent)
            .with_decode_allow_trailing_bits(true),
    );
    let (head, data) = rest.split_once(',').ok_or("its data URI has no comma")?;
    if head.ends_with(";base64") {
        LENIENT.decode(data).map_err(|_| "its data URI is not valid base64")
    } else {
        Ok(percent_decode_bytes(data))
    }
}

fn percent_decode(text: &str) -> Option<String> {
    String::from_utf8(percent_decode_bytes(text)).ok()
}

/// A percent sign that two hexadecimal digits do not follow stands for itself.
fn percent_decode_bytes(text: &str) -> Vec<u8> {
    let mut bytes = text.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    while let Some((&first, rest)) = bytes.split_first() {
        let digit = |index: usize| rest.get(index).and_then(|&byte| char::from(byte).to_digit(16));
        bytes = rest;
        if first == b'%'
            && let (Some(high), Some(low)) = (digit(0), digit(1))
        {
            decoded.push((high * 16 + low) as u8);
            bytes = &rest[2..];
        } else {
            decoded.push(first);
        }
    }
    decoded
}

/// Reads all buffers. Their digests go to `digest`, in order.
pub(super) fn load_buffers<'a>(
    document: &Document,
    path: &Path,
    bin: Option<&'a [u8]>,
    budget: &MemoryBudget,
    digest: &mut blake3::Hasher,
) -> Result<Vec<Cow<'a, [u8]>>, SceneError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut buffers = Vec::with_capacity(document.buffers.len());
    for (index, buffer) in document.buffers.iter().enumerate() {
        let place = || format!("buffers[{index}]");
        let invalid = |problem: String| SceneError::Invalid { path: path.into(), place: place(), problem };
        let uri = buffer.uri.as_ref().filter(|_| !buffer.extensions.is_fallback());
        let mut bytes = match (uri, bin) {
            (Some(uri), _) => match resolve(folder, uri).map_err(|bad| bad.error(path, place(), uri))? {
                Reference::Data(bytes) => Cow::Owned(bytes),
                Reference::File(file) => {
                    let bytes = read_file(&file, budget)?;
                    digest.update(blake3::hash(&bytes).as_bytes());
                    Cow::Owned(bytes)
                }
            },
            (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
            // Views of such a buffer are decompressed from another one. Who reads it otherwise is told that it is empty.
            (None, _) => {
                buffers.push(Cow::Borrowed(&[][..]));
                continue;
            }
        };
        let Some(length) = usize::try_from(buffer.byte_length).ok().filter(|&length| length <= bytes.len()) else {
            return Err(invalid(format!("announces {} bytes, there are {}", buffer.byte_length, bytes.len())));
        };
        match &mut bytes {
            Cow::Borrowed(slice) => *slice = &slice[..length],
            Cow::Owned(vec) => vec.truncate(length),
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

impl BadReference {
    pub(super) fn error(self, path: &Path, place: String, uri: &str) -> SceneError {
        let path = path.to_path_buf();
        match self {
            Self::Forbidden(reason) => {
                SceneError::ForbiddenReference { path, place, uri: shortened(uri).into_owned(), reason }
            }
            Self::Malformed(problem) => SceneError::Invalid { path, place, problem: problem.into() },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(uri: &str) -> Result<Reference, BadReference> {
        resolve(Path::new("scenes"), uri)
    }

    #[test]
    fn relative_paths_are_decoded_and_stay_in_the_folder() {
        let expected = |path: &str| Ok(Reference::File(PathBuf::from(path)));
        assert_eq!(file("a%20b/c.bin"), expected("scenes/a b/c.bin"));
        assert_eq!(file("./x/../c.bin"), expected("scenes/c.bin"));
        assert_eq!(file("textures\\c.png"), expected("scenes/textures/c.png"));
        assert_eq!(file("100%.png"), expected("scenes/100%.png"));
        assert_eq!(file("%C3%BC.png"), expected("scenes/ü.png"));
    }

    #[test]
    fn whatever_leaves_the_folder_is_refused() {
        for uri in [
            "../a",
            "a/../../b",
            "/etc/passwd",
            "%2e%2e/a",
            "..%2Fa",
            "..\\a",
            "C:\\a",
            "c:a",
            "file:///etc/passwd",
            "https://example.org/a.bin",
            "//host/a",
            "%2Fetc/passwd",
        ] {
            assert!(matches!(file(uri), Err(BadReference::Forbidden(_))), "{uri}");
        }
        for uri in ["", ".", "a/..", "a%00b", "%ff"] {
            assert!(matches!(file(uri), Err(BadReference::Malformed(_))), "{uri}");
        }
    }

    #[test]
    fn data_uris_hold_their_bytes() {
        let data = |bytes: &[u8]| Ok(Reference::Data(bytes.to_vec()));
        assert_eq!(file("data:application/octet-stream;base64,AQID"), data(&[1, 2, 3]));
        assert_eq!(file("data:;base64,AQI="), data(&[1, 2]));
        assert_eq!(file("data:;base64,AQI"), data(&[1, 2]));
        assert_eq!(file("DATA:,a%20b"), data(b"a b"));
        assert!(file("data:;base64,A*").is_err());
        assert!(file("data:base64").is_err());
    }
}
