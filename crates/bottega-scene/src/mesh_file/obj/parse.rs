//! Parsing of the statements of a block of an OBJ file.

use std::ops::Range;

use glam::{Vec2, Vec3};

use super::super::lines::{LineBlock, LineFault, LocatedFault, float, integer, next_number, next_word};
use super::file::{Corner, NONE};
use crate::image::linear_of_srgb;
use crate::model::COORDINATE_MAX;
use crate::text::shortened;

/// Maximal number of vertices.
pub(super) const COUNT_MAX: usize = 1 << 30;

/// Flag of an index relative to the first vertex of the block: the index plus [`COUNT_MAX`], with this bit set.
const RELATIVE: u32 = 1 << 31;

/// A parsed block. Indices are absolute, or relative to the block.
#[derive(Default)]
pub(super) struct ParsedLines {
    /// Positions; invalid ones are 0.
    pub(super) positions: Vec<Vec3>,
    /// Indices of the invalid positions.
    pub(super) unsound: Vec<u32>,
    /// Linear colours, white where a vertex has none. Shorter than the positions if the last ones have none.
    pub(super) colors: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    pub(super) triangles: Vec<[Corner; 3]>,
    /// First triangle and number of triangles of each face with several.
    polygons: Vec<[u32; 2]>,
    /// Statements, each with the number of triangles before it in the block.
    pub(super) statements: Vec<(usize, Statement)>,
    /// Damaged statements, by kind.
    pub(super) skipped: SkippedStatements,
}

/// A statement that affects the following faces, or that is reported: material, smoothing group, material library and
/// its line, unsupported keyword and its line.
pub(super) enum Statement {
    Material(String),
    Smoothing(u32),
    Library(String, usize),
    Unknown(String, usize),
}

/// Damaged statements by kind: the first one, and their number.
#[derive(Default)]
pub(super) struct SkippedStatements([Option<(LocatedFault, usize)>; KINDS.len()]);

/// The effects of each kind of damage.
const KINDS: [&str; 5] = [
    "the vertex is left out with its faces",
    "0 replaces these texture coordinates",
    "the normal of its faces replaces it",
    "the face is left out",
    "the triangle has no area and is left out",
];
const VERTEX: usize = 0;
const UV: usize = 1;
const NORMAL: usize = 2;
const FACE: usize = 3;
const NO_AREA: usize = 4;

impl SkippedStatements {
    /// Counts a damaged statement; `locate` is called for the first one.
    fn add(&mut self, kind: usize, locate: impl FnOnce() -> LocatedFault) {
        match &mut self.0[kind] {
            Some((_, count)) => *count += 1,
            first => *first = Some((locate(), 1)),
        }
    }

    /// Adds those of a later block.
    pub(super) fn append(&mut self, later: Self) {
        for (mine, later) in self.0.iter_mut().zip(later.0) {
            match (&mut *mine, later) {
                (Some((_, count)), Some((_, more))) => *count += more,
                (None, later) => *mine = later,
                (Some(_), None) => {}
            }
        }
    }

    /// Returns line and message of each kind.
    pub(super) fn notes(self) -> Vec<(usize, String)> {
        let note = |(found, kind): (Option<(LocatedFault, usize)>, &str)| {
            let (LocatedFault { line, column, problem }, count) = found?;
            let others = match count - 1 {
                0 => String::new(),
                1 => " (and so is another one)".into(),
                more => format!(" (and so are {more} others)"),
            };
            let problem = if problem.is_empty() { String::new() } else { format!("{problem}; ") };
            Some((line, format!("column {column}: {problem}{kind}{others}")))
        };
        self.0.into_iter().zip(KINDS).filter_map(note).collect()
    }
}

/// Parses a block. Damaged statements are left out, unless the whole is not an OBJ file.
pub(super) fn parse(block: LineBlock<'_>) -> Result<ParsedLines, LocatedFault> {
    parse_watching(block, |_, _, _| ())
}

/// Locates a corner of a triangle, numbered before any triangle was left out.
fn locate_corner(block: LineBlock<'_>, [triangle, corner]: [usize; 2], problem: String) -> LocatedFault {
    let mut found = LocatedFault { line: block.first_line, column: 1, problem };
    // Parsing again cannot fail, as it succeeded before.
    let _same = parse_watching(block, |triangles, line, words| {
        if triangles.contains(&triangle) {
            let mut rest = words;
            let corners: Vec<&[u8]> = std::iter::from_fn(|| next_number(&mut rest)).collect();
            // All triangles of a fan share the first corner of the face.
            let index = if corner == 0 { 0 } else { triangle - triangles.start + corner };
            let place = block.locate(line, LineFault::new(corners.get(index).copied().unwrap_or(words), ""));
            (found.line, found.column) = (place.line, place.column);
        }
    });
    found
}

