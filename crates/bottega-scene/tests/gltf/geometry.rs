//! Meshes and their positions.

use glam::{Vec2, Vec3, Vec4};
use serde_json::json;

use crate::gltf::support::{F32, File, U8, U16, U32, warns};

/// World-space corners of every triangle of the scene, instance by instance.
fn world_triangles(scene: &bottega_scene::Scene) -> Vec<[Vec3; 3]> {
    let mut list = Vec::new();
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh as usize];
        let corner = |vertex: u32| instance.world_from_object.transform_point3(mesh.positions[vertex as usize]);
        list.extend(mesh.triangles.iter().map(|triangle| triangle.map(corner)));
    }
    list
}

fn normal([a, b, c]: [Vec3; 3]) -> Vec3 {
    (b - a).cross(c - a).normalize()
}

/// A 2 × 3 grid of points in the plane z = 0.
fn grid(file: &mut File) -> usize {
    let points: Vec<f32> = (0..6).flat_map(|i| [(i / 2) as f32, (i % 2) as f32, 0.0]).collect();
    file.floats("VEC3", &points)
}

#[test]
fn strips_and_fans_become_triangles_that_all_face_the_same_way() {
    let mut file = File::new();
    let positions = grid(&mut file);
    file.primitive(json!({"attributes": {"POSITION": positions}, "mode": 5}));
    let scene = file.load().scene;
    let triangles = world_triangles(&scene);
    assert_eq!(triangles.len(), 4);
    assert!(triangles.iter().all(|&triangle| normal(triangle) == Vec3::NEG_Z));

    let mut file = File::new();
    let positions = file.floats("VEC3", &[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0., -1., 1., 0.]);
    file.primitive(json!({"attributes": {"POSITION": positions}, "mode": 6}));
    let triangles = world_triangles(&file.load().scene);
    assert_eq!(triangles.len(), 3);
    assert!(triangles.iter().all(|&triangle| normal(triangle) == Vec3::Z && triangle.contains(&Vec3::ZERO)));
}

#[test]
fn points_and_lines_are_left_out_with_a_warning() {
    for mode in 0..4 {
        let mut file = File::triangle();
        let primitive = file.json["meshes"][0]["primitives"][0].clone();
        file.primitive(primitive);
        file.json["meshes"][0]["primitives"][1]["mode"] = json!(mode);
        let loaded = file.load();
        assert_eq!(loaded.scene.triangle_count(), 1);
        assert!(warns(&loaded, &["meshes[0].primitives[1]", "points and lines"]));
    }
}

#[test]
fn indices_of_every_width_mean_the_same() {
    let indices = [3u32, 2, 0, 0, 2, 1];
    let bytes = |width: usize| indices.iter().flat_map(|i| i.to_le_bytes()[..width].to_vec()).collect::<Vec<u8>>();
    let mut seen = Vec::new();
    for (component, width) in [(U8, 1), (U16, 2), (U32, 4)] {
        let mut file = File::new();
        let positions = grid(&mut file);
        let indices = file.accessor("SCALAR", component, 6, &bytes(width));
        file.primitive(json!({"attributes": {"POSITION": positions}, "indices": indices}));
        let scene = file.load().scene;
        // The two points that no triangle uses are gone.
        assert_eq!(scene.meshes[0].positions.len(), 4);
        seen.push(world_triangles(&scene));
    }
    assert_eq!(seen[0].len(), 2);
    assert!(seen.iter().all(|triangles| triangles == &seen[0]));
}

#[test]
fn vertices_that_no_triangle_uses_are_left_out_of_every_attribute() {
    let mut file = File::textured(&json!({
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "normalTexture": {"index": 0},
    }));
    file.texture(&crate::gltf::support::png(1, 1, &[[128; 4]]));
    let points: Vec<f32> = (0..5).flat_map(|i| [i as f32, (i * i) as f32, 0.0]).collect();
    let positions = file.floats("VEC3", &points);
    let normals = file.floats("VEC3", &[0.0, 0.0, 1.0].repeat(5));
    let uvs = file.floats("VEC2", &[0., 0., 1., 1., 2., 2., 3., 3., 4., 4.]);
    let tangents = file.floats("VEC4", &[1.0, 0.0, 0.0, 1.0].repeat(5));
    let colors = file.floats("VEC3", &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.1, 0.1, 0.1, 0.2, 0.2, 0.2]);
    let indices = file.accessor("SCALAR", U8, 3, &[1, 3, 4]);
    file.json["meshes"][0]["primitives"][0] = json!({"attributes": {
        "POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uvs, "TANGENT": tangents, "COLOR_0": colors,
    }, "indices": indices, "material": 0});
    let scene = file.load().scene;
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.triangles, vec![[0, 1, 2]]);
    assert_eq!(mesh.uvs[0], vec![Vec2::splat(1.0), Vec2::splat(3.0), Vec2::splat(4.0)]);
    assert_eq!(mesh.colors[0], Vec4::new(0.4, 0.5, 0.6, 1.0));
    assert_eq!((mesh.normals.len(), mesh.tangents.len()), (3, 3));
}

