//! Motion in scene files: what moves gets keys, and what is wrong with them is said.

use bottega_scene::{LightKind, LoadOptions, Loaded, SceneError, Shutter, load, save_scene};
use glam::Vec3;
use serde_json::json;

use crate::gltf::support::{File, write};
use crate::mutation::{damage, survive};

fn load_text(name: &str, text: &str) -> Result<Loaded, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    load(&write(folder.path(), name, text.as_bytes()), &LoadOptions::default())
}

fn warnings(loaded: &Loaded) -> String {
    loaded.warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// Where the keys of an instance put a point.
fn places(loaded: &Loaded, instance: usize, p: Vec3) -> Vec<(f64, Vec3)> {
    let keys = loaded.scene.instances[instance].motion.iter();
    keys.map(|key| (key.time, key.transform.transform_point3(p))).collect()
}

fn assert_near(found: Vec3, expected: Vec3) {
    assert!((found - expected).length() < 1e-4, "{found} instead of {expected}");
}

const PBRT: &str = r#"
    TransformTimes 2 6
    LookAt 0 0 5  0 0 0  0 1 0
    ActiveTransform EndTime  Translate 1 0 0  ActiveTransform All
    Camera "perspective" "float shutteropen" 3 "float shutterclose" 4
    WorldBegin
    LightSource "point" "point3 from" [0 3 0]
    ObjectBegin "beside" Translate 1 0 0 Shape "sphere" "float radius" 0.1 ObjectEnd
    AttributeBegin
    ActiveTransform EndTime  Translate 2 0 0  ActiveTransform All
    Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0]
    Shape "sphere" "float radius" 0.5
    LightSource "spot" "point3 from" [0 1 0] "point3 to" [0 0 0]
    AttributeEnd
    Shape "trianglemesh" "point3 P" [5 0 0 6 0 0 5 1 0]
    AttributeBegin
    ActiveTransform EndTime  Rotate 90 0 0 1  ActiveTransform All
    ObjectInstance "beside"
    AttributeEnd
"#;

#[test]
fn pbrts_transformations_at_two_times_are_keys() {
    let loaded = load_text("scene.pbrt", PBRT).unwrap();
    let scene = &loaded.scene;
    assert!(!warnings(&loaded).contains("move"), "{}", warnings(&loaded));
    assert_eq!(scene.shutter, Shutter { open: 3.0, close: 4.0, ramp: 0.0 });
    // Camera and lights
    let eyes: Vec<_> = scene.cameras[0].motion.iter().map(|key| (key.time, key.transform.translation.x)).collect();
    assert!(eyes.len() == 2 && eyes[0] == (2.0, 0.0) && eyes[1].0 == 6.0, "{eyes:?}");
    assert!((eyes[1].1.abs() - 1.0).abs() < 1e-5, "{eyes:?}");
    assert!(scene.lights[0].motion.is_empty() && scene.lights[1].motion.len() == 2);
    let moved = scene.lights[1].kind.moved(&scene.lights[1].motion[1].transform);
    assert!(matches!(moved, LightKind::Spot { position, .. } if (position - Vec3::new(2.0, 1.0, 0.0)).length() < 1e-5));
    // Shapes that move are not joined with those that stand
    let moving: Vec<usize> = (0..scene.instances.len()).filter(|&i| !scene.instances[i].motion.is_empty()).collect();
    assert!(moving.len() == 1 && scene.instances.len() == 2, "{moving:?}");
    let shifted = places(&loaded, moving[0], Vec3::ZERO);
    assert_eq!(shifted.iter().map(|key| key.0).collect::<Vec<_>>(), [2.0, 6.0]);
    assert_near(shifted[1].1 - shifted[0].1, Vec3::X * 2.0);
    let ball = &scene.spheres[0];
    assert_eq!((ball.motion.len(), ball.motion[1].center - ball.motion[0].center), (2, Vec3::X * 2.0));
    // What stands beside the axis of a rotation moves on an arc
    assert!(scene.spheres[1].motion.len() > 8);
    for key in &scene.spheres[1].motion {
        let angle = ((key.time - 2.0) / 4.0 * std::f64::consts::FRAC_PI_2) as f32;
        assert_near(key.center, Vec3::new(angle.cos(), angle.sin(), 0.0));
    }
}

#[test]
fn wrong_times_of_pbrt_are_errors() {
    let error = |text: &str| load_text("scene.pbrt", text).unwrap_err().to_string();
    let late = error("TransformTimes 3 1 WorldBegin");
    assert!(late.contains("TransformTimes") && late.contains("scene.pbrt`, line 1, column 1"), "{late}");
    let flat = "WorldBegin ActiveTransform EndTime Scale 1 0 1 ActiveTransform All Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]";
    let loaded = load_text("scene.pbrt", flat).unwrap();
    assert!(warnings(&loaded).contains("stays where it starts") && !loaded.scene.has_motion(), "{}", warnings(&loaded));
}

