//! Blocks of numbers in a saved scene.

use std::io::{self, Write};
use std::path::Path;

use bytemuck::{Pod, Zeroable};
use glam::{Affine3A, Quat, Vec3};

use crate::budget::MemoryBudget;
use crate::error::SceneError;
use crate::facing_curves::CurvePoint;
use crate::model::{Instance, Sphere};
use crate::visibility::Visibility;

const _: () =
    assert!(cfg!(target_endian = "little"), "blocks are copied as they are in memory, which must be little-endian");

/// Writes an array as a block of bytes.
pub(super) fn put<T: Pod>(out: &mut dyn Write, values: &[T]) -> io::Result<()> {
    out.write_all(bytemuck::cast_slice(values))
}

/// The blocks of a file that are not read yet.
pub(super) struct Blocks<'a> {
    path: &'a Path,
    rest: &'a [u8],
    budget: &'a MemoryBudget,
}

impl<'a> Blocks<'a> {
    pub(super) fn new(path: &'a Path, rest: &'a [u8], budget: &'a MemoryBudget) -> Self {
        Self { path, rest, budget }
    }

    /// Reads an array. `place`: what it belongs to, such as `meshes[3]`.
    pub(super) fn take<T: Pod>(&mut self, place: &str, count: u64) -> Result<Vec<T>, SceneError> {
        let bytes = usize::try_from(count).ok().and_then(|count| count.checked_mul(size_of::<T>()));
        let Some((block, rest)) = bytes.and_then(|bytes| self.rest.split_at_checked(bytes)) else {
            let problem =
                format!("{place} has {count} values, and only {} bytes are left of the file", self.rest.len());
            return Err(self.damaged(problem));
        };
        self.budget.take(self.path, place, block.len())?;
        self.rest = rest;
        let mut values = vec![T::zeroed(); count as usize];
        bytemuck::cast_slice_mut(&mut values).copy_from_slice(block);
        Ok(values)
    }

    /// Reads an array that may be left out, which is then empty.
    pub(super) fn take_if<T: Pod>(&mut self, is_there: bool, place: &str, count: u64) -> Result<Vec<T>, SceneError> {
        if is_there { self.take(place, count) } else { Ok(Vec::new()) }
    }

    /// Checks that nothing is left.
    pub(super) fn end(&self) -> Result<(), SceneError> {
        if self.rest.is_empty() {
            return Ok(());
        }
        Err(self.damaged(format!("{} bytes follow after its last block", self.rest.len())))
    }

    pub(super) fn damaged(&self, problem: String) -> SceneError {
        SceneError::Damaged { path: self.path.into(), problem }
    }
}

/// An [`Instance`] in a file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct InstanceRecord {
    mesh: u32,
    /// [`NO_MATERIAL`]: that of the mesh.
    material: u32,
    visibility: u32,
    /// Column by column.
    world_from_object: [f32; 12],
}

const NO_MATERIAL: u32 = u32::MAX;

impl From<&Instance> for InstanceRecord {
    fn from(instance: &Instance) -> Self {
        Self {
            mesh: instance.mesh,
            material: instance.material.unwrap_or(NO_MATERIAL),
            visibility: u8::from(instance.visibility).into(),
            world_from_object: instance.world_from_object.to_cols_array(),
        }
    }
}

impl TryFrom<InstanceRecord> for Instance {
    type Error = String;

    fn try_from(record: InstanceRecord) -> Result<Self, String> {
        Ok(Self {
            mesh: record.mesh,
            material: (record.material != NO_MATERIAL).then_some(record.material),
            world_from_object: Affine3A::from_cols_array(&record.world_from_object),
            visibility: visibility_of(record.visibility)?,
            motion: Vec::new(),
        })
    }
}

/// A [`Sphere`] in a file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct SphereRecord {
    center: Vec3,
    radius: f32,
    world_from_object: [f32; 4],
    material: u32,
    visibility: u32,
}

impl From<&Sphere> for SphereRecord {
    fn from(sphere: &Sphere) -> Self {
        Self {
            center: sphere.center,
            radius: sphere.radius,
            world_from_object: sphere.world_from_object.to_array(),
            material: sphere.material,
            visibility: u8::from(sphere.visibility).into(),
        }
    }
}

impl TryFrom<SphereRecord> for Sphere {
    type Error = String;

    fn try_from(record: SphereRecord) -> Result<Self, String> {
        Ok(Self {
            center: record.center,
            radius: record.radius,
            world_from_object: Quat::from_array(record.world_from_object),
            material: record.material,
            visibility: visibility_of(record.visibility)?,
            motion: Vec::new(),
        })
    }
}

/// A [`CurvePoint`] in a file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct CurvePointRecord {
    position: Vec3,
    tangent: Vec3,
    radius: f32,
    along: f32,
    /// 1: the curve ends here; 0: it continues.
    is_last: u32,
}

impl From<&CurvePoint> for CurvePointRecord {
    fn from(point: &CurvePoint) -> Self {
        let &CurvePoint { position, tangent, radius, along, is_last } = point;
        Self { position, tangent, radius, along, is_last: is_last.into() }
    }
}

impl From<CurvePointRecord> for CurvePoint {
    fn from(record: CurvePointRecord) -> Self {
        let CurvePointRecord { position, tangent, radius, along, is_last } = record;
        Self { position, tangent, radius, along, is_last: is_last != 0 }
    }
}

fn visibility_of(bits: u32) -> Result<Visibility, String> {
    u8::try_from(bits).map_err(|_| format!("{bits} is not a set of kinds of ray")).and_then(Visibility::try_from)
}
