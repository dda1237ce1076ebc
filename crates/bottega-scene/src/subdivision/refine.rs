//! One step of refinement: values at the vertices of a mesh become values at the vertices of the next level.
//!
//! Sources: Catmull, Clark (1978), *Recursively generated B-spline surfaces on arbitrary topological meshes*; Loop (1987),
//! *Smooth Subdivision Surfaces Based on Triangles*; boundaries and creases by Hoppe et al. (1994), *Piecewise smooth surface
//! reconstruction*.

use std::ops::{Add, AddAssign, Mul};

use super::control::Scheme;
use super::rules::{VertexMask, masks};
use super::sharpness::{is_infinite, is_sharp};
use super::topology::{FaceSizes, HalfEdges, NONE};

/// A value that is interpolated linearly.
pub(crate) trait LinearValue: Copy + Default + Add<Output = Self> + AddAssign + Mul<f64, Output = Self> {}

impl<T: Copy + Default + Add<Output = T> + AddAssign + Mul<f64, Output = T>> LinearValue for T {}

/// Weight of each face at an edge next to a triangle, for the rule `smooth` of triangles in Catmull-Clark meshes.
const SMOOTH_TRIANGLE: f64 = 0.47;

/// A mesh of one level, and the weights of the step to the next one.
#[derive(Debug)]
pub(super) struct RefinementStep {
    pub(super) topology: HalfEdges,
    masks: Vec<VertexMask>,
    scheme: Scheme,
    /// `true`: triangles of a Catmull-Clark mesh follow the rule `smooth`.
    has_smooth_triangles: bool,
}

impl RefinementStep {
    pub(super) fn new(topology: HalfEdges, scheme: Scheme, has_smooth_triangles: bool) -> Self {
        let masks = if scheme == Scheme::Bilinear { Vec::new() } else { masks(&topology) };
        Self { topology, masks, scheme, has_smooth_triangles }
    }

    /// Returns the mesh of the next level.
    pub(super) fn refined_topology(&self) -> HalfEdges {
        match self.scheme {
            Scheme::Loop => self.topology.refined_to_triangles(),
            _ => self.topology.refined_to_quads(),
        }
    }

    /// Returns the values at the vertices of the next level.
    pub(super) fn refined<V: LinearValue>(&self, values: &[V]) -> Vec<V> {
        let topology = &self.topology;
        let mut refined = Vec::with_capacity(topology.vertex_count + topology.edges.len() + topology.face_count());
        match self.scheme {
            Scheme::Bilinear => {
                refined.extend_from_slice(values);
                let ends = topology.edges.iter().map(|edge| topology.ends(edge[0]));
                refined.extend(ends.map(|[a, b]| (values[a as usize] + values[b as usize]) * 0.5));
                refined.extend((0..topology.face_count()).map(|face| center(topology, face, values)));
            }
            Scheme::CatmullClark => {
                let centers: Vec<V> = (0..topology.face_count()).map(|face| center(topology, face, values)).collect();
                refined.extend(self.catmull_clark_vertices(values, &centers));
                refined.extend((0..topology.edges.len()).map(|edge| self.catmull_clark_edge(edge, values, &centers)));
                refined.extend(centers);
            }
            Scheme::Loop => {
                refined.extend(self.loop_vertices(values));
                refined.extend((0..topology.edges.len()).map(|edge| self.loop_edge(edge, values)));
            }
        }
        refined
    }

    /// Returns the middle of an edge, the weight of the smooth rule there, and the two half-edges.
    fn edge<V: LinearValue>(&self, edge: usize, values: &[V]) -> (V, f64, [u32; 2]) {
        let topology = &self.topology;
        let [first, second] = topology.edges[edge];
        let [a, b] = topology.ends(first).map(|end| values[end as usize]);
        let smooth = if second == NONE { 0.0 } else { 1.0 - topology.edge_sharpness[edge].min(1.0) };
        ((a + b) * 0.5, f64::from(smooth), [first, second])
    }