fn mitsuba(content: &str) -> String {
    format!("<scene version=\"3.0.0\">{content}</scene>")
}

const MOVES: &str = r#"<animation name="to_world"><transform time="0"><translate x="1"/></transform>
    <transform time="0.5"><translate x="2"/></transform><transform time="1"><translate x="5"/></transform></animation>"#;

#[test]
fn mitsubas_animations_are_keys() {
    let sensor = format!(
        r#"<sensor type="perspective"><float name="shutter_open" value="0.25"/><float name="shutter_close" value="1"/>{MOVES}</sensor>"#
    );
    let shapes = format!(
        r#"{sensor}<shape type="cube">{MOVES}</shape>
        <shape type="sphere"><point name="center" x="0" y="1" z="0"/>{MOVES}</shape>
        <shape type="shapegroup" id="g"><shape type="rectangle"/></shape>
        <shape type="instance"><ref id="g"/>{MOVES}</shape>
        <emitter type="point">{MOVES}<point name="position" x="0" y="0" z="1"/></emitter>"#
    );
    let loaded = load_text("scene.xml", &mitsuba(&shapes)).unwrap();
    let scene = &loaded.scene;
    assert_eq!(scene.shutter, Shutter { open: 0.25, close: 1.0, ramp: 0.0 });
    assert_eq!(scene.instances.len(), 2);
    for instance in 0..2 {
        let keys = places(&loaded, instance, Vec3::ZERO);
        assert_eq!(keys.iter().map(|key| (key.0, key.1.x)).collect::<Vec<_>>(), [(0.0, 1.0), (0.5, 2.0), (1.0, 5.0)]);
    }
    let centers: Vec<Vec3> = scene.spheres[0].motion.iter().map(|key| key.center).collect();
    assert_eq!(centers, [1.0, 2.0, 5.0].map(|x| Vec3::new(x, 1.0, 0.0)));
    assert_eq!(scene.cameras[0].motion[2].transform.translation.x, 5.0);
    assert_eq!(scene.lights[0].motion[2].transform.translation.x, 4.0);
    // A closed shutter, and an open one by option
    let closed = mitsuba(&shapes.replace("value=\"1\"/>", "value=\"0.25\"/>"));
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "scene.xml", closed.as_bytes());
    assert!(load(&path, &LoadOptions::default()).unwrap().scene.shutter.is_instant());
    let options = LoadOptions { shutter: Shutter::new(0.0, 0.5), at: Some(2.0), ..LoadOptions::default() };
    assert_eq!(load(&path, &options).unwrap().scene.shutter, Shutter { open: 2.0, close: 2.5, ramp: 0.0 });
}

#[test]
fn wrong_animations_of_mitsuba_are_errors() {
    let error = |content: &str| load_text("scene.xml", &mitsuba(content)).unwrap_err().to_string();
    let shape = |keys: &str| format!("<shape type=\"cube\"><animation name=\"to_world\">{keys}</animation></shape>");
    let key = |time: &str| format!("<transform {time}><translate x=\"1\"/></transform>");
    let unordered = error(&shape(&(key("time=\"1\"") + &key("time=\"1\""))));
    assert!(unordered.contains("must ascend") && unordered.contains("scene.xml`, line 1"), "{unordered}");
    let timeless = error(&shape(&(key("time=\"1\"") + &key(""))));
    assert!(timeless.contains("no `time`"), "{timeless}");
    let backwards = r#"<sensor type="perspective"><float name="shutter_open" value="2"/><float name="shutter_close" value="1"/></sensor>"#;
    assert!(error(backwards).contains("closes before it opens"));
}

