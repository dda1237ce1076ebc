//! The vertices of a PLY file, filled in place by several threads.

use glam::{Vec2, Vec3, Vec4};

use super::super::source::MeshSource;
use super::header::{Element, NumberKind};
use super::role::Role;
use crate::error::SceneError;
use crate::image::linear_of_srgb;
use crate::model::{COORDINATE_MAX, Mesh};

/// A range of the vertices. Absent attributes are empty.
pub(super) struct Slices<'a> {
    pub(super) positions: &'a mut [Vec3],
    normals: &'a mut [Vec3],
    uvs: &'a mut [Vec2],
    colors: &'a mut [Vec4],
}

/// Allocates the vertices of an element, with the attributes that are complete.
pub(super) fn allocate(source: MeshSource<'_>, element: &Element) -> Result<Mesh, SceneError> {
    let roles = element.roles();
    let count = element.count;
    let has = |part: &[Role]| part.iter().all(|role| roles.contains(&Some(*role)));
    let mut mesh = Mesh { positions: source.zeroed(count)?, ..Mesh::default() };
    if has(&[Role::Normal(0), Role::Normal(1), Role::Normal(2)]) {
        mesh.normals = source.zeroed(count)?;
    }
    if has(&[Role::Uv(0), Role::Uv(1)]) {
        mesh.uvs[0] = source.zeroed(count)?;
    }
    if has(&[Role::Color(0), Role::Color(1), Role::Color(2)]) {
        mesh.colors = source.zeroed(count)?;
    }
    Ok(mesh)
}

impl<'a> Slices<'a> {
    /// Returns all vertices of a mesh.
    pub(super) fn of(mesh: &'a mut Mesh) -> Self {
        let Mesh { positions, normals, uvs: [uvs, _], colors, .. } = mesh;
        Self { positions, normals, uvs, colors }
    }

    /// Splits off the first vertices.
    fn take(&mut self, count: usize) -> Self {
        Self {
            positions: take(&mut self.positions, count),
            normals: take(&mut self.normals, count),
            uvs: take(&mut self.uvs, count),
            colors: take(&mut self.colors, count),
        }
    }

    /// Splits into ranges of the given numbers of vertices.
    pub(super) fn split(mut self, counts: impl Iterator<Item = usize>) -> Vec<Self> {
        counts.map(|count| self.take(count)).collect()
    }

    /// Fills one component of all vertices of the range.
    pub(super) fn fill(&mut self, role: Role, kind: NumberKind, values: impl Iterator<Item = f64>) {
        match role {
            Role::Position(axis) => fill(bytemuck::cast_slice_mut(self.positions), 3, axis, values),
            Role::Normal(axis) => fill(bytemuck::cast_slice_mut(self.normals), 3, axis, values),
            Role::Uv(axis) => fill(bytemuck::cast_slice_mut(self.uvs), 2, axis, values),
            Role::Color(channel) => {
                let color = values.map(|value| color(value, kind, channel));
                fill(bytemuck::cast_slice_mut(self.colors), 4, channel, color);
            }
        }
    }

    /// Sets one component of one vertex.
    pub(super) fn set(&mut self, vertex: usize, role: Role, kind: NumberKind, value: f64) {
        let one = vertex..vertex + 1;
        let mut slices = Slices {
            positions: &mut self.positions[one.clone()],
            normals: self.normals.get_mut(one.clone()).unwrap_or_default(),
            uvs: self.uvs.get_mut(one.clone()).unwrap_or_default(),
            colors: self.colors.get_mut(one).unwrap_or_default(),
        };
        slices.fill(role, kind, std::iter::once(value));
    }

    /// Sets alpha to 1 if the file has none. The error is the first vertex without a valid position.
    pub(super) fn complete(&mut self, has_alpha: bool) -> Result<(), usize> {
        if !has_alpha {
            self.colors.iter_mut().for_each(|color| color.w = 1.0);
        }
        // A comparison with NaN is false.
        let is_sound =
            |p: &Vec3| p.x.abs() <= COORDINATE_MAX && p.y.abs() <= COORDINATE_MAX && p.z.abs() <= COORDINATE_MAX;
        self.positions.iter().position(|p| !is_sound(p)).map_or(Ok(()), Err)
    }
}

/// The error about a vertex that [`Slices::complete`] finds.
pub(super) const UNSOUND: &str = "the position is not a number, or out of reach";

fn take<'a, T>(slice: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let (first, rest) = std::mem::take(slice).split_at_mut_checked(count).unwrap_or_default();
    *slice = rest;
    first
}

fn fill(to: &mut [f32], width: usize, component: usize, values: impl Iterator<Item = f64>) {
    for (to, value) in to.chunks_exact_mut(width).zip(values) {
        to[component] = value as f32;
    }
}

/// Converts a colour value of the file to linear.
pub(super) fn color(value: f64, kind: NumberKind, channel: usize) -> f64 {
    let value = value / kind.color_max();
    if kind.is_integer() && channel < 3 { linear_of_srgb(value.clamp(0.0, 1.0)) } else { value }
}
