//! The importer on scenes by other exporters, read from the folder in `BOTTEGA_SCENES`, against their JSON
//! and against another reader of the format.

use std::path::{Path, PathBuf};

use bottega_scene::{AlphaMode, LightKind, LoadOptions, Loaded, Scene, Sides, Surface, load};
use glam::{Mat4, Vec3};
use serde_json::Value;

pub(crate) fn scenes() -> Option<PathBuf> {
    let folder = std::env::var_os("BOTTEGA_SCENES").filter(|folder| !folder.is_empty()).map(PathBuf::from);
    if folder.is_none() {
        eprintln!("skipped: set BOTTEGA_SCENES to the folder of the sample scenes");
    }
    folder
}

fn read(folder: &Path, name: &str) -> Loaded {
    let path = folder.join("gltf").join(name);
    load(&path, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// Every `.gltf` and `.glb` below a folder, in order.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut pending = vec![folder.to_path_buf()];
    while let Some(folder) = pending.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                pending.push(path);
            } else if path.extension().is_some_and(|extension| extension == "gltf" || extension == "glb") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

fn json_of(path: &Path) -> Value {
    let bytes = std::fs::read(path).unwrap();
    if bytes.starts_with(b"glTF") {
        let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        serde_json::from_slice(&bytes[20..20 + length]).unwrap()
    } else {
        serde_json::from_slice(&bytes).unwrap()
    }
}

fn list<'a>(value: &'a Value, member: &str) -> &'a [Value] {
    value[member].as_array().map_or(&[], Vec::as_slice)
}

fn number(value: &Value, default: f32) -> f32 {
    value.as_f64().map_or(default, |number| number as f32)
}

fn color(value: &Value, default: Vec3) -> Vec3 {
    value.as_array().map_or(default, |list| Vec3::from_array([0, 1, 2].map(|index| number(&list[index], f32::NAN))))
}

/// Triangles that the nodes of the document show. (In all samples, every node is in the scene.)
fn triangles_by_json(json: &Value) -> u64 {
    let count =
        |accessor: &Value| list(json, "accessors")[accessor.as_u64().unwrap() as usize]["count"].as_u64().unwrap();
    let of_primitive = |primitive: &Value| match (primitive["mode"].as_u64().unwrap_or(4), &primitive["indices"]) {
        (4, Value::Null) => count(&primitive["attributes"]["POSITION"]) / 3,
        (4, indices) => count(indices) / 3,
        _ => 0,
    };
    let of_node = |node: &Value| {
        let Some(mesh) = node["mesh"].as_u64() else { return 0 };
        let instances = &node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["TRANSLATION"];
        let instances = if instances.is_null() { 1 } else { count(instances) };
        instances * list(&list(json, "meshes")[mesh as usize], "primitives").iter().map(of_primitive).sum::<u64>()
    };
    list(json, "nodes").iter().map(of_node).sum()
}

