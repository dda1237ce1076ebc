//! One moving scene made of several still ones: the same parts, read at several times.

use std::collections::BTreeMap;

use glam::{Affine3A, Quat, Vec3};

use crate::camera::Camera;
use crate::light::{Light, LightKind};
use crate::model::{Instance, Mesh, Scene};
use crate::motion::{MeshKey, TransformKey};

/// The parts of a scene at a time.
pub(crate) struct StillParts {
    pub(crate) time: f64,
    pub(crate) meshes: Vec<Mesh>,
    pub(crate) instances: Vec<Instance>,
    pub(crate) cameras: Vec<Camera>,
    pub(crate) lights: Vec<Light>,
}

/// Gives the parts of a scene the keys of later times. Returns what cannot be followed; those parts stand still.
///
/// - `time`: time of the scene itself, before those of `stills`, which ascend.
pub(crate) fn merge(scene: &mut Scene, time: f64, stills: &[StillParts]) -> Vec<&'static str> {
    let mut problems = Vec::new();
    if stills.iter().all(|still| still.instances.len() == scene.instances.len()) {
        merge_instances(scene, time, stills);
        if !merge_meshes(scene, time, stills) {
            problems.push("a mesh has other triangles at another time; its vertices stand still");
        }
    } else {
        problems.push("surfaces appear or vanish while the shutter is open; all surfaces stand still");
    }
    if stills.iter().all(|still| still.cameras.len() == scene.cameras.len()) {
        for (index, camera) in scene.cameras.iter_mut().enumerate() {
            let keys = stills.iter().map(|still| (still.time, still.cameras[index].world_from_camera));
            camera.motion = motion(time, camera.world_from_camera, keys);
        }
    }
    if stills.iter().all(|still| still.lights.len() == scene.lights.len()) {
        for (index, light) in scene.lights.iter_mut().enumerate() {
            let moves = |still: &StillParts| moved(&light.kind, &still.lights[index].kind);
            let keys = stills.iter().map(|still| (still.time, moves(still)));
            light.motion = motion(time, Affine3A::IDENTITY, keys);
        }
    }
    problems
}

/// Returns keys of a transformation; none if it stays the same.
fn motion(time: f64, first: Affine3A, later: impl Iterator<Item = (f64, Affine3A)>) -> Vec<TransformKey> {
    let keys = std::iter::once((time, first)).chain(later);
    let keys: Vec<TransformKey> = keys.map(|(time, transform)| TransformKey { time, transform }).collect();
    if keys.iter().all(|key| key.transform == first) { Vec::new() } else { keys }
}

/// Returns the transformation of world space that moves a light without extent from one place to another.
fn moved(from: &LightKind, to: &LightKind) -> Affine3A {
    match (from, to) {
        (LightKind::Point { position: from, .. }, LightKind::Point { position: to, .. }) => {
            Affine3A::from_translation(*to - *from)
        }
        (
            LightKind::Spot { position: from, direction, .. },
            LightKind::Spot { position: to, direction: turned, .. },
        ) => {
            let turn = if direction == turned {
                Affine3A::IDENTITY
            } else {
                Affine3A::from_quat(Quat::from_rotation_arc(*direction, *turned))
            };
            Affine3A::from_translation(*to) * turn * Affine3A::from_translation(-*from)
        }
        _ => Affine3A::IDENTITY,
    }
}

fn merge_instances(scene: &mut Scene, time: f64, stills: &[StillParts]) {
    for (index, instance) in scene.instances.iter_mut().enumerate() {
        let keys = stills.iter().map(|still| (still.time, still.instances[index].world_from_object));
        instance.motion = motion(time, instance.world_from_object, keys);
    }
}

