//! ASCII PLY: one line per row of an element.

use std::ops::Range;

use rayon::prelude::*;

use super::super::lines::{self, LineBlock, LineFault, LocatedFault, float, integer, next_word};
use super::super::source::MeshSource;
use super::header::{Element, PlyHeader, WantedNumbers};
use super::role::Role;
use super::strips::Strip;
use super::vertices::{self, Slices, UNSOUND};
use crate::error::SceneError;
use crate::model::Mesh;
use crate::text::shortened;

/// Reads the mesh of an ASCII file.
pub(super) fn read(source: MeshSource<'_>, header: &PlyHeader, bytes: &[u8]) -> Result<Mesh, SceneError> {
    let blocks = lines::blocks(&bytes[header.body..], header.body_line, false);
    let counts: Vec<usize> = blocks.par_iter().map(|block| rows(*block).count()).collect();
    let elements = RowRanges::new(source, header, counts.iter().sum())?;
    let mut mesh = Mesh::default();
    if let Some((element, _)) = &elements.vertices {
        mesh = vertices::allocate(source, element)?;
    }
    let first_rows = counts.iter().scan(0, |next, count| {
        let first = *next;
        *next += count;
        Some(first..*next)
    });
    let first_rows: Vec<Range<usize>> = first_rows.collect();
    let vertex_rows = |rows: &Range<usize>| match &elements.vertices {
        Some((_, vertices)) => overlap(rows, vertices).len(),
        None => 0,
    };
    let slices = Slices::of(&mut mesh).split(first_rows.iter().map(vertex_rows));
    let tasks: Vec<_> = blocks.into_iter().zip(first_rows).zip(slices).collect();
    let decoded: Vec<Result<Vec<[u32; 3]>, LocatedFault>> = tasks
        .into_par_iter()
        .map(|((block, rows), vertices)| {
            let decoded = elements.decode(block, rows, vertices, header.vertex_count);
            decoded.map_err(|fault| block.locate(block.first_line, fault))
        })
        .collect();
    let decoded =
        decoded.into_iter().collect::<Result<Vec<_>, LocatedFault>>().map_err(|fault| source.located(fault))?;
    let total: usize = decoded.iter().map(Vec::len).sum();
    source.budget.take(source.path, "", total * size_of::<[u32; 3]>())?;
    mesh.triangles.reserve_exact(total);
    decoded.into_iter().for_each(|part| mesh.triangles.extend(part));
    Ok(mesh)
}

/// Implements [`super::visit_rows`].
pub(super) fn visit_rows(
    source: MeshSource<'_>,
    header: &PlyHeader,
    bytes: &[u8],
    wanted: &WantedNumbers<'_>,
    mut visit: impl FnMut(&[f64], usize) -> Result<(), SceneError>,
) -> Result<(), SceneError> {
    let blocks = lines::blocks(&bytes[header.body..], header.body_line, false);
    let mut lines = blocks.into_iter().flat_map(|block| rows(block).map(move |line| (block, line)));
    let mut values = vec![0.0; wanted.properties.len()];
    for (number, element) in header.elements.iter().enumerate().filter(|(_, element)| !element.properties.is_empty()) {
        let corners = element.corners();
        for row in 0..element.count {
            let Some((block, mut line)) = lines.next() else {
                return Err(source.damaged(format!("it ends before row {row} of `{}`", element.name())));
            };
            if number != wanted.element {
                continue;
            }
            let located = |fault| source.located(block.locate(block.first_line, fault));
            let mut length = 0;
            for (index, property) in element.properties.iter().enumerate() {
                let word = next_word(&mut line).ok_or_else(|| located(missing(element, line)))?;
                if property.count.is_some() {
                    if Some(index) == corners {
                        length = integer(word).and_then(|n| usize::try_from(n).ok()).unwrap_or(0);
                    }
                    skip_list(word, &mut line).map_err(located)?;
                } else if let Some(slot) = wanted.properties.iter().position(|&wanted| wanted == index) {
                    values[slot] = f64::from(float(word).ok_or_else(|| located(wrong(word)))?);
                }
            }
            visit(&values, length)?;
        }
        if number == wanted.element {
            break;
        }
    }
    Ok(())
}

/// Iterates over the lines that are not empty.
fn rows(block: LineBlock<'_>) -> impl Iterator<Item = &[u8]> {
    block.lines().map(|(_, line)| line).filter(|line| !line.is_empty())
}

fn overlap(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    let start = a.start.max(b.start);
    start..a.end.min(b.end).max(start)
}

