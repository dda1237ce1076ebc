//! Files that scenes refer to, and the encodings of their text.

use bottega_scene::{LoadOptions, Loaded, Mesh, SceneError, Spectrum, Surface};
use glam::{Vec2, Vec3};

use crate::mitsuba::support::{Folder, bare};

/// A scene whose material has a name beyond ASCII.
const SCENE: &str = "<scene version='3.0.0'>\n<!-- grün -->\n<bsdf type='diffuse' id='grün'>\n\
    <rgb name='reflectance' value='.2,.4,.6'/></bsdf>\n<shape type='rectangle'><ref id='grün'/></shape>\n</scene>\n";

fn reflectance(loaded: &Loaded) -> Spectrum {
    let Surface::Diffuse(diffuse) = &loaded.scene.materials[0].surface else { panic!("it is not diffuse") };
    diffuse.reflectance.factor
}

#[test]
fn text_may_be_in_any_encoding() {
    let declared = |label: &str| format!("<?xml version='1.0' encoding='{label}'?>\n{SCENE}");
    let latin = |text: String| text.chars().map(|c| c as u8).collect::<Vec<u8>>();
    let utf16 = |text: String| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    let utf16_big = |text: String| text.encode_utf16().flat_map(u16::to_be_bytes).collect::<Vec<u8>>();
    for (name, bytes) in [
        ("plain", SCENE.into()),
        ("marked", format!("\u{feff}{SCENE}").into_bytes()),
        ("iso-8859-1", latin(declared("iso-8859-1"))),
        ("windows-1252", latin(declared("Windows-1252"))),
        ("utf-8", declared("UTF-8").into_bytes()),
        ("utf-16", utf16(format!("\u{feff}{}", declared("utf-16")))),
        ("utf-16 without a mark", utf16(declared("utf-16"))),
        ("utf-16 of the other order", utf16_big(format!("\u{feff}{}", declared("utf-16")))),
        ("utf-16 that is not", declared("utf-16").into_bytes()),
        ("returns", SCENE.replace('\n', "\r").into_bytes()),
    ] {
        // As the scene itself, and as an included file.
        let part = "<scene version='3.0.0'><include filename='part.xml'/></scene>";
        for folder in
            [Folder::new().with("scene.xml", &bytes), Folder::new().with("scene.xml", part).with("part.xml", &bytes)]
        {
            let loaded = folder.load(&LoadOptions { strict: true, ..bare() });
            let loaded = loaded.unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(reflectance(&loaded), Vec3::new(0.2, 0.4, 0.6), "{name}");
        }
    }
}

#[test]
fn text_in_no_encoding_is_an_error_with_its_place() {
    let latin: Vec<u8> = SCENE.chars().map(|c| c as u8).collect();
    let error = Folder::new().with("scene.xml", latin).load(&bare()).unwrap_err().to_string();
    assert!(error.contains("scene.xml`, line 2, column 8") && error.contains("save it as UTF-8"), "{error}");
    let unknown = format!("<?xml version='1.0' encoding='klingon'?>{SCENE}");
    let error = Folder::new().with("scene.xml", unknown).load(&bare()).unwrap_err().to_string();
    assert!(error.contains("`klingon` is unknown"), "{error}");
}

#[test]
fn character_data_between_elements_is_left_out() {
    let loaded = Folder::new().scene("<![CDATA[ hi ]]><shape type='sphere'/>").load(&bare()).unwrap();
    assert_eq!(loaded.scene.spheres.len(), 1);
    assert!(loaded.warnings.iter().any(|warning| warning.place == "scene.xml:2:1"), "{:?}", loaded.warnings);
}

