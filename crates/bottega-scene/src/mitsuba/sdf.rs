//! Mitsuba's `sdfgrid`: zero surfaces of signed distance grids, as triangles.
//!
//! Between grid samples the distance is trilinear. Each cell that the surface crosses is subdivided, and each piece
//! split into six tetrahedra (Kuhn 1960) that match across faces, so the mesh has no holes. Vertices are at zeros of
//! the trilinear distance along edges, and have Mitsuba's normals.

use std::collections::HashMap;

use glam::{DVec3, UVec3, Vec3};

use super::volume::VolumeError;
use crate::model::Mesh;

/// Approximate number of triangles of a surface; determines the subdivision of cells.
const TRIANGLES: usize = 1 << 19;
/// Maximal number of pieces of a cell along each axis.
const PIECES_MAX: u32 = 16;
/// Approximate number of triangles for each piece of a cell's face that the surface crosses.
const TRIANGLES_PER_PIECE: usize = 6;
/// Memory of a triangle with its share of vertices and lookup tables, in bytes.
const TRIANGLE_BYTES: usize = 96;
/// Iterations to find the zero on an edge.
const STEPS: u32 = 6;

/// The computation of normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SdfNormals {
    /// Gradient of the distance within a cell, discontinuous between cells.
    Analytic,
    /// Blended gradients of neighbouring cells (Hansson-Söderlund, Evans and Akenine-Möller 2022, *Ray Tracing of
    /// Signed Distance Function Grids*).
    Smooth,
}

/// Signed distances at the corners of cells that fill the unit cube.
#[derive(Clone, Debug)]
pub(super) struct SdfGrid {
    /// Samples along x, y and z; at least two each.
    size: [u32; 3],
    /// Distances; x runs fastest.
    values: Vec<f32>,
}

impl SdfGrid {
    /// Makes a grid of one number per sample.
    pub(super) fn new(size: [u32; 3], values: Vec<f32>) -> Result<Self, VolumeError> {
        if size.iter().any(|&side| side < 2) {
            return Err(VolumeError::Flat { size });
        }
        Ok(Self { size, values })
    }

    fn sample(&self, index: [i64; 3]) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|axis| index[axis].clamp(0, i64::from(self.size[axis]) - 1) as usize);
        let [columns, rows, _] = self.size.map(|side| side as usize);
        f64::from(self.values[(z * rows + y) * columns + x])
    }

    /// Returns the values at the corners of a cell, x + 2 y + 4 z.
    fn corners(&self, cell: UVec3) -> [f64; 8] {
        let cell = cell.to_array().map(i64::from);
        std::array::from_fn(|i| {
            let bit = |axis: usize| (i >> axis & 1) as i64;
            self.sample([cell[0] + bit(0), cell[1] + bit(1), cell[2] + bit(2)])
        })
    }

    /// Returns the cells that the surface crosses.
    fn crossed(&self) -> Vec<UVec3> {
        let [columns, rows, layers] = self.size.map(|side| side - 1);
        let mut cells = Vec::new();
        for z in 0..layers {
            for y in 0..rows {
                for x in 0..columns {
                    let cell = UVec3::new(x, y, z);
                    let inside = self.corners(cell).iter().filter(|&&value| value < 0.0).count();
                    if inside % 8 != 0 {
                        cells.push(cell);
                    }
                }
            }
        }
        cells
    }

    /// Returns the gradient at a position in cells, blended as in Mitsuba.
    fn smooth_slope(&self, place: DVec3) -> DVec3 {
        let cells = self.size.map(|side| f64::from(side) - 1.0);
        let place = place.to_array();
        // Find the nearest grid corner and the cells around it: a lower and an upper one along each axis.
        let lower = place.map(|x| x.round() as i64 - 1);
        let own: [i64; 3] = std::array::from_fn(|axis| (place[axis].floor() as i64).clamp(0, cells[axis] as i64 - 1));
        // Interpolates the distance on the plane of samples with this index along an axis.
        let plane = |axis: usize, index: i64| {
            let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
            let at = |i: i64, j: i64| {
                let mut sample = [0; 3];
                (sample[axis], sample[b], sample[c]) = (index, own[b] + i, own[c] + j);
                self.sample(sample)
            };
            let (u, v) = (place[b] - own[b] as f64, place[c] - own[c] as f64);
            lerp(lerp(at(0, 0), at(1, 0), u), lerp(at(0, 1), at(1, 1), u), v)
        };
        let slopes: [[f64; 2]; 3] = std::array::from_fn(|axis| {
            [0, 1].map(|upper| {
                let first = lower[axis] + upper;
                (plane(axis, first + 1) - plane(axis, first)) * cells[axis]
            })
        });
        let mut slope = DVec3::ZERO;
        for i in 0..8 {
            let upper = [0, 1, 2].map(|axis| i >> axis & 1);
            let weight = |axis: usize| {
                // There is no cell before the first one.
                let t = if lower[axis] < 0 { 1.0 } else { place[axis] - lower[axis] as f64 - 0.5 };
                if upper[axis] == 1 { t } else { 1.0 - t }
            };
            let weight = weight(0) * weight(1) * weight(2);
            let of_cell = DVec3::new(slopes[0][upper[0]], slopes[1][upper[1]], slopes[2][upper[2]]);
            slope += weight * of_cell.normalize_or_zero();
        }
        slope
    }
}

