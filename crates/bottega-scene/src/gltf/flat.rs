//! Meshes flattened by their transformation: exporters scale by 0 along an axis for decals and shadows.
//!
//! An instance cannot be singular, so such a mesh is transformed to world space.

use glam::{DAffine3, DVec3, Vec3};

use crate::model::{COORDINATE_MAX, Mesh};

/// The error that a vertex is beyond [`COORDINATE_MAX`].
#[derive(Debug, PartialEq)]
pub(super) struct OutOfReach;

/// Heights below this share of the longest edge count as 0.
const HEIGHT_MIN: f64 = 1e-6;

/// Returns the flattened mesh in world space; `None`: nothing of it has an area.
pub(super) fn flattened(mesh: &Mesh, world_from_object: &DAffine3) -> Result<Option<Mesh>, OutOfReach> {
    let positions = mesh.positions.iter().map(|p| world_from_object.transform_point3(p.as_dvec3()).as_vec3());
    let mut flat = Mesh { positions: positions.collect(), ..mesh.clone() };
    let is_in_reach = |p: &Vec3| p.is_finite() && p.abs().max_element() <= COORDINATE_MAX;
    if !flat.positions.iter().all(is_in_reach) {
        return Err(OutOfReach);
    }
    let positions = &flat.positions;
    flat.triangles.retain(|triangle| {
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize].as_dvec3());
        let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
        let double_area = (b - a).cross(c - a).length();
        // Drop triangles whose area is 0 in single precision: no ray hits them.
        (double_area as f32).is_normal() && double_area > HEIGHT_MIN * longest
    });
    if flat.triangles.is_empty() {
        return Ok(None);
    }
    if flat.tangents.is_empty() {
        // A flat surface uses the normals of its triangles.
        flat.normals = Vec::new();
        return Ok(Some(flat));
    }
    for tangent in &mut flat.tangents {
        let direction: DVec3 = world_from_object.transform_vector3(tangent.truncate().as_dvec3());
        *tangent = direction.try_normalize().unwrap_or(DVec3::ZERO).as_vec3().extend(tangent.w);
    }
    let mut flat = flat.unshared();
    let normal = |&triangle: &[u32; 3]| flat.cross(triangle).as_dvec3().normalize_or_zero().as_vec3();
    flat.normals = flat.triangles.iter().flat_map(|triangle| [normal(triangle); 3]).collect();
    flat.mend_normals();
    flat.mend_tangents();
    Ok(Some(flat))
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DQuat, Vec4};

    use super::*;

    /// Two triangles in the plane z = 1, and one that stands on it.
    fn mesh() -> Mesh {
        let mut mesh = Mesh::quad(Vec3::Z, Vec3::X, Vec3::Y);
        mesh.positions.push(Vec3::Z * 2.0);
        mesh.triangles.push([0, 1, 4]);
        mesh.normals = vec![Vec3::ONE.normalize(); 5];
        mesh.uvs = Default::default();
        mesh
    }

    #[test]
    fn triangles_that_lost_their_area_are_left_out() {
        let turn = DMat3::from_quat(DQuat::from_rotation_x(0.7) * DQuat::from_rotation_y(0.3));
        for matrix in [DMat3::IDENTITY, turn] {
            let flat = DAffine3::from_mat3(matrix * DMat3::from_diagonal(DVec3::new(2.0, 1.0, 0.0)));
            let flattened = flattened(&mesh(), &flat).unwrap().unwrap();
            assert_eq!((flattened.triangles.len(), flattened.normals.len()), (2, 0));
            let area: f32 = flattened.triangles.iter().map(|&triangle| flattened.cross(triangle).length() / 2.0).sum();
            assert!((area - 2.0).abs() < 1e-5, "{area}");
        }
        // From the side, nothing but the one that stands.
        let side = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
        assert_eq!(flattened(&mesh(), &side).unwrap().unwrap().triangles, vec![[0, 1, 4]]);
        let line = DAffine3::from_scale(DVec3::new(0.0, 0.0, 1.0));
        assert_eq!(flattened(&mesh(), &line), Ok(None));
        let far = DAffine3::from_scale(DVec3::new(1e30, 1.0, 0.0));
        assert_eq!(flattened(&mesh(), &far), Err(OutOfReach));
    }

    #[test]
    fn directions_are_those_of_the_plane() {
        let tangents = [Vec4::new(1.0, 0.0, 1.0, -1.0).normalize(); 5];
        let mesh =
            Mesh { tangents: tangents.iter().map(|t| t.truncate().normalize().extend(-1.0)).collect(), ..mesh() };
        let flat = flattened(&mesh, &DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0))).unwrap().unwrap();
        assert_eq!(flat.normals, vec![Vec3::Z; 6]);
        assert!(flat.tangents.iter().all(|&tangent| tangent == Vec4::new(1.0, 0.0, 0.0, -1.0)), "{:?}", flat.tangents);
    }
}
