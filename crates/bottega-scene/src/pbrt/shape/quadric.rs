//! The shapes `sphere`, `disk` and `cylinder`.
//!
//! A whole sphere stays analytic; parts of it, disks and cylinders become triangles with the normals of the true
//! surface. Their corners are moved outwards slightly to keep the area; the edge is then off by at most 4·10⁻⁵ (disk),
//! 2·10⁻⁴ (cylinder) and 4·10⁻⁴ (sphere) of the radius.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::super::params::Params;
use super::geometry::{Geometry, texture_coordinate};
use crate::import::text_place::{TextFault, TextPlace};
use crate::model::{COORDINATE_MAX, Mesh};

/// Corners of a full circle.
const DISK_STEPS: u32 = 256;
const CYLINDER_STEPS: u32 = 128;
const SPHERE_STEPS: u32 = 128;

/// Reads a `sphere`.
pub(super) fn sphere(params: &Params, at: TextPlace) -> Result<Geometry, TextFault> {
    let radius = length(params, "radius", at)?;
    let z_min = params.float("zmin")?.unwrap_or(-radius);
    let z_max = params.float("zmax")?.unwrap_or(radius);
    let phi_max = angle(params)?;
    if z_min.min(z_max) <= -radius && z_max.max(z_min) >= radius && phi_max >= 360.0 {
        return Ok(Geometry::Sphere { radius });
    }
    let (z_min, z_max) = (z_min.min(z_max).clamp(-radius, radius), z_max.max(z_min).clamp(-radius, radius));
    if z_min >= z_max {
        return Err(at.fault("the sphere is cut away by `zmin` and `zmax`"));
    }
    Ok(single(sphere_mesh(radius, z_min, z_max, phi_max)))
}

/// Tessellates a sphere between z = `z_min` and `z_max`, up to `phi_max` degrees around.
pub(super) fn sphere_mesh(radius: f64, z_min: f64, z_max: f64, phi_max: f64) -> Mesh {
    let (theta_min, theta_max) = ((z_min / radius).clamp(-1.0, 1.0).acos(), (z_max / radius).clamp(-1.0, 1.0).acos());
    let columns = steps(SPHERE_STEPS, phi_max);
    let rows = (f64::from(SPHERE_STEPS) / TAU * (theta_min - theta_max)).ceil().max(1.0) as u32;
    grid("sphere", columns, rows, |uv| {
        let (sin_phi, cos_phi) = (uv.x * phi_max.to_radians()).sin_cos();
        let (sin_theta, cos_theta) = (theta_min + (theta_max - theta_min) * uv.y).sin_cos();
        let normal = DVec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta);
        // Chords in both directions have about the same length.
        (normal * radius * equal_area(columns, phi_max), normal)
    })
}

/// Reads a `disk`.
pub(super) fn disk(params: &Params, at: TextPlace) -> Result<Geometry, TextFault> {
    let radius = length(params, "radius", at)?;
    let height = params.float("height")?.unwrap_or(0.0);
    let inner = params.float("innerradius")?.unwrap_or(0.0);
    let phi_max = angle(params)?;
    if !(inner >= 0.0 && inner < radius && height.abs() < f64::from(COORDINATE_MAX)) {
        return Err(at.fault("the disk has no area: its inner radius must be from 0 to its radius"));
    }
    let columns = steps(DISK_STEPS, phi_max);
    let scale = equal_area(columns, phi_max);
    Ok(single(grid("disk", columns, 1, |uv| {
        let (sin, cos) = (uv.x * phi_max.to_radians()).sin_cos();
        let r = (radius + (inner - radius) * uv.y) * scale;
        (DVec3::new(r * cos, r * sin, height), DVec3::Z)
    })))
}

/// Reads a `cylinder`.
pub(super) fn cylinder(params: &Params, at: TextPlace) -> Result<Geometry, TextFault> {
    let radius = length(params, "radius", at)?;
    let (z0, z1) = (params.float("zmin")?.unwrap_or(-1.0), params.float("zmax")?.unwrap_or(1.0));
    let (z_min, z_max) = (z0.min(z1), z0.max(z1));
    let phi_max = angle(params)?;
    if !(z_min < z_max && z_max < f64::from(COORDINATE_MAX) && z_min > -f64::from(COORDINATE_MAX)) {
        return Err(at.fault("the cylinder has no height"));
    }
    let columns = steps(CYLINDER_STEPS, phi_max);
    // Keep the perimeter, which determines the lateral area.
    let half_step = 0.5 * phi_max.to_radians() / f64::from(columns);
    let scale = half_step / half_step.sin();
    Ok(single(grid("cylinder", columns, 1, |uv| {
        let (sin, cos) = (uv.x * phi_max.to_radians()).sin_cos();
        let normal = DVec3::new(cos, sin, 0.0);
        (normal * radius * scale + DVec3::Z * (z_min + (z_max - z_min) * uv.y), normal)
    })))
}

