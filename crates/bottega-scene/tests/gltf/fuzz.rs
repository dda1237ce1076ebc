//! For any bytes the importer returns: it does not panic, hang, or exceed its memory limit.

use std::path::Path;

use bottega_scene::{LoadOptions, load};
use serde_json::{Value, json};

use crate::gltf::compressed::data;
use crate::gltf::mutation::{Random, damage, survive};
use crate::gltf::pictures::{ktx2, sample_pictures};
use crate::gltf::sample_scenes::scenes;
use crate::gltf::support::{F32, File, U8, png, warns, write};

/// Numbers at the limits of types and counts.
const NUMBERS: [&str; 14] = [
    "0",
    "1",
    "-1",
    "2",
    "255",
    "65535",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "1e39",
    "-1e-46",
    "0.5",
    "1e400",
    "null",
];

fn mutate(file: &[u8], random: &mut Random) -> Vec<u8> {
    let mut file = file.to_vec();
    for _ in 0..=random.below(3) {
        if file.is_empty() {
            break;
        }
        let at = random.below(file.len());
        if random.below(7) < 5 {
            damage(&mut file, at, random);
            continue;
        }
        // A number of the JSON text becomes another one.
        let Some(start) = (at..file.len()).find(|&i| file[i].is_ascii_digit()) else { continue };
        let end = (start..file.len()).find(|&i| !file[i].is_ascii_digit()).unwrap_or(file.len());
        file.splice(start..end, NUMBERS[random.below(NUMBERS.len())].bytes());
    }
    // With the correct new length in the container, mutations reach the document.
    if file.starts_with(b"glTF") && file.len() >= 20 && random.below(4) > 0 {
        let length = file.len() as u32;
        file[8..12].copy_from_slice(&length.to_le_bytes());
        let json_end = file.windows(4).skip(20).position(|window| window == b"BIN\0").map(|at| at + 20 - 4);
        if let Some(json_end) = json_end.filter(|&end| end > 20) {
            file[12..16].copy_from_slice(&(json_end as u32 - 20).to_le_bytes());
            let bin = length - json_end as u32 - 8;
            file[json_end..json_end + 4].copy_from_slice(&bin.to_le_bytes());
        }
    }
    file
}

/// Changes a value of the document: its structure stays valid JSON, so that the change reaches further.
fn mutate_document(json: &Value, random: &mut Random) -> Value {
    let mut json = json.clone();
    for _ in 0..=random.below(3) {
        let mut value = &mut json;
        // Down to a random depth, along random members.
        loop {
            let count = match value {
                Value::Object(map) => map.len(),
                Value::Array(list) => list.len(),
                _ => 0,
            };
            if count == 0 || random.below(8) == 0 {
                break;
            }
            let index = random.below(count);
            value = match value {
                Value::Object(map) => map.values_mut().nth(index).unwrap(),
                Value::Array(list) => &mut list[index],
                _ => unreachable!("only objects and lists have members"),
            };
        }
        match value {
            Value::Number(number) => {
                *value = match random.below(4) {
                    0 => json!(number.as_i64().unwrap_or(0).wrapping_add(1)),
                    1 => json!(number.as_i64().unwrap_or(0).wrapping_sub(1)),
                    2 => json!(random.below(8)),
                    _ => serde_json::from_str(NUMBERS[random.below(NUMBERS.len() - 2)]).unwrap(),
                }
            }
            Value::Array(list) if !list.is_empty() && random.below(2) == 0 => {
                let copy = list[random.below(list.len())].clone();
                list.push(copy);
            }
            Value::Array(list) if !list.is_empty() => {
                list.remove(random.below(list.len()));
            }
            Value::Object(map) if !map.is_empty() => {
                let name = map.keys().nth(random.below(map.len())).unwrap().clone();
                map.remove(&name);
            }
            Value::String(text) => text.push('_'),
            _ => *value = json!({}),
        }
    }
    json
}

/// Loads mutations of a file, in the folder of the files that it refers to.
fn check(folder: &Path, name: &str, count: u64, mutated: impl Fn(&mut Random) -> Vec<u8>) {
    let options = LoadOptions {
        at: Some(0.5),
        variant: None,
        max_memory_bytes: 64 << 20,
        max_image_pixels: 1 << 20,
        ..LoadOptions::default()
    };
    survive(name, count, mutated, |bytes| load(&write(folder, name, bytes), &options).is_ok());
}

