//! Animations, skins and morph targets at a time, against poses computed by hand.

use std::f32::consts::FRAC_1_SQRT_2;

use bottega_scene::{LightKind, LoadOptions, Loaded, Projection, SceneError, load};
use glam::Vec3;
use serde_json::{Value, json};

use crate::gltf::support::{File, U8, warns, write};

fn try_load_with(file: &File, options: &LoadOptions) -> Result<Loaded, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    load(&write(folder.path(), "scene.glb", &file.glb()), options)
}

fn options(at: f32) -> LoadOptions {
    LoadOptions { at: Some(at), ..LoadOptions::default() }
}

fn load_at(file: &File, at: f32) -> Loaded {
    try_load_with(file, &options(at)).unwrap_or_else(|error| panic!("{error}"))
}

/// The corners of the first triangle, in world space.
fn corners(loaded: &Loaded) -> [Vec3; 3] {
    let instance = &loaded.scene.instances[0];
    let mesh = &loaded.scene.meshes[instance.mesh as usize];
    mesh.triangles[0].map(|vertex| instance.world_from_object.transform_point3(mesh.positions[vertex as usize]))
}

fn assert_near(a: Vec3, b: Vec3) {
    assert!((a - b).length() < 1e-5, "{a} instead of {b}");
}

/// Adds an animation of one property of a node.
fn animate(file: &mut File, node: usize, path: &str, interpolation: &str, times: &[f32], values: &[f32]) -> usize {
    let kind = match path {
        "rotation" => "VEC4",
        "weights" => "SCALAR",
        _ => "VEC3",
    };
    let input = file.floats("SCALAR", times);
    let output = file.floats(kind, values);
    file.push(
        "animations",
        json!({
            "name": format!("{path} of {node}"),
            "samplers": [{"input": input, "output": output, "interpolation": interpolation}],
            "channels": [{"sampler": 0, "target": {"node": node, "path": path}}],
        }),
    )
}

#[test]
fn linear_and_stepped_keys_move_a_node_and_hold_at_the_ends() {
    for (interpolation, expected) in
        [("LINEAR", [1.0, 1.0, 2.0, 3.0, 5.0, 5.0]), ("STEP", [1.0, 1.0, 1.0, 3.0, 3.0, 5.0])]
    {
        let mut file = File::triangle();
        animate(&mut file, 0, "translation", interpolation, &[1., 2., 4.], &[1., 0., 0., 3., 0., 0., 5., 0., 0.]);
        for (time, x) in [0.0, 1.0, 1.5, 2.0, 4.0, 9.0].into_iter().zip(expected) {
            // At the last key itself, its value holds.
            let x = if time == 4.0 { 5.0 } else { x };
            assert_near(corners(&load_at(&file, time))[0], Vec3::X * x);
        }
    }
}

#[test]
fn splines_leave_and_arrive_with_their_tangents() {
    let mut file = File::triangle();
    // Keys of value 0 and 1 two seconds apart; tangents 3 out of the first and −1 into the second.
    let key = |tangent_in: f32, value: f32, tangent_out: f32| {
        [[0.0, tangent_in, 0.0], [0.0, value, 0.0], [0.0, tangent_out, 0.0]].concat()
    };
    let values = [key(9.0, 0.0, 3.0), key(-1.0, 1.0, 9.0)].concat();
    animate(&mut file, 0, "translation", "CUBICSPLINE", &[0.0, 2.0], &values);
    let height = |time: f32| corners(&load_at(&file, time))[0].y;
    // s = 1/2: (v₀ + v₁)/2 + t(b₀ − a₁)/8; s = 1/4: 10/64 v₁ + t(9/64 b₀ − 3/64 a₁).
    assert!((height(1.0) - (0.5 + 2.0 * 4.0 / 8.0)).abs() < 1e-6, "{}", height(1.0));
    assert!((height(0.5) - (10.0 + 2.0 * (27.0 + 3.0)) / 64.0).abs() < 1e-6, "{}", height(0.5));
    assert_eq!((height(0.0), height(2.0), height(-1.0), height(3.0)), (0.0, 1.0, 0.0, 1.0));
}