fn single(mesh: Mesh) -> Geometry {
    Geometry::Mesh { mesh: Box::new(mesh), primitive_count: 1 }
}

fn length(params: &Params, name: &str, at: TextPlace) -> Result<f64, TextFault> {
    let length = params.float(name)?.unwrap_or(1.0);
    if length > 0.0 && length < f64::from(COORDINATE_MAX) && (length as f32).is_normal() {
        Ok(length)
    } else {
        Err(at.fault(format!("`{name}` must be above 0, and not out of reach")))
    }
}

/// Reads `phimax`, in degrees.
fn angle(params: &Params) -> Result<f64, TextFault> {
    let degrees = params.float("phimax")?.unwrap_or(360.0);
    let is_sound = degrees.abs() > 0.0;
    if is_sound {
        Ok(degrees.clamp(0.0, 360.0).max(1e-3))
    } else {
        Err(params.place_of("phimax").fault("`phimax` is 0"))
    }
}

fn steps(whole: u32, phi_max: f64) -> u32 {
    ((f64::from(whole) * phi_max / 360.0).ceil() as u32).max(1)
}

/// Returns the factor of a polygon's radius that gives it the area of the circle.
fn equal_area(steps: u32, phi_max: f64) -> f64 {
    let step = phi_max.to_radians() / f64::from(steps);
    (step / step.sin()).sqrt()
}

/// Tessellates a parametric surface over the unit square; `at` returns position and unit normal.
fn grid(name: &str, columns: u32, rows: u32, at: impl Fn(DVec2) -> (DVec3, DVec3)) -> Mesh {
    let mut mesh = Mesh { name: name.into(), ..Mesh::default() };
    for row in 0..=rows {
        for column in 0..=columns {
            let uv = DVec2::new(f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
            let (position, normal) = at(uv);
            mesh.positions.push(position.as_vec3());
            mesh.normals.push(normal.as_vec3().normalize());
            mesh.uvs[0].push(texture_coordinate(uv));
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let a = row * (columns + 1) + column;
            let b = a + columns + 1;
            let triangles = [[a, a + 1, b + 1], [a, b + 1, b]];
            // At a pole, or the centre of a disk, one of them has no area.
            mesh.triangles.extend(triangles.into_iter().filter(|&triangle| {
                let [p, q, r] = triangle.map(|vertex: u32| mesh.positions[vertex as usize]);
                (q - p).cross(r - p).length_squared() > 0.0
            }));
        }
    }
    mesh.face_normals();
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(mesh: &Mesh) -> f64 {
        mesh.triangles.iter().map(|&triangle| 0.5 * f64::from(mesh.cross(triangle).length())).sum()
    }

    fn read(kind: fn(&Params, TextPlace) -> Result<Geometry, TextFault>, text: &str) -> Result<Mesh, TextFault> {
        let mut tokens = super::super::super::token::Tokens::new(0, text);
        let params = Params::read(&mut tokens, TextPlace::default(), Default::default())?;
        match kind(&params, TextPlace::default())? {
            Geometry::Mesh { mesh, .. } => Ok(*mesh),
            _ => panic!("no mesh"),
        }
    }

    #[test]
    fn the_area_is_that_of_the_true_surface_and_fronts_are_outside() {
        let pi = std::f64::consts::PI;
        let disk = read(disk, r#""float radius" 2 "float innerradius" 1 "float height" 3"#).unwrap();
        assert!((area(&disk) / (3.0 * pi) - 1.0).abs() < 1e-5);
        assert!(disk.triangles.iter().all(|&t| disk.cross(t).z > 0.0) && disk.positions[0].z == 3.0);
        let cylinder = read(cylinder, r#""float radius" 0.5 "float zmax" 3"#).unwrap();
        assert!((area(&cylinder) / (4.0 * pi) - 1.0).abs() < 1e-5);
        let cap = read(sphere, r#""float radius" 2 "float zmin" 0"#).unwrap();
        assert!((area(&cap) / (8.0 * pi) - 1.0).abs() < 5e-4, "{}", area(&cap) / (8.0 * pi));
        for mesh in [&cylinder, &cap] {
            for &triangle in &mesh.triangles {
                let outward = mesh.normals[triangle[0] as usize];
                assert!(mesh.cross(triangle).dot(outward) > 0.0);
            }
        }
        let wedge = read(super::disk, r#""float phimax" 90"#).unwrap();
        assert!((area(&wedge) / (0.25 * pi) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn empty_quadrics_are_faults() {
        for bad in [r#""float radius" 0"#, r#""float radius" -1"#, r#""float innerradius" 1"#, r#""float phimax" 0"#] {
            assert!(read(disk, bad).is_err(), "{bad}");
        }
        assert!(read(cylinder, r#""float zmax" -1"#).is_err());
        assert!(read(sphere, r#""float zmin" 2 "float zmax" 3"#).is_err());
    }
}
