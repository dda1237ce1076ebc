//! The limit surface: positions and normals that infinitely many refinements of a mesh would give to its vertices.
//!
//! Sources: Halstead, Kass, DeRose (1993), *Efficient, Fair Interpolation using Catmull-Clark Surfaces*; tangents at boundaries and
//! creases by Biermann, Levin, Zorin (2000), *Piecewise Smooth Subdivision Surfaces with Normal Control*, and Hoppe et al.
//! (1994).

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::control::Scheme;
use super::fading::Fading;
use super::refine::{LinearValue, loop_beta};
use super::rules::{VertexRule, rules};
use super::sharpness::{is_infinite, is_sharp};
use super::topology::{HalfEdges, NONE};

/// A mesh, with the rule for each vertex at its limit.
#[derive(Debug)]
struct RuledMesh {
    topology: HalfEdges,
    scheme: Scheme,
    /// Rule and number of edges of each vertex.
    rules: Vec<(VertexRule, u32)>,
}

/// The surroundings of a vertex on one side of sharp edges.
#[derive(Default)]
struct VertexSide {
    /// Its corners there.
    fan: Vec<u32>,
    /// The other ends of its edges.
    ends: Vec<DVec3>,
    /// The opposite corners of its faces, which are quadrilaterals.
    opposites: Vec<DVec3>,
}

/// The finest mesh, with its vertices at their limits. Where edges are sharp a vertex has several normals: it is divided into one
/// vertex per side.
#[derive(Debug)]
pub(super) struct LimitSurface {
    mesh: RuledMesh,
    /// Vertex of each corner, after the division.
    pub(super) corner_vertices: Vec<u32>,
    /// A corner of each vertex, after the division; [`NONE`]: it has no face.
    corner_of: Vec<u32>,
    /// Vertex before the division, of those that were added.
    added: Vec<u32>,
    /// The vertices that are semi-sharp, and the mesh of their limits.
    fading: Option<Box<(Fading, RuledMesh)>>,
}

impl LimitSurface {
    /// - `topology`: of quadrilaterals, or of triangles for Loop's scheme.
    pub(super) fn new(mut topology: HalfEdges, scheme: Scheme) -> Self {
        if scheme == Scheme::Bilinear {
            let corner_vertices = topology.tails.clone();
            let mesh = RuledMesh { topology, scheme, rules: Vec::new() };
            return Self { mesh, corner_vertices, corner_of: Vec::new(), added: Vec::new(), fading: None };
        }
        let fading = settle(&mut topology, scheme);
        let mesh = RuledMesh::new(topology, scheme);
        // The sides of a vertex are its fans between sharp edges
        let mut corner_vertices = vec![NONE; mesh.topology.tails.len()];
        let mut corner_of = vec![NONE; mesh.topology.vertex_count];
        let (mut added, mut fan) = (Vec::new(), Vec::new());
        for corner in 0..mesh.topology.tails.len() {
            if corner_vertices[corner] != NONE {
                continue;
            }
            let vertex = mesh.topology.tails[corner];
            mesh.collect_side(corner as u32, &mut fan);
            let divided = if corner_of[vertex as usize] == NONE {
                corner_of[vertex as usize] = corner as u32;
                vertex
            } else {
                added.push(vertex);
                corner_of.push(corner as u32);
                corner_of.len() as u32 - 1
            };
            fan.iter().for_each(|&corner| corner_vertices[corner as usize] = divided);
        }
        Self { mesh, corner_vertices, corner_of, added, fading }
    }

    /// Returns the finest mesh.
    pub(super) fn topology(&self) -> &HalfEdges {
        &self.mesh.topology
    }

    /// Returns the values of the divided vertices.
    pub(super) fn divided<V: LinearValue>(&self, mut values: Vec<V>) -> Vec<V> {
        let added: Vec<V> = self.added.iter().map(|&vertex| values[vertex as usize]).collect();
        values.extend(added);
        values
    }

    /// Returns the limits of values at the vertices before the division.
    pub(super) fn values<V: LinearValue>(&self, values: &[V]) -> Vec<V> {
        match self.mesh.scheme {
            Scheme::Bilinear => values.to_vec(),
            _ => limits_with(&self.mesh, self.fading.as_deref(), values),
        }
    }

    /// Returns the normals of the limit surface at the divided vertices, of unit length or zero; empty for the bilinear scheme.
    ///
    /// - `points`: vertices of the finest mesh, before they are moved to their limits.
    pub(super) fn normals(&self, points: &[DVec3]) -> Vec<DVec3> {
        use rayon::prelude::*;
        let later = self.fading.as_deref().map(|(fading, mesh)| (fading, mesh, fading.refined(points)));
        let normal = |side: &mut VertexSide, &corner: &u32| {
            if corner == NONE {
                return DVec3::ZERO;
            }
            if let Some((fading, mesh, points)) = &later
                && let Some(corner) = fading.corner(corner)
            {
                return mesh.normal(corner, points, side);
            }
            self.mesh.normal(corner, points, side)
        };
        self.corner_of.par_iter().with_min_len(1 << 10).map_init(VertexSide::default, normal).collect()
    }
}

