//! Mesh files as scenes.

use std::path::PathBuf;

use bottega_scene::{AlphaMode, Channel, LoadOptions, SceneError, Surface, load};
use glam::{Vec2, Vec3};

use crate::meshes::support::{MTL, OBJ, PLY, binary_ply, gzip, load_files, png, serialized, try_load};

#[test]
fn every_format_shows_its_surfaces_under_a_sky() {
    let files: [(&str, Vec<u8>, &str, u64); 6] = [
        ("a.ply", PLY.into(), "PLY", 2),
        ("without extension", binary_ply(false), "PLY", 2),
        ("a.PLY", binary_ply(true), "PLY", 2),
        ("a.ply.gz", gzip(&binary_ply(false)), "PLY", 2),
        ("a.serialized", serialized(3), "Mitsuba serialized", 6),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n".into(), "Wavefront OBJ", 1),
    ];
    for (name, bytes, format, triangles) in files {
        let loaded = load_files(&[(name, &bytes)]);
        assert_eq!((loaded.metadata.format, loaded.scene.triangle_count()), (format, triangles), "{name}");
        assert!(loaded.scene.environment.is_some() && loaded.scene.cameras.len() == 1);
        assert_eq!(loaded.scene.bounds(), (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
    }
}

#[test]
fn materials_and_pictures_of_an_obj_file() {
    let wood = png([255, 128, 0, 128]);
    let files: [(&str, &[u8]); 3] =
        [("a.obj", OBJ.as_bytes()), ("sub/a b.mtl", MTL.as_bytes()), ("sub/wood 1.png", &wood)];
    let loaded = load_files(&files);
    let scene = &loaded.scene;
    assert_eq!(scene.materials.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(), ["red", "glass", ""]);
    // One picture, in one encoding, for the colour and its alpha.
    assert_eq!((scene.images.len(), scene.images[0].name.as_str()), (1 + 1, "sub/wood 1.png"));
    let red = &scene.materials[0];
    let layered = red.layered().unwrap();
    assert_eq!(layered.base_color.factor, Vec3::new(1.0, 0.5, 0.5));
    assert!((layered.roughness.factor - (2.0f32 / 100.0).powf(0.25)).abs() < 1e-6);
    assert_eq!((red.alpha_mode, red.opacity.texture.as_ref().unwrap().1), (AlphaMode::Blend, Channel::A));
    // (u, v) = (1, 0) in the file, at twice the scale and moved by (0.25, 0); v is flipped.
    let map = layered.base_color.texture.as_ref().unwrap();
    let mesh = &scene.meshes[0];
    let corner = mesh.positions.iter().position(|p| *p == Vec3::X).unwrap();
    assert_eq!(map.picture_from_uv.transform_point2(mesh.uvs[0][corner]), Vec2::new(2.25, 1.0));
    let Surface::Layered(glass) = &scene.materials[1].surface else { panic!("glass is layered") };
    assert_eq!((glass.transmission.factor, glass.ior, glass.roughness.factor), (1.0, 1.33, 0.0));
    assert_eq!(glass.base_color.factor, Vec3::new(1.0, 1.0, 0.5));
    assert!(scene.meshes[1].uvs[0].is_empty());
    assert!(loaded.warnings.iter().any(|warning| warning.message.contains("`unknown`")));
    // The resources that the digest covers.
    for changed in 0..3 {
        let mut bytes: Vec<Vec<u8>> = files.iter().map(|(_, bytes)| bytes.to_vec()).collect();
        bytes[changed] = if changed == 2 { png([0, 0, 0, 128]) } else { [&bytes[changed][..], b"\n"].concat() };
        let files: Vec<(&str, &[u8])> =
            files.iter().zip(&bytes).map(|((name, _), bytes)| (*name, &bytes[..])).collect();
        assert_ne!(load_files(&files).scene.digest, scene.digest, "{changed}");
    }
}

#[test]
fn scenes_with_lights_get_no_sky() {
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl lamp\nf 1 2 3\n";
    let loaded = load_files(&[("a.obj", obj.as_bytes()), ("a.mtl", MTL.as_bytes())]);
    assert!(loaded.scene.environment.is_none() && loaded.scene.materials[0].emission.factor == Vec3::splat(5.0));
}

#[test]
fn missing_files_are_warned_of_and_foreign_ones_refused() {
    let loaded = load_files(&[("a.obj", OBJ.as_bytes())]);
    assert!(loaded.warnings.iter().any(|warning| warning.to_string().contains("line 1: cannot read the materials")));
    let loaded = load_files(&[("a.obj", OBJ.as_bytes()), ("sub/a b.mtl", MTL.as_bytes())]);
    let warning = loaded.warnings.iter().find(|warning| warning.place == "sub/a b.mtl, line 6").unwrap();
    assert!(warning.message.contains("wood 1.png") && warning.message.contains("magenta"));
    let outside = OBJ.replace("sub/a b.mtl", "../b.mtl");
    let files: [(&str, &[u8]); 2] = [("sub/a.obj", outside.as_bytes()), ("b.mtl", MTL.as_bytes())];
    let refused = try_load(&files, &LoadOptions::default());
    assert!(matches!(&refused, Err(SceneError::ForbiddenReference { place, .. }) if place == "line 1"), "{refused:?}");
    assert!(refused.unwrap_err().to_string().contains("--allow-outside"));
    let allowed = try_load(&files, &LoadOptions { allow_outside: true, ..LoadOptions::default() }).unwrap();
    assert!(allowed.scene.materials[1].layered().unwrap().transmission.factor == 1.0);
    let picture = MTL.replace("-o 0.25 0 wood 1.png", "../../wood.png");
    let files: [(&str, &[u8]); 2] = [("a.obj", OBJ.as_bytes()), ("sub/a b.mtl", picture.as_bytes())];
    let loaded = try_load(&files, &LoadOptions::default()).unwrap();
    let warning = loaded.warnings.iter().find(|warning| warning.place == "sub/a b.mtl, line 6").unwrap();
    assert!(warning.message.contains("--asset-root") && warning.message.contains("magenta"), "{warning}");
    let strict = try_load(&files, &LoadOptions { strict: true, ..LoadOptions::default() });
    assert!(matches!(strict, Err(SceneError::Unsupported { .. })), "{strict:?}");
}

/// The colour of the square in `bytes`, with no warnings but `expected`.
fn check_square(files: &[(&str, &[u8])], expected: &[&str]) {
    let loaded = load_files(files);
    let name = files[0].0;
    assert_eq!(loaded.scene.triangle_count(), 2, "{name}");
    let (min, max) = loaded.scene.bounds();
    assert_eq!((min, max), (Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 0.0)), "{name}");
    let color = &loaded.scene.materials[0].layered().unwrap().base_color;
    assert_eq!(color.factor, Vec3::new(0.8, 0.1, 0.1), "{name}");
    let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    let warnings: Vec<&String> = warnings.iter().filter(|text| !text.contains("the scene has no")).collect();
    assert_eq!(warnings.len(), expected.len(), "{name}: {warnings:?}");
    for (warning, expected) in warnings.iter().zip(expected) {
        assert!(warning.contains(expected), "{name}: {warning}");
    }
}

#[test]
fn text_may_be_in_any_encoding() {
    const SQUARE: &str = "# grün\nmtllib m.mtl\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nusemtl rot-grün\nf 1 2 3 4\n";
    const RED: &str = "newmtl rot-grün\nKd 0.8 0.1 0.1\n";
    let utf8 = |text: &str| text.as_bytes().to_vec();
    let marked = |text: &str| [b"\xef\xbb\xbf", text.as_bytes()].concat();
    let utf16 = |text: &str| {
        let units = std::iter::once(0xfeff).chain(text.encode_utf16());
        units.flat_map(u16::to_le_bytes).collect::<Vec<u8>>()
    };
    let utf16_big = |text: &str| {
        let units = std::iter::once(0xfeff).chain(text.encode_utf16());
        units.flat_map(u16::to_be_bytes).collect::<Vec<u8>>()
    };
    let returns = |text: &str| text.replace('\n', "\r").into_bytes();
    let latin = |text: &str| text.chars().map(|c| c as u8).collect::<Vec<u8>>();
    type Encode<'a> = &'a dyn Fn(&str) -> Vec<u8>;
    let all: [(Encode<'_>, bool); 6] =
        [(&utf8, false), (&marked, false), (&utf16, false), (&utf16_big, false), (&returns, false), (&latin, true)];
    for (obj, obj_is_guessed) in all {
        for (mtl, mtl_is_guessed) in all {
            let guessed = usize::from(obj_is_guessed) + usize::from(mtl_is_guessed);
            let files: [(&str, &[u8]); 2] = [("a.obj", &obj(SQUARE)), ("m.mtl", &mtl(RED))];
            check_square(&files, &vec!["windows-1252"; guessed]);
        }
    }
    // The mark before the first vertex costs no vertex.
    let first = SQUARE.split_once("\nmtllib m.mtl\n").unwrap().1;
    let files: [(&str, &[u8]); 2] = [("a.obj", &marked(&format!("{first}mtllib m.mtl"))), ("m.mtl", RED.as_bytes())];
    check_square(&files, &[]);
}

#[test]
fn ply_may_be_in_any_encoding() {
    const PLY: &str = "ply\nformat ascii 1.0\ncomment grün\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let utf16: Vec<u8> = std::iter::once(0xfeff).chain(PLY.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let latin: Vec<u8> = PLY.chars().map(|c| c as u8).collect();
    let marked = format!("\u{feff}{PLY}").into_bytes();
    let returns = PLY.replace('\n', "\r").into_bytes();
    let start = PLY.split_once("0 0 0").unwrap().0.replace("ascii", "binary_little_endian");
    let numbers = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|number| number.to_le_bytes());
    let binary = [b"\xef\xbb\xbf", start.as_bytes()].concat();
    let binary: Vec<u8> = binary.into_iter().chain(numbers).chain([3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]).collect();
    for bytes in [utf16, latin, marked, returns, binary] {
        let loaded = load_files(&[("a.ply", &bytes)]);
        assert_eq!(loaded.scene.meshes[0].positions[2], Vec3::Y, "{bytes:?}");
    }
}

#[test]
fn names_of_pictures_are_found_as_other_machines_write_them() {
    const SQUARE: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nusemtl t\nf 1/1 2/1 3/1\n";
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_pixel(1, 1, image::Rgb([0, 255, 0])).write_to(&mut png, image::ImageFormat::Png).unwrap();
    for (reference, expected) in [
        ("brick wall.png", None),
        ("\"brick wall.png\"", None),
        ("Brick Wall.PNG", Some("`brick wall.png` is used")),
        ("C:\\Users\\someone\\Desktop\\brick wall.png", Some("beside the scene is used")),
        ("/home/other/Brick Wall.png", Some("beside the scene is used")),
    ] {
        let mtl = format!("newmtl t\nKd 1 1 1\nmap_Kd {reference}\n");
        let files: [(&str, &[u8]); 3] =
            [("a.obj", SQUARE.as_bytes()), ("m.mtl", mtl.as_bytes()), ("brick wall.png", png.get_ref())];
        let loaded = load_files(&files);
        let green = loaded.scene.images[0].eval(
            &bottega_scene::TextureMap::new(bottega_scene::ImageId(0)),
            Default::default(),
            0.0,
        );
        assert_eq!(green.truncate(), Vec3::Y, "{reference}: {:?}", loaded.warnings);
        let warned = loaded.warnings.iter().find(|warning| warning.place == "m.mtl, line 3").map(ToString::to_string);
        assert_eq!(warned.is_some(), expected.is_some(), "{warned:?}");
        assert!(warned.unwrap_or_default().contains(expected.unwrap_or_default()), "{reference}");
    }
}

#[test]
fn statements_of_a_library_are_followed_or_reported() {
    let square = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nusemtl t\nf 1/1 2/1 3/1\n";
    let strict = |statement: &str| {
        let mtl = format!("newmtl t\nKd 1 1 1\n{statement}\n");
        let options = LoadOptions { strict: true, ..LoadOptions::default() };
        try_load(&[("a.obj", square.as_bytes()), ("m.mtl", mtl.as_bytes()), ("a.png", &png([9; 4]))], &options)
    };
    for known in ["Ka 1 1 1", "sharpness 60", "Pc 0", "map_Kd -blendu on -mm 0 1 a.png", "map_aat on"] {
        strict(known).unwrap_or_else(|error| panic!("{known}: {error}"));
    }
    let others = [
        "Pc 0.5",
        "aniso 0.3",
        "map_Kd -t 0.1 0 a.png",
        "map_Kd -mm 0.2 1 a.png",
        "map_Kd -imfchan r a.png",
        "disp a.png",
    ];
    for other in others {
        assert!(matches!(strict(other), Err(SceneError::Unsupported { .. })), "{other}");
    }
}

#[test]
fn missing_maps_of_normals_are_flat() {
    let square = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl t\nf 1/1 2/2 3/3\n";
    for statement in ["norm none.png", "map_Bump -bm 1 none.png"] {
        let mtl = format!("newmtl t\nKd 1 1 1\n{statement}\n");
        let files: [(&str, &[u8]); 2] = [("a.obj", square.as_bytes()), ("m.mtl", mtl.as_bytes())];
        let loaded = load_files(&files);
        let map = bottega_scene::TextureMap::new(bottega_scene::ImageId(0));
        let found = loaded.scene.images[0].eval(&map, Vec2::ZERO, 0.0).truncate();
        let flat = found == Vec3::ONE || (found - Vec3::new(0.5, 0.5, 1.0)).length() < 0.005;
        assert!(flat, "{statement}: {found}");
        let is_reported = loaded.warnings.iter().any(|warning| warning.message.contains("none.png"));
        assert!(is_reported, "{statement}: {:?}", loaded.warnings);
        let strict = try_load(&files, &LoadOptions { strict: true, ..LoadOptions::default() });
        assert!(matches!(strict, Err(SceneError::Unsupported { .. })), "{strict:?}");
    }
}

/// The folder of real scenes, if the environment names one.
pub(crate) fn real_scenes() -> Option<PathBuf> {
    let folder = std::env::var_os("BOTTEGA_SCENES").filter(|folder| !folder.is_empty()).map(PathBuf::from);
    if folder.is_none() {
        eprintln!("BOTTEGA_SCENES is not set: meshes of others are not read");
    }
    folder
}

#[test]
fn meshes_that_others_wrote() {
    let Some(scenes) = real_scenes() else { return };
    for (name, triangles) in [("goblet.ply", 25_152), ("spot.ply", 5_856), ("spot.obj", 5_856), ("wyrm.ply", 153_728)] {
        let loaded = load(&scenes.join("meshes").join(name), &LoadOptions::default()).unwrap();
        assert_eq!(loaded.scene.triangle_count(), triangles, "{name}");
        assert!(loaded.warnings.iter().all(|warning| warning.message.contains("the scene has no")), "{name}");
    }
    // The same shape in both formats.
    let bounds = ["spot.ply", "spot.obj"]
        .map(|name| load(&scenes.join("meshes").join(name), &LoadOptions::default()).unwrap().scene.bounds());
    assert!((bounds[0].0 - bounds[1].0).length() < 1e-5 && (bounds[0].1 - bounds[1].1).length() < 1e-5);
    for folder in ["coffee/pbrt/models", "staircase2/pbrt/models", "staircase2/mitsuba/models"] {
        let mut count = 0;
        for entry in std::fs::read_dir(scenes.join(folder)).unwrap() {
            let path = entry.unwrap().path();
            let loaded = load(&path, &LoadOptions::default()).unwrap();
            assert!(loaded.scene.triangle_count() > 0, "{}", path.display());
            count += 1;
        }
        assert!(count > 10, "{folder}");
    }
}
