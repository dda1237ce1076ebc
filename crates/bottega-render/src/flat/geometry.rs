//! Instances, meshes and spheres.

use bottega_scene::{Mesh, Scene};
use glam::{Mat3, Vec3};

use super::{INSTANCE_WORDS, MESH_WORDS, NONE, SPHERE_WORDS, Words, header};
use crate::prepare::{PreparedMaterial, PreparedScene};

/// Words that the geometry takes, at most.
pub(super) fn count(prepared: &PreparedScene) -> u64 {
    let scene = prepared.scene();
    let mesh = |mesh: &Mesh| (mesh.memory_bytes() / size_of::<u32>()) as u64 + u64::from(MESH_WORDS);
    scene.meshes.iter().map(mesh).sum::<u64>()
        + scene.instances.len() as u64 * u64::from(INSTANCE_WORDS)
        + scene.spheres.len() as u64 * u64::from(SPHERE_WORDS)
}

pub(super) fn write(prepared: &PreparedScene, words: &mut Words) {
    let scene: &Scene = prepared.scene();
    let meshes: Vec<u32> =
        scene.meshes.iter().map(|mesh| write_mesh(mesh, prepared.material(mesh.material).1, words)).collect();
    words.head(header::INSTANCES, words.place());
    for (instance, index) in scene.instances.iter().zip(0..) {
        let (start, known) = (words.place(), prepared.instance(index));
        words.mat3(Mat3::from(instance.world_from_object.matrix3));
        words.vec3(Vec3::from(instance.world_from_object.translation));
        words.mat3(known.world_from_normal);
        words.word(meshes[instance.mesh as usize]);
        words.word(known.first_light);
        words.fill(start, INSTANCE_WORDS);
    }
    words.head(header::SPHERES, words.place());
    for (sphere, index) in scene.spheres.iter().zip(0..) {
        let start = words.place();
        words.vec3(sphere.center);
        words.number(sphere.radius);
        words.numbers(&sphere.world_from_object.to_array());
        words.word(sphere.material);
        words.word(prepared.lights().of_sphere(index));
        words.fill(start, SPHERE_WORDS);
    }
}

/// The record: material, and the places of triangles, positions, normals, both sets of texture coordinates, colours and tangents.
/// What its material asks nothing of is left out.
fn write_mesh(mesh: &Mesh, material: &PreparedMaterial, words: &mut Words) -> u32 {
    let lifts = !mesh.normals.is_empty() && !material.transmits;
    let wants_uvs = material.is_textured || material.needs_tangents;
    let mut place_of = |is_wanted: bool, write: &dyn Fn(&mut Words)| {
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
    let record = [
        mesh.material,
        place_of(is_indexed, &|words| mesh.triangles.iter().for_each(|triangle| words.words(triangle))),
        place_of(lifts, &|words| mesh.positions.iter().for_each(|&p| words.vec3(p))),
        place_of(!mesh.normals.is_empty(), &|words| mesh.normals.iter().for_each(|&n| words.vec3(n))),
        place_of(uvs(0), &|words| mesh.uvs[0].iter().for_each(|&uv| words.vec2(uv))),
        place_of(uvs(1), &|words| mesh.uvs[1].iter().for_each(|&uv| words.vec2(uv))),
        place_of(!mesh.colors.is_empty(), &|words| mesh.colors.iter().for_each(|&color| words.vec4(color))),
        place_of(has_tangents, &|words| mesh.tangents.iter().for_each(|&tangent| words.vec4(tangent))),
    ];
    let place = words.place();
    words.words(&record);
    place
}