fn lerp(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// Interpolates the value at a position within a cell, in [0, 1] along each axis.
fn trilinear(corners: &[f64; 8], p: DVec3) -> f64 {
    let along_x = |i: usize| lerp(corners[i], corners[i + 1], p.x);
    lerp(lerp(along_x(0), along_x(2), p.y), lerp(along_x(4), along_x(6), p.y), p.z)
}

/// Returns the gradient, per cell size.
fn slope(corners: &[f64; 8], p: DVec3) -> DVec3 {
    let across = |axis: usize| {
        let mut ends = [p; 2];
        (ends[0][axis], ends[1][axis]) = (0.0, 1.0);
        trilinear(corners, ends[1]) - trilinear(corners, ends[0])
    };
    DVec3::new(across(0), across(1), across(2))
}

/// The state of tessellating a surface.
struct Mesher<'a> {
    grid: &'a SdfGrid,
    normals: SdfNormals,
    /// Number of pieces of a cell along each axis.
    pieces: u32,
    mesh: Mesh,
    /// Zeros on edges of pieces, by their ends.
    places: HashMap<[u64; 2], DVec3>,
    /// Vertices by their edge, and by cell if each cell has its own.
    vertices: HashMap<([u64; 2], u32), u32>,
}

/// Tessellates a surface; `take` is called first with the memory in bytes.
pub(super) fn triangles<E>(
    grid: &SdfGrid,
    normals: SdfNormals,
    take: impl FnOnce(usize) -> Result<(), E>,
) -> Result<Mesh, E> {
    let cells = grid.crossed();
    let per_piece = cells.len().max(1) * TRIANGLES_PER_PIECE;
    let pieces =
        (1..=PIECES_MAX).rev().find(|&pieces| per_piece * (pieces * pieces) as usize <= TRIANGLES).unwrap_or(1);
    take(per_piece.saturating_mul((pieces * pieces) as usize).saturating_mul(TRIANGLE_BYTES))?;
    Ok(mesh(grid, normals, &cells, pieces))
}

/// Tessellates cells, each subdivided into `pieces` pieces along each axis.
fn mesh(grid: &SdfGrid, normals: SdfNormals, cells: &[UVec3], pieces: u32) -> Mesh {
    let mut mesher =
        Mesher { grid, normals, pieces, mesh: Mesh::default(), places: HashMap::new(), vertices: HashMap::new() };
    for (number, &cell) in (0..).zip(cells) {
        mesher.add_cell(cell, number);
    }
    mesher.mesh
}