/// A file that uses most features of the importer.
fn rich_file() -> File {
    let texture = |index: usize| json!({"index": index, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}});
    let mut file = File::textured(&json!({
        "pbrMetallicRoughness": {"baseColorTexture": texture(0), "metallicRoughnessTexture": texture(0)},
        "normalTexture": {"index": 0}, "alphaMode": "MASK", "emissiveFactor": [1, 1, 1],
        "extensions": {"KHR_materials_volume": {"thicknessFactor": 1}, "KHR_materials_clearcoat": {"clearcoatFactor": 1},
            "KHR_materials_anisotropy": {"anisotropyStrength": 1}, "KHR_materials_iridescence": {"iridescenceFactor": 1},
            "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 1},
            "KHR_materials_dispersion": {"dispersion": 1}},
    }));
    file.texture(&png(2, 2, &[[1; 4], [2; 4], [3; 4], [4; 4]]));
    let indices = file.accessor("SCALAR", U8, 6, &[0, 1, 2, 2, 1, 0]);
    let values = file.view(&[0; 12]);
    let sparse = file.view(&[1, 2]);
    let joints = file.accessor("VEC4", U8, 3, &[0; 12]);
    let weights = file.accessor("VEC4", U8, 3, &[255; 12]);
    let translations = file.accessor("VEC3", F32, 2, &[0; 24]);
    let primitive = &mut file.json["meshes"][0]["primitives"][0];
    primitive["indices"] = json!(indices);
    primitive["mode"] = json!(5);
    primitive["attributes"]["JOINTS_0"] = json!(joints);
    primitive["attributes"]["WEIGHTS_0"] = json!(weights);
    primitive["targets"] = json!([{"POSITION": 0}]);
    file.json["meshes"][0]["weights"] = json!([0.5]);
    file.json["accessors"][1]["sparse"] = json!({
        "count": 1, "indices": {"bufferView": sparse, "componentType": U8}, "values": {"bufferView": values},
    });
    file.json["skins"] = json!([{"joints": [1]}]);
    let times = file.floats("SCALAR", &[0.0, 1.0]);
    let turns = file.floats("VEC4", &[0., 0., 0., 1., 0., 0., 1., 0.]);
    let tangents = file.floats("SCALAR", &[0.0; 6]);
    file.json["animations"] = json!([{
        "samplers": [
            {"input": times, "output": turns},
            {"input": times, "output": tangents, "interpolation": "CUBICSPLINE"},
        ],
        "channels": [
            {"sampler": 0, "target": {"node": 1, "path": "rotation"}},
            {"sampler": 1, "target": {"node": 0, "path": "weights"}},
        ],
    }]);
    file.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}]);
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot"}]}});
    file.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "children": [1, 2]},
        {"camera": 0, "rotation": [0, 0, 0, 1], "extensions": {"KHR_lights_punctual": {"light": 0}}},
        {"mesh": 0, "scale": [-1, 1, 1], "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translations}}}},
    ]);
    file
}

#[test]
fn mutated_files_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let file = rich_file();
    assert!(file.try_load().is_ok(), "{:?}", file.try_load().err());
    let glb = file.glb();
    check(folder.path(), "rich.glb", 800, |random| mutate(&glb, random));
    check(folder.path(), "tree.glb", 1500, |random| {
        let mut bin = file.bin.clone();
        if random.below(4) == 0 {
            let at = random.below(bin.len());
            bin[at] = random.byte();
        }
        File { json: mutate_document(&file.json, random), bin }.glb()
    });
    let mut document = file.json.clone();
    document["buffers"] = json!([{"byteLength": file.bin.len(), "uri": "rich.bin"}]);
    write(folder.path(), "rich.bin", &file.bin);
    let text = document.to_string().into_bytes();
    check(folder.path(), "rich.gltf", 400, |random| mutate(&text, random));
}

/// Mutations of the compressed data itself; those of the document are above.
fn mutate_bin(file: &[u8], random: &mut Random) -> Vec<u8> {
    let mut file = file.to_vec();
    let bin = 20 + u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize + 8;
    for _ in 0..=random.below(4) {
        let at = bin + random.below(file.len() - bin);
        match random.below(3) {
            0 => file[at] = random.byte(),
            1 => file[at] ^= 1 << random.below(8),
            _ => file[at..(at + 4).min(bin + (at - bin) / 4 * 4 + 4)].fill(0xff),
        }
    }
    file
}

#[test]
fn mutated_compressed_files_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    for (name, count) in [("meshopt.glb", 160), ("draco.glb", 400)] {
        let file = std::fs::read(data(name)).unwrap();
        check(folder.path(), name, count, |random| mutate_bin(&file, random));
        check(folder.path(), name, count / 4, |random| mutate(&file, random));
    }
}