#[test]
fn files_of_other_machines_are_found_and_errors_about_missing_ones_name_their_line() {
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    for name in ["Meshes/A.OBJ", "meshes\\a.obj", "D:\\work\\meshes\\a.obj", "/home/other/scene/meshes/a.obj"] {
        let shape = format!("<shape type='obj'><string name='filename' value='{name}'/></shape>");
        let loaded = Folder::new().scene(&shape).with("meshes/a.obj", mesh).load(&bare()).unwrap();
        assert_eq!(loaded.scene.triangle_count(), 1, "{name}");
        assert_eq!(loaded.files[0].name, "meshes/a.obj", "{name}");
    }
    let shape = "<shape type='obj'>\n<string name='filename' value='b.obj'/></shape>";
    let error = Folder::new().scene(shape).load(&bare()).unwrap_err();
    assert!(matches!(error, SceneError::Read { .. }));
    assert!(error.to_string().contains("b.obj` (requested by scene.xml:3:1)"), "{error}");
    let large = "v 0 0 0\n".repeat(10_000) + mesh;
    let small = LoadOptions { max_memory_bytes: 100_000, ..bare() };
    let error = Folder::new().scene(shape).with("b.obj", large).load(&small).unwrap_err();
    assert!(matches!(error, SceneError::Limit { .. }));
    assert!(error.to_string().contains("b.obj`, requested by scene.xml:3:1"), "{error}");
}

/// A square with values per vertex and per face, like the test files of Mitsuba's `mesh_attribute`.
const SQUARE: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    property float u\nproperty float v\nproperty float tint_0\nproperty float tint_1\nproperty float tint_2\n\
    property float part_x\nelement face 2\nproperty list uchar int vertex_indices\nproperty float mark_r\n\
    property float mark_g\nproperty float mark_b\nproperty float share_1\nproperty float color_0\nproperty float color_1\n\
    property float color_2\nend_header\n\
    -1 -1 0 0 0 0.9 0.1 0.1 0.1\n1 -1 0 1 0 0.1 0.9 0.1 0.9\n1 1 0 1 1 0.1 0.1 0.9 0.9\n-1 1 0 0 1 0.8 0.8 0.2 0.1\n\
    3 0 1 2 0.2 0.7 0.3 0.25 1 0 0\n3 0 2 3 0.9 0.3 0.6 0.75 0 1 0\n";

/// The same square as a binary file.
fn binary(text: &str, big_endian: bool) -> Vec<u8> {
    let (header, body) = text.split_once("end_header\n").unwrap();
    let order = if big_endian { "binary_big_endian" } else { "binary_little_endian" };
    let mut bytes = header.replace("ascii", order).into_bytes();
    bytes.extend(b"end_header\n");
    let order = |mut number: [u8; 4]| {
        if big_endian {
            number.reverse();
        }
        number
    };
    for (row, line) in body.lines().enumerate() {
        for (column, word) in line.split(' ').enumerate() {
            match (row < 4, column) {
                (false, 0) => bytes.push(word.parse().unwrap()),
                (false, 1..=3) => bytes.extend(order(word.parse::<i32>().unwrap().to_le_bytes())),
                _ => bytes.extend(order(word.parse::<f32>().unwrap().to_le_bytes())),
            }
        }
    }
    bytes
}

/// Both sets of texture coordinates of a triangle, at the weights of its second and third corner.
fn uvs_at(mesh: &Mesh, triangle: usize, u: f32, v: f32) -> [Vec2; 2] {
    let [a, b, c] = mesh.triangles[triangle].map(|vertex| vertex as usize);
    [0, 1].map(|set| match &mesh.uvs[set][..] {
        [] => Vec2::ZERO,
        uvs => uvs[a] * (1.0 - u - v) + uvs[b] * u + uvs[c] * v,
    })
}