#[test]
fn rotations_take_the_shortest_arc_at_constant_speed() {
    let half = FRAC_1_SQRT_2;
    // A quarter turn about z, spelled with either sign.
    for sign in [1.0, -1.0] {
        let mut file = File::triangle();
        animate(&mut file, 0, "rotation", "LINEAR", &[0., 3.], &[0., 0., 0., 1., 0., 0., half * sign, half * sign]);
        let angle = 30f32.to_radians();
        assert_near(corners(&load_at(&file, 1.0))[1], Vec3::new(angle.cos(), angle.sin(), 0.0));
        assert_near(corners(&load_at(&file, 3.0))[1], Vec3::Y);
    }
    // Splines are brought to unit length.
    let mut file = File::triangle();
    let zero = [0.0; 4];
    let values = [zero, [0., 0., 0., 1.], zero, zero, [0., 0., half, half], zero].concat();
    animate(&mut file, 0, "rotation", "CUBICSPLINE", &[0.0, 1.0], &values);
    assert_near(corners(&load_at(&file, 0.5))[1], Vec3::new(half, half, 0.0));
}

#[test]
fn normalized_integers_are_decoded() {
    let mut file = File::triangle();
    animate(&mut file, 0, "rotation", "STEP", &[0.0], &[0.0, 0.0, 0.0, 1.0]);
    let turned: Vec<u8> = [0i16, 0, 23170, 23170].iter().flat_map(|v| v.to_le_bytes()).collect();
    let output = file.accessor("VEC4", 5122, 1, &turned);
    file.json["accessors"][output]["normalized"] = json!(true);
    file.json["animations"][0]["samplers"][0]["output"] = json!(output);
    assert_near(corners(&load_at(&file, 0.0))[1], Vec3::Y);
}

#[test]
fn weights_morph_every_target_for_itself() {
    let mut file = File::triangle();
    let up = file.floats("VEC3", &[0., 0., 1.].repeat(3));
    let right = file.floats("VEC3", &[1., 0., 0.].repeat(3));
    file.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": up}, {"POSITION": right}]);
    file.json["meshes"][0]["weights"] = json!([9.0, 9.0]);
    animate(&mut file, 0, "weights", "LINEAR", &[0., 1.], &[0., 1., 1., 3.]);
    assert_near(corners(&load_at(&file, 0.0))[0], Vec3::new(1.0, 0.0, 0.0));
    assert_near(corners(&load_at(&file, 0.5))[0], Vec3::new(2.0, 0.0, 0.5));
    assert_near(corners(&file.load())[0], Vec3::new(9.0, 0.0, 9.0));
    // Keys of a spline hold all tangents, then all values, then all tangents.
    file.json["animations"] = json!([]);
    animate(&mut file, 0, "weights", "CUBICSPLINE", &[0.], &[7., 7., 2., 4., 7., 7.]);
    assert_near(corners(&load_at(&file, 0.0))[0], Vec3::new(4.0, 0.0, 2.0));
}

/// A triangle with one corner on a joint at the origin, one on a joint at (0, 0, 4), and one on both.
fn skinned() -> File {
    let mut file = File::triangle();
    let joints = file.accessor("VEC4", U8, 3, &[0, 1, 0, 0].repeat(3));
    let weights = file.floats("VEC4", &[1., 0., 0., 0., 0., 1., 0., 0., 0.5, 0.5, 0., 0.]);
    let attributes = &mut file.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    file.json["skins"] = json!([{"joints": [1, 2]}]);
    file.json["scenes"][0]["nodes"] = json!([0, 1]);
    file.json["nodes"] = json!([{"mesh": 0, "skin": 0}, {"children": [2]}, {"translation": [0, 0, 4]}]);
    file
}