/// Mutates each picture by itself, in a scene that shows it.
#[test]
fn mutated_textures_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = File::textured(&json!({"emissiveTexture": {"index": 0}}));
    scene.json["images"] = json!([{"uri": "picture"}]);
    scene.json["textures"] = json!([{"source": 0}]);
    let scene = write(folder.path(), "scene.glb", &scene.glb());
    let options = LoadOptions { max_memory_bytes: 64 << 20, max_image_pixels: 1 << 20, ..LoadOptions::default() };
    let level: Vec<u8> = (0..=255).collect();
    let mut pictures = [(37, 8, 8), (44, 4, 16), (133, 16, 32), (137, 16, 16), (145, 16, 16)]
        .map(|(format, width, height)| (format!("format {format}"), ktx2(format, width, height, &level)))
        .to_vec();
    let mut webp = std::io::Cursor::new(Vec::new());
    let pixels = image::RgbaImage::from_fn(16, 9, |x, y| image::Rgba([x as u8 * 9, y as u8, 5, 200]));
    pixels.write_to(&mut webp, image::ImageFormat::WebP).unwrap();
    pictures.push(("WebP".into(), webp.into_inner()));
    pictures.extend(scenes().map(|folder| sample_pictures(&folder)).into_iter().flatten());
    for (name, file) in pictures {
        let load_it = |bytes: &[u8]| {
            write(folder.path(), "picture", bytes);
            load(&scene, &options)
        };
        let loaded = load_it(&file).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(!warns(&loaded, &["magenta"]), "{name}: {:?}", loaded.warnings);
        survive(&name, 100, |random| mutate(&file, random), |bytes| load_it(bytes).is_ok());
    }
}

#[test]
fn mutated_sample_files_never_panic() {
    let Some(scenes) = scenes() else { return };
    let folder = tempfile::tempdir().unwrap();
    for name in ["CornellBox/CornellBox.glb", "playcanvas/Lights.glb"] {
        let file = std::fs::read(scenes.join("gltf").join(name)).unwrap();
        check(folder.path(), name.rsplit('/').next().unwrap(), 200, |random| mutate(&file, random));
    }
    let transform = scenes.join("gltf/blender-io/09_texture_transform");
    for entry in std::fs::read_dir(&transform).unwrap() {
        let entry = entry.unwrap();
        std::fs::write(folder.path().join(entry.file_name()), std::fs::read(entry.path()).unwrap()).unwrap();
    }
    let file = std::fs::read(transform.join("09_texture_transform.gltf")).unwrap();
    check(folder.path(), "09_texture_transform.gltf", 200, |random| mutate(&file, random));
}

#[test]
fn mutated_pictures_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path(), "scene.glb", &File::triangle().glb());
    let mut pictures = vec![("a.png", png(3, 2, &[[1, 2, 3, 4]; 6]))];
    let texels = image::Rgb32FImage::from_fn(16, 9, |x, y| image::Rgb([x as f32, y as f32, 0.5]));
    let mut hdr = std::io::Cursor::new(Vec::new());
    texels.write_to(&mut hdr, image::ImageFormat::Hdr).unwrap();
    pictures.push(("b.hdr", hdr.into_inner()));
    let mut jpeg = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_fn(16, 9, |x, y| image::Rgb([x as u8 * 9, y as u8, 5]))
        .write_to(&mut jpeg, image::ImageFormat::Jpeg)
        .unwrap();
    pictures.push(("c.jpg", jpeg.into_inner()));
    for compression in [exr::prelude::Encoding::SMALL_LOSSLESS, exr::prelude::Encoding::UNCOMPRESSED] {
        pictures.push(("d.exr", exr(compression)));
    }
    let options = LoadOptions { max_memory_bytes: 64 << 20, max_image_pixels: 1 << 20, ..LoadOptions::default() };
    for (name, file) in pictures {
        let path = write(folder.path(), name, &file);
        let options = LoadOptions { environment: Some(path.clone()), ..options.clone() };
        assert!(load(&scene, &options).is_ok(), "{name}: {:?}", load(&scene, &options).err());
        let load_it = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            load(&scene, &options).is_ok()
        };
        survive(name, 200, |random| mutate(&file, random), load_it);
    }
}

fn exr(encoding: exr::prelude::Encoding) -> Vec<u8> {
    use exr::prelude::{Image, Layer, LayerAttributes, SpecificChannels, WritableImage};
    let channels = SpecificChannels::rgb(|at: exr::math::Vec2<usize>| (at.0 as f32, at.1 as f32, 0.5f32));
    let layer = Layer::new((16, 9), LayerAttributes::named("main"), encoding, channels);
    let mut file = std::io::Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut file).unwrap();
    file.into_inner()
}
