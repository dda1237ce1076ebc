//! Implicit surfaces as meshes: cube, cylinder, cone, capsule and plane.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3, Vec2, Vec3};
use openusd::usd::Prim;

use super::source::StageSource;
use crate::model::Mesh;

/// The kinds of surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ShapeKind {
    Mesh,
    Sphere,
    Cube,
    Cylinder,
    Cone,
    Capsule,
    Plane,
}

impl ShapeKind {
    /// Returns the kind of a type of prims; `None`: it is not a surface.
    pub(super) fn of(type_name: &str) -> Option<Self> {
        Some(match type_name {
            "Mesh" => Self::Mesh,
            "Sphere" => Self::Sphere,
            "Cube" => Self::Cube,
            "Cylinder" | "Cylinder_1" => Self::Cylinder,
            "Cone" => Self::Cone,
            "Capsule" | "Capsule_1" => Self::Capsule,
            "Plane" => Self::Plane,
            _ => return None,
        })
    }
}

/// Columns around an axis.
const COLUMNS: u32 = 96;

/// Rows of half a ball.
const ROWS: u32 = 24;

/// A point of the profile of a solid of revolution: its distance from the axis and place along it, and the same of its
/// normal.
type ProfilePoint = (DVec2, DVec2);

/// Reads a surface; empty if it has no extent.
pub(super) fn read(source: &StageSource<'_>, prim: &Prim, kind: ShapeKind, time: f64) -> Option<Mesh> {
    let number = |name: &str, usual: f64| source.number(prim, name, time).unwrap_or(usual);
    let (height, radius) =
        (number("height", if kind == ShapeKind::Capsule { 1.0 } else { 2.0 }), number("radius", 1.0));
    let sizes = match kind {
        ShapeKind::Cube => vec![number("size", 2.0)],
        ShapeKind::Plane => vec![number("width", 2.0), number("length", 2.0)],
        ShapeKind::Capsule => vec![number("radius", 0.5), height],
        _ => vec![radius, height],
    };
    if !sizes.iter().all(|&size| size > 0.0 && size <= f64::from(f32::MAX)) {
        source.warn(prim.path().as_str(), format!("a surface of the size {sizes:?} is left out"));
        return None;
    }
    // The schemas with a number in their name have a radius for each end
    let ends = [number("radiusBottom", sizes[0]), number("radiusTop", sizes[0])].map(|radius| radius.max(0.0));
    let axis = source.text(prim, "axis", time);
    let axis = axis.as_deref().unwrap_or("Z");
    Some(match kind {
        ShapeKind::Cube => {
            let half = Vec3::splat(0.5 * sizes[0] as f32);
            Mesh::cuboid(-half, half)
        }
        ShapeKind::Plane => along(plane(sizes[0], sizes[1], axis), "Z"),
        ShapeKind::Cylinder => {
            along(revolved(&[&side(ends, height), &cap(ends[0], -0.5 * height), &cap(ends[1], 0.5 * height)]), axis)
        }
        ShapeKind::Cone => along(revolved(&[&side([radius, 0.0], height), &cap(radius, -0.5 * height)]), axis),
        _ => along(revolved(&[&capsule(ends, height)]), axis),
    })
}

/// Returns a rectangle in the plane across an axis, front towards it: the width is along x, or along z if the axis is x; the length
/// is along y, or along z if the axis is y.
fn plane(width: f64, length: f64, axis: &str) -> Mesh {
    let (u, v) = match axis {
        "X" => (DVec3::NEG_Z, DVec3::Y),
        "Y" => (DVec3::X, DVec3::NEG_Z),
        _ => (DVec3::X, DVec3::Y),
    };
    let (u, v) = ((u * width).as_vec3(), (v * length).as_vec3());
    Mesh::quad(-0.5 * (u + v), u, v)
}

/// Returns the side of a cylinder or cone, from the bottom up.
fn side([bottom, top]: [f64; 2], height: f64) -> Vec<ProfilePoint> {
    let normal = DVec2::new(height, bottom - top).normalize();
    vec![(DVec2::new(bottom, -0.5 * height), normal), (DVec2::new(top, 0.5 * height), normal)]
}

/// Returns the disk at an end: from the axis outwards below, inwards above.
fn cap(radius: f64, z: f64) -> Vec<ProfilePoint> {
    let normal = DVec2::Y * z.signum();
    let ends = [(DVec2::new(0.0, z), normal), (DVec2::new(radius, z), normal)];
    if z < 0.0 { ends.to_vec() } else { vec![ends[1], ends[0]] }
}

/// Returns a cylinder between two halves of balls.
fn capsule([bottom, top]: [f64; 2], height: f64) -> Vec<ProfilePoint> {
    let half = |radius: f64, z: f64, from: f64| {
        (0..=ROWS).map(move |row| {
            let (sin, cos) = (from + FRAC_PI_2 * f64::from(row) / f64::from(ROWS)).sin_cos();
            let cos = if cos.abs() < 1e-12 { 0.0 } else { cos };
            (DVec2::new(radius * cos, z + radius * sin), DVec2::new(cos, sin))
        })
    };
    half(bottom, -0.5 * height, -FRAC_PI_2).chain(half(top, 0.5 * height, 0.0)).collect()
}