#[test]
fn quantized_attributes_are_decoded() {
    let mut file = File::new();
    file.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    file.json["nodes"][0]["scale"] = json!([0.5, 0.5, 0.5]);
    let bytes: Vec<u8> = [0i16, 0, 0, 0, 200, 0, 0, 0, 0, 100, 0, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let positions = file.accessor("VEC3", 5122, 3, &bytes);
    file.json["bufferViews"][0]["byteStride"] = json!(8);
    let normals = file.accessor("VEC3", 5120, 3, &[0, 0, 127, 0, 0, 127, 0, 90, 90]);
    file.json["accessors"][normals]["normalized"] = json!(true);
    file.primitive(json!({"attributes": {"POSITION": positions, "NORMAL": normals}}));
    let scene = file.load().scene;
    assert_eq!(world_triangles(&scene)[0], [Vec3::ZERO, Vec3::X * 100.0, Vec3::Y * 50.0]);
    let diagonal = Vec3::new(0.0, 1.0, 1.0).normalize();
    assert!((scene.meshes[0].normals[2] - diagonal).length() < 1e-6, "normals become unit length");
}

#[test]
fn nodes_multiply_their_transformations() {
    let mut file = File::triangle();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    file.json["nodes"] = json!([
        {"children": [1], "translation": [10, 0, 0], "rotation": [0, 0, half, half], "scale": [2, 2, 2]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 5, 0, 1]},
    ]);
    let corners = world_triangles(&file.load().scene)[0];
    // (0, 0, 0) → (0, 5, 0) → scaled (0, 10, 0) → turned by 90° (−10, 0, 0) → moved (0, 0, 0).
    let expected = [Vec3::ZERO, Vec3::new(0.0, 2.0, 0.0), Vec3::new(-2.0, 0.0, 0.0)];
    for (corner, expected) in corners.iter().zip(expected) {
        assert!((*corner - expected).length() < 1e-5, "{corner} {expected}");
    }
}

#[test]
fn mirrored_instances_keep_their_front_and_their_bitangents() {
    let mut file = File::textured(&json!({"normalTexture": {"index": 0}}));
    file.texture(&crate::gltf::support::png(1, 1, &[[128; 4]]));
    let normals = file.floats("VEC3", &[0., 0., 1., 0., 0., 1., 0., 0., 1.]);
    let tangents = file.floats("VEC4", &[1., 0., 0., 1., 1., 0., 0., 1., 1., 0., 0., 1.]);
    file.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    file.json["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(tangents);
    file.json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    file.json["nodes"] = json!([
        {"mesh": 0},
        {"mesh": 0, "scale": [1, 1, -1]},
        {"mesh": 0, "scale": [-2, 1, 1]},
    ]);
    let scene = file.load().scene;
    assert_eq!((scene.meshes.len(), scene.instances.len()), (2, 3));
    for (instance, (facing, bitangent)) in
        scene.instances.iter().zip([(Vec3::Z, Vec3::Y), (Vec3::NEG_Z, Vec3::Y), (Vec3::Z, Vec3::Y)])
    {
        assert!(instance.world_from_object.matrix3.determinant() > 0.0);
        let mesh = &scene.meshes[instance.mesh as usize];
        let m = instance.world_from_object.matrix3;
        let [a, b, c] = mesh.triangles[0].map(|v| Vec3::from(m * glam::Vec3A::from(mesh.positions[v as usize])));
        assert_eq!(normal([a, b, c]), facing);
        let shading = Vec3::from(m.inverse().transpose() * glam::Vec3A::from(mesh.normals[0])).normalize();
        assert_eq!(shading, facing);
        let tangent = Vec3::from(m * glam::Vec3A::from(mesh.tangents[0].truncate())).normalize();
        assert_eq!(shading.cross(tangent) * mesh.tangents[0].w, bitangent);
    }
}

#[test]
fn a_mesh_that_is_only_mirrored_is_kept_once() {
    let mut file = File::triangle();
    file.json["nodes"][0]["scale"] = json!([-1, 1, 1]);
    let scene = file.load().scene;
    assert_eq!(scene.meshes.len(), 1);
    assert_eq!(scene.bounds(), (Vec3::new(-1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0)));
    assert_eq!(normal(world_triangles(&scene)[0]), Vec3::Z);
}

#[test]
fn shared_meshes_become_instances() {
    let mut file = File::triangle();
    file.json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    file.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}, {"mesh": 0, "scale": [3, 3, 3]}]);
    let scene = file.load().scene;
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.triangle_count()), (1, 3, 3));
    assert_eq!(scene.bounds().1, Vec3::new(6.0, 3.0, 0.0));
}