    fn catmull_clark_edge<V: LinearValue>(&self, edge: usize, values: &[V], centers: &[V]) -> V {
        let (middle, smooth, halves) = self.edge(edge, values);
        if smooth == 0.0 {
            return middle;
        }
        let topology = &self.topology;
        let faces = halves.map(|half| topology.face_of(half) as usize);
        let weight = match topology.sizes {
            FaceSizes::Each { .. } if self.has_smooth_triangles => {
                let of = |face: usize| if topology.corners(face).len() == 3 { SMOOTH_TRIANGLE } else { 0.25 };
                0.5 * (of(faces[0]) + of(faces[1]))
            }
            _ => 0.25,
        };
        let sum = centers[faces[0]] + centers[faces[1]];
        middle * (1.0 - smooth * 2.0 * weight) + sum * (smooth * weight)
    }

    fn loop_edge<V: LinearValue>(&self, edge: usize, values: &[V]) -> V {
        let (middle, smooth, halves) = self.edge(edge, values);
        if smooth == 0.0 {
            return middle;
        }
        let opposite = halves.map(|half| values[self.topology.tails[self.topology.previous(half) as usize] as usize]);
        middle * (1.0 - 0.25 * smooth) + (opposite[0] + opposite[1]) * (0.125 * smooth)
    }

    /// Returns the values of vertices, with those of the ends of their edges: `weight` is that of each end by the smooth rule.
    fn vertices<V: LinearValue>(&self, values: &[V], weight: impl Fn(u32) -> [f64; 2]) -> Vec<V> {
        let topology = &self.topology;
        let own = |(value, mask): (&V, &VertexMask)| {
            let smooth = f64::from(mask.smooth);
            let crease = f64::from(mask.crease) + f64::from(mask.later_crease);
            let corner = if mask.smooth == 1.0 { 0.0 } else { 1.0 - smooth - crease };
            *value * (corner + 0.75 * crease + smooth * weight(mask.valence)[0])
        };
        let mut refined: Vec<V> = values.iter().zip(&self.masks).map(own).collect();
        for (edge, &sharpness) in topology.edge_sharpness.iter().enumerate() {
            let ends = topology.ends(topology.edges[edge][0]);
            for [end, other] in [ends, [ends[1], ends[0]]] {
                let mask = &self.masks[end as usize];
                let mut factor = 0.0;
                if mask.smooth > 0.0 {
                    factor += f64::from(mask.smooth) * weight(mask.valence)[1];
                }
                if is_sharp(sharpness) {
                    factor += 0.125 * f64::from(mask.crease);
                    if sharpness > 1.0 || is_infinite(sharpness) {
                        factor += 0.125 * f64::from(mask.later_crease);
                    }
                }
                if factor > 0.0 {
                    refined[end as usize] += values[other as usize] * factor;
                }
            }
        }
        refined
    }

    fn catmull_clark_vertices<V: LinearValue>(&self, values: &[V], centers: &[V]) -> Vec<V> {
        let weights = |valence: u32| {
            let n = f64::from(valence);
            if valence == 0 { [1.0, 0.0] } else { [(n - 2.0) / n, 1.0 / (n * n)] }
        };
        let mut refined = self.vertices(values, weights);
        for (face, &center) in centers.iter().enumerate() {
            for &vertex in &self.topology.tails[self.topology.corners(face)] {
                let mask = &self.masks[vertex as usize];
                if mask.smooth > 0.0 {
                    refined[vertex as usize] += center * (f64::from(mask.smooth) * weights(mask.valence)[1]);
                }
            }
        }
        refined
    }

    fn loop_vertices<V: LinearValue>(&self, values: &[V]) -> Vec<V> {
        self.vertices(values, |valence| {
            let beta = loop_beta(valence);
            [1.0 - f64::from(valence) * beta, beta]
        })
    }
}

/// Returns Loop's weight of each neighbour of a vertex.
pub(super) fn loop_beta(valence: u32) -> f64 {
    match valence {
        0 => 0.0,
        6 => 0.0625,
        _ => {
            let n = f64::from(valence);
            let cosine = 0.375 + 0.25 * (std::f64::consts::TAU / n).cos();
            (0.625 - cosine * cosine) / n
        }
    }
}

/// Returns the mean of the values of a face.
fn center<V: LinearValue>(topology: &HalfEdges, face: usize, values: &[V]) -> V {
    let corners = &topology.tails[topology.corners(face)];
    let mut sum = V::default();
    corners.iter().for_each(|&vertex| sum += values[vertex as usize]);
    sum * (1.0 / corners.len() as f64)
}
