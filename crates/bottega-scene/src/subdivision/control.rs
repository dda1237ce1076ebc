//! Control meshes as files give them, and the sound faces among theirs.

use super::sharpness::INFINITE;
use super::topology::HalfEdges;

/// The schemes of subdivision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scheme {
    /// Faces of any size.
    CatmullClark,
    /// Triangles alone.
    Loop,
    /// Faces of any size, which stay where they are.
    Bilinear,
}

/// The rules for boundaries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BoundaryRule {
    /// Faces at boundaries are not part of the surface, unless all boundary edges at their points are sharp.
    None,
    /// Boundaries are smooth curves.
    EdgeOnly,
    /// Boundaries are smooth curves through corners of the mesh that have one face.
    EdgeAndCorner,
}

/// The rules for values by corner where faces with different values meet. Elsewhere such values are smooth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum SeamRule {
    /// Seams are smooth curves.
    Smooth,
    /// Smooth curves, with sharp corners of regions of one face.
    Corners,
    /// Also where more than two regions meet.
    Junctions,
    /// Also where a seam ends, and opposite to a corner of one face.
    Ends,
    /// Seams and boundaries are linear.
    Linear,
    /// Everything is linear.
    AllLinear,
}

/// A mesh that controls a surface.
#[derive(Clone, Debug)]
pub(crate) struct ControlMesh<'a> {
    pub(crate) point_count: usize,
    /// Number of corners of each face.
    pub(crate) face_sizes: &'a [usize],
    /// Point of each corner, below `point_count`.
    pub(crate) corner_points: &'a [u32],
    /// `true`: the face is not part of the surface; empty: all are.
    pub(crate) is_hole: Vec<bool>,
    /// Pairs of points and the sharpness of their edge; from 10 on it stays sharp.
    pub(crate) creases: Vec<([u32; 2], f32)>,
    /// Points and their sharpness.
    pub(crate) corners: Vec<(u32, f32)>,
    pub(crate) scheme: Scheme,
    pub(crate) boundary: BoundaryRule,
    pub(crate) seams: SeamRule,
    /// `true`: triangles of a Catmull-Clark mesh follow the rule `smooth`.
    pub(crate) has_smooth_triangles: bool,
}

/// The faces of a control mesh that have at least three corners.
#[derive(Clone, Debug, Default)]
pub(super) struct SoundFaces {
    /// First corner of each face, and the end of the last one.
    pub(super) starts: Vec<u32>,
    /// Vertex of each corner: a row of `points`.
    pub(super) tails: Vec<u32>,
    /// Points that corners have.
    pub(super) points: Vec<u32>,
    /// Corner and face of the control mesh.
    pub(super) corner_sources: Vec<u32>,
    pub(super) face_sources: Vec<u32>,
    /// Faces with fewer than three corners that differ: their number and the first one.
    pub(super) left_out: Option<(usize, usize)>,
    /// Faces that lost corners which repeat others.
    pub(super) mended: Option<(usize, usize)>,
}

impl SoundFaces {
    pub(super) fn new(mesh: &ControlMesh<'_>) -> Self {
        let mut faces = Self { starts: vec![0], ..Self::default() };
        let count = |found: &mut Option<(usize, usize)>, face: usize| {
            *found = Some(found.map_or((1, face), |(count, first)| (count + 1, first)));
        };
        let mut first = 0;
        let mut corners = Vec::new();
        for (face, &size) in mesh.face_sizes.iter().enumerate() {
            let kept = sound_corners(&mesh.corner_points[first..first + size], &mut corners);
            if kept.len() < size.max(3) {
                count(if kept.len() < 3 { &mut faces.left_out } else { &mut faces.mended }, face);
            }
            if kept.len() >= 3 {
                faces.corner_sources.extend(kept.iter().map(|&corner| (first + corner) as u32));
                faces.starts.push(faces.corner_sources.len() as u32);
                faces.face_sources.push(face as u32);
            }
            first += size;
        }
        // Number the points that corners have
        let mut number = vec![u32::MAX; mesh.point_count];
        let point_of = |&source: &u32| mesh.corner_points[source as usize];
        faces.corner_sources.iter().for_each(|source| number[point_of(source) as usize] = 0);
        for (number, point) in number.iter_mut().zip(0..).filter(|it| *it.0 == 0) {
            *number = faces.points.len() as u32;
            faces.points.push(point);
        }
        faces.tails = faces.corner_sources.iter().map(|source| number[point_of(source) as usize]).collect();
        faces
    }