/// Returns the limits of values at the vertices of a mesh.
pub(super) fn limits<V: LinearValue>(mut topology: HalfEdges, scheme: Scheme, values: &[V]) -> (HalfEdges, Vec<V>) {
    let fading = settle(&mut topology, scheme);
    let mesh = RuledMesh::new(topology, scheme);
    let limits = limits_with(&mesh, fading.as_deref(), values);
    (mesh.topology, limits)
}

/// Makes semi-sharp features smooth, for which the vertices that have them are refined further. Does nothing if these are too
/// many.
fn settle(topology: &mut HalfEdges, scheme: Scheme) -> Option<Box<(Fading, RuledMesh)>> {
    let (fading, last) = Fading::new(topology, scheme)?;
    for sharpness in topology.edge_sharpness.iter_mut().chain(&mut topology.vertex_sharpness) {
        if !is_infinite(*sharpness) {
            *sharpness = 0.0;
        }
    }
    Some(Box::new((fading, RuledMesh::new(last, scheme))))
}

fn limits_with<V: LinearValue>(mesh: &RuledMesh, fading: Option<&(Fading, RuledMesh)>, values: &[V]) -> Vec<V> {
    let mut limits = mesh.limits(values);
    if let Some((fading, later)) = fading {
        let later = later.limits(&fading.refined(values));
        for (&vertex, &in_last) in fading.vertices.iter().zip(&fading.in_last) {
            limits[vertex as usize] = later[in_last as usize];
        }
    }
    limits
}

impl RuledMesh {
    fn new(topology: HalfEdges, scheme: Scheme) -> Self {
        let rules = rules(&topology);
        Self { topology, scheme, rules }
    }

    /// Collects the corners of a vertex on the same side of sharp edges. Returns true if they go all around.
    fn collect_side(&self, corner: u32, fan: &mut Vec<u32>) -> bool {
        let topology = &self.topology;
        let is_smooth = self.rules[topology.tails[corner as usize] as usize].0 == VertexRule::Smooth;
        topology.collect_fan(corner, fan, |edge| {
            !topology.is_boundary(edge) && (is_smooth || !is_sharp(topology.edge_sharpness[edge]))
        })
    }

    /// Returns the limits of values at the vertices.
    fn limits<V: LinearValue>(&self, values: &[V]) -> Vec<V> {
        let (topology, scheme, rules) = (&self.topology, self.scheme, &self.rules);
        // Weights of a smooth vertex itself, of the other ends of its edges, and of the opposite corners of its faces
        let weights = |valence: u32| {
            let n = f64::from(valence);
            match scheme {
                _ if valence == 0 => [1.0, 0.0, 0.0],
                Scheme::Loop => {
                    let neighbor = 1.0 / (n + 0.375 / loop_beta(valence));
                    [1.0 - n * neighbor, neighbor, 0.0]
                }
                _ => [n / (n + 5.0), 4.0 / (n * (n + 5.0)), 1.0 / (n * (n + 5.0))],
            }
        };
        let own = |(value, &(rule, valence)): (&V, &(VertexRule, u32))| match rule {
            VertexRule::Smooth => *value * weights(valence)[0],
            VertexRule::Crease => *value * (2.0 / 3.0),
            VertexRule::Corner => *value,
        };
        let mut limits: Vec<V> = values.iter().zip(rules).map(own).collect();
        for (edge, &sharpness) in topology.edge_sharpness.iter().enumerate() {
            let ends = topology.ends(topology.edges[edge][0]);
            for [end, other] in [ends, [ends[1], ends[0]]] {
                match rules[end as usize] {
                    (VertexRule::Smooth, valence) => {
                        limits[end as usize] += values[other as usize] * weights(valence)[1];
                    }
                    (VertexRule::Crease, _) if is_sharp(sharpness) => {
                        limits[end as usize] += values[other as usize] * (1.0 / 6.0);
                    }
                    _ => {}
                }
            }
        }
        if scheme == Scheme::CatmullClark {
            for face in topology.tails.chunks_exact(4) {
                for corner in 0..4 {
                    if let (VertexRule::Smooth, valence) = rules[face[corner] as usize] {
                        limits[face[corner] as usize] += values[face[(corner + 2) % 4] as usize] * weights(valence)[2];
                    }
                }
            }
        }
        limits
    }

