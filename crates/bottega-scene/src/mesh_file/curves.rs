//! Curve files of Mitsuba 3: a control point per line, `x y z radius`, and an empty line between curves (its
//! documentation, Shapes, `bsplinecurve`). Further numbers on a line are ignored, as there.

use std::path::Path;

use glam::Vec4;

use super::lines::{LineBlock, LineFault, float, next_word};
use super::source::MeshSource;
use crate::budget::MemoryBudget;
use crate::error::SceneError;
use crate::model::COORDINATE_MAX;
use crate::text::{decode, shortened};

/// Control points of curves; w is the radius.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Curves {
    points: Vec<Vec4>,
    /// End of each curve in `points`.
    ends: Vec<usize>,
}

impl Curves {
    /// Iterates over the control points of each curve.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &[Vec4]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.points[start..end])
    }
}

/// Reads a file of curves.
///
/// - `least`: required number of control points per curve.
pub(crate) fn read(path: &Path, bytes: &[u8], least: usize, budget: &MemoryBudget) -> Result<Curves, SceneError> {
    let source = MeshSource { path, budget };
    let text = decode(path, bytes, budget)?.text;
    let bytes = text.as_bytes();
    let lines = 1 + bytes.iter().filter(|&&byte| byte == b'\n').count();
    budget.take(path, "", lines.saturating_mul(size_of::<Vec4>()))?;
    let mut curves = Curves::default();
    let block = LineBlock { text: bytes, first_line: 1 };
    // First line of the current curve.
    let mut start = None;
    for (number, line) in block.lines() {
        let locate = |fault| source.located(block.locate(number, fault));
        if !line.is_empty() {
            curves.points.push(point(line).map_err(locate)?);
            start = start.or(Some(line));
        } else if let Some(first) = start.take() {
            curves.end(first, least).map_err(locate)?;
        }
    }
    if let Some(first) = start {
        curves.end(first, least).map_err(|fault| source.located(block.locate(1, fault)))?;
    }
    if curves.ends.is_empty() {
        return Err(source.damaged("it has no control points: lines of `x y z radius`"));
    }
    Ok(curves)
}

impl Curves {
    fn end<'t>(&mut self, first: &'t [u8], least: usize) -> Result<(), LineFault<'t>> {
        let count = self.points.len() - self.ends.last().copied().unwrap_or(0);
        if count < least {
            let problem =
                format!("a curve of {count} control points; it needs {least} at least: add some, or remove it");
            return Err(LineFault::new(first, problem));
        }
        self.ends.push(self.points.len());
        Ok(())
    }
}

fn point(line: &[u8]) -> Result<Vec4, LineFault<'_>> {
    let mut rest = line;
    let mut numbers = [0.0; 4];
    for (number, name) in numbers.iter_mut().zip(["x", "y", "z", "radius"]) {
        let Some(word) = next_word(&mut rest) else {
            return Err(LineFault::new(rest, format!("the {name} is missing; a control point is `x y z radius`")));
        };
        let value = float(word).ok_or_else(|| {
            let text = String::from_utf8_lossy(word);
            LineFault::new(word, format!("`{}` is not a number; a control point is `x y z radius`", shortened(&text)))
        })?;
        if value.is_nan() || value.abs() > COORDINATE_MAX {
            return Err(LineFault::new(word, format!("the {name} is out of reach: beyond {COORDINATE_MAX:e}")));
        }
        if name == "radius" && value < 0.0 {
            return Err(LineFault::new(word, "the radius is below 0; make it 0 or greater"));
        }
        *number = value;
    }
    Ok(Vec4::from_array(numbers))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str, least: usize) -> Result<Curves, String> {
        let budget = MemoryBudget::new(1 << 20);
        read(Path::new("hair.txt"), text.as_bytes(), least, &budget).map_err(|error| error.to_string())
    }

    #[test]
    fn empty_lines_part_curves() {
        // As Mitsuba 3.9 reads them: spaces and returns are nothing, and so are further empty lines.
        let text = "\n\n0 0 0 .1\r\n1 0 0 .2 and more\n \t\r\n\n-1e0 2 +3 0\n0 0 0 1\n0 0 5 1\n\n\n";
        let curves = parsed(text, 2).unwrap();
        let lengths: Vec<usize> = curves.iter().map(<[Vec4]>::len).collect();
        assert_eq!(lengths, [2, 3]);
        assert_eq!(curves.iter().nth(1).unwrap()[0], Vec4::new(-1.0, 2.0, 3.0, 0.0));
        assert_eq!(parsed("0 0 0 1\n0 0 1 1", 2).unwrap().iter().count(), 1);
    }

    #[test]
    fn errors_name_line_and_column() {
        for (text, place, reason) in [
            ("0 0 0 1\n0 0 1\n", "line 2, column 6", "radius is missing"),
            ("0 0 0 1\n0 zero 1 1\n", "line 2, column 3", "`zero` is not a number"),
            ("# hair\n0 0 0 1\n", "line 1, column 1", "`#` is not a number"),
            ("0 0 nan 1\n0 0 1 1\n", "line 1, column 5", "out of reach"),
            ("0 0 1e30 1\n0 0 1 1\n", "line 1, column 5", "out of reach"),
            ("0 0 0 -1\n0 0 1 1\n", "line 1, column 7", "below 0"),
            ("0 0 0 1\n0 0 1 1\n\n 0 0 0 1\n\n0 0 0 1\n0 0 1 1", "line 4, column 2", "of 1 control points"),
            ("0 0 0 1\n0 0 1 1\n\n0 0 0 1", "line 4, column 1", "of 1 control points"),
            ("", "hair.txt", "no control points"),
            ("\n \n", "hair.txt", "no control points"),
            ("\0\0\u{7}", "line 1, column 1", "not text"),
        ] {
            let error = parsed(text, 2).unwrap_err();
            assert!(error.contains("hair.txt") && error.contains(place) && error.contains(reason), "{text:?}: {error}");
        }
    }

    #[test]
    fn memory_is_booked_before_it_is_taken() {
        let text = "0 0 0 1\n".repeat(10_000);
        let small = MemoryBudget::new(1 << 16);
        assert!(matches!(read(Path::new(""), text.as_bytes(), 4, &small), Err(SceneError::Limit { .. })));
    }
}
