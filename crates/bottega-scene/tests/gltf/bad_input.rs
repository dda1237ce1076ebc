//! Invalid files: each gets an error that names the file and the place, or a warning.

use std::path::Path;

use bottega_scene::{LoadOptions, SceneError, load};
use serde_json::{Value, json};

use crate::gltf::support::{File, U8, U16, load_bytes, png, warns, write};

fn error_of(path: &Path) -> SceneError {
    load(path, &LoadOptions::default()).expect_err("the file is bad")
}

#[test]
fn paths_that_lead_to_no_scene_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let missing = error_of(&folder.path().join("missing.glb"));
    assert!(matches!(missing, SceneError::Read { .. }) && missing.to_string().contains("missing.glb"));
    assert!(matches!(error_of(folder.path()), SceneError::NotAFile { .. }));
    assert!(matches!(error_of(&write(folder.path(), "empty.glb", b"")), SceneError::UnknownFormat { .. }));
    assert!(matches!(error_of(&write(folder.path(), "empty.gltf", b"")), SceneError::Json { .. }));
    let picture = error_of(&write(folder.path(), "scene.glb", &png(1, 1, &[[0; 4]])));
    assert!(picture.to_string().contains("a picture"), "{picture}");
    assert!(matches!(error_of(&write(folder.path(), "scene.dae", b"v 0 0 0")), SceneError::UnknownFormat { .. }));
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let file = File::triangle().glb();
    for length in 0..file.len() {
        assert!(load_bytes("scene.glb", &file[..length]).is_err(), "{length} of {}", file.len());
    }
    let text = File::triangle().json.to_string();
    for length in 0..text.len() {
        assert!(load_bytes("scene.gltf", &text.as_bytes()[..length]).is_err(), "{length}");
    }
}

