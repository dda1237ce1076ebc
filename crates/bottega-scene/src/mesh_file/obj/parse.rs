//! The statements of a piece of an OBJ file.

use glam::{Vec2, Vec3};

use super::super::lines::{Block, Fault, Located, float, integer, next_word};
use super::{Corner, NONE};
use crate::image::linear_of_srgb;
use crate::model::COORDINATE_MAX;
use crate::text::shortened;

/// More vertices than this cannot be told apart.
pub(super) const COUNT_MAX: usize = 1 << 30;

/// Marks an index that counts from the first vertex of the piece: it is itself, plus [`COUNT_MAX`], plus this bit.
const RELATIVE: u32 = 1 << 31;

/// A piece of a file. Indices are absolute, or relative to the piece.
#[derive(Default)]
pub(super) struct Parsed {
    pub(super) positions: Vec<Vec3>,
    /// Linear; shorter than the positions where the last ones have none, white in between.
    pub(super) colors: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    pub(super) triangles: Vec<[Corner; 3]>,
    /// With the number of triangles of the piece before each.
    pub(super) statements: Vec<(usize, Statement)>,
}

pub(super) enum Statement {
    Material(String),
    Smoothing(u32),
    Library(String, usize),
    Unknown(String, usize),
}

pub(super) fn parse(block: Block<'_>) -> Result<Parsed, Located> {
    let mut parsed = Parsed::default();
    let mut unknown: Vec<Vec<u8>> = Vec::new();
    block.for_each_statement(|number, line| {
        let mut words = line;
        let keyword = next_word(&mut words).unwrap_or_default();
        match keyword {
            b"v" => parsed.position(words),
            b"vt" => parsed.uv(words),
            b"vn" => parsed.normal(words),
            b"f" | b"fo" => parsed.polygon(words),
            b"usemtl" => parsed.add(Statement::Material(text(words))),
            b"s" => parsed.smoothing(words),
            b"mtllib" => parsed.add(Statement::Library(text(words), number)),
            b"g" | b"o" => Ok(()),
            _ if unknown.iter().any(|known| known == keyword) => Ok(()),
            _ => {
                unknown.push(keyword.to_vec());
                let keyword = shortened(&String::from_utf8_lossy(keyword)).into_owned();
                if unknown.len() > 16 && !keyword.is_ascii() {
                    return Err(Fault::new(line, "this is no OBJ file"));
                }
                parsed.add(Statement::Unknown(keyword, number))
            }
        }
    })?;
    Ok(parsed)
}

/// Tells of a problem at the corner of a triangle of a piece that could be parsed.
pub(super) fn locate_corner(block: Block<'_>, [triangle, corner]: [usize; 2], problem: String) -> Located {
    let mut before = 0;
    let found = block.for_each_statement(|_, line| {
        let mut words = line;
        if !matches!(next_word(&mut words), Some(b"f" | b"fo")) {
            return Ok(());
        }
        let corners: Vec<&[u8]> = std::iter::from_fn(|| next_word(&mut words)).collect();
        let count = corners.len().saturating_sub(2);
        if triangle < before + count {
            // A fan: all triangles of a face share its first corner.
            let index = if corner == 0 { 0 } else { triangle - before + corner };
            return Err(Fault::new(corners[index], ""));
        }
        before += count;
        Ok(())
    });
    let (line, column) = found.map_or_else(|found| (found.line, found.column), |()| (block.first_line, 1));
    Located { line, column, problem }
}

fn text(words: &[u8]) -> String {
    String::from_utf8_lossy(words.trim_ascii()).into_owned()
}

fn wrong(word: &[u8]) -> Fault<'_> {
    Fault::new(word, format!("`{}` is not a number", shortened(&String::from_utf8_lossy(word))))
}

/// Up to `N` numbers, and how many there are.
fn floats<const N: usize>(mut words: &[u8]) -> Result<([f32; N], usize), Fault<'_>> {
    let mut values = [0.0; N];
    let mut count = 0;
    for value in &mut values {
        let Some(word) = next_word(&mut words) else { break };
        *value = float(word).ok_or_else(|| wrong(word))?;
        count += 1;
    }
    Ok((values, count))
}

/// Tells of all the words of a statement, from the first one on.
fn few(words: &[u8], problem: String) -> Fault<'_> {
    Fault::new(words.trim_ascii_start(), problem)
}