/// The row ranges of the elements that are read.
struct RowRanges<'a> {
    vertices: Option<(&'a Element, Range<usize>)>,
    /// Faces and triangle strips.
    polygons: Vec<(&'a Element, Range<usize>)>,
}

impl<'a> RowRanges<'a> {
    fn new(source: MeshSource<'_>, header: &'a PlyHeader, row_count: usize) -> Result<Self, SceneError> {
        let mut elements = Self { vertices: None, polygons: Vec::new() };
        let mut next = 0usize;
        for element in header.elements.iter().filter(|element| !element.properties.is_empty()) {
            let rows = next..next.saturating_add(element.count);
            next = rows.end;
            if rows.end > row_count {
                let row = row_count.saturating_sub(rows.start);
                let problem = format!("it ends before row {row} of the {} of `{}`", element.count, element.name());
                return Err(source.damaged(problem));
            }
            if element.is_vertices() {
                elements.vertices = Some((element, rows));
            } else if element.is_faces() || element.is_strips() {
                elements.polygons.push((element, rows));
            }
        }
        Ok(elements)
    }

    /// Fills the vertices in a block of text, and returns its triangles.
    fn decode<'t>(
        &self,
        block: LineBlock<'t>,
        numbers: Range<usize>,
        mut vertices: Slices<'_>,
        vertex_count: usize,
    ) -> Result<Vec<[u32; 3]>, LineFault<'t>> {
        let mut triangles = Vec::new();
        let mut lines = numbers.clone().zip(rows(block));
        let part = |rows: &Range<usize>| overlap(&numbers, rows);
        let mut passages = Vec::new();
        passages.extend(self.vertices.as_ref().map(|(element, rows)| (part(rows), *element, true)));
        passages.extend(self.polygons.iter().map(|(element, rows)| (part(rows), *element, false)));
        passages.sort_by_key(|(rows, ..)| rows.start);
        for (rows, element, is_vertices) in passages {
            if rows.is_empty() {
                continue;
            }
            let mut lines =
                (&mut lines).skip_while(|(row, _)| *row < rows.start).take(rows.len()).map(|(_, line)| line);
            if is_vertices {
                read_vertices(element, &mut lines, &mut vertices)?;
            } else {
                read_faces(element, &mut lines, vertex_count, &mut triangles)?;
            }
        }
        Ok(triangles)
    }
}

fn missing<'t>(element: &Element, end: &'t [u8]) -> LineFault<'t> {
    LineFault::new(end, format!("a row of `{}` has fewer numbers than announced", element.name()))
}

fn wrong(word: &[u8]) -> LineFault<'_> {
    LineFault::new(word, format!("`{}` is not a number as announced", shortened(&String::from_utf8_lossy(word))))
}

fn read_vertices<'t>(
    element: &Element,
    lines: &mut impl Iterator<Item = &'t [u8]>,
    vertices: &mut Slices<'_>,
) -> Result<(), LineFault<'t>> {
    let roles = element.roles();
    let mut starts = Vec::new();
    for (vertex, mut line) in lines.enumerate() {
        starts.push(line);
        for (property, role) in element.properties.iter().zip(&roles) {
            let word = next_word(&mut line).ok_or_else(|| missing(element, line))?;
            if property.count.is_some() {
                skip_list(word, &mut line)?;
            } else if let Some(role) = *role {
                let value = if property.kind.is_integer() {
                    integer(word).map(|value| value as f64)
                } else {
                    float(word).map(f64::from)
                };
                let value = value.ok_or_else(|| wrong(word))?;
                vertices.set(vertex, role, property.kind, value);
            }
        }
    }
    let has_alpha = roles.contains(&Some(Role::Color(3)));
    vertices
        .complete(has_alpha)
        .map_err(|vertex| LineFault::new(starts.get(vertex).copied().unwrap_or_default(), UNSOUND))
}

/// Skips the numbers of a list whose length is `word`.
fn skip_list<'t>(word: &'t [u8], line: &mut &'t [u8]) -> Result<(), LineFault<'t>> {
    let length = integer(word).and_then(|length| usize::try_from(length).ok()).ok_or_else(|| wrong(word))?;
    for _ in 0..length {
        next_word(line).ok_or_else(|| LineFault::new(line, "a list has fewer numbers than announced"))?;
    }
    Ok(())
}

fn read_faces<'t>(
    element: &Element,
    lines: &mut impl Iterator<Item = &'t [u8]>,
    vertex_count: usize,
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), LineFault<'t>> {
    let corners = element.corners();
    let read = if element.is_strips() { read_strip } else { read_corners };
    for mut line in lines {
        for (index, property) in element.properties.iter().enumerate() {
            let word = next_word(&mut line).ok_or_else(|| missing(element, line))?;
            if Some(index) == corners {
                read(word, &mut line, vertex_count, triangles)?;
                // The remaining properties are not used.
                break;
            } else if property.count.is_some() {
                skip_list(word, &mut line)?;
            }
        }
    }
    Ok(())
}

fn read_corners<'t>(
    word: &'t [u8],
    line: &mut &'t [u8],
    vertex_count: usize,
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), LineFault<'t>> {
    let length = integer(word).and_then(|length| usize::try_from(length).ok()).ok_or_else(|| wrong(word))?;
    let (mut first, mut last) = (0, 0);
    for corner in 0..length {
        let word = next_word(line).ok_or_else(|| LineFault::new(line, "a face has fewer corners than announced"))?;
        let index = integer(word).ok_or_else(|| wrong(word))?;
        let in_range = u32::try_from(index).ok().filter(|&index| (index as usize) < vertex_count);
        let index = in_range
            .ok_or_else(|| LineFault::new(word, format!("refers to vertex {index}, but there are {vertex_count}")))?;
        match corner {
            0 => first = index,
            1 => {}
            _ => triangles.push([first, last, index]),
        }
        last = index;
    }
    Ok(())
}

fn read_strip<'t>(
    word: &'t [u8],
    line: &mut &'t [u8],
    vertex_count: usize,
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), LineFault<'t>> {
    let length = integer(word).and_then(|length| usize::try_from(length).ok()).ok_or_else(|| wrong(word))?;
    let mut strip = Strip::default();
    for _ in 0..length {
        let word = next_word(line).ok_or_else(|| LineFault::new(line, "a strip has fewer corners than announced"))?;
        let index = integer(word).ok_or_else(|| wrong(word))?;
        triangles.extend(strip.next(index, vertex_count).map_err(|error| LineFault::new(word, error.to_string()))?);
    }
    Ok(())
}
