//! Curves of an edited scene: hair, fur and grass, by arrays of points.

use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::corner_mesh::{length, rows};
use super::error::EditError;
use super::mesh_parts::MeshParts;
use crate::facing_curves::CurveLook;
use crate::import::strand::{Station, add_hull};
use crate::model::{COORDINATE_MAX, Mesh};

/// The greatest number of points: the hull around them has up to four corners per point, which are numbered by `u32`.
const POINTS_MAX: usize = 1 << 29;

/// Curves that consist of straight pieces between their points, as arrays for
/// [`SceneEditor::put_curves`](crate::SceneEditor::put_curves). They have no inside and no ends.
#[derive(Clone, Copy, Debug)]
pub struct CurveStrands<'a> {
    /// Points of all curves, object space, one curve after another.
    pub points: &'a [[f32; 3]],
    /// Number of points of each curve, at least 2.
    pub counts: &'a [i32],
    /// Half the width at each point, in units of the object's space.
    pub radii: &'a [f32],
    /// The shape of all curves.
    pub look: CurveLook,
    /// `true`: curves without length are left out; `false`: they are an error.
    pub drop_empty: bool,
}

impl CurveStrands<'_> {
    /// Makes a mesh of the curves and their hull, after checking all arrays.
    pub(super) fn parts(&self, name: &str) -> Result<MeshParts, EditError> {
        self.check()?;
        let mut mesh = Mesh { name: name.to_owned(), ..Mesh::default() };
        let mut first = 0;
        for (row, &count) in self.counts.iter().enumerate() {
            let end = first + count as usize;
            let line = line(&self.points[first..end], &self.radii[first..end]);
            if line.is_empty() && !self.drop_empty {
                let remedy = "leave it out, or pass drop_empty=True";
                return Err(EditError::row("counts", row, "the curve has no length", remedy));
            }
            add_hull(&mut mesh, &line, self.look);
            first = end;
        }
        let parts = if mesh.triangles.is_empty() { Vec::new() } else { vec![(0, Arc::new(mesh))] };
        Ok(MeshParts::of(parts))
    }

    fn check(&self) -> Result<(), EditError> {
        let points = self.points.len();
        if points > POINTS_MAX {
            let problem = format!("it has {points} rows, and {POINTS_MAX} is the most");
            return Err(EditError::argument("points", problem, "divide the curves among several meshes"));
        }
        length("radii", Some(self.radii.len()), points, "points")?;
        rows("counts", self.counts, |&count| count >= 2, "a curve has at least 2 points")?;
        let sum = self.counts.iter().map(|&count| count as u64).sum::<u64>();
        if sum != points as u64 {
            let problem = format!("its sum is {sum}, and there are {points} points");
            return Err(EditError::argument("counts", problem, "give the number of points of each curve"));
        }
        let is_place = |p: &[f32; 3]| p.iter().all(|x| x.abs() <= COORDINATE_MAX);
        rows("points", self.points, is_place, "finite numbers up to 1e18 are needed")?;
        rows("radii", self.radii, |radius| (0.0..=COORDINATE_MAX).contains(radius), "numbers from 0 to 1e18 are needed")
    }
}

/// Returns the stations of a curve, without points in the same place; empty if the curve has no length.
fn line(points: &[[f32; 3]], radii: &[f32]) -> Vec<Station> {
    let mut places: Vec<(DVec3, f64)> = Vec::with_capacity(points.len());
    for (point, &radius) in points.iter().zip(radii) {
        let place = Vec3::from_array(*point).as_dvec3();
        if places.last().is_none_or(|(last, _)| *last != place) {
            places.push((place, f64::from(radius)));
        }
    }
    if places.len() < 2 {
        return Vec::new();
    }
    let lengths = places.windows(2).map(|ends| (ends[1].0 - ends[0].0).length());
    let total: f64 = lengths.sum();
    let (mut along, last) = (0.0, places.len() - 1);
    let station = |index: usize| {
        let (position, radius) = places[index];
        let (before, after) = (places[index.saturating_sub(1)].0, places[(index + 1).min(last)].0);
        if index > 0 {
            along += (position - before).length();
        }
        // A curve that turns back has the direction of its next piece there.
        let onward = (places[(index + 1).min(last)].0 - places[index.min(last - 1)].0).normalize();
        let tangent = (after - before).try_normalize().unwrap_or(onward);
        Station { position, tangent, width: 2.0 * radius, along: along / total }
    };
    (0..places.len()).map(station).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strands<'a>(points: &'a [[f32; 3]], counts: &'a [i32], radii: &'a [f32]) -> CurveStrands<'a> {
        CurveStrands { points, counts, radii, look: CurveLook::Round, drop_empty: false }
    }

    #[test]
    fn two_curves_become_one_mesh_with_their_points() {
        let points =
            [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 2.0, 0.0], [3.0, 0.0, 0.0], [3.0, 0.0, 2.0]];
        let parts = strands(&points, &[4, 2], &[0.1, 0.1, 0.1, 0.0, 0.2, 0.2]).parts("hair").unwrap();
        let [(0, mesh)] = &*parts.parts else { panic!("one mesh") };
        let curves = mesh.curves.as_ref().unwrap();
        assert_eq!(curves.points.len(), 5, "a point in the place of another is left out");
        assert!(curves.check(mesh.triangles.len()).is_ok());
        let ends: Vec<bool> = curves.points.iter().map(|point| point.is_last).collect();
        assert_eq!(ends, [false, false, true, false, true]);
        assert_eq!((curves.points[2].along, curves.points[2].radius), (1.0, 0.0));
        assert!((curves.points[1].along - 1.0 / (1.0 + 2.0_f32.sqrt())).abs() < 1e-6, "by length");
    }

    #[test]
    fn wrong_arrays_are_refused_by_row() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
        for (counts, radii, wanted) in [
            (&[3][..], &[0.1, 0.1][..], "radii"),
            (&[1, 2], &[0.1; 3], "counts"),
            (&[2], &[0.1; 3], "its sum is 2"),
            (&[i32::MAX, 3], &[0.1; 3], "its sum"),
            (&[3], &[0.1, f32::NAN, 0.1], "radii"),
            (&[3], &[0.1, -1.0, 0.1], "radii"),
        ] {
            let error = strands(&points, counts, radii).parts("hair").map(drop).unwrap_err().to_string();
            assert!(error.contains(wanted), "{error}");
        }
        let nowhere = [[1.0, 2.0, 3.0]; 2];
        let curves = strands(&nowhere, &[2], &[0.1; 2]);
        assert!(curves.parts("hair").map(drop).unwrap_err().to_string().contains("no length"));
        assert!(CurveStrands { drop_empty: true, ..curves }.parts("hair").unwrap().parts.is_empty());
    }

    #[test]
    fn a_curve_that_turns_back_has_directions() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0; 3]];
        let parts = strands(&points, &[3], &[0.1; 3]).parts("hair").unwrap();
        assert!(parts.parts[0].1.curves.as_ref().unwrap().check(parts.parts[0].1.triangles.len()).is_ok());
    }
}
