//! The multipart body of this transport: envelope and payload.

use super::head::{HttpError, end_of_head};
use crate::{
    acc::{Letter, Outbound},
    wire::{WireError, XML_FORM, parse_envelope, print_envelope},
};

const MALFORMED: HttpError = HttpError::Bad("the body does not have the two parts that it must have");

/// Parses the body of a POST. Returns its message, with envelope.
///
/// - `content_type`: the value of the Content-Type field, which names the boundary of the parts.
///
/// # Errors
/// [`HttpError::Bad`]: the content type is not `multipart/mixed` with a boundary, or the parts, the envelope or the
/// message are invalid.
pub fn open(content_type: &str, body: &[u8]) -> Result<Letter, HttpError> {
    let (envelope, payload) = split(content_type, body)?;
    let envelope = std::str::from_utf8(envelope).map_err(|_| HttpError::Bad("the envelope is not text"))?;
    let envelope = parse_envelope(envelope).map_err(|_| HttpError::Bad("the envelope cannot be read"))?;
    Letter::open(envelope, payload).map_err(|_| HttpError::Bad("the message cannot be read"))
}

/// Returns the bytes of the two parts. Their own fields are ignored, because the envelope has the same information.
fn split<'a>(content_type: &str, body: &'a [u8]) -> Result<(&'a [u8], &'a [u8]), HttpError> {
    let boundary = boundary(content_type).ok_or(HttpError::Bad("not multipart/mixed with a boundary"))?;
    let delimiter = [b"--", boundary.as_bytes()].concat();
    let mut parts = Vec::new();
    let mut begin = None;
    for (start, after) in delimiters(body, &delimiter) {
        if let Some(begin) = begin {
            // The line end before a delimiter may belong to the delimiter before
            parts.push(part(body.get(begin..start).ok_or(MALFORMED)?)?);
        }
        if body[after..].starts_with(b"--") {
            return match parts[..] {
                [envelope, payload] => Ok((envelope, payload)),
                _ => Err(MALFORMED),
            };
        }
        let line = body[after..].iter().position(|byte| *byte == b'\n').ok_or(MALFORMED)?;
        begin = Some(after + line + 1);
    }
    Err(MALFORMED)
}

/// Returns the `boundary` of `multipart/mixed`, which old platforms write `multipart-mixed`, with or without quotes.
fn boundary(content_type: &str) -> Option<&str> {
    let (kind, parameters) = content_type.split_once(';')?;
    let kind = kind.trim();
    if !kind.eq_ignore_ascii_case("multipart/mixed") && !kind.eq_ignore_ascii_case("multipart-mixed") {
        return None;
    }
    let mut values = parameters.split(';').filter_map(|parameter| parameter.split_once('='));
    let (_, value) = values.find(|(name, _)| name.trim().eq_ignore_ascii_case("boundary"))?;
    let value = value.trim();
    let value = value.strip_prefix('"').and_then(|value| value.strip_suffix('"')).unwrap_or(value);
    (1..=200).contains(&value.len()).then_some(value)
}

/// Returns the delimiters at beginnings of lines: the end of the part before, and the end of the delimiter.
fn delimiters<'a>(body: &'a [u8], delimiter: &'a [u8]) -> impl Iterator<Item = (usize, usize)> + 'a {
    let starts =
        std::iter::once(0).chain(body.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(at, _)| at + 1));
    starts.filter(|start| body[*start..].starts_with(delimiter)).map(|start| {
        // The line end before a delimiter belongs to it
        let before = &body[..start];
        let before = before.strip_suffix(b"\n").unwrap_or(before);
        let before = before.strip_suffix(b"\r").unwrap_or(before);
        (before.len(), start + delimiter.len())
    })
}

/// Returns the content after the fields of a part.
fn part(bytes: &[u8]) -> Result<&[u8], HttpError> {
    for blank in [&b"\r\n"[..], b"\n"] {
        if let Some(rest) = bytes.strip_prefix(blank) {
            return Ok(rest);
        }
    }
    end_of_head(bytes).map(|length| &bytes[length..]).ok_or(MALFORMED)
}

/// Returns the Content-Type and the body for an outgoing message, in the form that every known platform reads.
///
/// - `number`: makes the boundary of the parts unique.
///
/// # Errors
/// The envelope cannot be written in XML.
pub fn seal(outbound: &Outbound, number: u64) -> Result<(String, Vec<u8>), WireError> {
    let envelope: String = print_envelope(&outbound.envelope)?
        .chars()
        // Some platforms read the bytes of an envelope as Latin-1
        .map(|character| match character {
            ascii if ascii.is_ascii() => ascii.to_string(),
            other => format!("&#{};", u32::from(other)),
        })
        .collect();
    let mut boundary = format!("bottega{number:016x}");
    while outbound.payload.contains(&boundary) {
        boundary.push('x');
    }
    let xml = outbound.envelope.acl_representation.eq_ignore_ascii_case(XML_FORM);
    let kind = if xml { "application/xml" } else { "application/text" };
    let charset = outbound.envelope.payload_encoding.as_deref().unwrap_or("UTF-8");
    let body = format!(
        "This is not part of the MIME multipart encoded message.\r\n--{boundary}\r\nContent-Type: \
         application/xml\r\n\r\n{envelope}\r\n--{boundary}\r\nContent-Type: {kind}; charset={charset}\r\n\r\n{}\r\n--{boundary}--\r\n",
        outbound.payload
    );
    Ok((format!("multipart/mixed ; boundary=\"{boundary}\""), body.into_bytes()))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        AgentId, Performative,
        wire::{Envelope, STRING_FORM, WireMessage, print_string},
    };

    #[test]
    fn what_is_sealed_opens_as_the_same_and_the_envelope_is_ascii() {
        let agent = AgentId { name: "é@中".into(), addresses: Arc::new(["http://h/acc".to_owned()]) };
        let boundary = "bottega0000000000000007";
        let message = WireMessage {
            sender: Some(agent.clone()),
            content: Some(format!("—\r\n--{boundary}\r\n")),
            ..WireMessage::new(Performative::Inform)
        };
        let payload = print_string(&message).unwrap();
        let envelope = Envelope {
            to: vec![agent.clone()],
            acl_representation: STRING_FORM.to_owned(),
            payload_encoding: Some("UTF-8".to_owned()),
            ..Envelope::default()
        };
        let outbound =
            Outbound { addresses: Vec::new(), envelope: envelope.clone(), payload, message: message.clone() };
        let (content_type, body) = seal(&outbound, 7).unwrap();
        let end = body.windows(11).position(|bytes| bytes == b"</envelope>").unwrap();
        assert!(body[..end].is_ascii());
        let letter = open(&content_type, &body).unwrap();
        assert_eq!((letter.envelope, letter.message), (envelope, message));
    }

    #[test]
    fn a_body_has_two_parts_and_an_end() {
        let kind = "multipart/mixed; boundary=b";
        assert_eq!(split(kind, b"--b\n\nx\n--b\r\nF: v\r\n\r\ny\r\n--b--"), Ok((&b"x"[..], &b"y"[..])));
        for bad in [
            &b""[..],
            b"--b\n\nx\n--b\n\ny",
            b"--b\n\nx\n--b--",
            b"--b\n\nx\n--b\n\ny\n--b\n\nz\n--b--",
            b"--b\nx\n--b\n\ny\n--b--",
            b"--b",
            b"--b\n--b\n--b--",
        ] {
            assert_eq!(split(kind, bad), Err(MALFORMED), "{}", String::from_utf8_lossy(bad));
        }
    }
}