#[test]
fn type_errors_name_line_column_and_place() {
    let text = "{\"asset\": {\"version\": \"2.0\"},\n \"nodes\": [{}, {\"children\": [0, -1]}]}";
    let error = load_bytes("scene.gltf", text.as_bytes()).unwrap_err().to_string();
    assert!(error.contains("line 2") && error.contains("nodes[1].children[1]"), "{error}");
    let error = load_bytes("scene.gltf", br#"{"asset":{"version":"2.0"},"accessors":[{"count":1}]}"#).unwrap_err();
    assert!(error.to_string().contains("accessors[0]") && error.to_string().contains("componentType"), "{error}");
}

#[test]
fn other_versions_are_refused() {
    for asset in [json!({"version": "1.0"}), json!({"version": "2.0", "minVersion": "2.1"})] {
        let mut file = File::triangle();
        file.json["asset"] = asset;
        assert!(file.error().contains("asset.version"));
    }
    let mut file = File::triangle();
    file.json.as_object_mut().unwrap().remove("asset");
    assert!(file.error().contains("asset.version"));
    file.json["asset"] = json!({"version": "2.1"});
    file.load();
}

/// Applies a change to the file of one triangle and looks for words in the error.
fn breaks(change: impl FnOnce(&mut Value), words: &[&str]) {
    let mut file = File::triangle();
    let indices = file.accessor("SCALAR", U8, 3, &[0, 1, 2]);
    file.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    change(&mut file.json);
    let error = file.error();
    assert!(words.iter().all(|word| error.contains(word)) && error.contains("scene.glb"), "{error}");
}

#[test]
fn indices_out_of_range_name_their_place() {
    breaks(|json| json["scene"] = json!(7), &["scene", "7"]);
    breaks(|json| json["scenes"][0]["nodes"] = json!([9]), &["scenes", "node 9"]);
    breaks(|json| json["nodes"][0]["mesh"] = json!(1), &["nodes[0].mesh", "mesh 1"]);
    breaks(|json| json["nodes"][0]["children"] = json!([1]), &["nodes[0].children", "node 1"]);
    breaks(|json| json["nodes"][0]["camera"] = json!(0), &["nodes[0].camera", "camera 0"]);
    breaks(|json| json["nodes"][0]["skin"] = json!(0), &["skin 0"]);
    let primitive =
        |member: &'static str| move |json: &mut Value| json["meshes"][0]["primitives"][0][member] = json!(99);
    breaks(primitive("material"), &["material 99"]);
    breaks(primitive("indices"), &["meshes[0].primitives[0].indices", "accessor 99"]);
    breaks(primitive("mode"), &["meshes[0].primitives[0].mode", "99"]);
    let position = "meshes[0].primitives[0].attributes.POSITION";
    breaks(|json| json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(5), &[position, "accessor 5"]);
    breaks(|json| json["accessors"][0]["bufferView"] = json!(5), &[position, "buffer view 5"]);
    breaks(|json| json["bufferViews"][0]["buffer"] = json!(5), &[position, "buffer 5"]);
    let light = json!({"KHR_lights_punctual": {"light": 3}});
    breaks(|json| json["nodes"][0]["extensions"] = light, &["nodes[0].extensions.KHR_lights_punctual", "light 3"]);
}

#[test]
fn ranges_that_leave_their_buffer_name_their_place() {
    let position = "meshes[0].primitives[0].attributes.POSITION";
    breaks(|json| json["bufferViews"][0]["byteLength"] = json!(u64::MAX), &[position, "buffer view 0"]);
    breaks(|json| json["bufferViews"][0]["byteOffset"] = json!(1u64 << 40), &[position, "buffer view 0"]);
    breaks(|json| json["accessors"][0]["count"] = json!(4), &[position, "accessor 0", "4 elements"]);
    breaks(|json| json["accessors"][0]["count"] = json!(u64::MAX), &[position, "accessor 0"]);
    breaks(|json| json["accessors"][0]["byteOffset"] = json!(8), &[position, "accessor 0"]);
    breaks(|json| json["accessors"][0]["type"] = json!("VEC5"), &[position, "VEC5"]);
    breaks(|json| json["accessors"][0]["componentType"] = json!(5), &[position, "component type 5"]);
    breaks(|json| json["accessors"][0]["type"] = json!("VEC2"), &[position, "2 components"]);
    breaks(|json| json["accessors"][1]["componentType"] = json!(5126), &["indices"]);
    breaks(|json| json["accessors"][0]["count"] = json!(2), &["indices", "vertex 2"]);
    breaks(|json| json["buffers"] = json!([{"byteLength": 1_000_000}]), &["buffers[0]", "1000000"]);
    let uvs = json!({"POSITION": 0, "NORMAL": 1});
    breaks(|json| json["meshes"][0]["primitives"][0]["attributes"] = uvs, &["attributes.NORMAL"]);
    // Without a buffer view all values are zero, whatever count the document claims.
    let many = json!({"componentType": 5126, "type": "VEC3", "count": 4_000_000_000u64});
    breaks(|json| json["accessors"][0] = many, &[position, "4000000000"]);
}

#[test]
fn nodes_that_do_not_form_a_forest_are_errors() {
    breaks(|json| json["nodes"] = json!([{"children": [1]}, {"children": [0]}]), &["nodes[0]", "ancestor"]);
    breaks(|json| json["nodes"] = json!([{"children": [0]}]), &["nodes[0]", "ancestor"]);
    breaks(
        |json| json["nodes"] = json!([{"children": [2]}, {"children": [2]}, {}]),
        &["nodes[1].children", "two parents"],
    );
    breaks(|json| json["nodes"] = json!([{"children": [1, 1]}, {}]), &["nodes[0].children", "two parents"]);
    breaks(|json| json["scenes"][0]["nodes"] = json!([0, 0]), &["nodes[0]", "twice"]);
}

#[test]
fn a_chain_of_nodes_may_be_as_long_as_it_likes() {
    let mut file = File::triangle();
    let count = 100_000;
    let nodes: Vec<Value> = (1..count).map(|child| json!({"children": [child]})).chain([json!({"mesh": 0})]).collect();
    file.json["nodes"] = json!(nodes);
    assert_eq!(file.load().scene.triangle_count(), 1);
}

#[test]
fn json_nested_too_deep_is_an_error() {
    let text = format!("{{\"asset\":{{\"version\":\"2.0\",\"extras\":{}", "[".repeat(100_000));
    assert!(matches!(load_bytes("scene.gltf", text.as_bytes()), Err(SceneError::Json { .. })));
}

#[test]
fn required_extensions_that_are_unknown_are_refused_by_name() {
    let mut file = File::triangle();
    file.json["extensionsUsed"] = json!(["KHR_texture_transform", "EXT_unheard_of", "EXT_unheard_of"]);
    let loaded = file.load();
    assert_eq!(loaded.warnings.iter().filter(|warning| warning.to_string().contains("EXT_unheard_of")).count(), 1);
    file.json["extensionsRequired"] = json!(["KHR_texture_transform", "EXT_unheard_of"]);
    let error = file.error();
    assert!(error.contains("EXT_unheard_of") && error.contains("export without it"), "{error}");
    file.json["extensionsRequired"] = json!(["EXT_texture_avif"]);
    assert!(file.error().contains("PNG or JPEG"));
}

#[test]
fn references_may_not_leave_the_folder_of_the_scene() {
    let outer = tempfile::tempdir().unwrap();
    let folder = outer.path().join("scene");
    std::fs::create_dir(&folder).unwrap();
    let file = File::triangle();
    write(outer.path(), "secret.bin", &file.bin);
    write(&folder, "my data.bin", &file.bin);
    let mut json = file.json;
    let mut with_uri = |uri: &str| {
        json["buffers"] = json!([{"byteLength": 36, "uri": uri}]);
        load(&write(&folder, "scene.gltf", json.to_string().as_bytes()), &LoadOptions::default())
    };
    assert_eq!(with_uri("my%20data.bin").unwrap().scene.triangle_count(), 1);
    for uri in ["../secret.bin", "%2e%2e/secret.bin", "x/../../secret.bin", "http://localhost/secret.bin"] {
        let error = with_uri(uri).unwrap_err();
        assert!(matches!(&error, SceneError::ForbiddenReference { place, .. } if place == "buffers[0]"), "{error}");
    }
    assert!(matches!(
        with_uri(&outer.path().join("secret.bin").display().to_string()),
        Err(SceneError::ForbiddenReference { .. })
    ));
    let missing = with_uri("missing.bin").unwrap_err();
    assert!(missing.to_string().contains("missing.bin"), "{missing}");
    assert!(with_uri("data:;base64,AAAA").is_err(), "three bytes are not 36");
    assert!(with_uri("data:;base64,====").is_err());
}

#[test]
fn the_digest_covers_every_file_that_was_read() {
    let folder = tempfile::tempdir().unwrap();
    let file = File::textured(&json!({"emissiveTexture": {"index": 0}}));
    let mut json = file.json.clone();
    json["buffers"] = json!([{"byteLength": file.bin.len(), "uri": "data.bin"}]);
    json["images"] = json!([{"uri": "picture.png"}]);
    json["textures"] = json!([{"source": 0}]);
    let digest = |json: &Value, bin: &[u8], picture: &[u8]| {
        write(folder.path(), "data.bin", bin);
        write(folder.path(), "picture.png", picture);
        let path = write(folder.path(), "scene.gltf", json.to_string().as_bytes());
        load(&path, &LoadOptions::default()).unwrap().scene.digest
    };
    let picture = png(1, 1, &[[1; 4]]);
    let first = digest(&json, &file.bin, &picture);
    assert_eq!(first.len(), 64);
    assert_eq!(digest(&json, &file.bin, &picture), first);
    assert_ne!(digest(&json, &file.bin, &png(1, 1, &[[2; 4]])), first);
    let mut moved = file.bin.clone();
    moved[0] = 1;
    assert_ne!(digest(&json, &moved, &picture), first);
    json["nodes"][0]["name"] = json!("other");
    assert_ne!(digest(&json, &file.bin, &picture), first);
}

/// A PNG file whose header announces a size, and whose content is a few bytes.
fn bomb(width: u32, height: u32) -> Vec<u8> {
    let mut file = png(1, 1, &[[0; 4]]);
    file[16..20].copy_from_slice(&width.to_be_bytes());
    file[20..24].copy_from_slice(&height.to_be_bytes());
    let checksum = crc32(&file[12..29]);
    file[29..33].copy_from_slice(&checksum.to_be_bytes());
    file
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

#[test]
fn pictures_beyond_the_limit_are_refused_before_they_are_decoded() {
    let mut file = File::textured(&json!({"emissiveTexture": {"index": 0}}));
    file.texture(&bomb(100_000, 100_000));
    let error = file.error();
    assert!(error.contains("images[0]") && error.contains("100000 × 100000") && error.contains("scale"), "{error}");
    // Within the limit, but more than this number of bytes can hold: damaged, and replaced.
    let mut file = File::textured(&json!({"emissiveTexture": {"index": 0}}));
    file.texture(&bomb(10_000, 10_000));
    assert!(warns(&file.load(), &["images[0]", "10000 × 10000"]));
    let folder = tempfile::tempdir().unwrap();
    let mut file = File::textured(&json!({"emissiveTexture": {"index": 0}}));
    file.texture(&png(64, 64, &[[9; 4]; 4096]));
    let path = write(folder.path(), "scene.glb", &file.glb());
    let options = LoadOptions { max_image_pixels: 4095, ..LoadOptions::default() };
    assert!(matches!(load(&path, &options), Err(SceneError::Limit { .. })));
}

#[test]
fn scenes_beyond_the_memory_limit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = File::triangle();
    // A small file of many instances of a mesh of many primitives.
    let primitive = file.json["meshes"][0]["primitives"][0].clone();
    (0..100).for_each(|_| file.primitive(primitive.clone()));
    let nodes: Vec<Value> = (0..1000).map(|_| json!({"mesh": 0})).collect();
    file.json["nodes"] = json!(nodes);
    file.json["scenes"][0]["nodes"] = json!((0..1000).collect::<Vec<usize>>());
    let path = write(folder.path(), "scene.glb", &file.glb());
    assert_eq!(load(&path, &LoadOptions::default()).unwrap().scene.instances.len(), 101_000);
    let options = LoadOptions { max_memory_bytes: 4 << 20, ..LoadOptions::default() };
    let error = load(&path, &options).unwrap_err();
    assert!(matches!(error, SceneError::Limit { .. }) && error.to_string().contains("4 MiB"), "{error}");
    let tiny = LoadOptions { max_memory_bytes: 100, ..LoadOptions::default() };
    assert!(matches!(load(&path, &tiny), Err(SceneError::Limit { .. })));
}

#[test]
fn instancing_attributes_must_agree() {
    let mut file = File::triangle();
    let translations = file.floats("VEC3", &[0.0; 6]);
    let scales = file.floats("VEC3", &[1.0; 9]);
    let short = file.accessor("VEC3", U16, 1, &[0; 6]);
    let mut with = |attributes: Value| {
        file.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
        file.try_load()
    };
    let place = "nodes[0].extensions.EXT_mesh_gpu_instancing";
    assert!(with(json!({"TRANSLATION": translations, "SCALE": scales})).unwrap_err().to_string().contains(place));
    assert!(with(json!({"ROTATION": translations})).unwrap_err().to_string().contains(place));
    assert_eq!(with(json!({"SCALE": scales, "TRANSLATION": scales})).unwrap().scene.instances.len(), 3);
    assert_eq!(with(json!({"TRANSLATION": short})).unwrap().scene.instances.len(), 1);
}

#[test]
fn unsupported_parts_are_refused_when_strict() {
    let folder = tempfile::tempdir().unwrap();
    let strict = LoadOptions { strict: true, ..LoadOptions::default() };
    let refuses = |file: &File| load(&write(folder.path(), "scene.glb", &file.glb()), &strict).err();
    let mut extended = File::triangle();
    assert!(refuses(&extended).is_none());
    extended.json["extensionsUsed"] = json!(["ABC_new"]);
    let mut lines = File::triangle();
    lines.json["meshes"][0]["primitives"][0]["mode"] = json!(1);
    for (file, reason) in [(extended, "ABC_new"), (lines, "points and lines")] {
        assert!(file.try_load().is_ok());
        let Some(error @ SceneError::Unsupported { .. }) = refuses(&file) else { panic!("{reason}") };
        assert!(error.to_string().contains(reason), "{error}");
    }
}

#[test]
fn a_list_is_not_an_object() {
    let file = File::triangle();
    let document = &file.json;
    // Objects as arrays of their members in the order of reading: read by position, they would make a scene.
    for (place, list) in [
        ("/asset", json!(["2.0", null, null])),
        ("/accessors/0", json!([0, 0, 5126, false, 3, "VEC3", null])),
        ("/bufferViews/0", json!([0, 0, 36, null, {}])),
        ("/buffers", json!([[null, 36, {}]])),
    ] {
        let mut document = document.clone();
        if document.get("buffers").is_none() {
            document["buffers"] = json!([{"byteLength": 36}]);
        }
        *document.pointer_mut(place).unwrap_or_else(|| panic!("{place}")) = list;
        let folder = tempfile::tempdir().unwrap();
        let error = error_of(&write(folder.path(), "scene.gltf", document.to_string().as_bytes()));
        assert!(matches!(error, SceneError::Json { .. }), "{place}: {error}");
        assert!(error.to_string().contains("expected an object"), "{place}: {error}");
    }
}

#[test]
fn json_and_containers_are_recognized_by_their_contents() {
    let folder = tempfile::tempdir().unwrap();
    let text = json!({"asset": {"version": "2.0", "generator": "ü"}}).to_string();
    let utf16: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    for bytes in [text.clone().into_bytes(), format!("\u{feff} \n{text}").into_bytes(), utf16] {
        for name in ["a.glb", "a.gltf"] {
            let loaded = load(&write(folder.path(), name, &bytes), &LoadOptions::default()).unwrap();
            assert_eq!(loaded.metadata.generator.as_deref(), Some("ü"), "{name}");
        }
    }
    let loaded = load(&write(folder.path(), "b.gltf", &File::triangle().glb()), &LoadOptions::default()).unwrap();
    assert_eq!(loaded.scene.triangle_count(), 1);
    let latin = text.chars().map(|c| c as u8).collect::<Vec<u8>>();
    let error = error_of(&write(folder.path(), "c.gltf", &latin)).to_string();
    assert!(error.contains("c.gltf`, line 1, column") && error.contains("save it as UTF-8"), "{error}");
}