/// Parses a block.
///
/// - `watch`: called with the triangles of each face, its line, and its corners.
fn parse_watching(
    block: LineBlock<'_>,
    mut watch: impl FnMut(Range<usize>, usize, &[u8]),
) -> Result<ParsedLines, LocatedFault> {
    let mut parsed = ParsedLines::default();
    let mut unknown: Vec<Vec<u8>> = Vec::new();
    block.for_each_statement(|number, line| {
        let mut words = line;
        let keyword = next_word(&mut words).unwrap_or_default();
        let (kind, read) = match keyword {
            b"v" => (VERTEX, parsed.position(words)),
            b"vt" => (UV, parsed.uv(words)),
            b"vn" => (NORMAL, parsed.normal(words)),
            b"f" | b"fo" => {
                let first = parsed.triangles.len();
                let read = parsed.polygon(words);
                match read {
                    Ok(()) => watch(first..parsed.triangles.len(), number, words),
                    Err(_) => parsed.triangles.truncate(first),
                }
                (FACE, read)
            }
            b"usemtl" => return parsed.add(Statement::Material(text(words))),
            b"s" => return parsed.smoothing(words),
            b"mtllib" => return parsed.add(Statement::Library(text(words), number)),
            b"g" | b"o" => return Ok(()),
            _ if unknown.iter().any(|known| known == keyword) => return Ok(()),
            _ => {
                unknown.push(keyword.to_vec());
                let keyword = shortened(&String::from_utf8_lossy(keyword)).into_owned();
                if unknown.len() > 16 && !keyword.is_ascii() {
                    return Err(LineFault::new(line, "this is not an OBJ file"));
                }
                return parsed.add(Statement::Unknown(keyword, number));
            }
        };
        if let Err(fault) = read {
            parsed.skipped.add(kind, || block.locate(number, fault));
        }
        Ok(())
    })?;
    Ok(parsed)
}

fn text(words: &[u8]) -> String {
    String::from_utf8_lossy(words.trim_ascii()).into_owned()
}

fn wrong(word: &[u8]) -> LineFault<'_> {
    LineFault::new(word, format!("`{}` is not a number", shortened(&String::from_utf8_lossy(word))))
}

/// Parses up to `N` numbers. Returns them and their count.
fn floats<const N: usize>(mut words: &[u8]) -> Result<([f32; N], usize), LineFault<'_>> {
    let mut values = [0.0; N];
    let mut count = 0;
    for value in &mut values {
        let Some(word) = next_number(&mut words) else { break };
        *value = float(word).ok_or_else(|| wrong(word))?;
        count += 1;
    }
    Ok((values, count))
}

/// Makes a fault that spans all words of a statement.
fn few(words: &[u8], problem: String) -> LineFault<'_> {
    LineFault::new(words.trim_ascii_start(), problem)
}

