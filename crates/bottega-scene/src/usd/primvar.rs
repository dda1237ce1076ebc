//! Primvars: values on surfaces, by face, point or corner.

use glam::{Vec2, Vec3};
use openusd::sdf::Value;
use openusd::usd::Prim;

use super::source::StageSource;
use super::values;

/// The parts of a surface that have values of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Interpolation {
    /// One value for all.
    Constant,
    /// One value per face, or per curve.
    Uniform,
    /// One value per point; for curves also one per end of a segment.
    Vertex,
    /// Like [`Self::Vertex`], except on curves.
    Varying,
    /// One value per corner of a face.
    FaceVarying,
}

/// A primvar: values, and the index of each element into them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Primvar<T> {
    pub(super) values: Vec<T>,
    /// Indices into the values; `None`: element i has value i.
    indices: Option<Vec<i32>>,
    pub(super) interpolation: Interpolation,
}

/// The numbers of elements of a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Counts {
    pub(super) faces: usize,
    pub(super) points: usize,
    pub(super) corners: usize,
}

impl<T: Copy> Primvar<T> {
    /// Makes a primvar without indices.
    pub(super) fn new(values: Vec<T>, interpolation: Interpolation) -> Self {
        Self { values, indices: None, interpolation }
    }

    /// Returns the number of elements.
    pub(super) fn count(&self) -> usize {
        self.indices.as_ref().map_or(self.values.len(), Vec::len)
    }

    /// Returns the value of an element; `None`: it has none.
    pub(super) fn at(&self, element: usize) -> Option<T> {
        let index = match &self.indices {
            Some(indices) => usize::try_from(*indices.get(element)?).ok()?,
            None => element,
        };
        self.values.get(index).copied()
    }

    /// Returns the index of an element into the values; `None`: the primvar has no indices.
    pub(super) fn index(&self, element: usize) -> Option<i32> {
        self.indices.as_ref()?.get(element).copied()
    }

    /// Returns the value of a corner, by its face and point.
    pub(super) fn of_corner(&self, face: usize, point: usize, corner: usize) -> Option<T> {
        self.at(match self.interpolation {
            Interpolation::Constant => 0,
            Interpolation::Uniform => face,
            Interpolation::Vertex | Interpolation::Varying => point,
            Interpolation::FaceVarying => corner,
        })
    }

    /// Returns why the primvar does not fit a surface.
    pub(super) fn misfit(&self, counts: Counts) -> Option<String> {
        let (needed, of) = match self.interpolation {
            Interpolation::Constant => (1, "surfaces"),
            Interpolation::Uniform => (counts.faces, "faces"),
            Interpolation::Vertex | Interpolation::Varying => (counts.points, "points"),
            Interpolation::FaceVarying => (counts.corners, "corners"),
        };
        let count = self.count();
        if count < needed {
            return Some(format!("has {count} values for {needed} {of}"));
        }
        let is_wrong = |index: &&i32| usize::try_from(**index).map_or(true, |index| index >= self.values.len());
        let wrong = self.indices.as_ref().and_then(|indices| indices.iter().find(is_wrong));
        wrong.map(|index| format!("refers to value {index} of {}", self.values.len()))
    }
}

/// Reads an attribute as a primvar; `None`: the prim has none, or it is empty.
///
/// - `usual`: the interpolation if the file names none.
pub(super) fn read<T>(
    source: &StageSource<'_>,
    prim: &Prim,
    name: &str,
    time: f64,
    usual: Interpolation,
    convert: impl FnOnce(&Value) -> Option<Vec<T>>,
) -> Option<Primvar<T>> {
    let values = source.read(prim, name, time, convert)?;
    if values.is_empty() {
        return None;
    }
    let path = prim.attribute(name.to_owned()).path().clone();
    let interpolation = match source.metadata(&path, "interpolation").as_deref() {
        Some("constant") => Interpolation::Constant,
        Some("uniform") => Interpolation::Uniform,
        Some("vertex") => Interpolation::Vertex,
        Some("varying") => Interpolation::Varying,
        Some("faceVarying") => Interpolation::FaceVarying,
        _ => usual,
    };
    let indices = if name.starts_with("primvars:") {
        source.read(prim, &format!("{name}:indices"), time, values::integers).filter(|indices| !indices.is_empty())
    } else {
        None
    };
    Some(Primvar { values, indices, interpolation })
}

/// Reads the primvar of a name at a prim, or a constant one at the nearest ancestor that has it.
///
/// - `ancestors`: nearest last.
fn inherited<T>(
    source: &StageSource<'_>,
    prim: &Prim,
    ancestors: &[Prim],
    name: &str,
    time: f64,
    convert: impl Fn(&Value) -> Option<Vec<T>>,
) -> Option<Primvar<T>> {
    let name = format!("primvars:{name}");
    if let Some(own) = read(source, prim, &name, time, Interpolation::Constant, &convert) {
        return Some(own);
    }
    ancestors.iter().rev().find_map(|ancestor| {
        let found = read(source, ancestor, &name, time, Interpolation::Constant, &convert);
        found.filter(|primvar| primvar.interpolation == Interpolation::Constant)
    })
}

/// Reads texture coordinates.
pub(super) fn pairs(
    source: &StageSource<'_>,
    prim: &Prim,
    ancestors: &[Prim],
    name: &str,
    time: f64,
) -> Option<Primvar<Vec2>> {
    inherited(source, prim, ancestors, name, time, values::pairs)
}

/// Reads colours.
pub(super) fn vectors(
    source: &StageSource<'_>,
    prim: &Prim,
    ancestors: &[Prim],
    name: &str,
    time: f64,
) -> Option<Primvar<Vec3>> {
    inherited(source, prim, ancestors, name, time, values::vectors)
}

/// Reads numbers.
pub(super) fn numbers(
    source: &StageSource<'_>,
    prim: &Prim,
    ancestors: &[Prim],
    name: &str,
    time: f64,
) -> Option<Primvar<f32>> {
    inherited(source, prim, ancestors, name, time, values::numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_found_by_interpolation_and_index() {
        let primvar =
            Primvar { values: vec![10, 20], indices: Some(vec![1, 0, 1]), interpolation: Interpolation::Uniform };
        assert_eq!((primvar.of_corner(2, 0, 0), primvar.of_corner(1, 7, 9)), (Some(20), Some(10)));
        assert_eq!(primvar.of_corner(3, 0, 0), None);
        assert_eq!(primvar.misfit(Counts { faces: 3, points: 0, corners: 0 }), None);
        assert!(primvar.misfit(Counts { faces: 4, points: 0, corners: 0 }).unwrap().contains("3 values for 4 faces"));
        let wrong = Primvar { indices: Some(vec![0, -1]), ..primvar };
        assert!(wrong.misfit(Counts { faces: 2, points: 0, corners: 0 }).unwrap().contains("value -1 of 2"));
    }
}