/// Gives meshes keys of their vertices. Instances that share a mesh at first and differ later get meshes of their own.
/// Returns false if a mesh has other triangles at another time.
fn merge_meshes(scene: &mut Scene, time: f64, stills: &[StillParts]) -> bool {
    // Meshes that an instance has at all times, and the instances that have the same ones
    let mut users: BTreeMap<Vec<u32>, Vec<usize>> = BTreeMap::new();
    for (index, instance) in scene.instances.iter().enumerate() {
        let later = stills.iter().map(|still| still.instances[index].mesh);
        users.entry(std::iter::once(instance.mesh).chain(later).collect()).or_default().push(index);
    }
    let mut variants: BTreeMap<u32, usize> = BTreeMap::new();
    for meshes in users.keys() {
        *variants.entry(meshes[0]).or_default() += 1;
    }
    let mut is_complete = true;
    for (meshes, instances) in users {
        let first = &scene.meshes[meshes[0] as usize];
        let later: Vec<&Mesh> =
            stills.iter().zip(&meshes[1..]).map(|(still, &mesh)| &still.meshes[mesh as usize]).collect();
        let is_alike = |other: &&Mesh| {
            other.positions.len() == first.positions.len()
                && other.normals.len() == first.normals.len()
                && other.triangles == first.triangles
        };
        if !later.iter().all(is_alike) {
            is_complete = false;
            continue;
        }
        if later.iter().all(|other| other.positions == first.positions && other.normals == first.normals) {
            continue;
        }
        let key = |time: f64, mesh: &Mesh| {
            let (positions, normals): (Vec<Vec3>, Vec<Vec3>) = (mesh.positions.clone(), mesh.normals.clone());
            MeshKey { time, positions, normals }
        };
        let later = stills.iter().zip(later).map(|(still, mesh)| key(still.time, mesh));
        let motion: Vec<MeshKey> = std::iter::once(key(time, first)).chain(later).collect();
        if variants[&meshes[0]] == 1 {
            scene.meshes[meshes[0] as usize].motion = motion;
        } else {
            let own = scene.push_mesh(Mesh { motion, ..scene.meshes[meshes[0] as usize].clone() });
            for index in instances {
                scene.instances[index].mesh = own;
            }
        }
    }
    is_complete
}

#[cfg(test)]
mod tests {
    use super::*;

    fn still(time: f64, meshes: Vec<Mesh>, placed: &[(u32, f32)]) -> StillParts {
        let instance = |&(mesh, x): &(u32, f32)| Instance::new(mesh, Affine3A::from_translation(Vec3::X * x));
        let instances = placed.iter().map(instance).collect();
        StillParts { time, meshes, instances, cameras: Vec::new(), lights: Vec::new() }
    }

    fn cube(size: f32) -> Mesh {
        Mesh::cuboid(Vec3::ZERO, Vec3::splat(size))
    }

    #[test]
    fn parts_get_the_keys_of_all_times() {
        let StillParts { meshes, instances, .. } =
            still(0.0, vec![cube(1.0), cube(5.0)], &[(0, 0.0), (0, 1.0), (1, 2.0)]);
        let mut scene = Scene { meshes: meshes.into(), instances, ..Scene::default() };
        let later = still(0.5, vec![cube(1.0), cube(2.0), cube(5.0)], &[(0, 0.0), (1, 4.0), (2, 2.0)]);
        assert!(merge(&mut scene, 0.0, &[later]).is_empty());
        // The first two share a mesh only at first
        assert_eq!(scene.meshes.len(), 3);
        assert_eq!(scene.instances.iter().map(|it| it.mesh).collect::<Vec<_>>(), [0, 2, 1]);
        assert!(scene.meshes[0].motion.is_empty() && scene.meshes[1].motion.is_empty());
        assert_eq!(scene.meshes[2].motion[1].positions, cube(2.0).positions);
        assert_eq!(scene.instances[1].motion[1].transform.translation.x, 4.0);
        assert!(scene.instances[0].motion.is_empty() && scene.instances[2].motion.is_empty());
    }

    #[test]
    fn parts_that_vanish_are_reported() {
        let StillParts { meshes, instances, .. } = still(0.0, vec![cube(1.0)], &[(0, 0.0), (0, 1.0)]);
        let mut scene = Scene { meshes: meshes.into(), instances, ..Scene::default() };
        let problems = merge(&mut scene, 0.0, &[still(0.5, vec![cube(1.0)], &[(0, 1.0)])]);
        assert!(problems.len() == 1 && problems[0].contains("vanish") && !scene.has_motion(), "{problems:?}");
    }

    #[test]
    fn a_spot_turns_with_its_node() {
        let spot = |position: Vec3, direction: Vec3| LightKind::Spot {
            position,
            direction,
            intensity: Vec3::ONE,
            cos_inner: 0.9,
            cos_outer: 0.8,
            falloff: Default::default(),
        };
        let (from, to) = (spot(Vec3::ONE, Vec3::NEG_Z), spot(Vec3::Y * 3.0, Vec3::X));
        let LightKind::Spot { position, direction, .. } = from.moved(&moved(&from, &to)) else { panic!() };
        assert!((position - Vec3::Y * 3.0).length() < 1e-6 && (direction - Vec3::X).length() < 1e-6);
    }
}
