//! The shape `loopsubdiv`: Loop's subdivision surface (1987, *Smooth Subdivision Surfaces Based on Triangles*), with
//! the boundary of Hoppe et al. (1994). Vertices are moved to the limit surface; normals are those of the finest
//! triangles.

use std::collections::HashMap;

use glam::{DVec3, Vec2};

use super::super::context::Context;
use super::super::params::Params;
use super::geometry::{Geometry, indices, positions};
use crate::import::text_place::{ImportResult, TextPlace};
use crate::model::Mesh;

/// Maximal number of levels, each of which has four times the triangles.
const LEVELS_MAX: i64 = 12;

/// Maximal number of triangles of a surface.
const TRIANGLES_MAX: usize = 1 << 23;

/// Reads a `loopsubdiv`.
pub(super) fn read(context: &mut Context<'_>, params: &Params, at: TextPlace) -> ImportResult<Geometry> {
    let points = params.points3("P", "point3")?.ok_or_else(|| at.fault("`loopsubdiv` needs the positions `P`"))?;
    positions(&points, params.place_of("P"))?;
    let corners = params.integers("indices").ok_or_else(|| at.fault("`loopsubdiv` needs `indices`"))?;
    let corners = indices(corners, points.len(), params.place_of("indices"))?;
    let levels = params.integer("levels")?.unwrap_or(3);
    if !(0..=LEVELS_MAX).contains(&levels) {
        return Err(params.place_of("levels").fault(format!("`levels` must be from 0 to {LEVELS_MAX}")).into());
    }
    let (triangles, _) = corners.as_chunks::<3>();
    let is_sound =
        |triangle: &[u32; 3]| triangle[0] != triangle[1] && triangle[1] != triangle[2] && triangle[2] != triangle[0];
    let triangles: Vec<[u32; 3]> = triangles.iter().copied().filter(is_sound).collect();
    if triangles.len() > TRIANGLES_MAX >> (2 * levels) {
        let problem = format!("{levels} levels make more than {TRIANGLES_MAX} triangles of it");
        return Err(params.place_of("levels").fault(problem).into());
    }
    // Vertices, triangles and the edge table.
    let bytes = (points.len() * 48 + triangles.len() * 160) << (2 * levels);
    let place = context.place(at);
    context.resources.budget().take(context.path(at.file), &place, bytes)?;

    let mut mesh = ControlMesh { points, triangles };
    for _ in 0..levels {
        mesh = mesh.refined();
    }
    let mut mesh = Mesh {
        positions: mesh.limit().iter().map(|point| point.as_vec3()).collect(),
        triangles: mesh.triangles,
        ..Mesh::default()
    };
    mesh.smooth_normals();
    mesh.face_normals();
    // pbrt gives every triangle the same texture coordinates; this surface has none.
    mesh.uvs[0] = vec![Vec2::ZERO; mesh.positions.len()];
    let primitive_count = mesh.triangles.len();
    Ok(Geometry::Mesh { mesh: Box::new(mesh), primitive_count })
}

/// Edges by their end vertices, the lower one first.
type Edges = HashMap<(u32, u32), Edge>;

/// A control mesh.
struct ControlMesh {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

/// The neighbours of a vertex.
#[derive(Clone, Copy, Default)]
struct OneRing {
    /// Sum of the neighbours; `valence` is their number.
    sum: DVec3,
    valence: u32,
    /// Sum of the neighbours along the boundary; `boundary_valence` is their number.
    boundary_sum: DVec3,
    boundary_valence: u32,
}

/// An edge: the sum of the opposite corners, and the number of adjacent triangles.
#[derive(Clone, Copy, Default)]
struct Edge {
    opposite: DVec3,
    triangle_count: u32,
    /// Index of the vertex at its midpoint.
    middle: u32,
}

impl ControlMesh {
    /// Returns the edges by their end vertices, and their order of first use by triangles.
    fn edges(&self) -> (Edges, Vec<(u32, u32)>) {
        let mut edges: Edges = HashMap::with_capacity(self.triangles.len() * 3 / 2);
        let mut order = Vec::with_capacity(self.triangles.len() * 3 / 2);
        for triangle in &self.triangles {
            for side in 0..3 {
                let key = key(triangle[side], triangle[(side + 1) % 3]);
                let edge = edges.entry(key).or_insert_with(|| {
                    order.push(key);
                    Edge { middle: (self.points.len() + order.len() - 1) as u32, ..Edge::default() }
                });
                edge.opposite += self.points[triangle[(side + 2) % 3] as usize];
                edge.triangle_count += 1;
            }
        }
        (edges, order)
    }