impl ParsedLines {
    /// Returns the numbers of positions, texture coordinates and normals.
    pub(super) fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.uvs.len(), self.normals.len()]
    }

    /// Returns the memory of the lines until the blocks are joined, in bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        // Twice: they are copied when the blocks are joined.
        2 * (size_of_val(&self.positions[..])
            + size_of_val(&self.colors[..])
            + size_of_val(&self.uvs[..])
            + size_of_val(&self.normals[..])
            + size_of_val(&self.triangles[..])
            + size_of_val(&self.polygons[..])
            + size_of_val(&self.statements[..]))
    }

    fn add<'t>(&mut self, statement: Statement) -> Result<(), LineFault<'t>> {
        self.statements.push((self.triangles.len(), statement));
        Ok(())
    }

    /// Parses a position. An invalid one is stored as well, because faces refer to the following ones by number.
    fn position<'t>(&mut self, words: &'t [u8]) -> Result<(), LineFault<'t>> {
        let read = floats(words).and_then(|([x, y, z, r, g, b], count)| {
            if count < 3 {
                return Err(few(words, format!("a vertex needs three coordinates, here are {count}")));
            }
            let position = Vec3::new(x, y, z);
            if !(position.is_finite() && position.abs().max_element() <= COORDINATE_MAX) {
                return Err(few(words, "the position is not a number, or out of reach".into()));
            }
            // Programs that write vertex colours write sRGB.
            let linear = |code: f32| linear_of_srgb(f64::from(code).clamp(0.0, 1.0)) as f32;
            Ok((position, (count == 6).then(|| Vec3::new(linear(r), linear(g), linear(b)))))
        });
        if let Ok((_, Some(color))) = read {
            self.colors.resize(self.positions.len(), Vec3::ONE);
            self.colors.push(color);
        }
        if read.is_err() {
            self.unsound.push(self.positions.len() as u32);
        }
        self.positions.push(read.as_ref().map_or(Vec3::ZERO, |(position, _)| *position));
        read.map(|_| ())
    }

    fn uv<'t>(&mut self, words: &'t [u8]) -> Result<(), LineFault<'t>> {
        let read = floats(words).and_then(|(uv, count)| match count {
            0 => Err(few(words, "texture coordinates without number".into())),
            _ => Ok(Vec2::from_array(uv)),
        });
        self.uvs.push(*read.as_ref().unwrap_or(&Vec2::ZERO));
        read.map(|_| ())
    }

    fn normal<'t>(&mut self, words: &'t [u8]) -> Result<(), LineFault<'t>> {
        let read = floats(words).and_then(|(normal, count)| match count {
            3 => Ok(Vec3::from_array(normal)),
            _ => Err(few(words, format!("a normal needs three numbers, here are {count}"))),
        });
        self.normals.push(*read.as_ref().unwrap_or(&Vec3::ZERO));
        read.map(|_| ())
    }

    fn smoothing<'t>(&mut self, mut words: &'t [u8]) -> Result<(), LineFault<'t>> {
        let group = match next_word(&mut words) {
            None | Some(b"off") => 0,
            Some(b"on") => 1,
            // Other words also enable smoothing.
            Some(word) => integer(word).map_or(1, |group| (group & 0x3fff_ffff) as u32),
        };
        self.add(Statement::Smoothing(group))
    }

    fn polygon<'t>(&mut self, words: &'t [u8]) -> Result<(), LineFault<'t>> {
        let all = words;
        let mut words = words;
        let (mut first, mut last) = ([NONE; 3], [NONE; 3]);
        let mut count = 0;
        let before = self.triangles.len();
        while let Some(word) = next_number(&mut words) {
            let corner = self.corner(word)?;
            match count {
                0 => first = corner,
                1 => {}
                _ => self.triangles.push([first, last, corner]),
            }
            last = corner;
            count += 1;
        }
        if count < 3 {
            return Err(few(all, format!("a face needs three corners, here are {count}")));
        }
        if count > 3 {
            self.polygons.push([before as u32, count - 2]);
        }
        Ok(())
    }

    /// Parses `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner<'t>(&self, word: &'t [u8]) -> Result<Corner, LineFault<'t>> {
        let mut corner = [NONE; 3];
        let counts = self.counts();
        let mut numbers = word.split(|&byte| byte == b'/');
        for (kind, index) in corner.iter_mut().enumerate() {
            match numbers.next() {
                None => break,
                Some([]) if kind > 0 => {}
                Some(number) => {
                    let value = integer(number).ok_or_else(|| wrong(word))?;
                    *index = encode(value, counts[kind]).map_err(|error| LineFault::new(number, error.to_string()))?;
                }
            }
        }
        if numbers.next().is_some() { Err(wrong(word)) } else { Ok(corner) }
    }

    /// Makes indices absolute, and leaves out faces that refer to missing vertices, and triangles without area.
    ///
    /// - `block`: its text.
    /// - `base`: numbers of positions, texture coordinates and normals before this block.
    /// - `totals`: their numbers in the file.
    /// - `unsound`: the invalid positions of the file, in order.
    pub(super) fn resolve(&mut self, block: LineBlock<'_>, base: [usize; 3], totals: [usize; 3], unsound: &[u32]) {
        let (mut faces, mut flat): (Vec<Range<usize>>, Vec<usize>) = (Vec::new(), Vec::new());
        for number in 0..self.triangles.len() {
            for which in 0..3 {
                let mut corner = self.triangles[number][which];
                let resolved = resolve_corner(&mut corner, base, totals, unsound);
                self.triangles[number][which] = corner;
                let Err(error) = resolved else { continue };
                if faces.last().is_none_or(|last| !last.contains(&number)) {
                    faces.push(self.face_of(number));
                    // An invalid vertex was already reported with its faces.
                    if error != IndexError::UnsoundVertex {
                        self.skipped.add(FACE, || locate_corner(block, [number, which], error.to_string()));
                    }
                }
            }
            let [a, b, c] = self.triangles[number].map(|corner| corner[0]);
            if a == b || b == c || c == a {
                flat.push(number);
            }
        }
        let mut rest = &faces[..];
        flat.retain(|number| {
            rest = &rest[rest.partition_point(|face| face.end <= *number)..];
            rest.first().is_none_or(|face| !face.contains(number))
        });
        for &number in &flat {
            self.skipped.add(NO_AREA, || locate_corner(block, [number, 0], String::new()));
        }
        if !(faces.is_empty() && flat.is_empty()) {
            let mut keeps = vec![true; self.triangles.len()];
            faces.into_iter().for_each(|face| keeps[face].fill(false));
            flat.into_iter().for_each(|number| keeps[number] = false);
            self.retain(&keeps);
        }
    }

    /// Returns the triangles of the face that a triangle belongs to.
    fn face_of(&self, triangle: usize) -> Range<usize> {
        let after = self.polygons.partition_point(|polygon| polygon[0] as usize <= triangle);
        let polygon = after.checked_sub(1).map(|index| self.polygons[index].map(|number| number as usize));
        let polygon = polygon.map(|[first, count]| first..first + count).filter(|polygon| polygon.contains(&triangle));
        polygon.unwrap_or(triangle..triangle + 1)
    }

    /// Removes the triangles whose flag is false.
    fn retain(&mut self, keeps: &[bool]) {
        // Shift the positions of statements between triangles.
        let mut statements = self.statements.iter_mut().peekable();
        let mut kept = 0;
        for (number, keep) in keeps.iter().chain([&true]).enumerate() {
            while let Some(statement) = statements.next_if(|statement| statement.0 == number) {
                statement.0 = kept;
            }
            kept += usize::from(*keep);
        }
        let mut keep = keeps.iter();
        self.triangles.retain(|_| keep.next().is_none_or(|keep| *keep));
    }
}

