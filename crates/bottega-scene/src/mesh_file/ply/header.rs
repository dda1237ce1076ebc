//! The header of a PLY file.

use super::super::lines::{LineFault, LocatedFault, integer, next_word};
use super::super::source::MeshSource;
use super::role::Role;
use crate::error::SceneError;
use crate::text::{column, shortened};

/// The encoding of the data after the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PlyEncoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// The storage of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberKind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl NumberKind {
    fn new(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// Returns the size of a number, in bytes.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Returns true for integer kinds.
    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// Returns the value of a colour of this kind that stands for 1.
    pub(super) fn color_max(self) -> f64 {
        match self {
            Self::I8 | Self::U8 => 255.0,
            Self::I16 | Self::U16 => 65535.0,
            Self::I32 | Self::U32 => f64::from(u32::MAX),
            Self::F32 | Self::F64 => 1.0,
        }
    }
}

/// A property of an element: a number or a list.
#[derive(Clone, Debug)]
pub(super) struct PlyProperty {
    name: Vec<u8>,
    /// Kind of the number, or of the elements of the list.
    pub(super) kind: NumberKind,
    /// Kind of a list's length; `None`: not a list.
    pub(super) count: Option<NumberKind>,
}

/// An element type with its properties, such as `vertex`.
#[derive(Clone, Debug)]
pub(super) struct Element {
    name: Vec<u8>,
    /// Number of elements.
    pub(super) count: usize,
    /// Properties, in the order of the file.
    pub(super) properties: Vec<PlyProperty>,
    /// Line of the element's declaration.
    pub(super) line: usize,
}

impl Element {
    /// Returns true for the element `vertex`.
    pub(super) fn is_vertices(&self) -> bool {
        self.name == b"vertex"
    }

    /// Returns true for the element `face`.
    pub(super) fn is_faces(&self) -> bool {
        self.name == b"face"
    }

    /// Returns true for the element `tristrips`.
    pub(super) fn is_strips(&self) -> bool {
        self.name == b"tristrips"
    }

    /// Returns the element's name, for messages.
    pub(super) fn name(&self) -> String {
        shortened(&String::from_utf8_lossy(&self.name)).into_owned()
    }

    /// Returns the bytes of a row if all rows have the same length: `None` with lists.
    pub(super) fn fixed_bytes(&self) -> Option<usize> {
        self.properties.iter().map(|property| property.count.is_none().then(|| property.kind.bytes())).sum()
    }

    /// Returns the least bytes of a row: with empty lists.
    pub(super) fn least_bytes(&self) -> usize {
        self.properties.iter().map(|property| property.count.unwrap_or(property.kind).bytes()).sum()
    }

    /// Returns the role of each property of a vertex; `None`: not used.
    pub(super) fn roles(&self) -> Vec<Option<Role>> {
        let mut roles: Vec<Option<Role>> = Vec::new();
        for property in &self.properties {
            let role = Role::new(&property.name).filter(|_| property.count.is_none());
            // Of synonyms, use the first.
            roles.push(role.filter(|role| !roles.contains(&Some(*role))));
        }
        roles
    }

    /// Returns the properties of an attribute, in the order of its channels: `NAME_0`, `NAME_1` …, or with letters, as
    /// in Mitsuba 3.
    pub(super) fn attribute(&self, name: &str) -> Vec<usize> {
        const ENDS: [[&str; 4]; 4] =
            [["x", "y", "z", "w"], ["r", "g", "b", "a"], ["0", "1", "2", "3"], ["1", "2", "3", "4"]];
        let find = |end: &&str| {
            let name = format!("{name}_{end}");
            self.properties.iter().position(|it| it.count.is_none() && it.name == name.as_bytes())
        };
        ENDS.iter()
            .map(|ends| ends.iter().map_while(find).collect())
            .find(|found: &Vec<usize>| !found.is_empty())
            .unwrap_or_default()
    }

    /// Returns the index of the property that lists the corners of a face or strip; `None`: there is none.
    pub(super) fn corners(&self) -> Option<usize> {
        self.properties.iter().position(|property| {
            property.count.is_some() && matches!(&property.name[..], b"vertex_indices" | b"vertex_index")
        })
    }
}

/// A selection of numbers from the rows of an element.
pub(super) struct WantedNumbers<'a> {
    /// Index of the element.
    pub(super) element: usize,
    /// Indices of the element's properties; none is a list.
    pub(super) properties: &'a [usize],
}

/// The parsed and validated header of a file.
#[derive(Clone, Debug)]
pub(super) struct PlyHeader {
    pub(super) encoding: PlyEncoding,
    /// Element types, in the order of the file.
    pub(super) elements: Vec<Element>,
    /// Offset of the data.
    pub(super) body: usize,
    /// Number of the first line after the header.
    pub(super) body_line: usize,
    /// Number of vertices.
    pub(super) vertex_count: usize,
}