/// A triangle that a node shifts by 4 in a second, a camera and a light on nodes of their own.
fn animated() -> File {
    let mut file = File::triangle();
    let input = file.floats("SCALAR", &[0.0, 1.0]);
    let shift = file.floats("VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    file.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.01}}));
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot"}]}});
    file.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    let camera = file.push("nodes", json!({"camera": 0}));
    let lamp = file.push("nodes", json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    file.json["scenes"][0]["nodes"] = json!([0, camera, lamp]);
    let channel = |node: usize| json!({"sampler": 0, "target": {"node": node, "path": "translation"}});
    file.push(
        "animations",
        json!({"samplers": [{"input": input, "output": shift}], "channels": [channel(0), channel(camera), channel(lamp)]}),
    );
    file
}

fn load_open(file: &File, at: Option<f32>, shutter: Shutter) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let options = LoadOptions { at, shutter: Some(shutter), ..LoadOptions::default() };
    load(&write(folder.path(), "scene.glb", &file.glb()), &options).unwrap()
}

#[test]
fn nodes_of_gltf_move_while_the_shutter_is_open() {
    let loaded = load_open(&animated(), Some(0.25), Shutter { open: 0.0, close: 0.5, ramp: 0.25 });
    let scene = &loaded.scene;
    assert_eq!(scene.shutter, Shutter { open: 0.25, close: 0.75, ramp: 0.25 });
    let keys = places(&loaded, 0, Vec3::ZERO);
    assert!(keys.len() > 2 && keys[0].0 == 0.25 && keys[keys.len() - 1].0 == 0.75, "{keys:?}");
    assert!(keys.iter().all(|(time, p)| (p.x - 4.0 * *time as f32).abs() < 1e-5), "{keys:?}");
    assert_eq!(scene.instances[0].world_from_object.translation.x, 1.0);
    assert!((scene.cameras[0].motion.last().unwrap().transform.translation.x - 3.0).abs() < 1e-5);
    assert!((scene.lights[0].motion.last().unwrap().transform.translation.x - 2.0).abs() < 1e-5);
    // Open for no time, or before anything moves
    let still = load_open(&animated(), Some(0.25), Shutter::default());
    assert!(!still.scene.has_motion() && still.scene.instances[0].world_from_object.translation.x == 1.0);
    let late = load_open(&animated(), None, Shutter { open: 2.0, close: 3.0, ramp: 0.0 });
    assert!(!late.scene.has_motion() && warnings(&late).contains("nothing moves"), "{}", warnings(&late));
}

#[test]
fn morphs_and_skins_of_gltf_move_vertices() {
    let mut file = File::triangle();
    let target = file.floats("VEC3", &[0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0]);
    file.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": target}]);
    let input = file.floats("SCALAR", &[0.0, 1.0]);
    let output = file.floats("SCALAR", &[0.0, 1.0]);
    file.push(
        "animations",
        json!({"samplers": [{"input": input, "output": output}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}),
    );
    let morphed = load_open(&file, None, Shutter { open: 0.0, close: 1.0, ramp: 0.0 });
    let mut skinned = File::triangle();
    let joints = skinned.accessor("VEC4", 5121, 3, &[0; 12]);
    let weights = skinned.floats("VEC4", &[1., 0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0.]);
    let attributes = &mut skinned.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    skinned.json["skins"] = json!([{"joints": [1]}]);
    skinned.json["nodes"] = json!([{"mesh": 0, "skin": 0}, {}]);
    skinned.json["scenes"][0]["nodes"] = json!([0, 1]);
    let input = skinned.floats("SCALAR", &[0.0, 1.0]);
    let output = skinned.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
    skinned.push(
        "animations",
        json!({"samplers": [{"input": input, "output": output}],
            "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]}),
    );
    let skinned = load_open(&skinned, None, Shutter { open: 0.0, close: 1.0, ramp: 0.0 });
    for (loaded, speed) in [(morphed, [1.0, 2.0, 3.0]), (skinned, [2.0; 3])] {
        let mesh = &loaded.scene.meshes[0];
        assert!(mesh.motion.len() > 2 && loaded.scene.instances[0].motion.is_empty());
        for key in &mesh.motion {
            for (vertex, speed) in speed.into_iter().enumerate() {
                let moved = key.positions[vertex] - mesh.positions[vertex];
                assert_near(moved, Vec3::Z * speed * key.time as f32);
            }
        }
    }
}

#[test]
fn motion_is_saved_and_damaged_files_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bottega");
    let mut scene = load_text("scene.pbrt", PBRT).unwrap().scene;
    let mesh = &mut scene.meshes[0];
    let key = |time: f64| bottega_scene::MeshKey {
        time,
        positions: mesh.positions.iter().map(|&p| p * (1.0 + time as f32)).collect(),
        normals: mesh.normals.clone(),
    };
    mesh.motion = vec![key(0.1), key(0.3)];
    save_scene(&path, &scene, &Default::default()).unwrap();
    let file = std::fs::read(&path).unwrap();
    assert_eq!(file[8], 3, "the version of scenes that move");
    let after = load(&path, &LoadOptions::default()).unwrap().scene;
    assert!(after.meshes == scene.meshes && after.instances == scene.instances && after.spheres == scene.spheres);
    assert!(after.lights == scene.lights && after.cameras == scene.cameras && after.shutter == scene.shutter);
    // The last blocks are the keys
    let options = LoadOptions { max_memory_bytes: 64 << 20, ..LoadOptions::default() };
    let start = file.len().saturating_sub(400);
    survive(
        "saved motion",
        300,
        |random| {
            let mut file = file.clone();
            let at =
                if random.below(2) == 0 { start + random.below(file.len() - start) } else { random.below(file.len()) };
            damage(&mut file, at, random);
            file
        },
        |bytes| {
            std::fs::write(&path, bytes).unwrap();
            load(&path, &options).is_ok()
        },
    );
}
