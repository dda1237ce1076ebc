//! Shapes, in their object space.
//!
//! Fronts follow pbrt: the front of a triangle is the side of its vertex normals if it has any, else the side from
//! which it is counter-clockwise; that of a quadric is outside. `ReverseOrientation` flips them. (For mirroring
//! transformations, pbrt flips quadrics in ray intersection but not in light sampling. Here they face outwards.)

mod curve;
pub(super) mod geometry;
mod patch;
mod quadric;
mod subdivision;
mod triangles;

use geometry::Geometry;
use glam::Vec3;

use super::context::Context;
use super::world::Entity;
use crate::import::text_place::ImportResult;
use crate::model::Mesh;
use crate::text::shortened;

/// Reads the parameters of a shape. `None`: it is left out, with a warning.
///
/// - `shines`: it is an area light.
pub(super) fn read(context: &mut Context<'_>, entity: &Entity, shines: bool) -> ImportResult<Option<Geometry>> {
    let (params, at) = (&entity.params, entity.at);
    Ok(Some(match entity.kind.as_str() {
        "plymesh" => {
            let reference = params.text("filename")?.ok_or_else(|| at.fault("`plymesh` needs a `filename`"))?;
            let place = context.place(params.place_of("filename"));
            let location = context.resources.locate(reference, &place)?;
            Geometry::Ply(location)
        }
        "trianglemesh" => triangles::read(context, params, at)?,
        "bilinearmesh" => patch::read(context, params, at)?,
        "loopsubdiv" => subdivision::read(context, params, at)?,
        "curve" => return curve::read(context, params, at, shines),
        "sphere" => quadric::sphere(params, at)?,
        "disk" => quadric::disk(params, at)?,
        "cylinder" => quadric::cylinder(params, at)?,
        kind => {
            context.unsupported(at, format!("the shape \"{}\" is unknown and left out", shortened(kind)));
            return Ok(None);
        }
    }))
}

/// Returns the whole sphere as triangles, for transformations that do not keep it a sphere.
pub(super) fn sphere_mesh(radius: f64) -> Mesh {
    quadric::sphere_mesh(radius, -radius, radius, 360.0)
}

impl Mesh {
    /// Orients every triangle to the side of its vertex normals.
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
        let keys = self.motion.iter_mut().flat_map(|key| &mut key.normals);
        self.normals.iter_mut().chain(keys).for_each(|normal| *normal = -*normal);
    }
}