    fn rings(&self, edges: &Edges, order: &[(u32, u32)]) -> Vec<OneRing> {
        let mut rings = vec![OneRing::default(); self.points.len()];
        for key in order {
            let is_boundary = edges[key].triangle_count != 2;
            for (from, to) in [(key.0, key.1), (key.1, key.0)] {
                let ring = &mut rings[from as usize];
                let neighbor = self.points[to as usize];
                ring.sum += neighbor;
                ring.valence += 1;
                if is_boundary {
                    ring.boundary_sum += neighbor;
                    ring.boundary_valence += 1;
                }
            }
        }
        rings
    }

    /// Moves the vertices by the weights `inner` (of each neighbour, by valence) and `boundary`.
    fn moved(&self, rings: &[OneRing], inner: impl Fn(u32) -> f64, boundary: f64) -> Vec<DVec3> {
        let vertex = |(point, ring): (&DVec3, &OneRing)| match (ring.boundary_valence, ring.valence) {
            (_, 0) => *point,
            (0, valence) => {
                let weight = inner(valence);
                *point * (1.0 - weight * f64::from(valence)) + ring.sum * weight
            }
            (2, _) => *point * (1.0 - 2.0 * boundary) + ring.boundary_sum * boundary,
            // Where boundaries meet, keep a corner.
            _ => *point,
        };
        self.points.iter().zip(rings).map(vertex).collect()
    }

    fn refined(&self) -> Self {
        let (edges, order) = self.edges();
        let rings = self.rings(&edges, &order);
        let mut points = self.moved(&rings, beta, 0.125);
        points.extend(order.iter().map(|key| {
            let (edge, ends) = (edges[key], self.points[key.0 as usize] + self.points[key.1 as usize]);
            if edge.triangle_count == 2 { ends * 0.375 + edge.opposite * 0.125 } else { ends * 0.5 }
        }));
        let quarter = |&[a, b, c]: &[u32; 3]| {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(from, to)| edges[&key(from, to)].middle);
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        Self { points, triangles: self.triangles.iter().flat_map(quarter).collect() }
    }

    /// Returns the positions on the limit surface.
    fn limit(&self) -> Vec<DVec3> {
        let (edges, order) = self.edges();
        let rings = self.rings(&edges, &order);
        self.moved(&rings, |valence| 1.0 / (f64::from(valence) + 0.375 / beta(valence)), 0.2)
    }
}

fn key(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// Returns Warren's weight of each neighbour (1995), as in pbrt.
fn beta(valence: u32) -> f64 {
    if valence == 3 { 0.1875 } else { 0.375 / f64::from(valence) }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    /// An octahedron.
    fn mesh() -> ControlMesh {
        let points = vec![DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
        let upper = (0..4).map(|i| [i, (i + 1) % 4, 4]);
        let lower = (0..4).map(|i| [(i + 1) % 4, i, 5]);
        ControlMesh { points, triangles: upper.chain(lower).collect() }
    }

    #[test]
    fn the_limit_does_not_depend_on_the_level_from_which_it_is_taken() {
        let (coarse, fine) = (mesh(), mesh().refined());
        for (a, b) in coarse.limit().iter().zip(fine.limit()) {
            assert!((*a - b).length() < 1e-12, "{a} {b}");
        }
        assert_eq!((fine.points.len(), fine.triangles.len()), (18, 32));
    }

    #[test]
    fn a_flat_net_stays_flat_and_keeps_its_straight_boundary() {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let mesh = ControlMesh { points, triangles: vec![[0, 1, 2], [0, 2, 3]] }.refined().refined();
        assert!(mesh.limit().iter().all(|point| point.z == 0.0));
        let center = mesh.limit().iter().sum::<DVec3>() / mesh.points.len() as f64;
        assert!((center.truncate() - DVec2::splat(0.5)).length() < 1e-12);
    }
}