    /// Makes the connectivity, with all sharpness. Returns also the faces that are not part of the surface, and what is to be
    /// reported.
    pub(super) fn topology(&self, mesh: &ControlMesh<'_>) -> (HalfEdges, Vec<bool>, Vec<String>) {
        let mut problems = Vec::new();
        let name = |what: &str, found: Option<(usize, usize)>| {
            found.map(|(count, first)| format!("{count} {what}, the first is face {first}"))
        };
        problems.extend(name("faces with fewer than 3 distinct corners are left out", self.left_out));
        problems.extend(name("faces lose corners that repeat others", self.mended));
        let (mut topology, bad_edges) = HalfEdges::new(self.points.len(), self.starts.clone(), self.tails.clone());
        if bad_edges > 0 {
            problems.push(format!(
                "{bad_edges} edges of more than two faces, or of faces that turn against each other, are sharp"
            ));
        }
        let is_apart = topology.fanless_vertices();
        let mut number = vec![u32::MAX; mesh.point_count];
        self.points.iter().zip(0..).for_each(|(&point, vertex)| number[point as usize] = vertex);
        let vertex = |point: u32| number.get(point as usize).copied().filter(|&vertex| vertex != u32::MAX);
        // Sharpen the edges that the mesh names
        let mut missing = 0;
        let is_sharp = |sharpness: f32| sharpness > 0.0;
        for &([a, b], sharpness) in mesh.creases.iter().filter(|crease| is_sharp(crease.1)) {
            let edge = vertex(a).zip(vertex(b)).and_then(|(a, b)| topology.edge_between(a, b));
            match edge {
                Some(edge) => {
                    let own = if is_fixed(&topology, edge) { INFINITE } else { 0.0 };
                    topology.edge_sharpness[edge] = own.max(sharpness.min(INFINITE));
                }
                None => missing += 1,
            }
        }
        if missing > 0 {
            problems.push(format!("{missing} creases are not along edges of the mesh"));
        }
        let is_hole = self.holes(mesh, &topology);
        sharpen_vertices(&mut topology, mesh.boundary, &is_apart);
        for &(point, sharpness) in mesh.corners.iter().filter(|corner| is_sharp(corner.1)) {
            if let Some(vertex) = vertex(point) {
                let own = &mut topology.vertex_sharpness[vertex as usize];
                *own = own.max(sharpness.min(INFINITE));
            }
        }
        (topology, is_hole, problems)
    }

    /// Returns true for each face that is not part of the surface.
    fn holes(&self, mesh: &ControlMesh<'_>, topology: &HalfEdges) -> Vec<bool> {
        let source_is_hole = |&face: &u32| mesh.is_hole.get(face as usize) == Some(&true);
        let mut is_hole: Vec<bool> = self.face_sources.iter().map(source_is_hole).collect();
        if mesh.boundary == BoundaryRule::None && mesh.scheme != Scheme::Bilinear {
            // EdgeCounts at boundaries are sharp in this mesh; those that the file makes sharp count here
            let named: std::collections::BTreeSet<[u32; 2]> = mesh
                .creases
                .iter()
                .filter(|crease| crease.1 >= INFINITE)
                .map(|&([a, b], _)| [a.min(b), a.max(b)])
                .collect();
            let mut is_left_out = vec![false; topology.vertex_count];
            for edge in (0..topology.edges.len()).filter(|&edge| topology.is_boundary(edge)) {
                let ends = topology.ends(topology.edges[edge][0]);
                let [a, b] = ends.map(|vertex| self.points[vertex as usize]);
                if !named.contains(&[a.min(b), a.max(b)]) {
                    ends.into_iter().for_each(|vertex| is_left_out[vertex as usize] = true);
                }
            }
            for (face, is_hole) in is_hole.iter_mut().enumerate() {
                *is_hole |= topology.tails[topology.corners(face)].iter().any(|&vertex| is_left_out[vertex as usize]);
            }
        }
        is_hole
    }
}

