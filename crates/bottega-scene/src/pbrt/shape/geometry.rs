//! The geometry of a shape, and validation of its vertices.

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::super::context::Context;
use crate::import::text_place::{TextFault, TextPlace};
use crate::model::{COORDINATE_MAX, Mesh};
use crate::resource::Location;

/// The geometry of a shape.
#[derive(Debug)]
pub(in super::super) enum Geometry {
    /// Triangles, and the number of pbrt primitives: each of these gets the full power of an area light.
    Mesh { mesh: Box<Mesh>, primitive_count: usize },
    /// Triangles in a file that is not yet read.
    Ply(Location),
    /// A whole sphere around the origin, with pole +z.
    Sphere { radius: f64 },
}

/// Converts positions to single precision and checks their range.
pub(super) fn positions(points: &[DVec3], at: TextPlace) -> Result<Vec<Vec3>, TextFault> {
    if points.iter().any(|point| point.abs().max_element() > f64::from(COORDINATE_MAX)) {
        return Err(at.fault(format!("a coordinate is beyond {COORDINATE_MAX:e}")));
    }
    Ok(points.iter().map(|point| point.as_vec3()).collect())
}

/// Converts texture coordinates: v grows downwards.
pub(super) fn texture_coordinate(uv: DVec2) -> Vec2 {
    let uv = Vec2::new(uv.x as f32, (1.0 - uv.y) as f32);
    if uv.is_finite() { uv } else { Vec2::ZERO }
}

/// Converts and checks indices of `count` vertices.
pub(super) fn indices(numbers: &[f64], count: usize, at: TextPlace) -> Result<Vec<u32>, TextFault> {
    let index = |&number: &f64| {
        if number >= 0.0 && number < count as f64 {
            Ok(number as u32)
        } else {
            Err(at.fault(format!("there is no vertex {number}; there are {count}, counted from 0")))
        }
    };
    numbers.iter().map(index).collect()
}

/// Returns `list` if it has one element per vertex; otherwise warns and drops it.
pub(super) fn matching<T>(
    context: &mut Context<'_>,
    list: Option<Vec<T>>,
    name: &str,
    count: usize,
    at: TextPlace,
) -> Vec<T> {
    let list = list.unwrap_or_default();
    if list.is_empty() || list.len() == count {
        return list;
    }
    context.warn(at, format!("`{name}` has {} elements for {count} vertices, and is left out", list.len()));
    Vec::new()
}
