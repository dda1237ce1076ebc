//! URIs of buffers and images: files beside the document, or embedded data.

use std::borrow::Cow;
use std::path::Path;

use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;

use super::document::Document;
use crate::error::SceneError;
use crate::resource::Resources;
use crate::text::shortened;

/// A resolved reference.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Reference {
    /// A file: its path, relative to the folder of the scene.
    File(String),
    /// The decoded bytes of a `data:` URI.
    Data(Vec<u8>),
}

/// An error about an invalid reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BadReference {
    Forbidden(&'static str),
    Malformed(&'static str),
}

/// Resolves a URI of a document: a `data:` URI or a path. [`Resources`] checks later whether the path is allowed.
pub(super) fn resolve(uri: &str) -> Result<Reference, BadReference> {
    if let Some(rest) = strip_prefix_ignoring_case(uri, "data:") {
        return decode_data(rest).map(Reference::Data).map_err(BadReference::Malformed);
    }
    let uri = uri.split('#').next().unwrap_or(uri);
    // Drop a query, which names a version for browsers.
    let uri = uri.split('?').next().unwrap_or(uri);
    if let Some(file) = strip_prefix_ignoring_case(uri, "file:") {
        let path = percent_decode(file).ok_or(BadReference::Malformed(NOT_ENCODED))?;
        // `file:///C:/a` is on a drive.
        let path = path.strip_prefix("//").unwrap_or(&path);
        let on_drive = path.strip_prefix('/').filter(|path| path.as_bytes().get(1) == Some(&b':'));
        return Ok(Reference::File(on_drive.unwrap_or(path).into()));
    }
    let scheme = uri.split(['/', '?', '#', '\\']).next().and_then(|start| start.split_once(':'));
    // A single letter is a drive.
    let is_scheme =
        |scheme: &str| scheme.len() > 1 && scheme.bytes().all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(&b));
    if scheme.is_some_and(|(scheme, _)| is_scheme(scheme)) {
        return Err(BadReference::Forbidden(
            "only files beside the scene are read; download it and refer to it by a relative path",
        ));
    }
    let decoded = percent_decode(uri).ok_or(BadReference::Malformed(NOT_ENCODED))?;
    Ok(Reference::File(decoded))
}

const NOT_ENCODED: &str = "it is not valid percent-encoded UTF-8";

fn strip_prefix_ignoring_case<'a>(text: &'a str, prefix: &str) -> Option<&'a str> {
    let (head, rest) = text.split_at_checked(prefix.len())?;
    head.eq_ignore_ascii_case(prefix).then_some(rest)
}

/// Decodes a `data:` URI after its scheme (RFC 2397).
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
        Ok(percent_decode_str(data).collect())
    }
}

/// Decodes percent-encoding; a percent sign without two hexadecimal digits is kept.
fn percent_decode(text: &str) -> Option<String> {
    percent_decode_str(text).decode_utf8().ok().map(Cow::into_owned)
}

/// Reads all buffers of a document.
pub(super) fn load_buffers<'a>(
    document: &Document,
    path: &Path,
    bin: Option<&'a [u8]>,
    resources: &Resources<'_>,
) -> Result<Vec<Cow<'a, [u8]>>, SceneError> {
    let mut buffers = Vec::with_capacity(document.buffers.len());
    for (index, buffer) in document.buffers.iter().enumerate() {
        let place = || format!("buffers[{index}]");
        let invalid = |problem: String| SceneError::Invalid { path: path.into(), place: place(), problem };
        let uri = buffer.uri.as_ref().filter(|_| !buffer.extensions.is_fallback());
        let mut bytes = match (uri, bin) {
            (Some(uri), _) => match resolve(uri).map_err(|bad| bad.error(path, place(), uri))? {
                Reference::Data(bytes) => Cow::Owned(bytes),
                Reference::File(file) => Cow::Owned(resources.open(&file, &place())?),
            },
            (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
            // Fallback buffer: its views are decompressed from another one, and direct reads find it empty.
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
    /// Converts to an error at a location of the document.
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

    #[test]
    fn paths_are_decoded() {
        let expected = |path: &str| Ok(Reference::File(path.into()));
        assert_eq!(resolve("a%20b/c.bin"), expected("a b/c.bin"));
        assert_eq!(resolve("%2e%2e/a"), expected("../a"));
        assert_eq!(resolve("100%.png"), expected("100%.png"));
        assert_eq!(resolve("%C3%BC.png"), expected("ü.png"));
        for uri in ["a.png?v=3", "a.png?v=3#x", "a.png#x"] {
            assert_eq!(resolve(uri), expected("a.png"));
        }
        assert_eq!(resolve("a%3Fb%23.png"), expected("a?b#.png"));
        // Any path resolves here; permission is checked when the file is opened.
        assert_eq!(resolve("file:///etc/passwd"), expected("/etc/passwd"));
        assert_eq!(resolve("FILE:///C:/a%20b.png"), expected("C:/a b.png"));
        assert!(matches!(resolve("%ff"), Err(BadReference::Malformed(_))));
    }

    #[test]
    fn other_schemes_are_refused() {
        for uri in ["https://example.org/a.bin", "HTTP:a"] {
            assert!(matches!(resolve(uri), Err(BadReference::Forbidden(_))), "{uri}");
        }
    }

    #[test]
    fn data_uris_hold_their_bytes() {
        let data = |bytes: &[u8]| Ok(Reference::Data(bytes.to_vec()));
        assert_eq!(resolve("data:application/octet-stream;base64,AQID"), data(&[1, 2, 3]));
        assert_eq!(resolve("data:;base64,AQI="), data(&[1, 2]));
        assert_eq!(resolve("data:;base64,AQI"), data(&[1, 2]));
        assert_eq!(resolve("DATA:,a%20b"), data(b"a b"));
        assert!(resolve("data:;base64,A*").is_err());
        assert!(resolve("data:base64").is_err());
    }
}
