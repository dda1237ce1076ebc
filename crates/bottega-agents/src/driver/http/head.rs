//! The parsers of HTTP/1.1 headers, and the errors that they return. They accept what old platforms send: blank lines before
//! the header, folded fields, and lines that end in LF alone.

use super::HEAD_BYTES_MAX;

/// The reason why a request is rejected, with its status; or why a response cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HttpError {
    /// 400: the request is malformed, as the text says. Also stands for a response that cannot be read.
    #[error("bad request: {0}")]
    Bad(&'static str),
    /// 404: the path does not exist.
    #[error("nothing is here")]
    NotFound,
    /// 405: the method is not supported for this path.
    #[error("this path does not support the method")]
    Method,
    /// 411: the length of the body is not given by Content-Length.
    #[error("a length is needed")]
    Length,
    /// 413: the request is too large.
    #[error("too large")]
    TooLarge,
    /// 503: the server is overloaded.
    #[error("too many requests")]
    Busy,
}

impl HttpError {
    /// Returns the status code and the reason phrase, such as `404 Not Found`.
    pub fn status(&self) -> &'static str {
        match self {
            Self::Bad(_) => "400 Bad Request",
            Self::NotFound => "404 Not Found",
            Self::Method => "405 Method Not Allowed",
            Self::Length => "411 Length Required",
            Self::TooLarge => "413 Content Too Large",
            Self::Busy => "503 Service Unavailable",
        }
    }
}

/// The header of an HTTP request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Head {
    /// The method: `POST`, `GET`, …
    pub method: String,
    /// The path of the target without its query; the target may be in absolute form.
    pub path: String,
    /// True if the client keeps the connection open for further requests.
    pub keep: bool,
    /// The value of Content-Type; empty if there is none.
    pub content_type: String,
    /// Length of the body in bytes; 0 if a request other than a POST does not give it.
    pub content_length: usize,
    /// True if the client waits for 100 Continue before it sends the body.
    pub expects_continue: bool,
}

/// Parses a header at the beginning of `bytes`. Returns it with its length in bytes, including blank lines before it;
/// `None`: it is incomplete.
///
/// Blank lines before it are ignored, fields may be folded over several lines, and lines may end in LF alone.
///
/// # Errors
/// [`HttpError::Bad`]: the header is longer than [`HEAD_BYTES_MAX`] bytes, or malformed. [`HttpError::Length`]: a POST
/// without Content-Length, or a request with Transfer-Encoding.
pub fn parse_head(bytes: &[u8]) -> Result<Option<(Head, usize)>, HttpError> {
    let blank = bytes.iter().take_while(|byte| matches!(byte, b'\r' | b'\n')).count();
    let Some(length) = end_of_head(&bytes[blank..]) else {
        return if bytes.len() > HEAD_BYTES_MAX { Err(HttpError::Bad("the head is too long")) } else { Ok(None) };
    };
    if length > HEAD_BYTES_MAX {
        return Err(HttpError::Bad("the head is too long"));
    }
    let text: String = bytes[blank..blank + length].iter().map(|byte| char::from(*byte)).collect();
    Ok(Some((read_head(&text)?, blank + length)))
}

/// Returns the length of the header in bytes, including the empty line at its end.
pub(super) fn end_of_head(bytes: &[u8]) -> Option<usize> {
    let ends = bytes.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(at, _)| at);
    ends.map(|at| (at, &bytes[at + 1..])).find_map(|(at, rest)| match rest {
        [b'\n', ..] => Some(at + 2),
        [b'\r', b'\n', ..] => Some(at + 3),
        _ => None,
    })
}

fn read_head(text: &str) -> Result<Head, HttpError> {
    let mut lines = text.lines();
    let mut request = lines.next().unwrap_or_default().split_ascii_whitespace();
    let (Some(method), Some(target), Some(version), None) =
        (request.next(), request.next(), request.next(), request.next())
    else {
        return Err(HttpError::Bad("no request line"));
    };
    if !version.starts_with("HTTP/1.") {
        return Err(HttpError::Bad("not HTTP/1"));
    }
    let (mut keep, mut content_type, mut content_length) = (version != "HTTP/1.0", None, None);
    let mut expects_continue = false;
    for (name, value) in fields(lines)? {
        match name.as_str() {
            "connection" => {
                let mut words = value.split(',').map(str::trim);
                keep = words.clone().any(|word| word.eq_ignore_ascii_case("keep-alive"))
                    || keep && !words.any(|word| word.eq_ignore_ascii_case("close"));
            }
            "content-type" => content_type = Some(value),
            "content-length" => {
                let length = if value.bytes().all(|byte| byte.is_ascii_digit()) { value.parse().ok() } else { None };
                let length: usize = length.ok_or(HttpError::Bad("the length is not a number"))?;
                if content_length.replace(length).is_some_and(|other| other != length) {
                    return Err(HttpError::Bad("two lengths"));
                }
            }
            // No client of this transport uses chunks, and two ways to give a length are unsafe
            "transfer-encoding" => return Err(HttpError::Length),
            "expect" => expects_continue = value.eq_ignore_ascii_case("100-continue"),
            _ => {}
        }
    }
    if method == "POST" && content_length.is_none() {
        return Err(HttpError::Length);
    }
    Ok(Head {
        method: method.to_owned(),
        path: path_of(target).to_owned(),
        keep,
        content_type: content_type.unwrap_or_default(),
        content_length: content_length.unwrap_or(0),
        expects_continue,
    })
}