fn check_materials(json: &Value, scene: &Scene, name: &str) {
    for material in &scene.materials {
        let Some(description) = list(json, "materials").iter().find(|m| m["name"] == material.name.as_str()) else {
            assert!(material.name.is_empty(), "{name}: {}", material.name);
            continue;
        };
        let what = format!("{name}: {}", material.name);
        let extension = |extension: &str| &description["extensions"][extension];
        let is_unlit = matches!(material.surface, Surface::Unlit(_));
        assert_eq!(is_unlit, !extension("KHR_materials_unlit").is_null(), "{what}");
        let Some(layers) = material.layered() else { continue };
        if extension("KHR_materials_pbrSpecularGlossiness").is_null() {
            let pbr = &description["pbrMetallicRoughness"];
            assert_eq!(layers.base_color.factor, color(&pbr["baseColorFactor"], Vec3::ONE), "{what}");
            assert_eq!(material.opacity.factor, number(&pbr["baseColorFactor"][3], 1.0), "{what}");
            assert_eq!(layers.metallic.factor, number(&pbr["metallicFactor"], 1.0), "{what}");
            assert_eq!(layers.roughness.factor, number(&pbr["roughnessFactor"], 1.0), "{what}");
            assert_eq!(layers.base_color.texture.is_some(), !pbr["baseColorTexture"].is_null(), "{what}");
            assert_eq!(layers.roughness.texture.is_some(), !pbr["metallicRoughnessTexture"].is_null(), "{what}");
            assert_eq!(layers.ior, number(&extension("KHR_materials_ior")["ior"], 1.5), "{what}");
        }
        let strength = number(&extension("KHR_materials_emissive_strength")["emissiveStrength"], 1.0);
        assert_eq!(material.emission.factor, color(&description["emissiveFactor"], Vec3::ZERO) * strength, "{what}");
        assert_eq!(material.emission_sides == Sides::Both, description["doubleSided"] == true, "{what}");
        assert_eq!(material.relief.is_some(), !description["normalTexture"].is_null(), "{what}");
        let transmission = extension("KHR_materials_transmission");
        assert_eq!(layers.transmission.factor, number(&transmission["transmissionFactor"], 0.0), "{what}");
        let volume = extension("KHR_materials_volume");
        let is_solid = number(&volume["thicknessFactor"], 0.0) > 0.0;
        assert_eq!(layers.thin, !transmission.is_null() && !is_solid, "{what}");
        if is_solid {
            let distance = number(&volume["attenuationDistance"], f32::INFINITY);
            let color = color(&volume["attenuationColor"], Vec3::ONE);
            let found = material.interior.map_or(Vec3::ZERO, |medium| scene.media[medium.0 as usize].absorption);
            let passed = found * -distance.min(1e6);
            let passed = Vec3::new(passed.x.exp(), passed.y.exp(), passed.z.exp());
            assert!((passed - color).abs().max_element() < 1e-5, "{what}: {passed}");
        }
        let coat = extension("KHR_materials_clearcoat");
        assert_eq!(layers.coat.factor, number(&coat["clearcoatFactor"], 0.0), "{what}");
        assert_eq!(layers.coat_roughness.factor, number(&coat["clearcoatRoughnessFactor"], 0.0), "{what}");
        let strength = number(&extension("KHR_materials_anisotropy")["anisotropyStrength"], 0.0);
        assert_eq!(layers.anisotropy.as_ref().map_or(0.0, |anisotropy| anisotropy.strength), strength, "{what}");
        let sheen = extension("KHR_materials_sheen");
        assert_eq!(layers.sheen_color.factor, color(&sheen["sheenColorFactor"], Vec3::ZERO), "{what}");
        assert_eq!(layers.sheen_roughness.factor, number(&sheen["sheenRoughnessFactor"], 0.0), "{what}");
        let specular = extension("KHR_materials_specular");
        if !specular.is_null() {
            assert_eq!(layers.specular.factor, number(&specular["specularFactor"], 1.0), "{what}");
            assert_eq!(layers.specular_color.factor, color(&specular["specularColorFactor"], Vec3::ONE), "{what}");
        }
        let mode = match description["alphaMode"].as_str() {
            Some("BLEND") => AlphaMode::Blend,
            Some("MASK") => AlphaMode::Mask { cutoff: number(&description["alphaCutoff"], 0.5) },
            _ => AlphaMode::Opaque,
        };
        assert_eq!(material.alpha_mode, mode, "{what}");
    }
}

fn world_corners(scene: &Scene) -> Vec<Vec3> {
    let of_instance = |instance: &bottega_scene::Instance| {
        let mesh = &scene.meshes[instance.mesh as usize];
        let corner = |&vertex: &u32| instance.world_from_object.transform_point3(mesh.positions[vertex as usize]);
        mesh.triangles.iter().flatten().map(corner).collect::<Vec<_>>()
    };
    scene.instances.iter().flat_map(of_instance).collect()
}

/// The same corners by another reader of the format.
fn corners_by_another_reader(path: &Path) -> Vec<Vec3> {
    let bytes = std::fs::read(path).unwrap();
    let gltf = gltf::Gltf::from_slice_without_validation(&bytes).unwrap();
    let buffers: Vec<Vec<u8>> = gltf
        .buffers()
        .map(|buffer| match buffer.source() {
            gltf::buffer::Source::Bin => gltf.blob.clone().unwrap(),
            gltf::buffer::Source::Uri(uri) => std::fs::read(path.parent().unwrap().join(uri)).unwrap(),
        })
        .collect();
    let mut corners = Vec::new();
    let mut pending: Vec<(gltf::Node<'_>, Mat4)> =
        gltf.scenes().flat_map(|scene| scene.nodes()).map(|node| (node, Mat4::IDENTITY)).collect();
    while let Some((node, parent)) = pending.pop() {
        let world = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        pending.extend(node.children().map(|child| (child, world)));
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            if primitive.mode() != gltf::mesh::Mode::Triangles {
                continue;
            }
            let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()]));
            let positions: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from_array).collect();
            let indices: Vec<u32> = match reader.read_indices() {
                Some(indices) => indices.into_u32().collect(),
                None => (0..positions.len() as u32).collect(),
            };
            corners.extend(indices.iter().map(|&index| world.transform_point3(positions[index as usize])));
        }
    }
    corners
}

fn bounds_and_mean(corners: &[Vec3]) -> [Vec3; 3] {
    let min = corners.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let max = corners.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
    let sum = corners.iter().fold(glam::DVec3::ZERO, |sum, corner| sum + corner.as_dvec3());
    [min, max, (sum / corners.len() as f64).as_vec3()]
}

