//! PLY, the Stanford polygon file format: ASCII, binary of either byte order, and any of them within gzip.
//!
//! Elements other than `vertex`, `face` and `tristrips`, and unused properties, are skipped. Integer colours are read
//! as sRGB codes, as programs write them; float colours are linear.

mod ascii;
mod binary;
mod header;
mod role;
mod strips;
mod vertices;

use std::path::Path;

use glam::Vec4;
use header::{Element, PlyEncoding, PlyHeader, WantedNumbers};
use role::Role;

use super::source::MeshSource;
use super::{clean, finish, inflate};
use crate::budget::MemoryBudget;
use crate::error::SceneError;
use crate::model::Mesh;
use crate::text::decode;

/// Reads a mesh. Polygons become triangle fans; faces with fewer than three corners are left out.
///
/// - `path`: for errors and the name of the mesh.
/// - `bytes`: the file.
pub(crate) fn read(path: &Path, bytes: &[u8], budget: &MemoryBudget) -> Result<Mesh, SceneError> {
    let mesh = open(MeshSource { path, budget }, bytes, |source, header, bytes| match header.encoding {
        PlyEncoding::Ascii => ascii::read(source, header, bytes),
        PlyEncoding::LittleEndian => binary::read(source, header, bytes, false),
        PlyEncoding::BigEndian => binary::read(source, header, bytes, true),
    })?;
    Ok(finish(mesh))
}

/// Returns face colours, one for each triangle that [`read`] makes. `None`: there are none.
pub(crate) fn face_colors(path: &Path, bytes: &[u8], budget: &MemoryBudget) -> Result<Option<Vec<Vec4>>, SceneError> {
    open(MeshSource { path, budget }, bytes, |source, header, bytes| {
        let Some((element, faces)) = header.elements.iter().enumerate().find(|(_, element)| element.is_faces()) else {
            return Ok(None);
        };
        let roles = faces.roles();
        let channel = |property: usize| match roles[property] {
            Some(Role::Color(channel)) => Some((property, channel)),
            _ => None,
        };
        let (properties, channels): (Vec<usize>, Vec<usize>) = (0..roles.len()).filter_map(channel).unzip();
        if !(0..3).all(|channel| channels.contains(&channel)) {
            return Ok(None);
        }
        let mut colors = Vec::new();
        visit_rows(source, header, bytes, &WantedNumbers { element, properties: &properties }, |values, corners| {
            let mut color = Vec4::ONE;
            for ((&value, &property), &channel) in values.iter().zip(&properties).zip(&channels) {
                color[channel] = vertices::color(value, faces.properties[property].kind, channel) as f32;
            }
            let triangles = corners.saturating_sub(2);
            budget.take(path, "", triangles * size_of::<Vec4>())?;
            colors.extend(std::iter::repeat_n(clean(color), triangles));
            Ok(())
        })?;
        Ok(Some(colors))
    })
}

/// Values per vertex, or per triangle that [`read`] makes of a face.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Attribute {
    /// Channels: 1 or 3.
    pub(crate) channels: usize,
    /// Values; a single channel is repeated three times.
    pub(crate) values: Vec<[f32; 3]>,
}

/// Reads what Mitsuba calls `vertex_NAME` or `face_NAME`: properties `NAME_0`, `NAME_1` and so on, or with letters
/// instead of numbers. `None`: there are none of that name, or neither one nor three.
pub(crate) fn attribute(
    path: &Path,
    bytes: &[u8],
    name: &str,
    budget: &MemoryBudget,
) -> Result<Option<Attribute>, SceneError> {
    open(MeshSource { path, budget }, bytes, |source, header, bytes| {
        let (name, is_of_faces) = match (name.strip_prefix("vertex_"), name.strip_prefix("face_")) {
            (Some(name), _) => (name, false),
            (None, Some(name)) => (name, true),
            (None, None) => return Ok(None),
        };
        let is_it = |element: &&Element| if is_of_faces { element.is_faces() } else { element.is_vertices() };
        let Some(element) = header.elements.iter().position(|element| is_it(&element)) else { return Ok(None) };
        let properties = header.elements[element].attribute(name);
        if !matches!(properties.len(), 1 | 3) {
            return Ok(None);
        }
        let mut attribute = Attribute { channels: properties.len(), values: Vec::new() };
        visit_rows(source, header, bytes, &WantedNumbers { element, properties: &properties }, |values, corners| {
            let number = |channel: usize| clean(Vec4::splat(values[channel % values.len()] as f32)).x;
            let count = if is_of_faces { corners.saturating_sub(2) } else { 1 };
            budget.take(path, "", count * size_of::<[f32; 3]>())?;
            attribute.values.extend(std::iter::repeat_n([0, 1, 2].map(number), count));
            Ok(())
        })?;
        Ok(Some(attribute))
    })
}

/// Visits the rows of an element: the selected numbers, and the number of corners of a face.
fn visit_rows(
    source: MeshSource<'_>,
    header: &PlyHeader,
    bytes: &[u8],
    wanted: &WantedNumbers<'_>,
    visit: impl FnMut(&[f64], usize) -> Result<(), SceneError>,
) -> Result<(), SceneError> {
    match header.encoding {
        PlyEncoding::Ascii => ascii::visit_rows(source, header, bytes, wanted, visit),
        PlyEncoding::LittleEndian => binary::visit_rows(source, header, bytes, false, wanted, visit),
        PlyEncoding::BigEndian => binary::visit_rows(source, header, bytes, true, wanted, visit),
    }
}

/// Decompresses a file if necessary, and reads its header.
fn open<T>(
    source: MeshSource<'_>,
    bytes: &[u8],
    read: impl FnOnce(MeshSource<'_>, &PlyHeader, &[u8]) -> Result<T, SceneError>,
) -> Result<T, SceneError> {
    let unfolded;
    let bytes = if bytes.starts_with(inflate::GZIP_MAGIC) {
        unfolded = inflate::gunzip(source, bytes)?;
        &unfolded.0[..]
    } else {
        bytes
    };
    let body = bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes);
    if body.starts_with(b"ply") {
        let header = PlyHeader::parse(source, body)?;
        if header.encoding != PlyEncoding::Ascii {
            return read(source, &header, body);
        }
    }
    // Decode the whole file as text. A guessed encoding affects only comments, so it needs no warning.
    let text = decode(source.path, bytes, source.budget)?.text;
    let header = PlyHeader::parse(source, text.as_bytes())?;
    if header.encoding != PlyEncoding::Ascii {
        return Err(source.damaged("its header was changed to another encoding, and what follows it with the header"));
    }
    read(source, &header, text.as_bytes())
}

/// The byte order mark of UTF-8.
const UTF8_MARK: &[u8] = &[0xef, 0xbb, 0xbf];

/// Recognizes a file by its first bytes, or by its name if it is compressed.
pub(crate) fn recognizes(path: &Path, bytes: &[u8]) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let start = bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes);
    start.starts_with(b"ply\n")
        || start.starts_with(b"ply\r")
        || name.ends_with(".ply")
        || (bytes.starts_with(inflate::GZIP_MAGIC) && name.ends_with(".ply.gz"))
}

#[cfg(test)]
mod tests;
