//! Binary PLY: rows of numbers, split into pieces whose output ranges are known in advance, so that threads decode
//! straight into the mesh.

use rayon::prelude::*;

use super::super::source::MeshSource;
use super::header::{Element, NumberKind, PlyHeader, PlyProperty, WantedNumbers};
use super::role::Role;
use super::strips::Strip;
use super::vertices::{self, Slices, UNSOUND};
use crate::error::SceneError;
use crate::model::Mesh;

/// Rows that one thread decodes at a time.
const PIECE_ROWS: usize = 8192;

/// Evaluates an expression with the reader of a kind of number, which reads the first bytes of a slice.
macro_rules! with_reader {
    ($kind:expr, $big_endian:expr, $read:ident => $body:expr) => {{
        macro_rules! arm {
            ($number:ty, $from:ident) => {{
                let $read =
                    |bytes: &[u8]| bytes.first_chunk().map_or(<$number>::default(), |chunk| <$number>::$from(*chunk));
                $body
            }};
        }
        match ($kind, $big_endian) {
            (NumberKind::I8, _) => arm!(i8, from_le_bytes),
            (NumberKind::U8, _) => arm!(u8, from_le_bytes),
            (NumberKind::I16, false) => arm!(i16, from_le_bytes),
            (NumberKind::U16, false) => arm!(u16, from_le_bytes),
            (NumberKind::I32, false) => arm!(i32, from_le_bytes),
            (NumberKind::U32, false) => arm!(u32, from_le_bytes),
            (NumberKind::F32, false) => arm!(f32, from_le_bytes),
            (NumberKind::F64, false) => arm!(f64, from_le_bytes),
            (NumberKind::I16, true) => arm!(i16, from_be_bytes),
            (NumberKind::U16, true) => arm!(u16, from_be_bytes),
            (NumberKind::I32, true) => arm!(i32, from_be_bytes),
            (NumberKind::U32, true) => arm!(u32, from_be_bytes),
            (NumberKind::F32, true) => arm!(f32, from_be_bytes),
            (NumberKind::F64, true) => arm!(f64, from_be_bytes),
        }
    }};
}

/// The data of one element; its end may not be known yet.
struct Body<'a> {
    source: MeshSource<'a>,
    element: &'a Element,
    big_endian: bool,
    /// Bytes from the element's first row to the end of the file.
    bytes: &'a [u8],
    /// Offset of the element's first row in the file.
    offset: usize,
}

/// Reads the mesh of a binary file.
pub(super) fn read(
    source: MeshSource<'_>,
    header: &PlyHeader,
    bytes: &[u8],
    big_endian: bool,
) -> Result<Mesh, SceneError> {
    let mut mesh = Mesh::default();
    let mut triangles = Vec::new();
    let mut offset = header.body;
    for element in &header.elements {
        let body = Body { source, element, big_endian, bytes: &bytes[offset..], offset };
        offset += if element.is_vertices() {
            let (vertices, length) = body.vertices()?;
            mesh = vertices;
            length
        } else if let Some(corners) = element.corners().filter(|_| element.is_faces()) {
            let (faces, length) = body.triangles(corners, header.vertex_count)?;
            // Strips may have come first. Avoid copying the larger list.
            triangles = if triangles.is_empty() { faces } else { [triangles, faces].concat() };
            length
        } else if let Some(corners) = element.corners().filter(|_| element.is_strips()) {
            body.strips(corners, header.vertex_count, &mut triangles)?
        } else {
            body.skip()?
        };
    }
    Ok(Mesh { triangles, ..mesh })
}

/// Implements [`super::visit_rows`].
pub(super) fn visit_rows(
    source: MeshSource<'_>,
    header: &PlyHeader,
    bytes: &[u8],
    big_endian: bool,
    wanted: &WantedNumbers<'_>,
    visit: impl FnMut(&[f64], usize) -> Result<(), SceneError>,
) -> Result<(), SceneError> {
    let mut offset = header.body;
    for (number, element) in header.elements.iter().enumerate() {
        let body = Body { source, element, big_endian, bytes: &bytes[offset..], offset };
        if number == wanted.element {
            return body.visit_rows(wanted.properties, visit);
        }
        offset += body.skip()?;
    }
    Ok(())
}

/// A piece of the faces, and its number of triangles.
struct FacePiece {
    /// Offset within the element.
    start: usize,
    rows: usize,
    triangles: usize,
    /// The layout, if all its rows are alike.
    uniform: Option<Uniform>,
}