impl Mesher<'_> {
    fn add_cell(&mut self, cell: UVec3, number: u32) {
        /// The tetrahedra: paths along the edges of a cube from its first corner to its last one.
        const PATHS: [[usize; 2]; 6] = [[0, 1], [0, 2], [1, 0], [1, 2], [2, 0], [2, 1]];
        let corners = self.grid.corners(cell);
        let side = self.pieces + 1;
        let at = |node: UVec3| node.as_dvec3() / f64::from(self.pieces);
        let values: Vec<f64> = (0..side * side * side)
            .map(|i| trilinear(&corners, at(UVec3::new(i % side, i / side % side, i / (side * side)))))
            .collect();
        let value = |node: UVec3| values[((node.z * side + node.y) * side + node.x) as usize];
        for i in 0..self.pieces.pow(3) {
            let first = UVec3::new(i % self.pieces, i / self.pieces % self.pieces, i / (self.pieces * self.pieces));
            let inside = (0..8).filter(|i| value(first + UVec3::new(i & 1, i >> 1 & 1, i >> 2)) < 0.0).count();
            if inside % 8 == 0 {
                continue;
            }
            for path in PATHS {
                let second = first + UVec3::AXES[path[0]];
                let nodes = [first, second, second + UVec3::AXES[path[1]], first + UVec3::ONE];
                self.add_tetrahedron(cell, number, &corners, nodes, nodes.map(value));
            }
        }
    }

    /// Adds the triangles within a tetrahedron: none, one, or two that share an edge.
    fn add_tetrahedron(&mut self, cell: UVec3, number: u32, corners: &[f64; 8], nodes: [UVec3; 4], values: [f64; 4]) {
        let (inside, outside): (Vec<usize>, Vec<usize>) = (0..4).partition(|&i| values[i] < 0.0);
        let mut edge = |a: usize, b: usize| self.vertex(cell, number, corners, [nodes[a], nodes[b]]);
        let around = match (inside.as_slice(), outside.as_slice()) {
            (&[a], &[x, y, z]) | (&[x, y, z], &[a]) => vec![edge(a, x), edge(a, y), edge(a, z)],
            (&[a, b], &[x, y]) => vec![edge(a, x), edge(a, y), edge(b, y), edge(b, x)],
            _ => return,
        };
        let middle = |of: &[usize]| of.iter().map(|&i| nodes[i].as_dvec3()).sum::<DVec3>() / of.len() as f64;
        let outward = (middle(&outside) - middle(&inside)) / self.cell_counts();
        for last in 2..around.len() {
            let triangle = [around[0], around[last - 1], around[last]];
            let [a, b, c] = triangle.map(|vertex| self.mesh.positions[vertex as usize].as_dvec3());
            let is_outward = (b - a).cross(c - a).dot(outward) >= 0.0;
            self.mesh.triangles.push(if is_outward { triangle } else { [triangle[0], triangle[2], triangle[1]] });
        }
    }

    /// Returns the number of cells along each axis.
    fn cell_counts(&self) -> DVec3 {
        UVec3::from_array(self.grid.size.map(|side| side - 1)).as_dvec3()
    }

    /// Returns the vertex on the edge between two nodes of a cell.
    fn vertex(&mut self, cell: UVec3, number: u32, corners: &[f64; 8], mut ends: [UVec3; 2]) -> u32 {
        let nodes = self.grid.size.map(|side| u64::from(side - 1) * u64::from(self.pieces) + 1);
        let index = |node: UVec3| {
            let [x, y, z] = (cell * self.pieces + node).to_array().map(u64::from);
            (z * nodes[1] + y) * nodes[0] + x
        };
        ends.sort_by_key(|&end| index(end));
        let key = ends.map(index);
        let own_cell = if self.normals == SdfNormals::Analytic { number } else { 0 };
        if let Some(&known) = self.vertices.get(&(key, own_cell)) {
            return known;
        }
        let ends = ends.map(|end| end.as_dvec3() / f64::from(self.pieces));
        let place = *self.places.entry(key).or_insert_with(|| cell.as_dvec3() + crossing(corners, ends));
        let cells = self.cell_counts();
        let normal = match self.normals {
            SdfNormals::Analytic => slope(corners, place - cell.as_dvec3()) * cells,
            SdfNormals::Smooth => self.grid.smooth_slope(place),
        };
        let vertex = self.mesh.positions.len() as u32;
        self.mesh.positions.push((place / cells).as_vec3());
        self.mesh.normals.push(normal.as_vec3().try_normalize().unwrap_or(Vec3::Z));
        self.vertices.insert((key, own_cell), vertex);
        vertex
    }
}

