//! Compressed files give the same meshes as their uncompressed twins.
//!
//! `data/meshopt.glb` holds pairs of nodes that show the same: one by buffer views that the reference library of the
//! codec has compressed (both versions of attributes, both kinds of indices, three filters), one by the data that the same
//! library decompresses from them. `data/draco.glb` holds the same for Draco: sequential, by edgebreaker, and by edgebreaker
//! with valences.

use std::path::{Path, PathBuf};

use bottega_scene::{LoadOptions, Mesh, Scene, load};
use glam::{DVec3, Vec3};
use serde_json::json;

use crate::gltf::sample_scenes::scenes;
use crate::gltf::support::{File, load_bytes};

pub(crate) fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/gltf/data").join(name)
}

fn read(path: &Path) -> Scene {
    load(path, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}")).scene
}

/// Tolerance of filters: one unit in the last place of their output.
fn assert_same(a: &Mesh, b: &Mesh, tolerance: f32) {
    assert_eq!((a.triangles.len(), a.positions.len()), (b.triangles.len(), b.positions.len()), "{}", a.name);
    // The codec may begin a triangle with another of its corners.
    let from_least = |&[a, b, c]: &[u32; 3]| {
        if a < b && a < c {
            [a, b, c]
        } else if b < c {
            [b, c, a]
        } else {
            [c, a, b]
        }
    };
    assert!(a.triangles.iter().map(from_least).eq(b.triangles.iter().map(from_least)), "{}", a.name);
    assert!(a.positions == b.positions && a.uvs == b.uvs && a.colors == b.colors, "{}", a.name);
    assert_eq!(a.normals.len(), b.normals.len());
    for (a, b) in a.normals.iter().zip(&b.normals) {
        assert!((*a - *b).abs().max_element() <= tolerance, "{a} {b}");
    }
}

#[test]
fn meshopt_views_equal_those_of_the_reference_library() {
    let scene = read(&data("meshopt.glb"));
    for (name, tolerance) in [("quantized", 1.5 / 127.0), ("floats", 1.5 / 32767.0), ("interleaved", 0.0)] {
        let find = |kind: &str| scene.meshes.iter().find(|mesh| mesh.name == format!("{name} {kind}")).unwrap();
        let (compressed, plain) = (find("compressed"), find("plain"));
        assert!(plain.triangles.len() == 722 && !plain.uvs[0].is_empty() && !plain.normals.is_empty());
        assert_same(compressed, plain, tolerance);
    }
    // Three pairs of meshes, and forty instances of each of two nodes.
    let (compressed, plain) = scene.instances[6..].split_at(40);
    assert_eq!(plain.len(), 40);
    for (a, b) in compressed.iter().zip(plain) {
        assert_eq!(a.world_from_object.translation, b.world_from_object.translation);
        assert!(a.world_from_object.abs_diff_eq(b.world_from_object, 2e-4));
    }
}

/// World-space corners, sorted so that their order in the file does not matter.
fn corners(scene: &Scene) -> Vec<[i32; 3]> {
    let of_instance = |instance: &bottega_scene::Instance| {
        let mesh = &scene.meshes[instance.mesh as usize];
        let corner = |&vertex: &u32| instance.world_from_object.transform_point3(mesh.positions[vertex as usize]);
        mesh.triangles.iter().flatten().map(corner).collect::<Vec<Vec3>>()
    };
    let mut corners: Vec<[i32; 3]> =
        scene.instances.iter().flat_map(of_instance).map(|p| (p * 1e4).round().as_ivec3().to_array()).collect();
    corners.sort_unstable();
    corners
}

#[test]
fn compressed_boxes_are_boxes() {
    let Some(folder) = scenes() else { return };
    let expected: Vec<[i32; 3]> = corners(&read(&folder.join("gltf/compressed/BoxDraco.gltf")));
    assert_eq!(expected.len(), 36);
    for name in ["BoxDraco.gltf", "BoxMeshopt.gltf", "BoxMeshopt.glb"] {
        let scene = read(&folder.join("gltf/compressed").join(name));
        let corners = corners(&scene);
        assert_eq!(corners.len(), 36, "{name}");
        // The two files cut some faces along the other diagonal; every corner is used by four or five triangles.
        for corner in &corners {
            assert!(corner.iter().all(|c| c.abs() == 5000), "{name}: {corner:?}");
        }
        let mesh = &scene.meshes[0];
        let world = &scene.instances[0].world_from_object;
        let mut area = 0.0;
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|vertex| world.transform_point3(mesh.positions[vertex as usize]));
            let cross = (b - a).cross(c - a);
            area += 0.5 * cross.length();
            for vertex in triangle {
                // The transformation turns and scales by the same in all directions.
                let normal = world.transform_vector3(mesh.normals[*vertex as usize]).normalize();
                assert!((normal - cross.normalize()).length() < 0.02, "{name}: {normal}");
            }
        }
        assert!((area - 6.0).abs() < 1e-3, "{name}: {area}");
    }
}

