//! What a mesh file becomes as a scene.

use std::path::PathBuf;

use bottega_scene::{AlphaMode, Channel, LoadOptions, SceneError, Surface, load};
use glam::{Vec2, Vec3};

use crate::support::{MTL, OBJ, PLY, binary_ply, gzip, load_files, png, serialized, try_load};

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
    // (u, v) = (1, 0) in the file, at twice the scale and moved by (0.25, 0); v turned over.
    let map = layered.base_color.texture.as_ref().unwrap();
    let mesh = &scene.meshes[0];
    let corner = mesh.positions.iter().position(|p| *p == Vec3::X).unwrap();
    assert_eq!(map.picture_from_uv.transform_point2(mesh.uvs[0][corner]), Vec2::new(2.25, 1.0));
    let Surface::Layered(glass) = &scene.materials[1].surface else { panic!("glass is layered") };
    assert_eq!((glass.transmission.factor, glass.ior, glass.roughness.factor), (1.0, 1.33, 0.0));
    assert_eq!(glass.base_color.factor, Vec3::new(1.0, 1.0, 0.5));
    assert!(scene.meshes[1].uvs[0].is_empty());
    assert!(loaded.warnings.iter().any(|warning| warning.message.contains("`unknown`")));
    // What the digest covers.
    for changed in 0..3 {
        let mut bytes: Vec<Vec<u8>> = files.iter().map(|(_, bytes)| bytes.to_vec()).collect();
        bytes[changed] = if changed == 2 { png([0, 0, 0, 128]) } else { [&bytes[changed][..], b"\n"].concat() };
        let files: Vec<(&str, &[u8])> =
            files.iter().zip(&bytes).map(|((name, _), bytes)| (*name, &bytes[..])).collect();
        assert_ne!(load_files(&files).scene.digest, scene.digest, "{changed}");
    }
}

#[test]
fn what_shines_needs_no_sky() {
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
    let refused = try_load(&[("a.obj", OBJ.as_bytes()), ("sub/a b.mtl", picture.as_bytes())], &LoadOptions::default());
    assert!(matches!(refused, Err(SceneError::ForbiddenReference { .. })));
}

/// The folder of real scenes, where the environment names one.
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
