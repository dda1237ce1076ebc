//! Subdivision surfaces: uniform refinement of polygon meshes by the schemes of Catmull and Clark, of Loop, and the bilinear one,
//! with the rules of OpenSubdiv for boundaries, creases and seams.
//!
//! [`Subdivision`] is made once of the connectivity of a mesh. It refines points and other values, also those of other times. The
//! vertices of the finest mesh lie on the limit surface.

mod control;
mod fading;
mod limit;
mod refine;
mod rules;
mod seams;
mod sharpness;
mod topology;

#[cfg(test)]
mod opensubdiv;
#[cfg(test)]
mod tests;

use control::SoundFaces;
pub(crate) use control::{BoundaryRule, ControlMesh, Scheme, SeamRule};
use glam::{DVec3, Vec3};
use limit::LimitSurface;
pub(crate) use refine::LinearValue;
use refine::RefinementStep;
use topology::HalfEdges;

/// The most faces of a refined mesh.
pub(crate) const FACES_MAX: usize = 1 << 22;

/// The memory of a refined mesh while it is made, in bytes per face: its connectivity, and the values of corners.
const BYTES_PER_FACE: usize = 512;

/// A refined mesh.
#[derive(Debug)]
pub(crate) struct Subdivision {
    faces: SoundFaces,
    /// The meshes from the control mesh on, without the finest one.
    steps: Vec<RefinementStep>,
    limit: LimitSurface,
    /// `true`: the face of the control mesh is not part of the surface.
    is_hole: Vec<bool>,
    scheme: Scheme,
    seams: SeamRule,
    has_smooth_triangles: bool,
}

/// Returns the number of faces after a number of levels, at least 1.
pub(crate) fn face_count(scheme: Scheme, face_sizes: &[usize], level: u32) -> usize {
    let first: usize = match scheme {
        Scheme::Loop => face_sizes.len().saturating_mul(4),
        _ => face_sizes.iter().fold(0, |sum, &size| sum.saturating_add(size)),
    };
    first.saturating_mul(1 << (2 * (level - 1)))
}

/// Returns the memory that a refinement takes, in bytes.
pub(crate) fn memory_bytes(face_count: usize) -> usize {
    face_count.saturating_mul(BYTES_PER_FACE)
}

impl Subdivision {
    /// Refines the connectivity of a mesh. Returns also what is to be reported; `None`: the mesh has no sound face.
    ///
    /// - `level`: number of refinements, at least 1.
    /// - `mesh`: for Loop's scheme all faces are triangles. [`face_count`] is at most [`FACES_MAX`].
    pub(crate) fn new(mesh: &ControlMesh<'_>, level: u32) -> (Option<Self>, Vec<String>) {
        let faces = SoundFaces::new(mesh);
        if faces.face_sources.is_empty() {
            return (None, vec!["no face has 3 distinct corners".into()]);
        }
        let (mut topology, is_hole, problems) = faces.topology(mesh);
        let mut steps: Vec<RefinementStep> = Vec::new();
        for _ in 0..level {
            let step = RefinementStep::new(topology, mesh.scheme, mesh.has_smooth_triangles);
            topology = step.refined_topology();
            steps.push(step);
        }
        let limit = LimitSurface::new(topology, mesh.scheme);
        let (scheme, seams, has_smooth_triangles) = (mesh.scheme, mesh.seams, mesh.has_smooth_triangles);
        (Some(Self { faces, steps, limit, is_hole, scheme, seams, has_smooth_triangles }), problems)
    }

    /// Returns the number of corners of each face: 3 or 4.
    pub(crate) fn sides(&self) -> usize {
        if self.scheme == Scheme::Loop { 3 } else { 4 }
    }

    /// Returns the point of each corner, as a row of [`Self::points`].
    pub(crate) fn corner_points(&self) -> &[u32] {
        &self.limit.corner_vertices
    }

    /// Returns the face of the control mesh that each face is a part of; `None`: the face is not part of the surface.
    pub(crate) fn face_sources(&self) -> impl Iterator<Item = Option<usize>> {
        let control = &self.steps[0].topology;
        let levels = self.steps.len() as u32;
        (0..self.limit.topology().face_count()).map(move |face| {
            let sound = match self.scheme {
                Scheme::Loop => face >> (2 * levels),
                _ => control.face_of((face >> (2 * (levels - 1))) as u32) as usize,
            };
            (!self.is_hole[sound]).then(|| self.faces.face_sources[sound] as usize)
        })
    }