#[test]
fn gpu_instancing_places_a_mesh_many_times() {
    let mut file = File::triangle();
    let translations = file.floats("VEC3", &[0., 0., 0., 0., 0., 7.]);
    // A quarter turn about z as normalized 16-bit integers.
    let quarter: Vec<u8> = [0i16, 0, 0, 32767, 0, 0, 23170, 23170].iter().flat_map(|v| v.to_le_bytes()).collect();
    let rotations = file.accessor("VEC4", 5122, 2, &quarter);
    file.json["accessors"][rotations]["normalized"] = json!(true);
    let scales = file.floats("VEC3", &[1., 1., 1., 2., 2., 2.]);
    file.json["nodes"][0] = json!({"mesh": 0, "translation": [100, 0, 0], "extensions": {"EXT_mesh_gpu_instancing": {
        "attributes": {"TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales},
    }}});
    let triangles = world_triangles(&file.load().scene);
    assert_eq!(triangles[0][1], Vec3::new(101.0, 0.0, 0.0));
    assert!((triangles[1][1] - Vec3::new(100.0, 2.0, 7.0)).length() < 1e-3, "{}", triangles[1][1]);
}

#[test]
fn morph_targets_are_added_with_their_default_weights() {
    let mut file = File::triangle();
    let deltas = file.floats("VEC3", &[0., 0., 1., 0., 0., 1., 0., 0., 1.]);
    file.json["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": deltas}, {"POSITION": deltas}]);
    file.json["meshes"][0]["weights"] = json!([0.5, 2.0]);
    let height = |file: &File| world_triangles(&file.load().scene)[0][0].z;
    assert_eq!(height(&file), 2.5);
    // The node's weights take precedence, and two nodes have two shapes.
    file.json["nodes"] = json!([{"mesh": 0, "weights": [1.0, 0.0]}, {"mesh": 0}]);
    file.json["scenes"][0]["nodes"] = json!([0, 1]);
    assert_eq!(height(&file), 1.0);
    assert_eq!(file.load().scene.meshes.len(), 2);
}

#[test]
fn skins_move_vertices_with_their_joints() {
    let mut file = File::triangle();
    let joints = file.accessor("VEC4", U8, 3, &[0, 1, 0, 0].repeat(3));
    let weights = file.floats("VEC4", &[1., 0., 0., 0., 0., 1., 0., 0., 0.5, 0.5, 0., 0.]);
    let identity = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
    let mut matrices = identity.to_vec();
    matrices.extend(identity);
    // The second joint stood at (0, 0, 1) when the mesh was bound to it.
    matrices[16 + 14] = -1.0;
    let binds = file.floats("MAT4", &matrices);
    file.json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = json!(joints);
    file.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
    file.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": binds}]);
    file.json["scenes"][0]["nodes"] = json!([0, 1]);
    // The transformation of the mesh's own node has no effect.
    file.json["nodes"] = json!([
        {"mesh": 0, "skin": 0, "translation": [50, 50, 50]},
        {"children": [2]},
        {"translation": [0, 0, 4]},
    ]);
    let corners = world_triangles(&file.load().scene)[0];
    assert_eq!(corners, [Vec3::ZERO, Vec3::new(1.0, 0.0, 3.0), Vec3::new(0.0, 1.0, 1.5)]);
}

