//! XML parser to elements with locations.
//!
//! Entities other than the five predefined ones and character references are errors, even if a document type
//! declaration defines them: nothing expands.

use quick_xml::errors::Error;
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

use crate::error::SceneError;
use crate::import::text_place::{ImportResult, TextFault, TextPlace};

/// Maximal depth of nested elements.
const DEPTH_MAX: usize = 64;

/// An element with its attributes and nested elements.
#[derive(Debug, PartialEq)]
pub(super) struct XmlElement {
    /// Name of the tag.
    pub(super) name: String,
    /// Names and values, in the order of the file.
    pub(super) attributes: Vec<(String, String)>,
    /// Nested elements, in the order of the file.
    pub(super) children: Vec<XmlElement>,
    /// Location of the element's start tag.
    pub(super) at: TextPlace,
}

impl XmlElement {
    /// Returns the value of the attribute with a name; `None`: there is none.
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|attribute| attribute.0 == name).map(|attribute| attribute.1.as_str())
    }

    /// Returns the element's memory without its children, in bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        let attribute = |(name, value): &(String, String)| name.len() + value.len() + size_of::<(String, String)>();
        2 * size_of::<Self>() + self.name.len() + self.attributes.iter().map(attribute).sum::<usize>()
    }
}

/// Parses a text with one root element.
///
/// - `file`: index of the file, for locations.
/// - `book`: books memory, in bytes.
/// - `left_out`: called with the location of ignored character data.
pub(super) fn parse(
    text: &str,
    file: u32,
    mut book: impl FnMut(usize) -> Result<(), SceneError>,
    mut left_out: impl FnMut(TextPlace),
) -> ImportResult<XmlElement> {
    let mut reader = Reader::from_str(text);
    let mut lines = Lines { text, file, offset: 0, line: 1, column: 1 };
    let mut open: Vec<XmlElement> = Vec::new();
    let mut root = None;
    loop {
        let start = reader.buffer_position();
        let event = reader.read_event();
        let at = lines.place(start);
        let fault = |problem: &str| at.fault(problem);
        let event = event.map_err(|error| {
            let at = lines.place(reader.error_position());
            at.fault(explain(&error))
        })?;
        let finished = match event {
            Event::Start(tag) => {
                if open.len() >= DEPTH_MAX {
                    return Err(fault(&format!("elements are nested more than {DEPTH_MAX} deep")).into());
                }
                let element = element(&tag, at)?;
                book(element.memory_bytes())?;
                open.push(element);
                continue;
            }
            Event::Empty(tag) => {
                let element = element(&tag, at)?;
                book(element.memory_bytes())?;
                element
            }
            // The reader checks that it matches the start tag.
            Event::End(_) => match open.pop() {
                Some(element) => element,
                None => return Err(fault("an element ends that has not begun").into()),
            },
            Event::Text(text) if !text.xml10_content().trim().is_empty() => {
                return Err(fault("there is text between the elements").into());
            }
            Event::GeneralRef(_) => return Err(fault("there is text between the elements").into()),
            Event::CData(_) => {
                left_out(at);
                continue;
            }
            Event::Eof => break,
            Event::Text(_) | Event::Comment(_) | Event::Decl(_) | Event::PI(_) | Event::DocType(_) => continue,
        };
        match open.last_mut() {
            Some(parent) => parent.children.push(finished),
            None if root.is_some() => return Err(fault("there is a second outermost element").into()),
            None => root = Some(finished),
        }
    }
    let at = lines.place(text.len() as u64);
    if let Some(element) = open.last() {
        return Err(at.fault(format!("the file ends within <{}>", element.name)).into());
    }
    Ok(root.ok_or_else(|| at.fault("the file has no element"))?)
}

fn element(tag: &BytesStart<'_>, at: TextPlace) -> Result<XmlElement, TextFault> {
    let name = tag.name().as_ref().to_owned();
    let mut attributes: Vec<(String, String)> = Vec::new();
    for attribute in tag.attributes() {
        let attribute = attribute.map_err(|error| at.fault(format!("in the tag <{name}>: {error}")))?;
        let key = attribute.key.as_ref().to_owned();
        let value = attribute
            .normalized_value(XmlVersion::Implicit1_0)
            .map_err(|error| at.fault(format!("in the attribute {key}: {}", explain(&error))))?;
        attributes.push((key, value.into_owned()));
    }
    Ok(XmlElement { name, attributes, children: Vec::new(), at })
}

fn explain(error: &Error) -> String {
    let text = error.to_string();
    // The reader's message begins with the kind of error.
    text.rsplit_once("error: ").map_or(text.as_str(), |(_, rest)| rest).to_owned()
}

/// Converts increasing byte offsets to lines and columns.
struct Lines<'a> {
    text: &'a str,
    file: u32,
    offset: usize,
    line: u32,
    column: u32,
}

impl Lines<'_> {
    fn place(&mut self, offset: u64) -> TextPlace {
        let offset = usize::try_from(offset).unwrap_or(usize::MAX).min(self.text.len());
        if offset < self.offset {
            // An error may be located before the last position.
            (self.offset, self.line, self.column) = (0, 1, 1);
        }
        for byte in &self.text.as_bytes()[self.offset..offset] {
            if *byte == b'\n' {
                (self.line, self.column) = (self.line.saturating_add(1), 1);
            } else if byte & 0xc0 != 0x80 {
                // Count all bytes except continuation bytes of UTF-8.
                self.column = self.column.saturating_add(1);
            }
        }
        self.offset = offset;
        TextPlace { file: self.file, line: self.line, column: self.column }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::text_place::ImportError;

    fn read(text: &str) -> Result<XmlElement, String> {
        parse(text, 0, |_| Ok(()), |_| ()).map_err(|error| match error {
            ImportError::Text(TextFault { at, problem }) => format!("{}:{}: {problem}", at.line, at.column),
            ImportError::Scene(error) => panic!("{error}"),
        })
    }

    #[test]
    fn elements_know_their_line_and_column() {
        let scene = read("<?xml version='1.0'?>\n<!-- a ü -->\n<scene version=\"3.0.0\">\n\tü".trim_end_matches('ü'));
        assert!(scene.is_err());
        let scene = read("<!-- ü --> <scene version=\"3.0.0\">\n\t<float name='a' value='1 &lt; 2'/>\n</scene>");
        let scene = scene.unwrap();
        assert_eq!((scene.at.line, scene.at.column), (1, 12));
        assert_eq!(scene.attribute("version"), Some("3.0.0"));
        let child = &scene.children[0];
        assert_eq!((child.at.line, child.at.column), (2, 2));
        assert_eq!(child.attribute("value"), Some("1 < 2"));
    }

    #[test]
    fn wrong_xml_is_an_error_with_its_place() {
        for (text, place) in [
            ("<scene>\n<shape></scene>", "2:"),
            ("<scene>\n  <float name=\"a\" name=\"b\"/></scene>", "2:3"),
            ("<scene>", "1:8"),
            ("", "1:1"),
            ("<scene/><scene/>", "1:9"),
            ("<scene>\n\nword</scene>", "1:8"),
            ("<!DOCTYPE a [<!ENTITY x 'y'>]>\n<scene a=\"&x;\"/>", "2:1"),
            ("<scene>&x;</scene>", "1:8"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.starts_with(place), "{text}: {error}");
        }
        let deep = "<a>".repeat(100_000);
        assert!(read(&deep).unwrap_err().contains("nested"));
    }
}