/// Finds the zero between two points of a cell with different signs, by the Illinois method: secants that keep both
/// signs, halving the value of an end that is kept.
fn crossing(corners: &[f64; 8], [mut a, mut b]: [DVec3; 2]) -> DVec3 {
    let (mut value_a, mut value_b) = (trilinear(corners, a), trilinear(corners, b));
    let mut place = a;
    for _ in 0..STEPS {
        let t = value_a / (value_a - value_b);
        place = if t.is_finite() { a.lerp(b, t.clamp(0.0, 1.0)) } else { a };
        let value = trilinear(corners, place);
        if (value < 0.0) == (value_b < 0.0) {
            (b, value_b, value_a) = (place, value, 0.5 * value_a);
        } else {
            (a, value_a, value_b) = (place, value, 0.5 * value_b);
        }
    }
    place
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// A ball of radius 0.3 in the middle of the cube.
    fn ball(size: [u32; 3]) -> SdfGrid {
        let [x, y, z] = size;
        let cells = UVec3::from_array(size.map(|side| side - 1)).as_vec3();
        let value = |i: u32| {
            let place = UVec3::new(i % x, i / x % y, i / (x * y)).as_vec3() / cells;
            (place - 0.5).length() - 0.3
        };
        SdfGrid::new(size, (0..x * y * z).map(value).collect()).unwrap()
    }

    fn mesh_of(grid: &SdfGrid, normals: SdfNormals) -> Mesh {
        triangles(grid, normals, |_| Ok::<_, ()>(())).unwrap()
    }

    #[test]
    fn the_surface_of_a_ball_is_closed_and_round() {
        for normals in [SdfNormals::Smooth, SdfNormals::Analytic] {
            let grid = ball([24, 20, 28]);
            let mesh = mesh(&grid, normals, &grid.crossed(), 2);
            // Each edge is an edge of two triangles, once in each direction.
            let mut edges: BTreeMap<[[u32; 3]; 2], i32> = BTreeMap::new();
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize].to_array().map(f32::to_bits));
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    *edges.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
                }
            }
            assert!(edges.values().all(|&balance| balance == 0));
            for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
                let out = *position - 0.5;
                assert!((out.length() - 0.3).abs() < 0.003, "{position}");
                assert!(out.normalize().dot(*normal) > 0.98, "{position} {normal}");
            }
            let facing = |triangle: &[u32; 3]| {
                let middle = triangle.iter().map(|&vertex| mesh.positions[vertex as usize]).sum::<Vec3>() / 3.0;
                mesh.cross(*triangle).dot(middle - 0.5)
            };
            assert!(mesh.triangles.iter().all(|triangle| facing(triangle) >= -1e-12));
        }
    }

    #[test]
    fn a_plane_is_where_it_should_be() {
        // The distance from x = 0.3, between samples at 0 and 1.
        let values = (0..8).map(|i| if i % 2 == 0 { -0.3 } else { 0.7 }).collect();
        let mesh = mesh_of(&SdfGrid::new([2; 3], values).unwrap(), SdfNormals::Smooth);
        assert!(mesh.positions.iter().all(|position| (position.x - 0.3).abs() < 1e-6));
        assert!(mesh.normals.iter().all(|normal| (*normal - Vec3::X).length() < 1e-6));
        let area: f32 = mesh.triangles.iter().map(|triangle| 0.5 * mesh.cross(*triangle).length()).sum();
        assert!((area - 1.0).abs() < 1e-4, "{area}");
    }

    #[test]
    fn a_grid_without_a_surface_has_no_triangles() {
        assert!(SdfGrid::new([1, 2, 2], vec![0.0; 4]).is_err());
        let grid = SdfGrid::new([2; 3], vec![1.0; 8]).unwrap();
        assert_eq!(mesh_of(&grid, SdfNormals::Smooth).triangles.len(), 0);
    }
}