#[test]
fn vertex_colors_of_every_format_become_linear_rgba() {
    for (kind, component, bytes, expected) in [
        ("VEC4", U8, vec![255, 0, 51, 102], Vec4::new(1.0, 0.0, 0.2, 0.4)),
        ("VEC3", U16, vec![255, 255, 0, 0, 51, 51], Vec4::new(1.0, 0.0, 0.2, 1.0)),
        ("VEC3", F32, [3.0f32, 0.5, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect(), Vec4::new(3.0, 0.5, 0.0, 1.0)),
    ] {
        let mut file = File::triangle();
        let colors = file.accessor(kind, component, 3, &bytes.repeat(3));
        file.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(colors);
        let scene = file.load().scene;
        assert!((scene.meshes[0].colors[1] - expected).length() < 1e-6);
    }
}

#[test]
fn sparse_accessors_move_single_vertices() {
    let mut file = File::triangle();
    let indices = file.view(&[2]);
    let values = file.view(&[0.0f32, 3.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
    file.json["accessors"][0]["sparse"] = json!({
        "count": 1, "indices": {"bufferView": indices, "componentType": U8}, "values": {"bufferView": values},
    });
    assert_eq!(file.load().scene.bounds().1, Vec3::new(1.0, 3.0, 0.0));
}

#[test]
fn triangles_that_no_ray_can_hit_are_left_out_and_counted() {
    let mut file = File::new();
    let positions =
        file.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0., f32::NAN, 0., 0., 1e30, 0., 0., 2., 0., 0.]);
    let indices = file.accessor("SCALAR", U8, 15, &[0, 1, 2, 0, 1, 3, 0, 4, 2, 0, 1, 1, 0, 1, 5]);
    file.primitive(json!({"attributes": {"POSITION": positions}, "indices": indices}));
    let loaded = file.load();
    assert_eq!(loaded.scene.triangle_count(), 1);
    assert_eq!(loaded.scene.bounds(), (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
    assert!(warns(&loaded, &["meshes[0].primitives[0].attributes.POSITION", "2 triangles", "not finite"]));
    assert!(warns(&loaded, &["2 triangles without area"]));
}

#[test]
fn normals_without_direction_are_replaced() {
    let mut file = File::triangle();
    let normals = file.floats("VEC3", &[0., 0., 0., 0., 0., 2., f32::NAN, 0., 0.]);
    file.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    let loaded = file.load();
    assert_eq!(loaded.scene.meshes[0].normals, vec![Vec3::Z; 3]);
    assert!(warns(&loaded, &["attributes.NORMAL"]));
}

#[test]
fn instances_that_cannot_be_placed_are_left_out() {
    for scale in [json!([0, 1, 1]), json!([1e30, 1, 1]), json!([1e-30, 1e-30, 1e-30])] {
        let mut file = File::triangle();
        file.json["scenes"][0]["nodes"] = json!([0, 1]);
        file.json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "scale": scale}]);
        let loaded = file.load();
        assert_eq!(loaded.scene.instances.len(), 1, "{scale}");
        assert!(warns(&loaded, &["nodes[1]", "left out"]), "{scale}");
    }
}

#[test]
fn texture_coordinates_are_kept_only_where_a_texture_wants_them() {
    let plain = File::textured(&json!({})).load().scene;
    assert!(plain.meshes[0].uvs.iter().all(Vec::is_empty));
    let mut file = File::textured(&json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}}));
    file.texture(&crate::gltf::support::png(1, 1, &[[9; 4]]));
    let scene = file.load().scene;
    assert_eq!((scene.meshes[0].uvs[0].len(), scene.meshes[0].uvs[1].len()), (0, 3));
}

#[test]
fn morph_targets_move_texture_coordinates_and_colors() {
    let mut file = File::textured(&json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}));
    file.texture(&crate::gltf::support::png(1, 1, &[[9; 4]]));
    let white = file.floats("VEC3", &[1.0; 9]);
    let (uvs, colors) =
        (file.floats("VEC2", &[0.5; 6]), file.floats("VEC3", &[-0.5, 0.0, 0.5, 0., 0., 0., 0., 0., 0.]));
    let primitive = &mut file.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["COLOR_0"] = json!(white);
    primitive["targets"] = json!([{"TEXCOORD_0": uvs, "COLOR_0": colors}]);
    file.json["meshes"][0]["weights"] = json!([0.5]);
    let mesh = &file.load().scene.meshes[0];
    assert_eq!(mesh.uvs[0], [Vec2::new(0.25, 0.25), Vec2::new(1.25, 0.25), Vec2::new(0.25, 1.25)]);
    // The output is not brighter than white.
    assert_eq!(mesh.colors, [Vec4::new(0.75, 1.0, 1.0, 1.0), Vec4::ONE, Vec4::ONE]);
}

#[test]
fn more_than_eight_joints_are_reported() {
    let mut file = File::triangle();
    let joints = file.accessor("VEC4", U8, 3, &[0; 12]);
    let weights = file.floats("VEC4", &[0.25; 12]);
    let attributes = &mut file.json["meshes"][0]["primitives"][0]["attributes"];
    for set in 0..3 {
        attributes[format!("JOINTS_{set}")] = json!(joints);
        attributes[format!("WEIGHTS_{set}")] = json!(weights);
    }
    file.json["nodes"][0]["skin"] = json!(0);
    file.json["skins"] = json!([{"joints": [0]}]);
    assert!(warns(&file.load(), &["JOINTS_2", "eight joints"]));
}