#[test]
fn draco_primitives_equal_those_of_the_reference_library() {
    let scene = read(&data("draco.glb"));
    for level in [0, 5, 10] {
        let find = |kind: &str| scene.meshes.iter().find(|mesh| mesh.name == format!("{level} {kind}")).unwrap();
        let (compressed, plain) = (find("compressed"), find("plain"));
        assert!(plain.triangles.len() == 128 && plain.positions.len() == 81 && plain.colors.len() == 81);
        assert_same(compressed, plain, 1e-6);
    }
}

/// The expected numbers are those of another decoder of the format.
#[test]
fn a_draco_mesh_has_the_geometry_that_another_decoder_sees() {
    let Some(folder) = scenes() else { return };
    let scene = read(&folder.join("gltf/compressed/DracoSparseMesh.gltf"));
    let mesh = &scene.meshes[0];
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (62, 102));
    let sum: DVec3 = mesh.positions.iter().map(|p| p.as_dvec3()).sum();
    assert!((sum - DVec3::new(-1.917_952_82, 5.016_171_39, 1.876_669_29)).length() < 1e-6, "{sum}");
    let sum: DVec3 = mesh.triangles.iter().flatten().map(|&v| mesh.positions[v as usize].as_dvec3()).sum();
    assert!((sum - DVec3::new(-9.861_292_76, 25.511_665_37, 9.264_541_9)).length() < 1e-6, "{sum}");
    // The bounds that the document gives.
    assert_eq!(mesh.bounds().0, Vec3::new(-0.039_651_595, 0.049_586_49, 0.028_698_957));
}

#[test]
fn damaged_compressed_data_names_its_place() {
    let mut file = File::triangle();
    let view = file.view(b"DRACO but not really");
    file.json["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_draco_mesh_compression": {"bufferView": view, "attributes": {"POSITION": 0}}});
    let error = file.error();
    assert!(error.contains("meshes[0].primitives[0].extensions.KHR_draco_mesh_compression"), "{error}");

    let mut file = File::triangle();
    let compressed = |mode: &str, stride: u32, filter: &str| {
        let view =
            json!({"buffer": 0, "byteLength": 36, "count": 3, "byteStride": stride, "mode": mode, "filter": filter});
        json!({"EXT_meshopt_compression": view})
    };
    for (extension, words) in [
        (compressed("ATTRIBUTES", 12, "NONE"), "supported version"),
        (compressed("TRIANGLES", 4, "NONE"), "triangles"),
        (compressed("INDICES", 4, "NONE"), "sequence"),
        (compressed("ATTRIBUTES", 14, "NONE"), "14 bytes"),
        (compressed("ATTRIBUTES", 12, "QUATERNION"), "12 bytes"),
        (compressed("ATTRIBUTES", 12, "OTHER"), "`OTHER`"),
        (compressed("OTHER", 12, "NONE"), "`OTHER`"),
    ] {
        file.json["bufferViews"][0]["extensions"] = extension;
        let error = file.error();
        assert!(
            error.contains("bufferViews[0].extensions.EXT_meshopt_compression") && error.contains(words),
            "{error}"
        );
    }
    let mut absurd = compressed("ATTRIBUTES", 12, "NONE");
    absurd["EXT_meshopt_compression"]["count"] = json!(u64::MAX);
    file.json["bufferViews"][0]["extensions"] = absurd;
    assert!(file.error().contains("MiB"));
}

#[test]
fn a_compressed_file_cut_anywhere_is_an_error() {
    let file = std::fs::read(data("meshopt.glb")).unwrap();
    for length in (0..file.len()).step_by(997) {
        assert!(load_bytes("scene.glb", &file[..length]).is_err(), "{length}");
    }
}