impl Parsed {
    /// Positions, texture coordinates, normals.
    pub(super) fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.uvs.len(), self.normals.len()]
    }

    pub(super) fn memory_bytes(&self) -> usize {
        // Twice: joined with the other pieces they exist again for a moment.
        2 * (size_of_val(&self.positions[..])
            + size_of_val(&self.colors[..])
            + size_of_val(&self.uvs[..])
            + size_of_val(&self.normals[..])
            + size_of_val(&self.triangles[..])
            + size_of_val(&self.statements[..]))
    }

    fn add<'t>(&mut self, statement: Statement) -> Result<(), Fault<'t>> {
        self.statements.push((self.triangles.len(), statement));
        Ok(())
    }

    fn position<'t>(&mut self, words: &'t [u8]) -> Result<(), Fault<'t>> {
        let ([x, y, z, r, g, b], count) = floats(words)?;
        if count < 3 {
            return Err(few(words, format!("a vertex needs three coordinates, here are {count}")));
        }
        let position = Vec3::new(x, y, z);
        if !(position.is_finite() && position.abs().max_element() <= COORDINATE_MAX) {
            return Err(few(words, "the position is not a number, or out of reach".into()));
        }
        if count == 6 {
            // Programs that write colours write what they show.
            let linear = |code: f32| linear_of_srgb(f64::from(code).clamp(0.0, 1.0)) as f32;
            self.colors.resize(self.positions.len(), Vec3::ONE);
            self.colors.push(Vec3::new(linear(r), linear(g), linear(b)));
        }
        self.positions.push(position);
        Ok(())
    }

    fn uv<'t>(&mut self, words: &'t [u8]) -> Result<(), Fault<'t>> {
        let (uv, count) = floats(words)?;
        self.uvs.push(Vec2::from_array(uv));
        if count > 0 { Ok(()) } else { Err(few(words, "texture coordinates without number".into())) }
    }

    fn normal<'t>(&mut self, words: &'t [u8]) -> Result<(), Fault<'t>> {
        let (normal, count) = floats(words)?;
        self.normals.push(Vec3::from_array(normal));
        if count == 3 { Ok(()) } else { Err(few(words, format!("a normal needs three numbers, here are {count}"))) }
    }

    fn smoothing<'t>(&mut self, mut words: &'t [u8]) -> Result<(), Fault<'t>> {
        let group = match next_word(&mut words) {
            None | Some(b"off") => 0,
            Some(b"on") => 1,
            // What is no group is taken for smoothing all the same.
            Some(word) => integer(word).map_or(1, |group| (group & 0x3fff_ffff) as u32),
        };
        self.add(Statement::Smoothing(group))
    }

    fn polygon<'t>(&mut self, words: &'t [u8]) -> Result<(), Fault<'t>> {
        let all = words;
        let mut words = words;
        let (mut first, mut last) = ([NONE; 3], [NONE; 3]);
        let mut count = 0;
        while let Some(word) = next_word(&mut words) {
            let corner = self.corner(word)?;
            match count {
                0 => first = corner,
                1 => {}
                _ => self.triangles.push([first, last, corner]),
            }
            last = corner;
            count += 1;
        }
        if count < 3 { Err(few(all, format!("a face needs three corners, here are {count}"))) } else { Ok(()) }
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner<'t>(&self, word: &'t [u8]) -> Result<Corner, Fault<'t>> {
        let mut corner = [NONE; 3];
        let counts = self.counts();
        let mut numbers = word.split(|&byte| byte == b'/');
        for (kind, index) in corner.iter_mut().enumerate() {
            match numbers.next() {
                None => break,
                Some([]) if kind > 0 => {}
                Some(number) => {
                    let value = integer(number).ok_or_else(|| wrong(word))?;
                    *index = encode(value, counts[kind]).map_err(|problem| Fault::new(number, problem))?;
                }
            }
        }
        if numbers.next().is_some() { Err(wrong(word)) } else { Ok(corner) }
    }

    /// Makes indices absolute. An error names the triangle and which of its corners.
    ///
    /// - `base`: how many of each kind were before this piece.
    /// - `totals`: how many of each kind the file has.
    pub(super) fn resolve(&mut self, base: [usize; 3], totals: [usize; 3]) -> Result<(), ([usize; 2], String)> {
        const NAMES: [&str; 3] = ["vertex", "texture coordinates", "normal"];
        for (number, triangle) in self.triangles.iter_mut().enumerate() {
            for (which, corner) in triangle.iter_mut().enumerate() {
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
                        let (name, total) = (NAMES[kind], totals[kind]);
                        let problem = match absolute {
                            ..0 => format!("counts back to before the first {name}"),
                            _ => format!("refers to {name} {}, but there are {total}", absolute + 1),
                        };
                        return Err(([number, which], problem));
                    }
                    *index = absolute as u32;
                }
            }
        }
        Ok(())
    }
}

/// An index of the file: from 1 from the start, or from −1 backwards from where it stands.
fn encode(number: i64, count: usize) -> Result<u32, String> {
    let relative = count as i64 + number + COUNT_MAX as i64;
    match number {
        0 => Err("an index is 0; they count from 1".into()),
        1.. if number <= COUNT_MAX as i64 => Ok((number - 1) as u32),
        ..0 if relative >= 0 => Ok(RELATIVE | relative as u32),
        _ => Err(format!("the index {number} is out of reach")),
    }
}
