//! PLY, the Stanford polygon file format: ascii, binary of either byte order, and any of them within gzip.
//!
//! Elements other than `vertex`, `face` and `tristrips`, and properties without a meaning for us, are skipped. Colours that are
//! integers are taken for sRGB codes, as the programs that write them do; colours that are floats are linear.

mod ascii;
mod binary;
mod header;
mod strips;
mod vertices;

use std::path::Path;

use glam::Vec4;
use header::{Encoding, Header};

use super::{Source, finish, inflate};
use crate::load::MemoryBudget;
use crate::{Mesh, SceneError};

/// Reads a mesh. Polygons become fans of triangles; faces with fewer than three corners are left out.
///
/// - `path`: for errors and for the name of the mesh.
/// - `bytes`: the file.
pub(crate) fn read(path: &Path, bytes: &[u8], budget: &MemoryBudget) -> Result<Mesh, SceneError> {
    let mesh = open(Source { path, budget }, bytes, |source, header, bytes| match header.encoding {
        Encoding::Ascii => ascii::read(source, header, bytes),
        Encoding::LittleEndian => binary::read(source, header, bytes, false),
        Encoding::BigEndian => binary::read(source, header, bytes, true),
    })?;
    Ok(finish(mesh))
}

/// Colours of the faces of a mesh, one for each of the triangles that [`read`] makes of it; white where faces have none.
pub(crate) fn face_colors(path: &Path, bytes: &[u8], budget: &MemoryBudget) -> Result<Vec<Vec4>, SceneError> {
    open(Source { path, budget }, bytes, |source, header, bytes| match header.encoding {
        Encoding::Ascii => ascii::face_colors(source, header, bytes),
        Encoding::LittleEndian => binary::face_colors(source, header, bytes, false),
        Encoding::BigEndian => binary::face_colors(source, header, bytes, true),
    })
}

/// Unfolds a file where it is compressed, and reads its header.
fn open<T>(
    source: Source<'_>,
    bytes: &[u8],
    read: impl FnOnce(Source<'_>, &Header, &[u8]) -> Result<T, SceneError>,
) -> Result<T, SceneError> {
    let unfolded;
    let bytes = if bytes.starts_with(inflate::GZIP_MAGIC) {
        unfolded = inflate::gunzip(source, bytes)?;
        &unfolded.0[..]
    } else {
        bytes
    };
    read(source, &Header::parse(source, bytes)?, bytes)
}

/// Whether a file is one of ours, by its first bytes, or by its name where it is compressed.
pub(crate) fn recognizes(path: &Path, bytes: &[u8]) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    bytes.starts_with(b"ply\n")
        || bytes.starts_with(b"ply\r")
        || name.ends_with(".ply")
        || (bytes.starts_with(inflate::GZIP_MAGIC) && name.ends_with(".ply.gz"))
}

#[cfg(test)]
mod tests;
