//! Cameras, lights, and their defaults.

use std::f32::consts::FRAC_PI_4;

use bottega_scene::{Clip, LightKind, LoadOptions, Projection, SceneError, load};
use glam::Vec3;
use serde_json::json;

use crate::gltf::support::{File, png, warns, write};

#[test]
fn cameras_keep_their_direction_and_lose_their_scale() {
    let mut file = File::triangle();
    file.json["cameras"] = json!([
        {"name": "main", "type": "perspective", "perspective": {"yfov": 0.8, "aspectRatio": 1.5, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0, "zfar": 9}},
    ]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    file.json["nodes"] = json!([
        {"mesh": 0},
        // A quarter turn to the left: the camera looks along −x.
        {"camera": 0, "translation": [1, 2, 3], "rotation": [0, half, 0, half], "scale": [3, 5, 7]},
        {"camera": 1, "name": "side"},
        {"camera": 0, "name": "again"},
    ]);
    file.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    let cameras = file.load().scene.cameras;
    let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["main", "side", "again"]);
    assert_eq!(cameras[0].projection, Projection::Perspective { vertical_fov: 0.8 });
    assert_eq!((cameras[0].aspect, cameras[1].aspect), (Some(1.5), Some(1.5)));
    assert_eq!(cameras[1].projection, Projection::Orthographic { height: 4.0 });
    let world = cameras[0].world_from_camera;
    assert!((world.transform_vector3(Vec3::NEG_Z) - Vec3::NEG_X).length() < 1e-6);
    assert!((world.transform_vector3(Vec3::Y) - Vec3::Y).length() < 1e-6);
    assert_eq!(world.transform_point3(Vec3::ZERO), Vec3::new(1.0, 2.0, 3.0));
}

#[test]
fn cameras_have_the_clip_planes_of_the_file() {
    let clip = |camera: serde_json::Value| {
        let mut file = File::triangle();
        file.json["cameras"] = json!([camera]);
        file.json["nodes"][0]["camera"] = json!(0);
        let loaded = file.load();
        let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
        (loaded.scene.cameras[0].clip, warnings.iter().any(|warning| warning.contains("clip planes")))
    };
    let perspective = |znear: f32, zfar: Option<f32>| {
        let mut camera = json!({"type": "perspective", "perspective": {"yfov": 0.8, "znear": znear}});
        if let Some(zfar) = zfar {
            camera["perspective"]["zfar"] = json!(zfar);
        }
        camera
    };
    assert_eq!(clip(perspective(0.5, None)), (Clip { near: 0.5, far: f32::INFINITY }, false));
    assert_eq!(clip(perspective(0.5, Some(8.0))), (Clip { near: 0.5, far: 8.0 }, false));
    assert_eq!(clip(perspective(0.5, Some(0.25))), (Clip::NONE, true));
    let parallel = json!({"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0, "zfar": 9}});
    assert_eq!(clip(parallel), (Clip { near: 0.0, far: 9.0 }, false));
}

#[test]
fn cameras_that_show_nothing_are_errors() {
    for camera in [
        json!({"type": "perspective", "perspective": {"yfov": 0, "znear": 0.1}}),
        json!({"type": "perspective", "perspective": {"yfov": 4, "znear": 0.1}}),
        json!({"type": "orthographic", "orthographic": {"xmag": 0, "ymag": 2}}),
        json!({"type": "fisheye"}),
    ] {
        let mut file = File::triangle();
        file.json["cameras"] = json!([camera]);
        file.json["nodes"][0]["camera"] = json!(0);
        assert!(file.error().contains("cameras[0]"), "{camera}");
    }
}

#[test]
fn punctual_lights_stand_where_their_nodes_stand() {
    let mut file = File::triangle();
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"name": "bulb", "type": "point", "color": [1, 0.5, 0], "intensity": 4},
        {"type": "spot", "spot": {"innerConeAngle": 0.2}},
        {"type": "directional", "intensity": 3},
        {"type": "area"},
    ]}});
    let light = |index: usize| json!({"KHR_lights_punctual": {"light": index}});
    let half = std::f32::consts::FRAC_1_SQRT_2;
    file.json["nodes"] = json!([
        {"mesh": 0},
        {"extensions": light(0), "translation": [0, 9, 0], "scale": [3, 3, 3]},
        {"extensions": light(1), "name": "lamp"},
        // The directional light points down.
        {"extensions": light(2), "rotation": [-half, 0, 0, half]},
        {"extensions": light(3)},
    ]);
    file.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4]);
    let loaded = file.load();
    let lights = &loaded.scene.lights;
    assert_eq!((lights[0].name.as_str(), lights[1].name.as_str(), lights.len()), ("bulb", "lamp", 3));
    assert_eq!(lights[0].kind, LightKind::Point { position: Vec3::Y * 9.0, intensity: Vec3::new(4.0, 2.0, 0.0) });
    let LightKind::Spot { direction, cos_inner, cos_outer, .. } = lights[1].kind else { panic!("{:?}", lights[1]) };
    assert_eq!(direction, Vec3::NEG_Z);
    assert!((cos_inner - 0.2f32.cos()).abs() < 1e-6 && (cos_outer - FRAC_PI_4.cos()).abs() < 1e-6);
    let LightKind::Directional { direction, irradiance, .. } = lights[2].kind else { panic!("{:?}", lights[2]) };
    assert!((direction - Vec3::NEG_Y).length() < 1e-6);
    assert_eq!(irradiance, Vec3::splat(3.0));
    assert!(warns(&loaded, &["lights[3]", "area"]));
    assert!(loaded.scene.environment.is_none(), "lit scenes need no sky");
}