#[test]
fn animated_joints_carry_their_vertices() {
    let mut file = skinned();
    let half = FRAC_1_SQRT_2;
    animate(&mut file, 1, "rotation", "LINEAR", &[0., 1.], &[0., 0., 0., 1., 0., 0., half, half]);
    animate(&mut file, 2, "translation", "LINEAR", &[0., 1.], &[0., 0., 4., 0., 0., 6.]);
    let at_rest = [Vec3::ZERO, Vec3::new(1.0, 0.0, 4.0), Vec3::new(0.0, 1.0, 2.0)];
    for (corner, expected) in corners(&load_at(&file, 0.0)).into_iter().zip(at_rest) {
        assert_near(corner, expected);
    }
    // A quarter turn takes x to y and y to −x, for the child too; the child stands at 6.
    let turned = [Vec3::ZERO, Vec3::new(0.0, 1.0, 6.0), Vec3::new(-1.0, 0.0, 3.0)];
    for (corner, expected) in corners(&load_at(&file, 1.0)).into_iter().zip(turned) {
        assert_near(corner, expected);
    }
}

#[test]
fn the_first_animation_of_a_property_holds_and_others_can_be_chosen() {
    let mut file = File::triangle();
    animate(&mut file, 0, "translation", "STEP", &[0.], &[1., 0., 0.]);
    animate(&mut file, 0, "translation", "STEP", &[0.], &[2., 0., 0.]);
    animate(&mut file, 0, "scale", "STEP", &[0.], &[3., 3., 3.]);
    file.json["animations"][1]["name"] = json!("walk");
    let shown = |animation: Option<&str>, at: Option<f32>| {
        let options = LoadOptions { at, animation: animation.map(Into::into), ..LoadOptions::default() };
        try_load_with(&file, &options).map(|loaded| corners(&loaded)[1].x)
    };
    assert_eq!(shown(None, None).unwrap(), 1.0, "the node as it stands");
    assert_eq!(shown(None, Some(0.0)).unwrap(), 4.0);
    assert_eq!(shown(Some("walk"), Some(0.0)).unwrap(), 3.0);
    assert_eq!(shown(Some("walk"), None).unwrap(), 3.0);
    assert_eq!(shown(Some("2"), Some(0.0)).unwrap(), 3.0);
    let error = shown(Some("run"), None).unwrap_err();
    assert!(matches!(error, SceneError::NoSuch { .. }) && error.to_string().contains("1 `walk`"), "{error}");
    assert!(warns(&file.load(), &["animations", "name a time"]));
    assert!(warns(&load_at(&File::triangle(), 1.0), &["no animations"]));
}

#[test]
fn cameras_and_digests_follow_the_time() {
    let mut file = File::triangle();
    file.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}]);
    file.json["nodes"][0]["camera"] = json!(0);
    animate(&mut file, 0, "translation", "LINEAR", &[0., 1.], &[0., 0., 0., 0., 0., 8.]);
    let (before, after) = (load_at(&file, 0.25), load_at(&file, 0.5));
    assert_eq!(Vec3::from(before.scene.cameras[0].world_from_camera.translation), Vec3::Z * 2.0);
    assert_eq!(Vec3::from(after.scene.cameras[0].world_from_camera.translation), Vec3::Z * 4.0);
    assert_ne!(before.scene.digest, after.scene.digest);
    assert_eq!(before.scene.digest, load_at(&file, 0.25).scene.digest);
}

#[test]
fn an_animated_matrix_is_taken_apart() {
    let mut file = File::triangle();
    file.json["nodes"][0]["matrix"] = json!([0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 5, 0, 0, 1]);
    animate(&mut file, 0, "translation", "STEP", &[0.], &[0., 0., 7.]);
    assert_near(corners(&load_at(&file, 0.0))[1], Vec3::new(0.0, 2.0, 7.0));
}