/// Returns true for an edge at a boundary, or one that is not manifold.
fn is_fixed(topology: &HalfEdges, edge: usize) -> bool {
    let [first, second] = topology.edges[edge];
    topology.is_boundary(edge)
        || topology.tails[first as usize] == topology.tails[second as usize]
        || topology.edge_sharpness[edge] >= INFINITE
}

/// Sharpens corners of boundaries, and vertices whose faces do not form one fan, as OpenSubdiv does.
fn sharpen_vertices(topology: &mut HalfEdges, boundary: BoundaryRule, is_apart: &[bool]) {
    #[derive(Clone, Copy, Default)]
    struct EdgeCounts {
        all: u32,
        boundary: u32,
        bad: u32,
    }
    let mut faces = vec![0u32; topology.vertex_count];
    topology.tails.iter().for_each(|&vertex| faces[vertex as usize] += 1);
    let mut sides = vec![0u32; topology.edges.len()];
    topology.edge_of.iter().for_each(|&edge| sides[edge as usize] += 1);
    let mut edges = vec![EdgeCounts::default(); topology.vertex_count];
    for (edge, (&[first, second], sides)) in topology.edges.iter().zip(sides).enumerate() {
        let is_boundary = topology.is_boundary(edge);
        let is_bad = sides > 2 || !is_boundary && topology.tails[first as usize] == topology.tails[second as usize];
        for end in topology.ends(first) {
            let edges = &mut edges[end as usize];
            edges.all += 1;
            edges.boundary += u32::from(is_boundary);
            edges.bad += u32::from(is_bad);
        }
    }
    for (vertex, sharpness) in topology.vertex_sharpness.iter_mut().enumerate() {
        let (edges, faces) = (edges[vertex], faces[vertex]);
        let is_corner = faces == 1 && edges.all == 2 && boundary == BoundaryRule::EdgeAndCorner;
        // Sheets that meet along a curve keep it smooth
        let is_on_curve = edges.bad == 2 && edges.boundary == 0 && faces > edges.all;
        if is_corner || (edges.bad > 0 || is_apart[vertex]) && !is_on_curve {
            *sharpness = INFINITE;
        }
    }
}

/// Returns the corners of a face that differ from the next one, and are not the tip of an edge that goes there and back.
///
/// - `points`: point of each corner.
fn sound_corners<'a>(points: &[u32], corners: &'a mut Vec<usize>) -> &'a [usize] {
    corners.clear();
    for (corner, &point) in points.iter().enumerate() {
        let of = |back: usize| corners.len().checked_sub(back).map(|index| points[corners[index]]);
        if of(1) == Some(point) {
            continue;
        }
        if of(2) == Some(point) {
            corners.pop();
        } else {
            corners.push(corner);
        }
    }
    // The same across the end of the list
    let (mut first, mut end) = (0, corners.len());
    while end - first >= 2 {
        let at = |index: usize| points[corners[index]];
        if at(first) == at(end - 1) {
            end -= 1;
        } else if end - first >= 3 && at(first) == at(end - 2) {
            end -= 2;
        } else if end - first >= 3 && at(first + 1) == at(end - 1) {
            first += 1;
            end -= 1;
        } else {
            break;
        }
    }
    &corners[first..end]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_that_repeat_others_are_left_out() {
        let kept = |points: &[u32]| {
            let mut corners = Vec::new();
            sound_corners(points, &mut corners).iter().map(|&corner| points[corner]).collect::<Vec<u32>>()
        };
        assert_eq!(kept(&[4, 5, 6]), [4, 5, 6]);
        assert_eq!(kept(&[4, 4, 5, 6, 6, 4]), [4, 5, 6]);
        assert_eq!(kept(&[4, 5, 9, 5, 6]), [4, 5, 6]);
        assert_eq!(kept(&[9, 5, 6, 4, 5]), [5, 6, 4]);
        assert_eq!(kept(&[5, 6, 4, 5, 9]), [5, 6, 4]);
        assert!(kept(&[1, 2, 1, 2]).len() < 3 && kept(&[3, 3, 3]).len() < 3 && kept(&[]).is_empty());
        // A face with a cut from its border to a hole
        assert_eq!(kept(&[0, 1, 2, 3, 0, 4, 5, 6, 4]).len(), 9);
    }
}
