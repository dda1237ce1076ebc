//! Mitsuba's serialized meshes: several compressed meshes per file, with a table at the end.
//!
//! The format is described with the `serialized` shape in the documentation of Mitsuba 3: little-endian; each mesh
//! begins with the magic number and version, uncompressed, followed by a zlib stream.

use std::io::Read;
use std::path::Path;

use bytemuck::Pod;
use glam::{Vec2, Vec3, Vec4};

use super::source::MeshSource;
use super::{finish, inflate};
use crate::budget::MemoryBudget;
use crate::error::SceneError;
use crate::model::{COORDINATE_MAX, Mesh};
use crate::text::shortened;

const MAGIC: u16 = 0x041c;

/// Flags of a mesh.
const HAS_NORMALS: u32 = 0x0001;
const HAS_UVS: u32 = 0x0002;
const HAS_COLORS: u32 = 0x0008;
const IS_FACETED: u32 = 0x0010;
const IS_DOUBLE: u32 = 0x2000;

/// Recognizes a file by its first bytes.
pub(crate) fn recognizes(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC.to_le_bytes()) && matches!(bytes.get(2..4), Some([3 | 4, 0]))
}

/// Reads one mesh of a file.
///
/// - `path`: for errors.
/// - `bytes`: the file.
/// - `shape_index`: index of the mesh, from 0.
pub(crate) fn read(path: &Path, bytes: &[u8], shape_index: u32, budget: &MemoryBudget) -> Result<Mesh, SceneError> {
    let source = MeshSource { path, budget };
    if !recognizes(bytes) {
        return Err(source.damaged("it does not begin like a serialized mesh of version 3 or 4"));
    }
    let range = find(source, bytes, shape_index)?;
    let start = range.start;
    let bytes = &bytes[range];
    if !recognizes(bytes) {
        return Err(
            source.damaged(format!("its table names byte {start} for shape {shape_index}, where no mesh begins"))
        );
    }
    let compressed = &bytes[4..];
    let decoder = flate2::bufread::ZlibDecoder::new(compressed);
    let place = format!("shape {shape_index} at byte {start}");
    // Before allocating, check each array against the greatest size of the decompressed data.
    let capacity = compressed.len().saturating_mul(inflate::RATIO_MAX);
    Stream { source, decoder, capacity, unfolded: 0, place }.mesh(bytes[2] == 4)
}

/// Returns the number of meshes in a file.
pub(crate) fn count(path: &Path, bytes: &[u8]) -> Result<u32, SceneError> {
    table(bytes).map(|table| table.count as u32).ok_or_else(|| no_table(path))
}

/// The table at the end of a file: offsets, then their number.
struct OffsetTable {
    start: usize,
    /// Size of an offset, in bytes.
    width: usize,
    count: usize,
}

fn table(bytes: &[u8]) -> Option<OffsetTable> {
    let width = if bytes.get(2) == Some(&4) { 8 } else { 4 };
    let count = u32::from_le_bytes(*bytes.last_chunk()?) as usize;
    let start = bytes.len().checked_sub(count.checked_mul(width)?.checked_add(4)?)?;
    (count > 0).then_some(OffsetTable { start, width, count })
}

fn no_table(path: &Path) -> SceneError {
    SceneError::Damaged { path: path.into(), problem: "the table at its end is missing".into() }
}

/// Returns the byte range of a mesh.
fn find(source: MeshSource<'_>, bytes: &[u8], shape_index: u32) -> Result<std::ops::Range<usize>, SceneError> {
    let OffsetTable { start: table, width, count } = table(bytes).ok_or_else(|| no_table(source.path))?;
    let offset = |index: usize| {
        let entry = bytes.get(table + index * width..table + (index + 1) * width)?;
        let mut wide = [0; 8];
        wide[..width].copy_from_slice(entry);
        usize::try_from(u64::from_le_bytes(wide)).ok()
    };
    let index = shape_index as usize;
    if index >= count {
        return Err(source.invalid("", format!("there is no shape {shape_index}, it has {count}")));
    }
    let end = if index + 1 < count { offset(index + 1) } else { Some(table) };
    match (offset(index), end) {
        (Some(start), Some(end)) if start < end && end <= table => Ok(start..end),
        _ => {
            let entry = table + index * width;
            Err(source.damaged(format!("its table, at byte {entry}, names no valid place for shape {shape_index}")))
        }
    }
}

/// The decompressor of one mesh.
struct Stream<'a, R> {
    source: MeshSource<'a>,
    decoder: R,
    /// Maximal number of bytes to come.
    capacity: usize,
    /// Bytes read so far.
    unfolded: usize,
    place: String,
}

