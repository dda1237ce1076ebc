//! Limits at vertices that are still semi-sharp in the finest mesh.
//!
//! The limit of such a vertex depends on the levels at which its sharpness fades. Only the faces around it matter there, so these
//! alone are refined further.

use super::control::Scheme;
use super::refine::{LinearValue, RefinementStep};
use super::sharpness::{is_infinite, is_sharp};
use super::topology::{HalfEdges, NONE};

/// The most faces around such vertices. Beyond them semi-sharp edges and vertices of the finest mesh count as sharp.
const FACES_MAX: usize = 1 << 18;

/// The meshes around vertices that are semi-sharp.
#[derive(Debug)]
pub(super) struct Fading {
    /// The vertices, ascending.
    pub(super) vertices: Vec<u32>,
    /// Vertices of each further level among those of the level before, and the step from there.
    steps: Vec<(Vec<u32>, RefinementStep)>,
    /// Vertices of the last level among those of the level before.
    kept: Vec<u32>,
    /// Index of each vertex in the last level.
    pub(super) in_last: Vec<u32>,
    /// Corners of the finest mesh at the vertices, ascending, and those of the last level.
    corners: Vec<(u32, u32)>,
}

/// A part of a mesh: its connectivity, and the former index of each vertex and corner.
struct FadingPart {
    topology: HalfEdges,
    vertices: Vec<u32>,
    corners: Vec<u32>,
}

impl Fading {
    /// Returns also the last level, without semi-sharp features; `None`: no vertex is semi-sharp, or too many are.
    pub(super) fn new(finest: &HalfEdges, scheme: Scheme) -> Option<(Self, HalfEdges)> {
        let is_fading = |sharpness: f32| is_sharp(sharpness) && !is_infinite(sharpness);
        let mut is_at = vec![false; finest.vertex_count];
        let mut most: f32 = 0.0;
        for (edge, &sharpness) in finest.edge_sharpness.iter().enumerate().filter(|edge| is_fading(*edge.1)) {
            finest.ends(finest.edges[edge][0]).into_iter().for_each(|end| is_at[end as usize] = true);
            most = most.max(sharpness);
        }
        for (vertex, &sharpness) in finest.vertex_sharpness.iter().enumerate().filter(|it| is_fading(*it.1)) {
            is_at[vertex] = true;
            most = most.max(sharpness);
        }
        let vertices: Vec<u32> = (0..finest.vertex_count as u32).filter(|&vertex| is_at[vertex as usize]).collect();
        if vertices.is_empty() {
            return None;
        }
        let mut part = FadingPart::around(finest, &vertices)?;
        let at_vertex = |&(corner, _): &(u32, u32)| is_at[finest.tails[corner as usize] as usize];
        let corners = part.corners.iter().zip(0..).map(|(&former, corner)| (former, corner));
        let mut corners: Vec<(u32, u32)> = corners.filter(at_vertex).collect();
        let mut at: Vec<u32> = part.find(&vertices);
        let mut steps = Vec::new();
        for _ in 0..most.ceil() as u32 {
            let step = RefinementStep::new(part.topology, scheme, false);
            let refined = step.refined_topology();
            let next = FadingPart::around(&refined, &at)?;
            // The first corner of the face of a corner is at the same vertex
            let mut number = vec![NONE; refined.tails.len()];
            next.corners.iter().zip(0..).for_each(|(&former, corner)| number[former as usize] = corner);
            for (_, corner) in &mut corners {
                let first = if scheme == Scheme::Loop { *corner / 3 * 12 + *corner % 3 * 3 } else { 4 * *corner };
                *corner = number[first as usize];
            }
            at = next.find(&at);
            steps.push((part.vertices, step));
            part = next;
        }
        corners.sort_unstable();
        Some((Self { vertices, steps, kept: part.vertices, in_last: at, corners }, part.topology))
    }

    /// Returns the values at the last level.
    ///
    /// - `values`: at the vertices of the finest mesh.
    pub(super) fn refined<V: LinearValue>(&self, values: &[V]) -> Vec<V> {
        let gathered =
            |values: &[V], kept: &[u32]| kept.iter().map(|&vertex| values[vertex as usize]).collect::<Vec<V>>();
        let mut refined: Option<Vec<V>> = None;
        for (kept, step) in &self.steps {
            refined = Some(step.refined(&gathered(refined.as_deref().unwrap_or(values), kept)));
        }
        gathered(refined.as_deref().unwrap_or(values), &self.kept)
    }

    /// Returns the corner of the last level for a corner of the finest mesh; `None`: its vertex is not semi-sharp.
    pub(super) fn corner(&self, corner: u32) -> Option<u32> {
        let row = self.corners.binary_search_by_key(&corner, |pair| pair.0).ok()?;
        Some(self.corners[row].1)
    }
}

impl FadingPart {
    /// Returns the faces at vertices; `None`: there are too many.
    fn around(mesh: &HalfEdges, vertices: &[u32]) -> Option<Self> {
        let mut is_at = vec![false; mesh.vertex_count];
        vertices.iter().for_each(|&vertex| is_at[vertex as usize] = true);
        let mut number = vec![NONE; mesh.vertex_count];
        let (mut starts, mut tails, mut kept, mut corners) = (vec![0], Vec::new(), Vec::new(), Vec::new());
        for face in 0..mesh.face_count() {
            let range = mesh.corners(face);
            if !mesh.tails[range.clone()].iter().any(|&vertex| is_at[vertex as usize]) {
                continue;
            }
            for corner in range {
                let vertex = mesh.tails[corner];
                if number[vertex as usize] == NONE {
                    number[vertex as usize] = kept.len() as u32;
                    kept.push(vertex);
                }
                tails.push(number[vertex as usize]);
                corners.push(corner as u32);
            }
            starts.push(tails.len() as u32);
        }
        if starts.len() > FACES_MAX {
            return None;
        }
        let (mut topology, _) = HalfEdges::new(kept.len(), starts, tails);
        for (edge, sharpness) in topology.edge_sharpness.iter_mut().enumerate() {
            let former = mesh.edge_of[corners[topology.edges[edge][0] as usize] as usize];
            *sharpness = sharpness.max(mesh.edge_sharpness[former as usize]);
        }
        topology.vertex_sharpness = kept.iter().map(|&vertex| mesh.vertex_sharpness[vertex as usize]).collect();
        Some(Self { topology, vertices: kept, corners })
    }

    /// Returns the indices of vertices by their former ones.
    fn find(&self, former: &[u32]) -> Vec<u32> {
        let mut rows: Vec<(u32, u32)> = self.vertices.iter().copied().zip(0..).collect();
        rows.sort_unstable();
        let row = |vertex: &u32| rows.binary_search_by_key(vertex, |row| row.0).map_or(NONE, |row| rows[row].1);
        former.iter().map(row).collect()
    }
}
