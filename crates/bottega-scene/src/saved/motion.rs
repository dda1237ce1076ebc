//! Motion in a saved scene.

use std::io::{self, Write};

use bytemuck::{Pod, Zeroable};
use glam::{Affine3A, Quat, Vec3};

use super::blocks::{Blocks, put};
use super::description::MotionDescription;
use crate::error::SceneError;
use crate::model::Scene;
use crate::motion::{MeshKey, Shutter, SphereKey, TransformKey};

/// A [`TransformKey`] in a file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct TransformRecord {
    time: f64,
    /// Column by column.
    transform: [f32; 12],
}

/// A [`SphereKey`] in a file.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct SphereKeyRecord {
    time: f64,
    center: Vec3,
    radius: f32,
    world_from_object: [f32; 4],
}

/// Returns what moves in a scene; `None`: nothing has keys, and the shutter is closed.
pub(super) fn describe_motion(scene: &Scene) -> Option<MotionDescription> {
    if !scene.has_motion() && scene.shutter == Shutter::default() {
        return None;
    }
    let counts = |lengths: &mut dyn Iterator<Item = usize>| -> Vec<(u32, u32)> {
        lengths.zip(0..).filter(|(length, _)| *length > 0).map(|(length, index)| (index, length as u32)).collect()
    };
    Some(MotionDescription {
        shutter: scene.shutter,
        instances: counts(&mut scene.instances.iter().map(|it| it.motion.len())),
        spheres: counts(&mut scene.spheres.iter().map(|it| it.motion.len())),
        meshes: counts(&mut scene.meshes.iter().map(|it| it.motion.len())),
    })
}

/// Writes the blocks of the motion.
pub(super) fn put_motion(out: &mut dyn Write, scene: &Scene) -> io::Result<()> {
    for key in scene.instances.iter().flat_map(|it| &it.motion) {
        put(out, &[TransformRecord { time: key.time, transform: key.transform.to_cols_array() }])?;
    }
    for key in scene.spheres.iter().flat_map(|it| &it.motion) {
        let &SphereKey { time, center, radius, world_from_object } = key;
        let world_from_object = world_from_object.to_array();
        put(out, &[SphereKeyRecord { time, center, radius, world_from_object }])?;
    }
    for mesh in scene.meshes.iter() {
        let times: Vec<f64> = mesh.motion.iter().map(|key| key.time).collect();
        put(out, &times)?;
        for key in &mesh.motion {
            put(out, &key.positions)?;
            put(out, &key.normals)?;
        }
    }
    Ok(())
}

/// Reads the blocks of the motion into a scene that has everything else.
pub(super) fn read_motion(
    blocks: &mut Blocks<'_>,
    motion: &MotionDescription,
    scene: &mut Scene,
) -> Result<(), SceneError> {
    scene.shutter = motion.shutter;
    let missing = |blocks: &Blocks<'_>, what: &str, index: u32| {
        Err(blocks.damaged(format!("{what}[{index}] moves, but does not exist")))
    };
    for &(index, count) in &motion.instances {
        let Some(instance) = scene.instances.get_mut(index as usize) else {
            return missing(blocks, "instances", index);
        };
        let records: Vec<TransformRecord> = blocks.take(&format!("instances[{index}].motion"), count.into())?;
        let key = |record: &TransformRecord| TransformKey {
            time: record.time,
            transform: Affine3A::from_cols_array(&record.transform),
        };
        instance.motion = records.iter().map(key).collect();
    }
    for &(index, count) in &motion.spheres {
        let Some(sphere) = scene.spheres.get_mut(index as usize) else { return missing(blocks, "spheres", index) };
        let records: Vec<SphereKeyRecord> = blocks.take(&format!("spheres[{index}].motion"), count.into())?;
        let key = |record: &SphereKeyRecord| {
            let &SphereKeyRecord { time, center, radius, world_from_object } = record;
            SphereKey { time, center, radius, world_from_object: Quat::from_array(world_from_object) }
        };
        sphere.motion = records.iter().map(key).collect();
    }
    for &(index, count) in &motion.meshes {
        let Some(mesh) = scene.meshes.get(index as usize) else { return missing(blocks, "meshes", index) };
        let (vertices, has_normals) = (mesh.positions.len() as u64, !mesh.normals.is_empty());
        let place = format!("meshes[{index}].motion");
        let times: Vec<f64> = blocks.take(&place, count.into())?;
        let mut keys = Vec::with_capacity(times.len());
        for time in times {
            let positions = blocks.take::<Vec3>(&place, vertices)?;
            let normals = blocks.take_if::<Vec3>(has_normals, &place, vertices)?;
            keys.push(MeshKey { time, positions, normals });
        }
        scene.meshes[index as usize].motion = keys;
    }
    Ok(())
}