#[test]
fn unsupported_animations_are_named() {
    let mut file = File::triangle();
    animate(&mut file, 0, "translation", "LINEAR", &[0., 1.], &[0., 0., 0., 4., 0., 0.]);
    let target = |file: &mut File, target: Value| file.json["animations"][0]["channels"][0]["target"] = target;
    target(&mut file, json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/materials/0"}}}));
    assert!(warns(&load_at(&file, 0.0), &["animations[0]", "KHR_animation_pointer"]));
    target(&mut file, json!({"path": "mood", "node": 0}));
    assert!(warns(&load_at(&file, 0.0), &["animations[0]", "`mood`"]));
    let error = |file: &File| try_load_with(file, &options(0.0)).unwrap_err().to_string();
    target(&mut file, json!({"path": "scale", "node": 5}));
    assert!(error(&file).contains("animations[0].channels[0].target.node"));
    target(&mut file, json!({"path": "rotation", "node": 0}));
    assert!(error(&file).contains("instead of 4"));
    target(&mut file, json!({"path": "translation", "node": 0}));
    file.json["animations"][0]["samplers"][0]["interpolation"] = json!("CUBICSPLINE");
    assert!(error(&file).contains("2 values for 2 times, not 3 for each"));
    file.json["animations"][0]["samplers"][0]["interpolation"] = json!("WOBBLE");
    assert!(error(&file).contains("`WOBBLE`"));
    file.json["animations"][0]["channels"][0]["sampler"] = json!(1);
    assert!(error(&file).contains("sampler 1"));
}

/// Adds an animation of the target of a pointer.
fn point(file: &mut File, pointer: &str, kind: &str, times: &[f32], values: &[f32]) {
    let input = file.floats("SCALAR", times);
    let output = file.floats(kind, values);
    let target = json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}});
    file.push(
        "animations",
        json!({
            "samplers": [{"input": input, "output": output}],
            "channels": [{"sampler": 0, "target": target}],
        }),
    );
}

#[test]
fn pointers_animate_materials_lights_cameras_and_nodes() {
    let mut file = File::triangle();
    let material = file.push("materials", json!({"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]}}));
    file.json["meshes"][0]["primitives"][0]["material"] = json!(material);
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 1}]}});
    file.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1}}]);
    file.json["nodes"][0]["camera"] = json!(0);
    file.json["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
    file.json["extensionsUsed"] = json!(["KHR_animation_pointer", "KHR_lights_punctual"]);
    file.json["extensionsRequired"] = file.json["extensionsUsed"].clone();
    let times = [0.0, 2.0];
    point(
        &mut file,
        "/materials/0/pbrMetallicRoughness/baseColorFactor",
        "VEC4",
        &times,
        &[0., 0., 0., 1., 1., 0.5, 0., 1.],
    );
    point(&mut file, "/materials/0/pbrMetallicRoughness/roughnessFactor", "SCALAR", &times, &[0.0, 1.0]);
    point(&mut file, "/materials/0/emissiveFactor", "VEC3", &times, &[0., 0., 0., 1., 1., 2.]);
    point(&mut file, "/extensions/KHR_lights_punctual/lights/0/intensity", "SCALAR", &times, &[2.0, 4.0]);
    point(&mut file, "/cameras/0/perspective/yfov", "SCALAR", &times, &[0.5, 1.0]);
    point(&mut file, "/nodes/0/translation", "VEC3", &times, &[0., 0., 0., 2., 0., 0.]);
    point(&mut file, "/nodes/0/name", "SCALAR", &times, &[0.0, 1.0]);
    let loaded = load_at(&file, 1.0);
    let scene = &loaded.scene;
    let layered = scene.materials[0].layered().unwrap();
    assert_eq!(layered.base_color.factor, Vec3::new(0.5, 0.25, 0.0));
    assert_eq!((layered.roughness.factor, layered.metallic.factor), (0.5, 1.0));
    assert_eq!(scene.materials[0].emission.factor, Vec3::new(0.5, 0.5, 1.0));
    let LightKind::Point { intensity, position } = scene.lights[0].kind else { panic!() };
    assert_eq!((intensity, position), (Vec3::splat(3.0), Vec3::X));
    let Projection::Perspective { vertical_fov } = scene.cameras[0].projection else { panic!() };
    assert_eq!(vertical_fov, 0.75);
    assert!(warns(&loaded, &["`/nodes/0/name`", "KHR_animation_pointer"]), "{:?}", loaded.warnings);
    assert!(try_load_with(&file, &LoadOptions { strict: true, ..options(1.0) }).is_err());
    // Without a time the scene is as the file describes it.
    let still = try_load_with(&file, &LoadOptions::default()).unwrap().scene;
    assert_eq!(still.materials[0].layered().unwrap().base_color.factor, Vec3::ONE);
}