/// An invalid index in a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
enum IndexError {
    #[error("an index is 0; they count from 1")]
    Zero,
    #[error("the index {0} is out of reach")]
    OutOfReach(i64),
    #[error("counts back to before the first {element}")]
    BeforeFirst { element: &'static str },
    #[error("refers to {element} {number}, but there are {total}")]
    Missing { element: &'static str, number: i64, total: usize },
    /// The vertex has no valid position, which is reported with its own line.
    #[error("refers to an invalid vertex")]
    UnsoundVertex,
}

/// Makes the indices of a corner absolute.
fn resolve_corner(
    corner: &mut Corner,
    base: [usize; 3],
    totals: [usize; 3],
    unsound: &[u32],
) -> Result<(), IndexError> {
    const NAMES: [&str; 3] = ["vertex", "texture coordinates", "normal"];
    for kind in 0..3 {
        let index = &mut corner[kind];
        if *index == NONE {
            continue;
        }
        let absolute = if *index & RELATIVE == 0 {
            i64::from(*index)
        } else {
            i64::from(*index - RELATIVE) - COUNT_MAX as i64 + base[kind] as i64
        };
        if absolute < 0 || absolute >= totals[kind] as i64 {
            let (element, total) = (NAMES[kind], totals[kind]);
            return Err(match absolute {
                ..0 => IndexError::BeforeFirst { element },
                _ => IndexError::Missing { element, number: absolute + 1, total },
            });
        }
        *index = absolute as u32;
    }
    if unsound.binary_search(&corner[0]).is_ok() { Err(IndexError::UnsoundVertex) } else { Ok(()) }
}

/// Encodes an index of the file: from 1 at the start, or from −1 backwards from here.
fn encode(number: i64, count: usize) -> Result<u32, IndexError> {
    let relative = count as i64 + number + COUNT_MAX as i64;
    match number {
        0 => Err(IndexError::Zero),
        1.. if number <= COUNT_MAX as i64 => Ok((number - 1) as u32),
        ..0 if relative >= 0 => Ok(RELATIVE | relative as u32),
        _ => Err(IndexError::OutOfReach(number)),
    }
}
