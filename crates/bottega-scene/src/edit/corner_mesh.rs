//! Meshes whose values are given by corner, and the checks of their arrays.

use rayon::prelude::*;

use super::error::EditError;
use crate::model::COORDINATE_MAX;
use crate::values::VALUE_MAX;

/// The greatest number of vertices, corners and triangles.
const COUNT_MAX: usize = i32::MAX as usize;

/// A mesh of triangles whose normals, texture coordinates and colours belong to corners: vertices that meet with
/// different values there have several corners. Errors name the first wrong row of an array.
#[derive(Clone, Copy, Debug, Default)]
pub struct CornerMesh<'a> {
    /// Vertex positions, object space, in scene units.
    pub positions: &'a [[f32; 3]],
    /// The vertex of each corner, as an index into `positions`; `None`: corner i is vertex i.
    pub corner_vertices: Option<&'a [i32]>,
    /// The corners of each triangle, counter-clockwise seen from the front.
    pub triangles: &'a [[i32; 3]],
    /// Normals by corner, of any length; the surface's own replaces one of length 0. `None`: flat shading.
    pub normals: Option<&'a [[f32; 3]]>,
    /// Two sets of texture coordinates by corner; `None`: the mesh does not have the set.
    pub uvs: [Option<&'a [[f32; 2]]>; 2],
    /// Linear RGBA by corner: RGB multiplies the base colour of layered materials, alpha the opacity. `None`: white.
    pub colors: Option<&'a [[f32; 4]]>,
    /// The material slot of each triangle; `None`: slot 0.
    pub triangle_materials: Option<&'a [i32]>,
    /// `true`: triangles without area are left out; `false`: they are an error.
    pub drop_empty: bool,
}

impl CornerMesh<'_> {
    /// Returns the number of corners.
    pub(super) fn corner_count(&self) -> usize {
        self.corner_vertices.map_or(self.positions.len(), <[i32]>::len)
    }

    /// Returns the vertex of a corner.
    #[inline(always)]
    pub(super) fn vertex_of(&self, corner: i32) -> usize {
        self.corner_vertices.map_or(corner as usize, |vertices| vertices[corner as usize] as usize)
    }

    /// Returns true if corners have values beside their position.
    pub(super) fn has_corner_values(&self) -> bool {
        self.normals.is_some() || self.uvs.iter().any(Option::is_some) || self.colors.is_some()
    }

    /// Checks all arrays: lengths, indices and values.
    ///
    /// - `slots`: number of material slots; 0: any slot is allowed.
    pub(super) fn check(&self, slots: usize) -> Result<(), EditError> {
        let corners = self.corner_count();
        // Check lengths before anything is read.
        count("positions", self.positions.len())?;
        count("corner_vertices", corners)?;
        count("triangles", self.triangles.len())?;
        length("normals", self.normals.map(<[_]>::len), corners, "corners")?;
        length("uvs", self.uvs[0].map(<[_]>::len), corners, "corners")?;
        length("uvs2", self.uvs[1].map(<[_]>::len), corners, "corners")?;
        length("colors", self.colors.map(<[_]>::len), corners, "corners")?;
        length("triangle_materials", self.triangle_materials.map(<[_]>::len), self.triangles.len(), "triangles")?;
        // Check values
        let is_place = |p: &[f32; 3]| p.iter().all(|x| x.abs() <= COORDINATE_MAX);
        rows("positions", self.positions, is_place, "finite numbers up to 1e18 are needed")?;
        let is_finite = |n: &[f32; 3]| n.iter().all(|x| x.is_finite());
        rows("normals", self.normals.unwrap_or_default(), is_finite, "finite numbers are needed")?;
        for (name, uvs) in ["uvs", "uvs2"].into_iter().zip(self.uvs) {
            let is_finite = |uv: &[f32; 2]| uv.iter().all(|x| x.is_finite());
            rows(name, uvs.unwrap_or_default(), is_finite, "finite numbers are needed")?;
        }
        let is_color = |color: &[f32; 4]| color.iter().all(|x| (0.0..=VALUE_MAX).contains(x));
        rows("colors", self.colors.unwrap_or_default(), is_color, "numbers from 0 to 1e12 are needed")?;
        // Check indices
        let vertices = self.positions.len();
        let is_vertex = |&vertex: &i32| (vertex as u32 as usize) < vertices;
        let needed = range("vertices", vertices);
        rows("corner_vertices", self.corner_vertices.unwrap_or_default(), is_vertex, &needed)?;
        let is_triangle = |triangle: &[i32; 3]| triangle.iter().all(|&corner| (corner as u32 as usize) < corners);
        rows("triangles", self.triangles, is_triangle, &range("corners", corners))?;
        let slot_count = if slots == 0 { COUNT_MAX } else { slots };
        let is_slot = |&slot: &i32| (slot as u32 as usize) < slot_count;
        let needed = range("materials", slot_count);
        rows("triangle_materials", self.triangle_materials.unwrap_or_default(), is_slot, &needed)
    }

    /// Returns true if a triangle has no area, so that no ray hits it.
    pub(super) fn is_empty(&self, triangle: &[i32; 3]) -> bool {
        let [a, b, c] = triangle.map(|corner| self.positions[self.vertex_of(corner)].map(f64::from));
        let (x, y) = (minus(b, a), minus(c, a));
        let cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
        cross == [0.0; 3]
    }

    /// Returns the first triangle without area.
    pub(super) fn check_areas(&self) -> Result<(), EditError> {
        let empty = self.triangles.par_iter().position_first(|triangle| self.is_empty(triangle));
        let Some(row) = empty else { return Ok(()) };
        let corners = self.triangles[row];
        Err(EditError::row(
            "triangles",
            row,
            format!("the triangle of the corners {corners:?} has no area"),
            "leave it out, or pass drop_empty=True",
        ))
    }
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn count(argument: &'static str, count: usize) -> Result<(), EditError> {
    if count <= COUNT_MAX {
        return Ok(());
    }
    let problem = format!("it has {count} rows, and {COUNT_MAX} is the most");
    Err(EditError::argument(argument, problem, "divide the mesh into several"))
}

pub(super) fn length(argument: &'static str, rows: Option<usize>, needed: usize, of: &str) -> Result<(), EditError> {
    match rows {
        Some(rows) if rows != needed => Err(EditError::argument(
            argument,
            format!("it has {rows} rows, and there are {needed} {of}"),
            format!("give one row for each of the {of}"),
        )),
        _ => Ok(()),
    }
}

fn range(of: &str, count: usize) -> String {
    match count {
        0 => format!("there are no {of}"),
        count => format!("there are {of} 0 to {}", count - 1),
    }
}

/// Checks all rows of an array. An error names the first wrong one.
pub(super) fn rows<T: Sync + std::fmt::Debug>(
    argument: &'static str,
    rows: &[T],
    is_right: impl Fn(&T) -> bool + Sync,
    needed: &str,
) -> Result<(), EditError> {
    match rows.par_iter().with_min_len(1 << 14).position_first(|row| !is_right(row)) {
        None => Ok(()),
        Some(row) => Err(EditError::row(argument, row, format!("it is {:?}", rows[row]), needed)),
    }
}