/// A row layout: the same length, with lists of the same length at the same offset.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Uniform {
    stride: usize,
    /// Offset of the list of corners within a row.
    list: usize,
    corners: usize,
}

impl Body<'_> {
    fn truncated(&self, row: usize) -> SceneError {
        let problem = format!("it ends before row {row} of the {} of `{}`", self.element.count, self.element.name());
        self.source.damaged(problem)
    }

    fn at_byte(&self, start: usize, problem: String) -> SceneError {
        self.source.invalid(format!("byte {}", self.offset + start), problem)
    }

    /// Returns the bytes of the row that begins at `start`, and the start and length of the list of property `corners`.
    fn row(&self, start: usize, corners: usize) -> Option<(usize, usize, usize)> {
        let mut at = start;
        let (mut list, mut length) = (start, 0);
        for (index, property) in self.element.properties.iter().enumerate() {
            let size = match property.count {
                None => property.kind.bytes(),
                Some(count_kind) => {
                    let count = self.count(at, count_kind)?;
                    at += count_kind.bytes();
                    if index == corners {
                        (list, length) = (at, count);
                    }
                    count.checked_mul(property.kind.bytes())?
                }
            };
            at = at.checked_add(size).filter(|&at| at <= self.bytes.len())?;
        }
        Some((at - start, list, length))
    }

    /// Returns the length of a list; `None` if it is cut off or negative.
    fn count(&self, at: usize, kind: NumberKind) -> Option<usize> {
        let bytes = self.bytes.get(at..at + kind.bytes())?;
        usize::try_from(with_reader!(kind, self.big_endian, read => read(bytes) as i64)).ok()
    }

    /// Returns the bytes of the element.
    fn skip(&self) -> Result<usize, SceneError> {
        let count = self.element.count;
        if let Some(stride) = self.element.fixed_bytes() {
            let length = count.saturating_mul(stride);
            return if length <= self.bytes.len() {
                Ok(length)
            } else {
                Err(self.truncated(self.bytes.len() / stride))
            };
        }
        let mut at = 0;
        for row in 0..count {
            at += self.row(at, usize::MAX).ok_or_else(|| self.truncated(row))?.0;
        }
        Ok(at)
    }

    fn vertices(&self) -> Result<(Mesh, usize), SceneError> {
        let element = self.element;
        let length = self.skip()?;
        let mut mesh = vertices::allocate(self.source, element)?;
        let roles = element.roles();
        let has_alpha = roles.contains(&Some(Role::Color(3)));
        let Some(stride) = element.fixed_bytes() else {
            self.scattered_vertices(&mut mesh, &roles, has_alpha)?;
            return Ok((mesh, length));
        };
        let columns = columns(&element.properties, &roles);
        let counts = (0..element.count).step_by(PIECE_ROWS).map(|first| PIECE_ROWS.min(element.count - first));
        let slices = Slices::of(&mut mesh).split(counts);
        let pieces = self.bytes[..length].par_chunks(stride * PIECE_ROWS).zip(slices);
        let decoded: Vec<Result<(), usize>> = pieces
            .map(|(rows, mut vertices)| {
                for &(role, kind, at) in &columns {
                    with_reader!(kind, self.big_endian, read => {
                        let values = rows.chunks_exact(stride).map(|row| f64::from(read(&row[at..])));
                        vertices.fill(role, kind, values);
                    });
                }
                vertices.complete(has_alpha)
            })
            .collect();
        for (piece, result) in decoded.into_iter().enumerate() {
            result.map_err(|row| self.at_byte((piece * PIECE_ROWS + row) * stride, UNSOUND.into()))?;
        }
        Ok((mesh, length))
    }

    /// Reads vertices that have list properties, one after another; such files are rare.
    fn scattered_vertices(&self, mesh: &mut Mesh, roles: &[Option<Role>], has_alpha: bool) -> Result<(), SceneError> {
        let mut vertices = Slices::of(mesh);
        let mut at = 0;
        for row in 0..self.element.count {
            for (property, role) in self.element.properties.iter().zip(roles) {
                let size = match property.count {
                    Some(kind) => {
                        let count = self.count(at, kind).ok_or_else(|| self.truncated(row))?;
                        kind.bytes() + count * property.kind.bytes()
                    }
                    None => property.kind.bytes(),
                };
                if let Some(role) = *role {
                    let number = &self.bytes[at..];
                    let value = with_reader!(property.kind, self.big_endian, read => f64::from(read(number)));
                    vertices.set(row, role, property.kind, value);
                }
                at += size;
            }
        }
        let end = at;
        vertices.complete(has_alpha).map_err(|row| self.at_byte(end, format!("vertex {row}: {UNSOUND}")))
    }

    fn triangles(&self, corners: usize, vertex_count: usize) -> Result<(Vec<[u32; 3]>, usize), SceneError> {
        let (pieces, length) = match self.uniform_pieces(corners) {
            Some(known) => known,
            None => self.scanned_pieces(corners)?,
        };
        let total = pieces.iter().map(|piece| piece.triangles).sum();
        let mut triangles: Vec<[u32; 3]> = self.source.zeroed(total)?;
        let mut rest = &mut triangles[..];
        let mut tasks = Vec::with_capacity(pieces.len());
        for piece in pieces {
            let (part, others) = std::mem::take(&mut rest).split_at_mut(piece.triangles);
            tasks.push((piece, part));
            rest = others;
        }
        let kind = self.element.properties[corners].kind;
        let decoded: Vec<Result<(), SceneError>> = tasks
            .into_par_iter()
            .map(|(piece, part)| {
                let greatest = with_reader!(kind, self.big_endian, read => {
                    // Map a negative index to one that is out of range.
                    self.decode(&piece, corners, kind.bytes(), part, |bytes| u32::try_from(read(bytes) as i64).unwrap_or(u32::MAX))
                });
                if greatest.is_none_or(|greatest| (greatest as usize) < vertex_count) {
                    return Ok(());
                }
                Err(self.first_bad_face(&piece, corners, vertex_count))
            })
            .collect();
        decoded.into_iter().collect::<Result<(), SceneError>>()?;
        Ok((triangles, length))
    }

    /// Visits the rows with the values of some properties, and the length of the list of corners.
    fn visit_rows(
        &self,
        wanted: &[usize],
        mut visit: impl FnMut(&[f64], usize) -> Result<(), SceneError>,
    ) -> Result<(), SceneError> {
        let corners = self.element.corners().unwrap_or(usize::MAX);
        let mut values = vec![0.0; wanted.len()];
        let mut at = 0;
        for row in 0..self.element.count {
            let (bytes, _, length) = self.row(at, corners).ok_or_else(|| self.truncated(row))?;
            let mut place = at;
            for (index, property) in self.element.properties.iter().enumerate() {
                if let Some(slot) = wanted.iter().position(|&wanted| wanted == index) {
                    let number = &self.bytes[place..];
                    values[slot] = with_reader!(property.kind, self.big_endian, read => f64::from(read(number)));
                }
                place += match property.count {
                    Some(kind) => kind.bytes() + self.count(place, kind).unwrap_or_default() * property.kind.bytes(),
                    None => property.kind.bytes(),
                };
            }
            visit(&values, length)?;
            at += bytes;
        }
        Ok(())
    }

    /// Appends the triangles of strips. Returns the bytes of the strips.
    fn strips(&self, corners: usize, vertex_count: usize, triangles: &mut Vec<[u32; 3]>) -> Result<usize, SceneError> {
        let kind = self.element.properties[corners].kind;
        let mut at = 0;
        for row in 0..self.element.count {
            let (bytes, list, length) = self.row(at, corners).ok_or_else(|| self.truncated(row))?;
            let most = length.saturating_sub(2);
            self.source.budget.take(self.source.path, "", most * size_of::<[u32; 3]>())?;
            triangles.reserve(most);
            let mut strip = Strip::default();
            for number in self.bytes[list..list + length * kind.bytes()].chunks_exact(kind.bytes()) {
                let index = with_reader!(kind, self.big_endian, read => read(number) as i64);
                let triangle = strip.next(index, vertex_count).map_err(|error| self.at_byte(at, error.to_string()))?;
                triangles.extend(triangle);
            }
            at += bytes;
        }
        Ok(at)
    }

    /// Splits faces that all have the same number of corners; `None`: they differ or are cut off.
    fn uniform_pieces(&self, corners: usize) -> Option<(Vec<FacePiece>, usize)> {
        let count = self.element.count;
        if count == 0 {
            return Some((Vec::new(), 0));
        }
        let (stride, list, length) = self.row(0, corners)?;
        let total = count.checked_mul(stride).filter(|&total| total <= self.bytes.len())?;
        // Offset and width of each list length of the first row, which must be equal in all rows.
        let mut lists = Vec::new();
        let mut at = 0;
        for property in &self.element.properties {
            at += match property.count {
                Some(kind) => {
                    lists.push((at, kind.bytes()));
                    kind.bytes() + self.count(at, kind)? * property.kind.bytes()
                }
                None => property.kind.bytes(),
            };
        }
        let first = &self.bytes[..stride];
        let is_uniform = self.bytes[..total].par_chunks(stride * PIECE_ROWS).all(|rows| match lists[..] {
            // The most common case.
            [(at, 1)] => rows.chunks_exact(stride).all(|row| row[at] == first[at]),
            _ => rows
                .chunks_exact(stride)
                .all(|row| lists.iter().all(|&(at, bytes)| row[at..at + bytes] == first[at..at + bytes])),
        });
        let piece = |row: usize| {
            let rows = PIECE_ROWS.min(count - row);
            let uniform = Some(Uniform { stride, list, corners: length });
            FacePiece { start: row * stride, rows, triangles: rows * length.saturating_sub(2), uniform }
        };
        is_uniform.then(|| ((0..count).step_by(PIECE_ROWS).map(piece).collect(), total))
    }

    /// Splits faces of any number of corners, by scanning all rows.
    fn scanned_pieces(&self, corners: usize) -> Result<(Vec<FacePiece>, usize), SceneError> {
        let mut pieces = Vec::new();
        let mut at = 0;
        for row in 0..self.element.count {
            let (bytes, list, length) = self.row(at, corners).ok_or_else(|| self.truncated(row))?;
            let uniform = Some(Uniform { stride: bytes, list: list - at, corners: length });
            if row % PIECE_ROWS == 0 {
                pieces.push(FacePiece { start: at, rows: 0, triangles: 0, uniform });
            }
            if let Some(piece) = pieces.last_mut() {
                piece.rows += 1;
                piece.uniform = piece.uniform.filter(|known| Some(*known) == uniform);
                piece.triangles += length.saturating_sub(2);
            }
            at += bytes;
        }
        Ok((pieces, at))
    }

    /// Decodes the triangles of a piece. Returns the greatest index.
    fn decode(
        &self,
        piece: &FacePiece,
        corners: usize,
        size: usize,
        triangles: &mut [[u32; 3]],
        index: impl Fn(&[u8]) -> u32,
    ) -> Option<u32> {
        if let Some(Uniform { stride, list, corners: 3 }) = piece.uniform {
            let rows = self.bytes[piece.start..piece.start + stride * piece.rows].chunks_exact(stride);
            let mut largest = 0;
            for (row, triangle) in rows.zip(triangles) {
                let list = &row[list..list + 3 * size];
                *triangle = [index(list), index(&list[size..]), index(&list[2 * size..])];
                largest = largest.max(triangle[0]).max(triangle[1]).max(triangle[2]);
            }
            return Some(largest);
        }
        let mut greatest = None;
        let mut at = piece.start;
        let mut triangles = triangles.iter_mut();
        for _ in 0..piece.rows {
            let Some((bytes, list, length)) = self.row(at, corners) else { break };
            at += bytes;
            let list = &self.bytes[list..list + length * size];
            let corner = |number: usize| index(&list[number * size..]);
            for (second, triangle) in (1..length.saturating_sub(1)).zip(&mut triangles) {
                *triangle = [corner(0), corner(second), corner(second + 1)];
                greatest = greatest.max(triangle.iter().copied().max());
            }
        }
        greatest
    }

    /// Returns the error for a piece with an index out of range.
    fn first_bad_face(&self, piece: &FacePiece, corners: usize, vertex_count: usize) -> SceneError {
        let kind = self.element.properties[corners].kind;
        let mut at = piece.start;
        for _ in 0..piece.rows {
            let Some((bytes, list, length)) = self.row(at, corners) else { break };
            let list = &self.bytes[list..list + length * kind.bytes()];
            let bad = list.chunks_exact(kind.bytes()).find_map(|number| {
                let index = with_reader!(kind, self.big_endian, read => read(number) as i64);
                usize::try_from(index)
                    .is_ok_and(|index| index < vertex_count)
                    .then_some(())
                    .map_or(Some(index), |()| None)
            });
            if let Some(index) = bad {
                return self.at_byte(at, format!("refers to vertex {index}, but there are {vertex_count}"));
            }
            at += bytes;
        }
        self.at_byte(piece.start, format!("refers to a vertex that is not among the {vertex_count}"))
    }
}

/// Returns role, kind and offset of the used columns of a fixed-length row.
fn columns(properties: &[PlyProperty], roles: &[Option<Role>]) -> Vec<(Role, NumberKind, usize)> {
    let mut at = 0;
    let mut columns = Vec::new();
    for (property, role) in properties.iter().zip(roles) {
        if let Some(role) = *role {
            columns.push((role, property.kind, at));
        }
        at += property.kind.bytes();
    }
    columns
}