impl PlyHeader {
    /// Parses and validates the header of a file.
    pub(super) fn parse(source: MeshSource<'_>, bytes: &[u8]) -> Result<Self, SceneError> {
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        let (mut at, mut number) = (0, 0);
        loop {
            // Lines end with a newline, with both characters, or in old files with a carriage return.
            let rest = &bytes[at..];
            let Some(length) = rest.iter().position(|&byte| byte == b'\n' || byte == b'\r') else {
                return Err(source.damaged("its header has no `end_header`"));
            };
            let line = &rest[..length];
            at += length + 1 + usize::from(rest[length..].starts_with(b"\r\n"));
            number += 1;
            let mut words = line;
            let wrong = |problem: String, at: &[u8]| {
                source.located(LocatedFault { line: number, column: column(line, at.trim_ascii_start()), problem })
            };
            let keyword = next_word(&mut words);
            if number == 1 {
                if keyword != Some(b"ply") {
                    return Err(wrong("a PLY file begins with `ply`".into(), line));
                }
                continue;
            }
            match keyword {
                None | Some(b"comment" | b"obj_info") => {}
                Some(b"format") => {
                    let at = words;
                    encoding = Some(match next_word(&mut words) {
                        Some(b"ascii") => PlyEncoding::Ascii,
                        Some(b"binary_little_endian") => PlyEncoding::LittleEndian,
                        Some(b"binary_big_endian") => PlyEncoding::BigEndian,
                        other => return Err(wrong(format!("unknown format `{}`", text(other)), at)),
                    });
                }
                Some(b"element") => {
                    let before_name = words;
                    let name = next_word(&mut words).unwrap_or_default().to_vec();
                    let before_count = words;
                    let count = next_word(&mut words).and_then(integer).and_then(|count| usize::try_from(count).ok());
                    let Some(count) = count else {
                        let problem = format!("the number of `{}` is not a number", text(Some(&name)));
                        return Err(wrong(problem, before_count));
                    };
                    if elements.iter().any(|element| element.name == name) {
                        return Err(wrong(format!("there are two elements `{}`", text(Some(&name))), before_name));
                    }
                    elements.push(Element { name, count, properties: Vec::new(), line: number });
                }
                Some(b"property") => {
                    let property = property(words).map_err(|LineFault { at, problem }| wrong(problem, at))?;
                    let Some(element) = elements.last_mut() else {
                        return Err(wrong("a property before the first element".into(), line));
                    };
                    element.properties.push(property);
                }
                Some(b"end_header") => break,
                other => return Err(wrong(format!("unknown keyword `{}`", text(other)), line)),
            }
        }
        let Some(encoding) = encoding else { return Err(source.damaged("its header does not name its format")) };
        let mut header = Self { encoding, elements, body: at, body_line: number + 1, vertex_count: 0 };
        header.check(source, bytes.len() - at)?;
        Ok(header)
    }

    /// Checks that there are vertices and faces, and no more than fit into the rest of the file.
    fn check(&mut self, source: MeshSource<'_>, body_bytes: usize) -> Result<(), SceneError> {
        for element in &self.elements {
            // A declaration starts its line.
            let at_element = |problem: String| source.located(LocatedFault { line: element.line, column: 1, problem });
            let announced = |problem: &str| at_element(format!("{} `{}` {problem}", element.count, element.name()));
            // A row in ASCII takes at least a digit and a newline.
            let row = match self.encoding {
                PlyEncoding::Ascii => element.properties.len().min(1),
                _ => element.least_bytes(),
            };
            if element.count.saturating_mul(row) > body_bytes {
                return Err(announced(&format!("do not fit into the {body_bytes} bytes that follow the header")));
            }
            if element.is_vertices() {
                let roles = element.roles();
                if !(0..3).all(|axis| roles.contains(&Some(Role::Position(axis)))) {
                    return Err(at_element("vertices need the properties x, y and z".into()));
                }
                if element.count > u32::MAX as usize {
                    return Err(announced("are more than can be indexed"));
                }
                self.vertex_count = element.count;
            }
            if element.is_faces() || element.is_strips() {
                let Some(corners) = element.corners() else {
                    return Err(at_element(format!("`{}` needs the list property vertex_indices", element.name())));
                };
                if !element.properties[corners].kind.is_integer() {
                    return Err(at_element("indices of vertices must be whole numbers".into()));
                }
            }
        }
        if !self.elements.iter().any(Element::is_vertices) {
            return Err(source.damaged("its header announces no `vertex`"));
        }
        Ok(())
    }
}

fn property(mut words: &[u8]) -> Result<PlyProperty, LineFault<'_>> {
    fn kind<'t>(words: &mut &'t [u8]) -> Result<NumberKind, LineFault<'t>> {
        let at = *words;
        let word = next_word(words);
        let wrong = || LineFault::new(at, format!("unknown type of property `{}`", text(word)));
        word.and_then(NumberKind::new).ok_or_else(wrong)
    }
    let mut rest = words;
    let (count, kind) = if next_word(&mut rest) == Some(b"list") {
        words = rest;
        let count = kind(&mut words)?;
        if !count.is_integer() {
            return Err(LineFault::new(rest, "the length of a list must be a whole number"));
        }
        (Some(count), kind(&mut words)?)
    } else {
        (None, kind(&mut words)?)
    };
    Ok(PlyProperty { name: next_word(&mut words).unwrap_or_default().to_vec(), kind, count })
}

fn text(word: Option<&[u8]>) -> String {
    shortened(&String::from_utf8_lossy(word.unwrap_or_default())).into_owned()
}