#[test]
fn hidden_nodes_are_left_out_until_they_are_shown() {
    let mut file = File::triangle();
    let child = file.json["nodes"].as_array().unwrap().len();
    let mesh = file.json["nodes"][0]["mesh"].clone();
    file.push("nodes", json!({"mesh": mesh, "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    file.json["nodes"][0]["children"] = json!([child]);
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}});
    file.json["extensionsUsed"] = json!(["KHR_node_visibility"]);
    for (visible, count) in [(None, 2), (Some(true), 2), (Some(false), 0)] {
        file.json["nodes"][0]["extensions"] =
            visible.map_or(json!({}), |v| json!({"KHR_node_visibility": {"visible": v}}));
        let scene = file.load().scene;
        assert_eq!((scene.instances.len(), scene.lights.len()), (count, count / 2), "{visible:?}");
    }
    // By step, from false to true.
    let input = file.floats("SCALAR", &[0.0, 1.0]);
    let output = file.accessor("SCALAR", U8, 2, &[0, 1]);
    let pointer = "/nodes/0/extensions/KHR_node_visibility/visible";
    let target = json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}});
    let sampler = json!({"input": input, "output": output, "interpolation": "STEP"});
    file.push("animations", json!({"samplers": [sampler], "channels": [{"sampler": 0, "target": target}]}));
    assert_eq!(load_at(&file, 0.5).scene.instances.len(), 0);
    assert_eq!(load_at(&file, 1.5).scene.instances.len(), 2);
}

#[test]
fn a_node_that_is_scaled_flat_is_a_flat_surface() {
    let area = |loaded: &Loaded| -> f32 {
        let of = |instance: &bottega_scene::Instance| -> f32 {
            let mesh = &loaded.scene.meshes[instance.mesh as usize];
            let place = |vertex: u32| instance.world_from_object.transform_point3(mesh.positions[vertex as usize]);
            mesh.triangles
                .iter()
                .map(|t| (place(t[1]) - place(t[0])).cross(place(t[2]) - place(t[0])).length() / 2.0)
                .sum()
        };
        loaded.scene.instances.iter().map(of).sum()
    };
    let triangle = area(&File::triangle().load());
    assert!(triangle > 0.0);
    let flat = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 3, 1]);
    for (node, warned, expected) in [
        (json!({"scale": [1, 1, 0]}), false, triangle),
        (json!({"scale": [2, 1, 0], "rotation": [0.5, 0.5, 0.5, 0.5]}), false, 2.0 * triangle),
        (json!({"matrix": flat}), false, triangle),
        // Scaled to a plane or a line: the mesh is dropped with a warning; a scale of three zeros hides it on purpose.
        (json!({"scale": [0, 1, 1]}), true, 0.0),
        (json!({"scale": [1, 0, 0]}), true, 0.0),
        (json!({"scale": [0, 0, 0]}), false, 0.0),
    ] {
        let mut file = File::triangle();
        for (name, value) in node.as_object().unwrap() {
            file.json["nodes"][0][name] = value.clone();
        }
        let loaded = file.load();
        assert!((area(&loaded) - expected).abs() < 1e-5, "{node}: {}", area(&loaded));
        assert_eq!(warns(&loaded, &["nodes[0]", "left out"]), warned, "{node}: {:?}", loaded.warnings);
    }
    // By a parent, by an animation, by an instance.
    let mut file = File::triangle();
    let parent = file.push("nodes", json!({"scale": [1, 1, 0], "children": [0]}));
    file.json["scenes"] = json!([{"nodes": [parent]}]);
    assert!((area(&file.load()) - triangle).abs() < 1e-5);
    let mut file = File::triangle();
    animate(&mut file, 0, "scale", "LINEAR", &[0.0, 1.0], &[1., 1., 1., 1., 1., 0.]);
    assert!((area(&load_at(&file, 1.0)) - triangle).abs() < 1e-5);
    let mut file = File::triangle();
    let scales = file.floats("VEC3", &[1., 1., 0., 1., 1., 1., 3., 1., 0.]);
    file.json["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": {"SCALE": scales}}});
    assert!((area(&file.load()) - 5.0 * triangle).abs() < 1e-5);
}
