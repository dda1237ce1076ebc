//! Validation of the input, and affine maps that compute bit-identically everywhere.

use crate::geometry::{BuildError, InstanceGeometry, MeshGeometry, SphereGeometry};
use crate::{Aabb, Hit};
use glam::{Affine3A, Vec3};

/// An affine map by rows: linear part and translation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Affine {
    /// `[row][column]`; column 3 is the translation.
    pub(crate) rows: [[f32; 4]; 3],
}

impl Affine {
    /// Converts an affine map of glam.
    pub(crate) fn new(map: &Affine3A) -> Self {
        let m = map.matrix3;
        let row = |i: usize| [m.x_axis[i], m.y_axis[i], m.z_axis[i], map.translation[i]];
        Self { rows: [row(0), row(1), row(2)] }
    }

    /// Transforms a point.
    pub(crate) fn point(&self, p: [f32; 3]) -> [f32; 3] {
        self.rows.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3])
    }

    fn is_finite(&self) -> bool {
        self.rows.iter().flatten().all(|x| x.is_finite())
    }

    /// Returns the inverse, computed in double precision; `None` if it is singular or beyond the range of floats.
    pub(crate) fn inverse(&self) -> Option<Self> {
        let r = self.rows.map(|r| r.map(f64::from));
        let minor = |a: usize, b: usize, c: usize, d: usize| r[a][c] * r[b][d] - r[a][d] * r[b][c];
        let cofactors = [
            [minor(1, 2, 1, 2), -minor(0, 2, 1, 2), minor(0, 1, 1, 2)],
            [-minor(1, 2, 0, 2), minor(0, 2, 0, 2), -minor(0, 1, 0, 2)],
            [minor(1, 2, 0, 1), -minor(0, 2, 0, 1), minor(0, 1, 0, 1)],
        ];
        let determinant = r[0][0] * cofactors[0][0] + r[0][1] * cofactors[1][0] + r[0][2] * cofactors[2][0];
        let norm = |axis: usize| r.iter().map(|row| row[axis] * row[axis]).sum::<f64>().sqrt();
        // Reject maps that flatten to less than a millionth: the rounding of the inverse becomes visible.
        let flat = 1e-6 * norm(0) * norm(1) * norm(2);
        if determinant.is_nan() || determinant.abs() <= flat {
            return None;
        }
        let linear = cofactors.map(|row| row.map(|x| x / determinant));
        let rows = linear.map(|row| {
            let moved = -(row[0] * r[0][3] + row[1] * r[1][3] + row[2] * r[2][3]);
            [row[0] as f32, row[1] as f32, row[2] as f32, moved as f32]
        });
        Some(Self { rows }).filter(Self::is_finite)
    }

    /// Returns a box around the image of a box, with a margin for the rounding of rays that are mapped back.
    pub(crate) fn bounds(&self, object: &Aabb) -> Aabb {
        let mut out = Aabb::EMPTY;
        for corner in 0..8 {
            let pick = |axis: usize| if corner >> axis & 1 == 1 { object.max[axis] } else { object.min[axis] };
            out = out.with(Vec3::from(self.point([pick(0), pick(1), pick(2)])));
        }
        let room = (out.min.abs().max(out.max.abs()) + (out.max - out.min)) * (16.0 * f32::EPSILON);
        Aabb { min: out.min - room, max: out.max + room }
    }
}

/// Checks that a tree can be built.
pub(crate) fn validate(
    meshes: &[MeshGeometry<'_>],
    instances: &[InstanceGeometry],
    spheres: &[SphereGeometry],
) -> Result<(), BuildError> {
    for (mesh, geometry) in meshes.iter().enumerate() {
        if let Some(vertex) = geometry.positions.iter().position(|p| !p.is_finite()) {
            return Err(BuildError::PositionNotFinite { mesh, vertex });
        }
        let vertices = geometry.positions.len();
        let bad = |t: &[u32; 3]| t.iter().copied().find(|&i| i as usize >= vertices);
        if let Some((triangle, vertex)) = geometry.triangles.iter().enumerate().find_map(|(i, t)| Some((i, bad(t)?))) {
            return Err(BuildError::IndexOutOfRange { mesh, triangle, vertex, vertices });
        }
        let (count, limit) = (geometry.triangles.len(), u32::MAX as usize - 1);
        if count > limit {
            return Err(BuildError::TooMany { what: "triangles", count, limit });
        }
    }
    let limit = Hit::SPHERE as usize - 1;
    for (what, count) in [("instances", instances.len()), ("spheres", spheres.len())] {
        if count > limit {
            return Err(BuildError::TooMany { what, count, limit });
        }
    }
    for (instance, i) in instances.iter().enumerate() {
        if i.mesh as usize >= meshes.len() {
            return Err(BuildError::NoSuchMesh { instance, mesh: i.mesh, meshes: meshes.len() });
        }
        if !Affine::new(&i.world_from_object).is_finite() {
            return Err(BuildError::TransformNotFinite { instance });
        }
    }
    let good = |s: &SphereGeometry| {
        let bounds = Aabb::around(s.center, s.radius);
        s.radius >= 0.0 && bounds.min.is_finite() && bounds.max.is_finite()
    };
    match spheres.iter().position(|s| !good(s)) {
        Some(sphere) => Err(BuildError::BadSphere { sphere }),
        None => Ok(()),
    }
}