#[test]
fn values_by_vertex_and_by_face_are_textures() {
    for (name, corners) in [
        (
            "vertex_tint",
            [[0.9, 0.1, 0.1], [0.1, 0.9, 0.1], [0.1, 0.1, 0.9], [0.9, 0.1, 0.1], [0.1, 0.1, 0.9], [0.8, 0.8, 0.2]],
        ),
        ("vertex_part", [[0.1; 3], [0.9; 3], [0.9; 3], [0.1; 3], [0.9; 3], [0.1; 3]]),
        (
            "face_mark",
            [[0.2, 0.7, 0.3], [0.2, 0.7, 0.3], [0.2, 0.7, 0.3], [0.9, 0.3, 0.6], [0.9, 0.3, 0.6], [0.9, 0.3, 0.6]],
        ),
        ("face_share", [[0.25; 3], [0.25; 3], [0.25; 3], [0.75; 3], [0.75; 3], [0.75; 3]]),
    ] {
        let shape = format!(
            "<shape type='ply'><string name='filename' value='square.ply'/><bsdf type='diffuse'>
            <texture name='reflectance' type='mesh_attribute'><string name='name' value='{name}'/></texture></bsdf></shape>"
        );
        for bytes in [SQUARE.as_bytes().to_vec(), binary(SQUARE, false), binary(SQUARE, true)] {
            let folder = Folder::new().scene(&shape).with("square.ply", bytes);
            let loaded = folder.load(&LoadOptions { strict: true, ..bare() }).unwrap();
            let Surface::Diffuse(diffuse) = &loaded.scene.materials[0].surface else { panic!("it is not diffuse") };
            for (triangle, values) in corners.as_chunks::<3>().0.iter().enumerate() {
                let [a, b, c] = values.map(Vec3::from_array);
                for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.2, 0.3), (0.5, 0.5)] {
                    let uvs = uvs_at(&loaded.scene.meshes[0], triangle, u, v);
                    let found = diffuse.reflectance.eval(&loaded.scene, uvs, 0.01);
                    let expected = a * (1.0 - u - v) + b * u + c * v;
                    assert!((found - expected).abs().max_element() < 1e-5, "{name} {triangle}: {found} {expected}");
                }
            }
        }
    }
}

#[test]
fn each_mesh_has_its_own_values_wherever_a_texture_can_stand() {
    let blend = "<bsdf type='blendbsdf' id='b'>
        <texture name='weight' type='mesh_attribute'><string name='name' value='face_share'/><float name='scale' value='0.5'/></texture>
        <bsdf type='diffuse'><texture name='reflectance' type='mesh_attribute'><string name='name' value='face_color'/></texture></bsdf>
        <bsdf type='diffuse'><rgb name='reflectance' value='0.1'/></bsdf></bsdf>";
    let shape = |file: &str| format!("<shape type='ply'><string name='filename' value='{file}'/><ref id='b'/></shape>");
    let other = SQUARE.replace("0.3 0.25", "0.3 0.5");
    let text = format!("{blend}{}{}", shape("a.ply"), shape("b.ply"));
    let folder = Folder::new().scene(&text).with("a.ply", SQUARE).with("b.ply", other);
    let scene = folder.load(&LoadOptions { strict: true, ..bare() }).unwrap().scene;
    for (mesh, expected) in scene.meshes.iter().zip([0.125, 0.25]) {
        let material = &scene.materials[mesh.material as usize];
        let (colors, scalars) = material.surface.params();
        let uvs = uvs_at(mesh, 0, 0.3, 0.3);
        let weights: Vec<f32> = scalars.iter().map(|scalar| scalar.eval(&scene, uvs, 0.0)).collect();
        assert!(weights.contains(&expected), "{weights:?}");
        let colors: Vec<Spectrum> = colors.iter().map(|color| color.eval(&scene, uvs, 0.0)).collect();
        assert!(colors.contains(&Vec3::X) && colors.contains(&Vec3::splat(0.1)), "{colors:?}");
        assert!(mesh.colors.is_empty());
    }
    // A missing picture is reported, and 0.5 replaces it.
    for (shape, expected) in [
        ("<shape type='ply'><string name='filename' value='a.ply'/>", "no attribute `vertex_mark`"),
        ("<shape type='sphere'>", "sphere` has no attribute"),
    ] {
        let text = format!(
            "{shape}<bsdf type='diffuse'><texture name='reflectance' type='mesh_attribute'>
            <string name='name' value='vertex_mark'/></texture></bsdf></shape>"
        );
        let loaded = Folder::new().scene(&text).with("a.ply", SQUARE).load(&bare()).unwrap();
        assert!(loaded.warnings.iter().any(|warning| warning.message.contains(expected)), "{:?}", loaded.warnings);
        let Surface::Diffuse(diffuse) = &loaded.scene.materials[0].surface else { panic!("it is not diffuse") };
        assert_eq!(diffuse.reflectance.eval(&loaded.scene, [Vec2::ZERO; 2], 0.0), Vec3::splat(0.5));
    }
}