    /// Returns the normal at the side of a vertex that a corner is on.
    fn normal(&self, corner: u32, points: &[DVec3], side: &mut VertexSide) -> DVec3 {
        let topology = &self.topology;
        let point = |vertex: u32| points[vertex as usize];
        let VertexSide { fan, ends, opposites } = side;
        let is_closed = self.collect_side(corner, fan);
        let vertex = topology.tails[corner as usize];
        ends.clear();
        ends.extend(fan.iter().map(|&half| point(topology.ends(half)[1])));
        if !is_closed {
            ends.push(point(topology.tails[topology.previous(fan[fan.len() - 1]) as usize]));
        }
        opposites.clear();
        if self.scheme == Scheme::CatmullClark {
            opposites.extend(fan.iter().map(|&half| point(topology.ends(topology.next(half))[1])));
        }
        let center = point(vertex);
        let [along, across] = match (is_closed, self.rules[vertex as usize].0, self.scheme) {
            (true, VertexRule::Smooth, Scheme::Loop) => loop_tangents(ends),
            (true, VertexRule::Smooth, _) => catmull_clark_tangents(ends, opposites),
            (false, VertexRule::Crease, Scheme::Loop) => loop_crease_tangents(center, ends),
            (false, VertexRule::Crease, _) => catmull_clark_crease_tangents(center, ends, opposites),
            // The sharp edges at both sides of a corner keep their directions
            (false, VertexRule::Corner, _) => [ends[0] - center, ends[ends.len() - 1] - center],
            _ => [DVec3::ZERO; 2],
        };
        // The mean of the faces
        let (mut sum, mut sizes) = (DVec3::ZERO, 0.0);
        for face in 0..fan.len() {
            let (a, b) = (ends[face] - center, ends[(face + 1) % ends.len()] - center);
            let c = opposites.get(face).map_or(b, |opposite| *opposite - center);
            sum += a.cross(c) + c.cross(b);
            sizes += a.length() * c.length() + c.length() * b.length();
        }
        let mean = normalized(sum, sizes, 1e-12);
        let is_corner = self.rules[vertex as usize].0 == VertexRule::Corner;
        let least = if is_corner { 0.05 } else { 1e-12 };
        match normalized(along.cross(across), along.length() * across.length(), least) {
            // The sides of a corner may enclose more than half a turn
            Some(normal) if is_corner && mean.is_some_and(|mean| normal.dot(mean) < 0.0) => -normal,
            Some(normal) => normal,
            None => mean.unwrap_or_default(),
        }
    }
}

/// Returns a vector with unit length; `None`: its length is not above a share of a scale.
fn normalized(vector: DVec3, scale: f64, least: f64) -> Option<DVec3> {
    let length = vector.length();
    (length > least * scale && length.is_finite()).then(|| vector / length)
}

/// Returns two tangents at a smooth vertex. Sums begin with differences, so that the place of a small mesh does not matter.
fn catmull_clark_tangents(ends: &[DVec3], opposites: &[DVec3]) -> [DVec3; 2] {
    let n = ends.len();
    let step = TAU / n as f64;
    let cosine = step.cos();
    let factor = 1.0 + cosine + (0.5 * step).cos() * (2.0 * (9.0 + cosine)).sqrt();
    let mut tangents = [DVec3::ZERO; 2];
    for index in 0..n {
        let (sin, cos) = (step * index as f64).sin_cos();
        let (next_sin, next_cos) = (step * (index + 1) as f64).sin_cos();
        let (end, opposite) = (ends[index] - ends[0], opposites[index] - ends[0]);
        tangents[0] += end * (factor * cos) + opposite * (cos + next_cos);
        tangents[1] += end * (factor * sin) + opposite * (sin + next_sin);
    }
    tangents
}

fn loop_tangents(ends: &[DVec3]) -> [DVec3; 2] {
    let step = TAU / ends.len() as f64;
    let mut tangents = [DVec3::ZERO; 2];
    for (index, &end) in ends.iter().enumerate() {
        let (sin, cos) = (step * index as f64).sin_cos();
        tangents[0] += (end - ends[0]) * cos;
        tangents[1] += (end - ends[0]) * sin;
    }
    tangents
}

/// Returns the tangents along a crease and across the faces at one side of it.
fn catmull_clark_crease_tangents(center: DVec3, ends: &[DVec3], opposites: &[DVec3]) -> [DVec3; 2] {
    let faces = opposites.len();
    let end = |index: usize| ends[index] - center;
    let along = end(0) - end(faces);
    if faces == 1 {
        return [along, end(0) + end(1)];
    }
    let angle = PI / faces as f64;
    let (sin, cos) = angle.sin_cos();
    let ratio = (cos + 1.0) / sin;
    let mut across = (end(0) + end(faces)) * (-ratio * (1.0 + 2.0 * cos));
    for (index, opposite) in opposites.iter().enumerate() {
        let sin = |index: usize| (angle * index as f64).sin();
        across += end(index) * (4.0 * sin(index)) + (*opposite - center) * (sin(index) + sin(index + 1));
    }
    [along, across]
}

fn loop_crease_tangents(center: DVec3, ends: &[DVec3]) -> [DVec3; 2] {
    let faces = ends.len() - 1;
    let end = |index: usize| ends[index] - center;
    let along = end(0) - end(faces);
    let across = match faces {
        1 => end(0) + end(1),
        2 => end(1),
        _ => {
            let angle = PI / faces as f64;
            let inner = |index: usize| end(index) * (angle * index as f64).sin();
            let sum = (1..faces).map(inner).sum::<DVec3>();
            -((end(0) + end(faces)) * angle.sin() + sum * (2.0 * angle.cos() - 2.0))
        }
    };
    [along, across]
}
