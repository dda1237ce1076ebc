//! Connectivity of a polygon mesh: half-edges, edges and their sharpness.
//!
//! A half-edge is the side of a face that begins at a corner; corner and half-edge have the same index. The half-edges of a face
//! follow each other, counter-clockwise.

use rayon::prelude::*;

use super::sharpness::{INFINITE, decayed, is_infinite, is_sharp};

/// Stands for a missing half-edge, or for one that has no number yet.
pub(super) const NONE: u32 = u32::MAX;

/// The sizes of faces.
#[derive(Clone, Debug)]
pub(super) enum FaceSizes {
    /// All faces have this number of corners.
    Same(u32),
    /// Each face has its own number of corners.
    Each {
        /// First corner of each face, and the end of the last one.
        starts: Vec<u32>,
        /// Face of each corner.
        face_of: Vec<u32>,
    },
}

/// The connectivity of a mesh.
#[derive(Clone, Debug)]
pub(super) struct HalfEdges {
    pub(super) vertex_count: usize,
    pub(super) sizes: FaceSizes,
    /// Vertex at which each half-edge begins.
    pub(super) tails: Vec<u32>,
    /// Edge of each half-edge.
    pub(super) edge_of: Vec<u32>,
    /// First two half-edges of each edge; the second one is [`NONE`] at a boundary. An edge with more, or with two of the same
    /// direction, is not manifold; its sharpness is infinite.
    pub(super) edges: Vec<[u32; 2]>,
    pub(super) edge_sharpness: Vec<f32>,
    pub(super) vertex_sharpness: Vec<f32>,
    /// `true`: vertices of boundaries keep their place, so that values are linear along boundaries.
    pub(super) has_linear_boundaries: bool,
}