impl<R: Read> Stream<'_, R> {
    fn mesh(mut self, has_name: bool) -> Result<Mesh, SceneError> {
        let flags = u32::from_le_bytes(self.bytes()?);
        let name = if has_name { self.name()? } else { String::new() };
        let vertex_count = self.count()?;
        let triangle_count = self.count()?;
        if vertex_count > u32::MAX as usize {
            return Err(self.invalid_here(format!("{vertex_count} vertices are more than can be indexed")));
        }
        let is_double = flags & IS_DOUBLE != 0;
        let mut mesh = Mesh { name, ..Mesh::default() };
        mesh.positions = self.vectors::<3, Vec3>(vertex_count, is_double)?;
        if flags & HAS_NORMALS != 0 {
            mesh.normals = self.vectors::<3, Vec3>(vertex_count, is_double)?;
        }
        if flags & HAS_UVS != 0 {
            mesh.uvs[0] = self.vectors::<2, Vec2>(vertex_count, is_double)?;
        }
        if flags & HAS_COLORS != 0 {
            let colors = self.vectors::<3, Vec3>(vertex_count, is_double)?;
            self.source.budget.take(self.source.path, &self.place, vertex_count * size_of::<Vec4>())?;
            mesh.colors = colors.into_iter().map(|color| color.extend(1.0)).collect();
        }
        if flags & IS_FACETED != 0 {
            mesh.normals = Vec::new();
        }
        mesh.triangles = self.numbers(triangle_count)?;
        self.check(&mesh)?;
        Ok(finish(mesh))
    }

    fn check(&self, mesh: &Mesh) -> Result<(), SceneError> {
        // A comparison with NaN is false.
        let is_sound = |p: &Vec3| p.abs().max_element() <= COORDINATE_MAX && p.is_finite();
        if let Some(vertex) = mesh.positions.iter().position(|p| !is_sound(p)) {
            return Err(self.invalid(format!("the position of vertex {vertex} is not a number, or out of reach")));
        }
        let count = mesh.positions.len();
        let is_bad = |triangle: &[u32; 3]| triangle.iter().any(|&vertex| vertex as usize >= count);
        match mesh.triangles.iter().position(is_bad) {
            None => Ok(()),
            Some(triangle) => {
                let [a, b, c] = mesh.triangles[triangle];
                Err(self.invalid(format!("triangle {triangle} has the vertices {a}, {b}, {c}, but there are {count}")))
            }
        }
    }

    fn invalid(&self, problem: impl Into<String>) -> SceneError {
        self.source.invalid(self.place.as_str(), problem)
    }

    /// Makes an error at the current position.
    fn invalid_here(&self, problem: impl Into<String>) -> SceneError {
        self.source.invalid(format!("{}, byte {} of its data when unfolded", self.place, self.unfolded), problem)
    }

    fn fill(&mut self, to: &mut [u8]) -> Result<(), SceneError> {
        self.decoder.read_exact(to).map_err(|error| {
            let (place, unfolded) = (&self.place, self.unfolded);
            let problem = format!("the data of {place} cannot be unfolded beyond their byte {unfolded} ({error})");
            self.source.damaged(problem)
        })?;
        self.capacity = self.capacity.saturating_sub(to.len());
        self.unfolded += to.len();
        Ok(())
    }

    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], SceneError> {
        let mut bytes = [0; N];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    fn count(&mut self) -> Result<usize, SceneError> {
        let count = u64::from_le_bytes(self.bytes()?);
        usize::try_from(count).map_err(|_| self.invalid_here(format!("announces {count} elements")))
    }

    /// Reads text up to a zero byte.
    fn name(&mut self) -> Result<String, SceneError> {
        const LENGTH_MAX: usize = 1 << 12;
        let mut name = Vec::new();
        loop {
            match self.bytes()? {
                [0] => return Ok(shortened(&String::from_utf8_lossy(&name)).into_owned()),
                [byte] => name.push(byte),
            }
            if name.len() > LENGTH_MAX {
                return Err(self.invalid_here("its name has no end"));
            }
        }
    }

    /// Reads `count` elements of 4-byte numbers, little-endian.
    fn numbers<T: Pod>(&mut self, count: usize) -> Result<Vec<T>, SceneError> {
        if count.saturating_mul(size_of::<T>()) > self.capacity {
            return Err(self.invalid_here(format!("announces {count} elements, more than its data can unfold to")));
        }
        let mut values = self.source.zeroed(count)?;
        self.fill(bytemuck::cast_slice_mut(&mut values))?;
        if cfg!(target_endian = "big") {
            let words: &mut [u32] = bytemuck::cast_slice_mut(&mut values);
            words.iter_mut().for_each(|word| *word = word.swap_bytes());
        }
        Ok(values)
    }

    /// Reads vectors of `N` floats, or of `N` doubles, which are rounded.
    fn vectors<const N: usize, T: Pod>(&mut self, count: usize, is_double: bool) -> Result<Vec<T>, SceneError> {
        if !is_double {
            return self.numbers(count);
        }
        if count.saturating_mul(8 * N) > self.capacity {
            return Err(self.invalid_here(format!("announces {count} elements, more than its data can unfold to")));
        }
        let mut values: Vec<T> = self.source.zeroed(count)?;
        let floats: &mut [f32] = bytemuck::cast_slice_mut(&mut values);
        let mut doubles = [0; 8 * 1024];
        for floats in floats.chunks_mut(1024) {
            let doubles = &mut doubles[..8 * floats.len()];
            self.fill(doubles)?;
            for (float, double) in floats.iter_mut().zip(doubles.as_chunks::<8>().0) {
                *float = f64::from_le_bytes(*double) as f32;
            }
        }
        Ok(values)
    }
}

#[cfg(test)]
mod tests;