#[test]
fn every_sample_has_the_contents_of_its_json() {
    let Some(folder) = scenes() else { return };
    let folder = folder.join("gltf");
    let mut count = 0;
    for path in files(&folder).iter().filter(|path| !path.starts_with(folder.join("compressed"))) {
        let name = path.strip_prefix(&folder).unwrap().display().to_string();
        let loaded = load(path, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let scene = &loaded.scene;
        let json = json_of(path);
        let has_flat = loaded.warnings.iter().any(|warning| warning.message.contains("without area"));
        let expected = triangles_by_json(&json);
        let triangles = scene.triangle_count();
        assert!(triangles == expected || (has_flat && triangles < expected), "{name}: {triangles} of {expected}");
        check_materials(&json, scene, &name);
        let is_instanced = json["extensionsUsed"].to_string().contains("EXT_mesh_gpu_instancing");
        if !is_instanced && !has_flat {
            let ours = bounds_and_mean(&world_corners(scene));
            let theirs = bounds_and_mean(&corners_by_another_reader(path));
            let size = (theirs[1] - theirs[0]).length();
            for (ours, theirs) in ours.iter().zip(theirs) {
                assert!((*ours - theirs).length() < 1e-5 * size, "{name}: {ours} {theirs}");
            }
        }
        assert!(!loaded.warnings.iter().any(|warning| warning.message.contains("magenta")), "{name}");
        eprintln!(
            "{name}: {triangles} triangles, {} materials, {} images, {:?}",
            scene.materials.len(),
            scene.images.len(),
            loaded.warnings.iter().map(ToString::to_string).collect::<Vec<_>>()
        );
        count += 1;
    }
    assert!(count >= 20, "{count} samples");
}

#[test]
fn the_cornell_box_is_framed_through_its_open_side() {
    let Some(folder) = scenes() else { return };
    let loaded = read(&folder, "CornellBox/CornellBox.glb");
    let scene = &loaded.scene;
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.materials.len()), (6, 6, 5));
    assert_eq!(scene.materials[0].emission.factor, Vec3::splat(100.0));
    assert!(scene.environment.is_none());
    let camera = &scene.cameras[0];
    assert!((camera.world_from_camera.transform_vector3(Vec3::NEG_Z) - Vec3::NEG_Z).length() < 1e-6);
}

#[test]
fn the_flight_helmet_has_its_pictures() {
    let Some(folder) = scenes() else { return };
    let loaded = read(&folder, "FlightHelmet/FlightHelmet.gltf");
    // Fifteen files; no picture is used both for colours and for numbers. The sky is the last one.
    assert_eq!(loaded.scene.images.len(), 16);
    let summary = loaded.summary();
    assert_eq!((summary.mesh_count, summary.instance_count), (6, 6));
    assert!(summary.images.iter().any(|image| image.0.contains("LeatherPartsMat_BaseColor") && image.1 == 512));
    let lenses = loaded.scene.materials.iter().find(|material| material.name.contains("Lenses")).unwrap();
    assert_eq!(lenses.alpha_mode, AlphaMode::Blend);
}

#[test]
fn the_lights_sample_has_its_lights_and_its_camera() {
    let Some(folder) = scenes() else { return };
    let scene = read(&folder, "playcanvas/Lights.glb").scene;
    let names: Vec<&str> = scene.lights.iter().map(|light| light.name.as_str()).collect();
    assert_eq!(names, ["Light", "Spot", "Spot.001", "Sun"]);
    assert!(
        matches!(scene.lights[0].kind, LightKind::Point { intensity, .. } if intensity == Vec3::new(5.0, 0.0, 0.0))
    );
    // The second spot hangs above the origin and shines straight down.
    let LightKind::Spot { direction, position, .. } = scene.lights[2].kind else { panic!("{:?}", scene.lights[2]) };
    assert!((direction - Vec3::NEG_Y).length() < 1e-6 && position.y > 6.0);
    assert_eq!(scene.cameras.len(), 1);
    assert_eq!(scene.cameras[0].name, "Camera");
    // The camera looks at the cube in the origin.
    let camera = &scene.cameras[0].world_from_camera;
    let toward_cube = -Vec3::from(camera.translation).normalize();
    assert!(camera.transform_vector3(Vec3::NEG_Z).dot(toward_cube) > 0.99);
}

#[test]
fn environments_of_both_formats_are_read() {
    let Some(folder) = scenes() else { return };
    for name in ["chinese_garden_1k.hdr", "sunset.exr", "interior.exr"] {
        let options = LoadOptions { environment: Some(folder.join("hdri").join(name)), ..LoadOptions::default() };
        let loaded = load(&folder.join("gltf/playcanvas/Lights.glb"), &options).unwrap_or_else(|e| panic!("{e}"));
        let image = loaded.scene.images.last().unwrap();
        let mean = image.mean();
        assert!(image.is_high_dynamic_range() && image.size().0 == 2 * image.size().1, "{name}: {:?}", image.size());
        assert!(mean.is_finite() && mean.min_element() > 0.0, "{name}: {mean}");
        eprintln!("{name}: {:?}, mean {mean}", image.size());
    }
}