/// Returns the field names in lower case, with values. A line that starts with a blank continues the one before.
fn fields<'a>(lines: impl Iterator<Item = &'a str>) -> Result<Vec<(String, String)>, HttpError> {
    let mut fields: Vec<(String, String)> = Vec::new();
    for line in lines {
        if line.is_empty() {
            break;
        }
        if line.starts_with([' ', '\t']) {
            let (_, value) = fields.last_mut().ok_or(HttpError::Bad("a fold of nothing"))?;
            value.push(' ');
            value.push_str(line.trim());
            continue;
        }
        let (name, value) = line.split_once(':').ok_or(HttpError::Bad("a field without a colon"))?;
        fields.push((name.trim().to_ascii_lowercase(), value.trim().to_owned()));
    }
    Ok(fields)
}

fn path_of(target: &str) -> &str {
    let path = match target.split_once("://") {
        Some((_, rest)) => rest.find('/').map_or("/", |slash| &rest[slash..]),
        None => target,
    };
    path.split(['?', '#']).next().unwrap_or(path)
}

/// Returns the code of the status line at the beginning of `bytes`, such as 200. `None`: the line is incomplete.
///
/// # Errors
/// The bytes are not a status line, or one that does not end within [`HEAD_BYTES_MAX`] bytes.
pub fn parse_status(bytes: &[u8]) -> Result<Option<u16>, HttpError> {
    let bad = HttpError::Bad("no status line");
    let Some(end) = bytes.iter().position(|byte| *byte == b'\n') else {
        return if bytes.len() > HEAD_BYTES_MAX { Err(bad) } else { Ok(None) };
    };
    let line = std::str::from_utf8(&bytes[..end]).map_err(|_| bad.clone())?;
    let mut words = line.split_ascii_whitespace();
    match (words.next(), words.next().and_then(|status| status.parse().ok())) {
        (Some(version), Some(status)) if version.starts_with("HTTP/1.") => Ok(Some(status)),
        _ => Err(bad),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_of_old_platforms_are_read() {
        let text = "\r\n\r\nPOST http://127.0.0.1:7779/acc?x HTTP/1.1\r\nHost: h\r\nContent-Type: multipart-mixed;\r\n \
                    boundary=b\r\ncontent-LENGTH: 12\nConnection: Keep-Alive\r\n\r\nbody";
        let (head, taken) = parse_head(text.as_bytes()).unwrap().unwrap();
        assert_eq!((head.method.as_str(), head.path.as_str()), ("POST", "/acc"));
        assert_eq!(head.content_type, "multipart-mixed; boundary=b");
        assert_eq!((head.content_length, head.keep), (12, true));
        assert_eq!(&text[taken..], "body");
        assert_eq!(parse_head(&text.as_bytes()[..60]), Ok(None));
        for (bad, error) in [
            ("POST / HTTP/1.1\r\n\r\n", HttpError::Length),
            ("POST / HTTP/1.1\r\nTransfer-Encoding: chunked\r\nContent-Length: 3\r\n\r\n", HttpError::Length),
            ("POST / HTTP/1.1\r\nContent-Length: 3\r\nContent-Length: 4\r\n\r\n", HttpError::Bad("two lengths")),
            ("POST / HTTP/1.1\r\nContent-Length: +3\r\n\r\n", HttpError::Bad("the length is not a number")),
            ("POST /\r\n\r\n", HttpError::Bad("no request line")),
            ("GET / HTTP/2\r\n\r\n", HttpError::Bad("not HTTP/1")),
            ("GET / HTTP/1.1\r\n folded\r\n\r\n", HttpError::Bad("a fold of nothing")),
        ] {
            assert_eq!(parse_head(bad.as_bytes()), Err(error), "{bad}");
        }
        let long = vec![b'a'; HEAD_BYTES_MAX + 1];
        assert!(parse_head(&long).is_err());
        let close = parse_head(b"GET / HTTP/1.1\r\nConnection: close\r\n\r\n").unwrap().unwrap().0;
        assert!(!close.keep);
    }

    #[test]
    fn of_an_answer_only_the_status_counts() {
        assert_eq!(parse_status(b"HTTP/1.1 200 OK\r\n"), Ok(Some(200)));
        assert_eq!(parse_status(b"HTTP/1.1 200 O"), Ok(None));
        assert!(parse_status(b"<html>\n").is_err());
    }
}