#[test]
fn a_scene_without_light_and_camera_gets_both() {
    let loaded = File::triangle().load();
    assert!(loaded.scene.environment.is_some() && loaded.scene.has_light());
    assert_eq!(loaded.scene.cameras.len(), 1);
    assert!(warns(&loaded, &["no light"]) && warns(&loaded, &["no camera"]));
}

#[test]
fn an_environment_can_be_given() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path(), "scene.glb", &File::triangle().glb());
    let picture = write(folder.path(), "sky.png", &png(2, 1, &[[255; 4], [0, 0, 0, 255]]));
    let options = LoadOptions {
        environment: Some(picture),
        environment_intensity: 2.0,
        environment_rotation: std::f32::consts::FRAC_PI_2,
        ..LoadOptions::default()
    };
    let loaded = load(&scene, &options).unwrap();
    let environment = loaded.scene.environment.unwrap();
    assert_eq!(environment.factor, Vec3::splat(2.0));
    assert!((environment.world_from_environment * Vec3::NEG_Z - Vec3::NEG_X).length() < 1e-6);
    let image = &loaded.scene.images[environment.image.unwrap().0 as usize];
    assert_eq!((image.texel(0, 0).x, image.texel(1, 0).x), (1.0, 0.0));
    // Without its environment the scene has another digest.
    assert_ne!(loaded.scene.digest, load(&scene, &LoadOptions::default()).unwrap().scene.digest);

    let missing = LoadOptions { environment: Some(folder.path().join("no.hdr")), ..LoadOptions::default() };
    assert!(matches!(load(&scene, &missing), Err(SceneError::Read { .. })));
    let no_picture = LoadOptions { environment: Some(scene.clone()), ..LoadOptions::default() };
    assert!(matches!(load(&scene, &no_picture), Err(SceneError::Picture { .. })));
}

#[test]
fn the_default_scene_is_shown_or_else_the_first() {
    let mut file = File::triangle();
    file.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}]);
    file.json["scenes"] = json!([{"nodes": [0]}, {"nodes": [1]}]);
    file.json["scene"] = json!(1);
    assert_eq!(file.load().scene.bounds().0.x, 5.0);
    file.json.as_object_mut().unwrap().remove("scene");
    let loaded = file.load();
    assert_eq!(loaded.scene.bounds().0.x, 0.0);
    assert!(warns(&loaded, &["scene", "first one"]));
    // Without scenes, all nodes without a parent are shown.
    file.json.as_object_mut().unwrap().remove("scenes");
    assert_eq!(file.load().scene.instances.len(), 2);
}

#[test]
fn ranges_of_lamps_are_reported() {
    for (light, is_reported) in [(json!({"type": "point", "range": 3.0}), true), (json!({"type": "point"}), false)] {
        let mut file = File::triangle();
        file.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
        file.json["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}});
        let loaded = file.load();
        assert_eq!((loaded.scene.lights.len(), warns(&loaded, &["lights[0].range"])), (1, is_reported));
    }
}