/// Returns the surface of revolution of profiles around z, front outside. The polygons of its columns have the area of
/// circles.
fn revolved(profiles: &[&[ProfilePoint]]) -> Mesh {
    let turn = TAU / f64::from(COLUMNS);
    let widening = (turn / turn.sin()).sqrt();
    let mut mesh = Mesh::default();
    for profile in profiles {
        let first = mesh.positions.len() as u32;
        for (row, (point, normal)) in profile.iter().enumerate() {
            for column in 0..=COLUMNS {
                // The last column is the first one again, to the bit
                let (sin, cos) = (turn * f64::from(column % COLUMNS)).sin_cos();
                let around = |v: DVec2, widening: f64| DVec3::new(v.x * cos * widening, v.x * sin * widening, v.y);
                mesh.positions.push(around(*point, widening).as_vec3());
                mesh.normals.push(around(*normal, 1.0).as_vec3().normalize());
                let (u, v) = (f64::from(column) / f64::from(COLUMNS), row as f64 / (profile.len() - 1) as f64);
                mesh.uvs[0].push(Vec2::new(u as f32, 1.0 - v as f32));
            }
        }
        let vertex = |row: u32, column: u32| first + row * (COLUMNS + 1) + column;
        for row in 0..profile.len() as u32 - 1 {
            let is_pole = |row: u32| profile[row as usize].0.x == 0.0;
            for column in 0..COLUMNS {
                let [a, b] = [vertex(row, column), vertex(row + 1, column)];
                if !is_pole(row) {
                    mesh.triangles.push([a, a + 1, b]);
                }
                if !is_pole(row + 1) {
                    mesh.triangles.push([a + 1, b + 1, b]);
                }
            }
        }
    }
    mesh.triangles.retain(|triangle| {
        let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize].as_dvec3());
        (b - a).cross(c - a) != DVec3::ZERO
    });
    mesh
}

/// Turns a surface around z to one around another axis.
fn along(mut mesh: Mesh, axis: &str) -> Mesh {
    let turn: fn(Vec3) -> Vec3 = match axis {
        "X" => |v| Vec3::new(v.z, v.x, v.y),
        "Y" => |v| Vec3::new(v.y, v.z, v.x),
        _ => |v| v,
    };
    mesh.positions.iter_mut().chain(&mut mesh.normals).for_each(|v| *v = turn(*v));
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem, and area.
    fn measures(mesh: &Mesh) -> (f64, f64) {
        let corners = |triangle: &[u32; 3]| triangle.map(|vertex| mesh.positions[vertex as usize].as_dvec3());
        let volume = |[a, b, c]: [DVec3; 3]| a.dot(b.cross(c)) / 6.0;
        let area = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
        let triangles = || mesh.triangles.iter().map(corners);
        (triangles().map(volume).sum(), triangles().map(area).sum())
    }

    #[test]
    fn solids_have_their_volume_and_front_outside() {
        use std::f64::consts::PI;
        let height = 3.0;
        let cylinder = [side([0.5; 2], height), cap(0.5, -1.5), cap(0.5, 1.5)];
        let cone = [side([0.5, 0.0], height), cap(0.5, -1.5)];
        let capsule = [capsule([0.5; 2], height)];
        let profiles = |list: &[Vec<ProfilePoint>]| revolved(&list.iter().map(Vec::as_slice).collect::<Vec<_>>());
        for (mesh, volume) in [
            (profiles(&cylinder), PI * 0.25 * height),
            (profiles(&cone), PI * 0.25 * height / 3.0),
            (profiles(&capsule), PI * 0.25 * height + 4.0 / 3.0 * PI * 0.125),
        ] {
            let found = measures(&mesh).0;
            assert!((found / volume - 1.0).abs() < 2e-3, "{found} {volume}");
            for axis in ["X", "Y"] {
                assert!((measures(&along(mesh.clone(), axis)).0 - found).abs() < 1e-6);
            }
            for (triangle, normal) in
                mesh.triangles.iter().map(|triangle| (triangle, mesh.normals[triangle[0] as usize]))
            {
                assert!(mesh.cross(*triangle).dot(normal) > 0.0);
            }
        }
    }

    #[test]
    fn a_plane_faces_its_axis() {
        for (axis, normal) in [("X", Vec3::X), ("Y", Vec3::Y), ("Z", Vec3::Z)] {
            let mesh = plane(2.0, 4.0, axis);
            assert_eq!(mesh.cross(mesh.triangles[0]).normalize(), normal);
            let (min, max) = mesh.bounds();
            let extent = max - min;
            let expected = match axis {
                "X" => Vec3::new(0.0, 4.0, 2.0),
                "Y" => Vec3::new(2.0, 0.0, 4.0),
                _ => Vec3::new(2.0, 4.0, 0.0),
            };
            assert_eq!(extent, expected, "{axis}");
        }
    }
}
