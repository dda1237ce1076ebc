//! Flattening of instances, meshes and spheres.

use std::collections::BTreeMap;

use bottega_scene::{Mesh, Scene};
use glam::{Mat3, Vec3};

use super::{InstanceRecord, MeshRecord, NONE, Portable, SphereRecord, WordBuffer, header};
use crate::prepare::PreparedScene;

/// Returns an upper bound of the number of words of the geometry.
pub(super) fn count(prepared: &PreparedScene) -> u64 {
    let scene = prepared.scene();
    let mesh = |mesh: &Mesh| (mesh.memory_bytes() / size_of::<u32>()) as u64 + u64::from(MeshRecord::WORDS);
    looks(scene).keys().map(|&(index, _)| mesh(&scene.meshes[index as usize])).sum::<u64>()
        + scene.instances.len() as u64 * u64::from(InstanceRecord::WORDS)
        + scene.spheres.len() as u64 * u64::from(SphereRecord::WORDS)
}

/// Writes instances, meshes and spheres, and their offsets into the header.
pub(super) fn write(prepared: &PreparedScene, words: &mut WordBuffer) {
    let scene: &Scene = prepared.scene();
    let mut looks = looks(scene);
    for (&(mesh, material), place) in &mut looks {
        *place = write_mesh(&scene.meshes[mesh as usize], material, prepared, words);
    }
    words.head(header::INSTANCES, words.place());
    for (instance, index) in scene.instances.iter().zip(0..) {
        let known = prepared.instance(index);
        words.record(&InstanceRecord {
            world_from_object: Mat3::from(instance.world_from_object.matrix3),
            translation: Vec3::from(instance.world_from_object.translation),
            world_from_normal: known.world_from_normal,
            mesh: looks[&(instance.mesh, scene.material_of(instance))],
            first_light: known.first_light,
        });
    }
    words.head(header::SPHERES, words.place());
    for (sphere, index) in scene.spheres.iter().zip(0..) {
        words.record(&SphereRecord {
            center: sphere.center,
            radius: sphere.radius,
            world_from_object: sphere.world_from_object.into(),
            material: sphere.material,
            light: prepared.lights().of_sphere(index),
        });
    }
}

/// Returns the pairs of mesh and material that instances have, each with a place for the offset of its record.
fn looks(scene: &Scene) -> BTreeMap<(u32, u32), u32> {
    scene.instances.iter().map(|it| ((it.mesh, scene.material_of(it)), NONE)).collect()
}

/// Writes the arrays of a mesh with a material, then its record, and returns the record's offset. Omits arrays that the
/// material does not need.
fn write_mesh(mesh: &Mesh, material_index: u32, prepared: &PreparedScene, words: &mut WordBuffer) -> u32 {
    let material = prepared.material(material_index).1;
    let lifts = !mesh.normals.is_empty() && !material.transmits;
    let wants_uvs = material.is_textured || material.needs_tangents;
    let mut place_of = |is_wanted: bool, write: &dyn Fn(&mut WordBuffer)| {
        if !is_wanted {
            return NONE;
        }
        let place = words.place();
        write(words);
        place
    };
    let uvs = |set: usize| wants_uvs && !mesh.uvs[set].is_empty();
    let has_tangents = material.needs_tangents && !mesh.tangents.is_empty();
    let is_indexed = !mesh.normals.is_empty() || !mesh.colors.is_empty() || uvs(0) || uvs(1) || has_tangents;
    let record = MeshRecord {
        material: material_index,
        triangles: place_of(is_indexed, &|words| mesh.triangles.iter().for_each(|triangle| words.words(triangle))),
        positions: place_of(lifts, &|words| mesh.positions.iter().for_each(|&p| words.vec3(p))),
        normals: place_of(!mesh.normals.is_empty(), &|words| mesh.normals.iter().for_each(|&n| words.vec3(n))),
        uvs: [0, 1].map(|set| place_of(uvs(set), &|words| mesh.uvs[set].iter().for_each(|&uv| words.vec2(uv)))),
        colors: place_of(!mesh.colors.is_empty(), &|words| mesh.colors.iter().for_each(|&color| words.vec4(color))),
        tangents: place_of(has_tangents, &|words| mesh.tangents.iter().for_each(|&tangent| words.vec4(tangent))),
    };
    words.record(&record)
}
