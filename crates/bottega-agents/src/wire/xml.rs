//! A small XML tree with limits, without document types and entities.

use quick_xml::{
    Reader, XmlVersion,
    events::{BytesStart, Event},
};

use super::{TEXT_BYTES_MAX, WireError};

/// Maximum depth of elements.
const DEPTH_MAX: usize = 16;
/// Maximum number of elements in a document.
const ELEMENTS_MAX: usize = 1 << 14;
/// Maximum number of attributes of an element.
const ATTRIBUTES_MAX: usize = 16;

/// An element with its attributes, text and child elements.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct XmlElement {
    pub(super) name: String,
    pub(super) attributes: Vec<(String, String)>,
    pub(super) children: Vec<XmlElement>,
    /// All text directly within it.
    pub(super) text: String,
}

impl XmlElement {
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(other, _)| other == name).map(|(_, value)| value.as_str())
    }

    pub(super) fn child(&self, name: &str) -> Option<&XmlElement> {
        self.children.iter().find(|child| child.name == name)
    }

    pub(super) fn children<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a XmlElement> {
        self.children.iter().filter(move |child| child.name == name)
    }
}

/// Parses a document.
pub(super) fn parse(text: &str) -> Result<XmlElement, WireError> {
    if text.len() > TEXT_BYTES_MAX {
        return Err(WireError::TooMany { what: "bytes", max: TEXT_BYTES_MAX });
    }
    if let Some((at, illegal)) = text.char_indices().find(|(_, character)| !is_legal(*character)) {
        return Err(WireError::Xml { at: at as u64, reason: format!("the character {illegal:?} is not allowed") });
    }
    let mut reader = Reader::from_str(text);
    reader.config_mut().enable_all_checks(true);
    // The document root and the open elements
    let mut open = vec![XmlElement::default()];
    let mut count = 0;
    loop {
        let event = reader.read_event();
        let at = reader.buffer_position();
        let fail = |reason: String| WireError::Xml { at, reason };
        let top = open.len() - 1;
        match event.map_err(|error| fail(error.to_string()))? {
            Event::Start(start) => {
                bound(&mut count, open.len())?;
                open.push(element(&start).map_err(fail)?);
            }
            Event::Empty(start) => {
                bound(&mut count, open.len())?;
                open[top].children.push(element(&start).map_err(fail)?);
            }
            Event::End(_) => {
                // The parser has checked that each end tag has its start tag
                let Some(closed) = open.pop().filter(|_| !open.is_empty()) else {
                    return Err(fail("an end without a start".to_owned()));
                };
                let parent = open.len() - 1;
                open[parent].children.push(closed);
            }
            Event::Text(part) => open[top].text.push_str(&part.xml10_content()),
            Event::CData(part) => open[top].text.push_str(&part.xml10_content()),
            Event::GeneralRef(reference) => {
                let character = match reference.resolve_char_ref().map_err(|error| fail(error.to_string()))? {
                    Some(character) => character,
                    None => predefined(&reference).ok_or_else(|| fail("entities are not supported".to_owned()))?,
                };
                if !is_legal(character) {
                    return Err(fail(format!("the character {character:?} is not allowed")));
                }
                open[top].text.push(character);
            }
            Event::DocType(_) => return Err(fail("document types are not supported".to_owned())),
            Event::Comment(_) | Event::Decl(_) | Event::PI(_) => {}
            Event::Eof => break,
        }
    }
    let fail = |reason: &str| WireError::Xml { at: reader.buffer_position(), reason: reason.to_owned() };
    if open.len() != 1 {
        return Err(fail("an element does not end"));
    }
    let mut document = open.remove(0);
    match (document.children.pop(), document.children.is_empty(), document.text.trim().is_empty()) {
        (Some(root), true, true) => Ok(root),
        _ => Err(fail("a document is one element")),
    }
}

fn bound(count: &mut usize, depth: usize) -> Result<(), WireError> {
    *count += 1;
    if *count > ELEMENTS_MAX {
        return Err(WireError::TooMany { what: "elements", max: ELEMENTS_MAX });
    }
    if depth > DEPTH_MAX {
        return Err(WireError::TooMany { what: "elements within elements", max: DEPTH_MAX });
    }
    Ok(())
}

fn predefined(name: &str) -> Option<char> {
    match name {
        "lt" => Some('<'),
        "gt" => Some('>'),
        "amp" => Some('&'),
        "quot" => Some('"'),
        "apos" => Some('\''),
        _ => None,
    }
}

fn element(start: &BytesStart<'_>) -> Result<XmlElement, String> {
    let mut attributes = Vec::new();
    for attribute in start.attributes() {
        let attribute = attribute.map_err(|error| error.to_string())?;
        if attributes.len() == ATTRIBUTES_MAX {
            return Err(format!("more than {ATTRIBUTES_MAX} attributes"));
        }
        let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|error| error.to_string())?;
        if !value.chars().all(is_legal) {
            return Err("a character that is not allowed".to_owned());
        }
        attributes.push((attribute.key.into_inner().to_owned(), value.into_owned()));
    }
    Ok(XmlElement { name: start.name().into_inner().to_owned(), attributes, ..XmlElement::default() })
}

/// Returns true for characters of XML 1.0, production 2.
fn is_legal(character: char) -> bool {
    matches!(character, '\t' | '\n' | '\r' | ' '..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..)
}

/// Escapes text, also for use between double quotes.
pub(super) fn escape(text: &str) -> Result<String, WireError> {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' => out.push_str("&#9;"),
            '\n' => out.push_str("&#10;"),
            '\r' => out.push_str("&#13;"),
            _ if is_legal(character) => out.push(character),
            _ => return Err(WireError::Unprintable("a control character")),
        }
    }
    Ok(out)
}