impl HalfEdges {
    /// Makes the connectivity of faces. Only edges at boundaries, and those that are not manifold, are sharp.
    ///
    /// - `starts`: first corner of each face, and the end of the last one. A face has at least 3 corners; corners that follow
    ///   each other differ.
    ///
    /// Returns also the number of edges that are not manifold.
    pub(super) fn new(vertex_count: usize, starts: Vec<u32>, tails: Vec<u32>) -> (Self, usize) {
        let mut face_of = vec![0; tails.len()];
        for (face, range) in starts.windows(2).enumerate() {
            face_of[range[0] as usize..range[1] as usize].fill(face as u32);
        }
        let mut topology = Self {
            vertex_count,
            sizes: FaceSizes::Each { starts, face_of },
            edge_of: vec![0; tails.len()],
            tails,
            edges: Vec::new(),
            edge_sharpness: Vec::new(),
            vertex_sharpness: vec![0.0; vertex_count],
            has_linear_boundaries: false,
        };
        // Bring the half-edges of each edge together
        let mut keys: Vec<(u32, u32, u32)> = (0..topology.tails.len() as u32)
            .map(|half| {
                let [tail, head] = topology.ends(half);
                (tail.min(head), tail.max(head), half)
            })
            .collect();
        keys.par_sort_unstable();
        let mut bad_count = 0;
        for sides in keys.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let edge = topology.edges.len() as u32;
            sides.iter().for_each(|&(_, _, half)| topology.edge_of[half as usize] = edge);
            let first = sides[0].2;
            let second = sides.get(1).map_or(NONE, |side| side.2);
            let is_manifold = sides.len() == 1
                || sides.len() == 2 && topology.tails[first as usize] != topology.tails[second as usize];
            bad_count += usize::from(!is_manifold);
            topology.edges.push([first, second]);
            topology.edge_sharpness.push(if is_manifold && second != NONE { 0.0 } else { INFINITE });
        }
        (topology, bad_count)
    }

    pub(super) fn face_count(&self) -> usize {
        match &self.sizes {
            FaceSizes::Same(sides) => self.tails.len() / *sides as usize,
            FaceSizes::Each { starts, .. } => starts.len() - 1,
        }
    }

    /// Returns the corners of a face.
    #[inline(always)]
    pub(super) fn corners(&self, face: usize) -> std::ops::Range<usize> {
        match &self.sizes {
            FaceSizes::Same(sides) => face * *sides as usize..(face + 1) * *sides as usize,
            FaceSizes::Each { starts, .. } => starts[face] as usize..starts[face + 1] as usize,
        }
    }

    /// Returns the face of a corner.
    #[inline(always)]
    pub(super) fn face_of(&self, corner: u32) -> u32 {
        match &self.sizes {
            FaceSizes::Same(sides) => corner / sides,
            FaceSizes::Each { face_of, .. } => face_of[corner as usize],
        }
    }

    /// Returns the next half-edge of the face.
    #[inline(always)]
    pub(super) fn next(&self, half: u32) -> u32 {
        let range = self.corners(self.face_of(half) as usize);
        if half as usize + 1 == range.end { range.start as u32 } else { half + 1 }
    }

    /// Returns the previous half-edge of the face.
    #[inline(always)]
    pub(super) fn previous(&self, half: u32) -> u32 {
        let range = self.corners(self.face_of(half) as usize);
        if half as usize == range.start { range.end as u32 - 1 } else { half - 1 }
    }

    /// Returns the vertices at which a half-edge begins and ends.
    #[inline(always)]
    pub(super) fn ends(&self, half: u32) -> [u32; 2] {
        [self.tails[half as usize], self.tails[self.next(half) as usize]]
    }

    /// Returns the half-edge on the other side of an edge that is manifold; `None`: the edge is at a boundary.
    #[inline(always)]
    pub(super) fn across(&self, half: u32) -> Option<u32> {
        let [first, second] = self.edges[self.edge_of[half as usize] as usize];
        let other = if first == half { second } else { first };
        (other != NONE).then_some(other)
    }

    /// Returns true if an edge has one face.
    #[inline(always)]
    pub(super) fn is_boundary(&self, edge: usize) -> bool {
        self.edges[edge][1] == NONE
    }

    /// Returns the edge between two vertices. The edges must be in the order of [`Self::new`].
    pub(super) fn edge_between(&self, a: u32, b: u32) -> Option<usize> {
        let key = (a.min(b), a.max(b));
        let key_of = |edge: &[u32; 2]| {
            let [tail, head] = self.ends(edge[0]);
            (tail.min(head), tail.max(head))
        };
        self.edges.binary_search_by_key(&key, key_of).ok()
    }

    /// Returns the end of an edge at which its part with the even number begins after a refinement.
    #[inline(always)]
    fn first_end(&self, edge: u32) -> u32 {
        self.tails[self.edges[edge as usize][0] as usize]
    }

    /// Returns the part of the edge of a half-edge that is at its begin, and the one that is at its end.
    #[inline(always)]
    fn parts(&self, half: u32) -> [u32; 2] {
        let edge = self.edge_of[half as usize];
        let first = 2 * edge;
        if self.tails[half as usize] == self.first_end(edge) { [first, first + 1] } else { [first + 1, first] }
    }

    /// Returns the sharpness of the vertices and edges that lie on vertices and edges of this mesh after a refinement.
    fn refined_sharpness(&self, vertex_count: usize, edge_count: usize) -> (Vec<f32>, Vec<f32>) {
        let mut edges = vec![0.0; edge_count];
        for (edge, &sharpness) in self.edge_sharpness.iter().enumerate().filter(|edge| is_sharp(*edge.1)) {
            edges[2 * edge..2 * edge + 2].fill(decayed(sharpness));
        }
        let mut vertices = vec![0.0; vertex_count];
        for (new, &sharpness) in vertices.iter_mut().zip(&self.vertex_sharpness) {
            *new = decayed(sharpness);
        }
        if self.has_linear_boundaries {
            for edge in (0..self.edges.len()).filter(|&edge| self.is_boundary(edge)) {
                vertices[self.vertex_count + edge] = INFINITE;
            }
        }
        (vertices, edges)
    }

    /// Divides each face into one quadrilateral per corner. The new vertices are those of the vertices, edges and faces of this
    /// mesh, in this order.
    ///
    /// The face of a corner has the vertices of: the corner's vertex, its edge, the face, the previous edge.
    pub(super) fn refined_to_quads(&self) -> Self {
        let (corners, edges) = (self.tails.len(), self.edges.len());
        let vertex_count = self.vertex_count + edges + self.face_count();
        let (vertex_sharpness, edge_sharpness) = self.refined_sharpness(vertex_count, 2 * edges + corners);
        let (mut tails, mut edge_of) = (vec![0; 4 * corners], vec![0; 4 * corners]);
        let chunks = tails.par_chunks_mut(4).zip(edge_of.par_chunks_mut(4)).with_min_len(1 << 12);
        chunks.enumerate().for_each(|(corner, (tails, edge_of))| {
            let corner = corner as u32;
            let previous = self.previous(corner);
            let middle = |half: u32| self.vertex_count as u32 + self.edge_of[half as usize];
            let center = (self.vertex_count + edges) as u32 + self.face_of(corner);
            tails.copy_from_slice(&[self.tails[corner as usize], middle(corner), center, middle(previous)]);
            let inner = |half: u32| 2 * edges as u32 + half;
            edge_of.copy_from_slice(&[self.parts(corner)[0], inner(corner), inner(previous), self.parts(previous)[1]]);
        });
        // Give the parts of edges, and the edges within faces, their half-edges
        let mut new_edges = vec![[NONE; 2]; 2 * edges + corners];
        let side = |half: u32, end: u32| match half {
            NONE => NONE,
            half if self.tails[half as usize] == end => 4 * half,
            half => 4 * self.next(half) + 3,
        };
        for (edge, &[first, second]) in self.edges.iter().enumerate() {
            for (part, end) in self.ends(first).into_iter().enumerate() {
                new_edges[2 * edge + part] = [side(first, end), side(second, end)];
            }
        }
        for corner in 0..corners as u32 {
            new_edges[2 * edges + corner as usize] = [4 * corner + 1, 4 * self.next(corner) + 2];
        }
        Self {
            vertex_count,
            sizes: FaceSizes::Same(4),
            tails,
            edge_of,
            edges: new_edges,
            edge_sharpness,
            vertex_sharpness,
            has_linear_boundaries: self.has_linear_boundaries,
        }
    }

    /// Divides each triangle into four: one per corner, then that in the middle. The new vertices are those of the vertices and
    /// edges of this mesh, in this order.
    pub(super) fn refined_to_triangles(&self) -> Self {
        let (corners, edges) = (self.tails.len(), self.edges.len());
        let vertex_count = self.vertex_count + edges;
        let (vertex_sharpness, edge_sharpness) = self.refined_sharpness(vertex_count, 2 * edges + corners);
        let (mut tails, mut edge_of) = (vec![0; 4 * corners], vec![0; 4 * corners]);
        // The first half-edge of the triangle of a corner
        let at = |corner: u32| corner / 3 * 12 + corner % 3 * 3;
        let middle = |half: u32| self.vertex_count as u32 + self.edge_of[half as usize];
        let inner = |corner: u32| 2 * edges as u32 + corner;
        for corner in 0..corners as u32 {
            let (next, previous) = (self.next(corner), self.previous(corner));
            let first = at(corner) as usize;
            tails[first..first + 3].copy_from_slice(&[self.tails[corner as usize], middle(corner), middle(previous)]);
            edge_of[first..first + 3].copy_from_slice(&[self.parts(corner)[0], inner(corner), self.parts(previous)[1]]);
            // The side of the triangle in the middle from this edge to the next one
            let center = (corner / 3 * 12 + 9 + corner % 3) as usize;
            tails[center] = middle(corner);
            edge_of[center] = inner(next);
        }
        let mut new_edges = vec![[NONE; 2]; 2 * edges + corners];
        let side = |half: u32, end: u32| match half {
            NONE => NONE,
            half if self.tails[half as usize] == end => at(half),
            half => at(self.next(half)) + 2,
        };
        for (edge, &[first, second]) in self.edges.iter().enumerate() {
            for (part, end) in self.ends(first).into_iter().enumerate() {
                new_edges[2 * edge + part] = [side(first, end), side(second, end)];
            }
        }
        for corner in 0..corners as u32 {
            let previous = self.previous(corner);
            new_edges[2 * edges + corner as usize] = [at(corner) + 1, previous / 3 * 12 + 9 + previous % 3];
        }
        Self {
            vertex_count,
            sizes: FaceSizes::Same(3),
            tails,
            edge_of,
            edges: new_edges,
            edge_sharpness,
            vertex_sharpness,
            has_linear_boundaries: self.has_linear_boundaries,
        }
    }

    /// Returns one corner of each vertex; [`NONE`]: it has no face.
    pub(super) fn vertex_corners(&self) -> Vec<u32> {
        let mut first = vec![NONE; self.vertex_count];
        for (corner, &vertex) in self.tails.iter().enumerate().rev() {
            first[vertex as usize] = corner as u32;
        }
        first
    }

    /// Collects the corners of a vertex that are reached from one of them over edges, counter-clockwise. Returns true if they go
    /// all around the vertex.
    ///
    /// - `fan`: overwritten.
    /// - `may_cross`: the edges over which corners are reached; they are manifold.
    pub(super) fn collect_fan(&self, corner: u32, fan: &mut Vec<u32>, may_cross: impl Fn(usize) -> bool) -> bool {
        let over = |half: u32| {
            let edge = self.edge_of[half as usize] as usize;
            if may_cross(edge) { self.across(half) } else { None }
        };
        // Go back to where the fan begins
        let mut first = corner;
        while let Some(other) = over(first) {
            first = self.next(other);
            if first == corner {
                break;
            }
        }
        fan.clear();
        let mut current = first;
        loop {
            fan.push(current);
            match over(self.previous(current)) {
                Some(next) if next == first => return true,
                Some(next) => current = next,
                None => return false,
            }
        }
    }

    /// Returns true for each vertex whose faces do not form one fan.
    pub(super) fn fanless_vertices(&self) -> Vec<bool> {
        let mut counts = vec![0u32; self.vertex_count];
        self.tails.iter().for_each(|&vertex| counts[vertex as usize] += 1);
        let mut fan = Vec::new();
        let corners = self.vertex_corners();
        let is_apart = |(&corner, &count): (&u32, &u32)| {
            corner != NONE && {
                let is_manifold = |edge: usize| !is_infinite(self.edge_sharpness[edge]) && !self.is_boundary(edge);
                self.collect_fan(corner, &mut fan, is_manifold);
                fan.len() as u32 != count
            }
        };
        corners.iter().zip(&counts).map(is_apart).collect()
    }
}