    /// Returns the points on the limit surface, and its normals there: empty for the bilinear scheme, zero where the surface
    /// has none.
    ///
    /// - `control`: points of the control mesh.
    pub(crate) fn points(&self, control: &[Vec3]) -> (Vec<Vec3>, Vec<Vec3>) {
        let points = self.refined(|point| control[point].as_dvec3());
        let normals = self.limit.normals(&points);
        let limits = self.limit.divided(self.limit.values(&points));
        let narrow = |values: Vec<DVec3>| values.into_iter().map(DVec3::as_vec3).collect();
        (narrow(limits), narrow(normals))
    }

    /// Returns values at the vertices of the finest mesh, before they are moved to their limits.
    fn refined<V: LinearValue>(&self, of_point: impl Fn(usize) -> V) -> Vec<V> {
        let control = self.faces.points.iter().map(|&point| of_point(point as usize)).collect();
        self.steps.iter().fold(control, |values: Vec<V>, step| step.refined(&values))
    }

    /// Returns the values of corners by values of points that are smooth like the surface.
    pub(crate) fn by_point<V: LinearValue>(&self, of_point: impl Fn(usize) -> V) -> Vec<V> {
        let limits = self.limit.values(&self.refined(of_point));
        self.limit.topology().tails.iter().map(|&vertex| limits[vertex as usize]).collect()
    }

    /// Returns the values of corners by values of corners that are linear within each face of the control mesh.
    pub(crate) fn linear<V: LinearValue>(&self, of_corner: impl Fn(usize) -> V) -> Vec<V> {
        let control = &self.steps[0].topology;
        let mut values: Vec<V> = self.faces.corner_sources.iter().map(|&corner| of_corner(corner as usize)).collect();
        for level in 0..self.steps.len() {
            let faces: Vec<std::ops::Range<usize>> = match level {
                0 => (0..control.face_count()).map(|face| control.corners(face)).collect(),
                _ => (0..values.len() / self.sides())
                    .map(|face| face * self.sides()..(face + 1) * self.sides())
                    .collect(),
            };
            let mut refined = Vec::with_capacity(4 * values.len());
            for corners in faces {
                let corners = &values[corners];
                let n = corners.len();
                let middle = |index: usize| (corners[index] + corners[(index + 1) % n]) * 0.5;
                if self.scheme == Scheme::Loop {
                    (0..n).for_each(|i| refined.extend([corners[i], middle(i), middle((i + n - 1) % n)]));
                    refined.extend((0..n).map(middle));
                } else {
                    let mut center = V::default();
                    corners.iter().for_each(|&corner| center += corner);
                    let center = center * (1.0 / n as f64);
                    (0..n).for_each(|i| refined.extend([corners[i], middle(i), center, middle((i + n - 1) % n)]));
                }
            }
            values = refined;
        }
        values
    }

    /// Returns the values of corners by values of corners that are smooth, except at seams.
    ///
    /// - `id_of_corner`: the same number for corners of a point that share a value.
    pub(crate) fn by_corner<V: LinearValue>(
        &self,
        of_corner: impl Fn(usize) -> V,
        id_of_corner: impl Fn(usize) -> u32,
    ) -> Vec<V> {
        if self.scheme == Scheme::Bilinear || self.seams == SeamRule::AllLinear {
            return self.linear(of_corner);
        }
        let (topology, values) = self.seamed(of_corner, id_of_corner);
        let (topology, limits) = limit::limits(topology, self.scheme, &values);
        topology.tails.iter().map(|&vertex| limits[vertex as usize]).collect()
    }

    /// Returns the connectivity of values of corners in the finest mesh, and the values before they are moved to their limits.
    fn seamed<V: LinearValue>(
        &self,
        of_corner: impl Fn(usize) -> V,
        id_of_corner: impl Fn(usize) -> u32,
    ) -> (HalfEdges, Vec<V>) {
        let ids: Vec<u32> = self.faces.corner_sources.iter().map(|&corner| id_of_corner(corner as usize)).collect();
        let control = &self.steps[0].topology;
        let (mut topology, corners) = seams::topology(control, self.faces.starts.clone(), &ids, self.seams);
        let source = |&corner: &u32| of_corner(self.faces.corner_sources[corner as usize] as usize);
        let mut values: Vec<V> = corners.iter().map(source).collect();
        for _ in &self.steps {
            let step = RefinementStep::new(topology, self.scheme, self.has_smooth_triangles);
            values = step.refined(&values);
            topology = step.refined_topology();
        }
        (topology, values)
    }

    /// Returns the memory of the refined connectivity, in bytes.
    pub(crate) fn bytes(&self) -> usize {
        let topologies = self.steps.iter().map(|step| &step.topology).chain([self.limit.topology()]);
        topologies
            .map(|topology| topology.tails.len() * 8 + topology.edges.len() * 12 + topology.vertex_count * 20)
            .sum::<usize>()
            + self.limit.corner_vertices.len() * 4
    }
}
