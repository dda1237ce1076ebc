//! Shapes, in their object space.
//!
//! Fronts follow pbrt: a triangle's is the side of its vertex normals where it has any, else the one from which it runs
//! counter-clockwise; that of a quadric is outside. `ReverseOrientation` turns them over. (pbrt turns the quadrics of
//! mirroring transformations over when a ray finds them, and not when it samples them as lights. They face outwards here.)

mod curve;
mod patch;
mod quadric;
mod subdivision;
mod triangles;

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::context::{Context, Outcome};
use super::token::{Fault, Place};
use super::world::Entity;
use crate::resource::Location;
use crate::text::shortened;
use crate::{COORDINATE_MAX, Mesh};

/// The shape of a shape.
#[derive(Debug)]
pub(super) enum Geometry {
    /// Triangles, and how many primitives pbrt makes of them: each of these has the power of a light for itself.
    Mesh { mesh: Box<Mesh>, primitive_count: usize },
    /// Triangles in a file that is not read yet.
    Ply(Location),
    /// A whole sphere around the origin, whose pole is +z.
    Sphere { radius: f64 },
}

/// Reads the parameters of a shape. `None`: it is left out, which was told.
pub(super) fn read(context: &mut Context<'_>, entity: &Entity) -> Outcome<Option<Geometry>> {
    let (params, at) = (&entity.params, entity.at);
    Ok(Some(match entity.kind.as_str() {
        "plymesh" => {
            let reference = params.text("filename")?.ok_or_else(|| at.fault("`plymesh` needs a `filename`"))?;
            let place = context.place(params.place_of("filename"));
            let location = context.resources.locate(reference, &place)?;
            if params.texture("displacement")?.is_some() {
                context.unsupported(params.place_of("displacement"), "the mesh is not displaced");
                params.ignore(&["edgelength"]);
            }
            Geometry::Ply(location)
        }
        "trianglemesh" => triangles::read(context, params, at)?,
        "bilinearmesh" => patch::read(context, params, at)?,
        "loopsubdiv" => subdivision::read(context, params, at)?,
        "curve" => return curve::read(context, params, at),
        "sphere" => quadric::sphere(params, at)?,
        "disk" => quadric::disk(params, at)?,
        "cylinder" => quadric::cylinder(params, at)?,
        kind => {
            context.unsupported(at, format!("the shape \"{}\" is not known, and left out", shortened(kind)));
            return Ok(None);
        }
    }))
}

/// The whole sphere as triangles, for transformations that make no sphere of it.
pub(super) fn sphere_mesh(radius: f64) -> Mesh {
    quadric::sphere_mesh(radius, -radius, radius, 360.0)
}

/// Positions in single precision, within reach.
fn positions(points: &[DVec3], at: Place) -> Result<Vec<Vec3>, Fault> {
    if points.iter().any(|point| point.abs().max_element() > f64::from(COORDINATE_MAX)) {
        return Err(at.fault(format!("a coordinate is beyond {COORDINATE_MAX:e}")));
    }
    Ok(points.iter().map(|point| point.as_vec3()).collect())
}

/// Texture coordinates as we have them: v grows downwards.
fn texture_coordinate(uv: DVec2) -> Vec2 {
    let uv = Vec2::new(uv.x as f32, (1.0 - uv.y) as f32);
    if uv.is_finite() { uv } else { Vec2::ZERO }
}

/// Indices of vertices, of which there are `count`.
fn indices(numbers: &[f64], count: usize, at: Place) -> Result<Vec<u32>, Fault> {
    let index = |&number: &f64| {
        if number >= 0.0 && number < count as f64 {
            Ok(number as u32)
        } else {
            Err(at.fault(format!("there is no vertex {number}; there are {count}, counted from 0")))
        }
    };
    numbers.iter().map(index).collect()
}

/// Takes what `list` holds if it has as many elements as there are vertices, and says so if not.
fn matching<T>(context: &mut Context<'_>, list: Option<Vec<T>>, name: &str, count: usize, at: Place) -> Vec<T> {
    let list = list.unwrap_or_default();
    if list.is_empty() || list.len() == count {
        return list;
    }
    context.warn(at, format!("`{name}` has {} elements for {count} vertices, and is left out", list.len()));
    Vec::new()
}

impl Mesh {
    /// Turns every triangle to the side of its vertex normals.
    pub(super) fn face_normals(&mut self) {
        if self.normals.is_empty() {
            return;
        }
        for index in 0..self.triangles.len() {
            let triangle = self.triangles[index];
            let side = triangle.iter().map(|&vertex| self.normals[vertex as usize]).sum::<Vec3>();
            if self.cross(triangle).dot(side) < 0.0 {
                self.triangles[index].swap(1, 2);
            }
        }
    }

    /// Turns the mesh inside out.
    pub(super) fn turn_over(&mut self) {
        self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        self.normals.iter_mut().for_each(|normal| *normal = -*normal);
    }
}
