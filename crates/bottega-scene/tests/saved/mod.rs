//! Saved scenes (`.bottega`): a written scene is read back bit for bit, and damaged files are refused.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use bottega_scene::{
    Blend, Density, EmissionVariation, Grid, Image, LoadOptions, Loaded, Medium, Metadata, Scene, SceneError, Spectrum,
    Variation, load, save_scene,
};
use glam::Affine3A;

use crate::mutation::{Random, damage, survive};

/// Scenes of other formats, which together have all features of a scene.
fn scenes_of_others() -> Vec<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let names = ["tests/pbrt/box.pbrt", "tests/pbrt/smoke.pbrt", "../../scenes/goblets.glb"];
    names.iter().map(|name| here.join(name)).collect()
}

/// A scene with an image of each format and a medium with grids of each kind.
fn images_and_grids() -> Scene {
    let mut scene = Scene::default();
    let images = [
        Image::from_gray8("gray", 3, 2, vec![0, 1, 2, 3, 4, 255], true),
        Image::from_rgb8("rgb", 1, 2, vec![[1, 2, 3], [4, 5, 6]], true),
        Image::from_rgba8("rgba", 2, 1, vec![[1, 2, 3, 4], [5, 6, 7, 8]], false),
        Image::from_rgba16("rgba16", 1, 1, vec![[1, 20_000, 40_000, 60_000]], true),
        Image::from_numbers("numbers", 2, 1, vec![[-1.5, 0.1, 1e9], [0.3, -0.0, 1e-30]]),
        Image::from_linear_rgba("linear", 1, 1, vec![[0.1, 0.2, 0.3, 0.4]]),
    ];
    scene.images = images.into_iter().collect();
    let grid = |values: &[f32], blend| Grid::new([values.len() as u32, 1, 1], values.to_vec(), blend).unwrap();
    let pair = || (grid(&[0.5, 1.0], Blend::LinearFading), grid(&[0.25], Blend::Nearest));
    let densities = [
        Density::Both(Grid::new([1, 1, 2], vec![0.1; 6], Blend::Linear).unwrap()),
        Density::Each { absorption: pair().0, scattering: pair().1 },
        Density::WithAlbedo { extinction: pair().0, albedo: pair().1 },
    ];
    for (index, density) in densities.into_iter().enumerate() {
        let emission = (index == 1).then(|| EmissionVariation::Factor(grid(&[7.0, 8.0, 9.0], Blend::Linear)));
        let variation = Variation { density, emission, grid_from_world: Affine3A::from_scale(glam::Vec3::splat(0.3)) };
        let medium = Medium::absorbing(Spectrum::new(0.1, 0.2, 0.3));
        scene.push_medium(Medium { variation: Some(Arc::new(variation)), g: 0.7, ..medium });
    }
    scene
}

fn read(path: &Path) -> Loaded {
    load(path, &LoadOptions::default()).unwrap()
}

fn assert_same(name: &str, before: &Loaded, after: &Loaded) {
    let (a, b) = (&before.scene, &after.scene);
    assert!(a.meshes == b.meshes, "{name}: meshes");
    assert!(a.instances == b.instances && a.spheres == b.spheres, "{name}: places");
    assert_eq!(a.materials, b.materials, "{name}");
    assert!(a.media == b.media && a.images == b.images, "{name}: media or images");
    assert_eq!(a.mappings, b.mappings, "{name}");
    assert_eq!(a.lights, b.lights, "{name}");
    assert_eq!(a.environment, b.environment, "{name}");
    assert_eq!(a.origin, b.origin, "{name}");
    assert_eq!(before.hints, after.hints, "{name}");
    // A scene without a camera gets one when it is read.
    assert!(a.cameras.is_empty() || a.cameras == b.cameras, "{name}: cameras");
}

#[test]
fn a_saved_scene_is_read_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let mut scenes: Vec<(String, Loaded)> =
        scenes_of_others().iter().map(|path| (path.display().to_string(), read(path))).collect();
    scenes.push(("images and grids".to_owned(), Loaded::from(images_and_grids())));
    // The scenes together have all features of a saved scene
    let has = |what: &dyn Fn(&Scene) -> bool| scenes.iter().any(|(_, loaded)| what(&loaded.scene));
    assert!(has(&|scene| scene.meshes.iter().any(|mesh| mesh.curves.is_some())), "no scene has curves");
    assert!(has(&|scene| scene.meshes.iter().any(|mesh| !mesh.normals.is_empty())), "no scene has normals");
    assert!(has(&|scene| scene.meshes.iter().any(|mesh| !mesh.uvs[0].is_empty())), "no scene has uvs");
    assert!(has(&|scene| !scene.spheres.is_empty() && !scene.lights.is_empty()), "no scene has spheres and lights");
    assert!(has(&|scene| scene.environment.is_some()), "no scene has an environment");
    assert!(has(&|scene| scene.instances.iter().any(|it| it.world_from_object != Affine3A::IDENTITY)), "nothing moved");
    for (name, before) in &scenes {
        let [first, second] = ["a.bottega", "b"].map(|file| folder.path().join(file));
        save_scene(&first, &before.scene, &before.hints).unwrap();
        let after = read(&first);
        assert_same(name, before, &after);
        assert_eq!(after.metadata, Metadata { format: "Bottega", ..Metadata::default() });
        // The file may have any name, and the same scene gives the same file
        save_scene(&second, &before.scene, &before.hints).unwrap();
        assert_eq!(std::fs::read(&first).unwrap(), std::fs::read(&second).unwrap(), "{name}");
        assert_eq!(read(&second).scene.digest, after.scene.digest, "{name}");
    }
}

#[test]
fn nothing_is_added_to_a_saved_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dark.bottega");
    // Without a light, and far away from the origin
    let mut scene = Scene::default();
    scene.push_material(bottega_scene::Material::matte(Spectrum::splat(0.5)));
    scene.push_sphere(glam::Vec3::splat(1e7), 1.0, 0);
    save_scene(&path, &scene, &Default::default()).unwrap();
    let loaded = read(&path);
    assert!(loaded.scene.environment.is_none() && loaded.scene.origin == scene.origin);
    assert_eq!(loaded.scene.spheres, scene.spheres);
}

fn refused(bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bottega");
    std::fs::write(&path, bytes).unwrap();
    let error = load(&path, &LoadOptions { max_memory_bytes: 64 << 20, ..LoadOptions::default() }).unwrap_err();
    assert!(!matches!(error, SceneError::UnknownFormat { .. }), "{error}");
    error.to_string()
}

/// A saved scene with some text of its description replaced.
fn described_otherwise(file: &[u8], old: &str, new: &str) -> Vec<u8> {
    let length = u64::from_le_bytes(file[12..20].try_into().unwrap()) as usize;
    let text = std::str::from_utf8(&file[20..20 + length]).unwrap();
    assert!(text.contains(old), "{text}");
    let text = text.replacen(old, new, 1);
    [&file[..12], &(text.len() as u64).to_le_bytes(), text.as_bytes(), &file[20 + length..]].concat()
}

#[test]
fn files_that_are_wrong_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bottega");
    save_scene(&path, &images_and_grids(), &Default::default()).unwrap();
    let file = std::fs::read(&path).unwrap();
    let changed = |at: usize, byte: u8| {
        let mut file = file.clone();
        file[at] = byte;
        refused(&file)
    };
    assert!(changed(8, 9).contains("version 9 of the format"), "{}", changed(8, 9));
    assert!(changed(19, 0xff).contains("description is cut off"));
    assert!(refused(&file[..11]).contains("head is cut off"));
    assert!(refused(&file[..file.len() - 1]).contains("media[2] has 1 values"), "{}", refused(&file[..file.len() - 1]));
    assert!(refused(&[&file[..], &[0]].concat()).contains("1 bytes follow"));
    for (old, new, said) in [
        ("\"instances\":0", "\"instances\":18446744073709551615", "instances has 18446744073709551615 values"),
        ("\"instances\":0", "\"instances\":0,\"sky\":1", "unknown field `sky`"),
        ("\"width\":3", "\"width\":0", "images[0] has 0 × 2 texels"),
        ("\"width\":3", "\"width\":4294967295", "images[0] has 8589934590 values"),
        ("\"density\":\"both\"", "\"density\":\"each\"", "media[0] has 1 grids"),
        ("\"size\":[1,1,2]", "\"size\":[9,9,9]", "media[0]: a grid of 729 cells has 6 values"),
        ("\"environment\":null", "\"environment\":{}", "description"),
    ] {
        let error = refused(&described_otherwise(&file, old, new));
        assert!(error.contains(said) && error.contains("scene.bottega"), "{old}: {error}");
    }
    let mut not_finite = file.clone();
    let number = (-1.5f32).to_le_bytes();
    let at = file.windows(4).position(|bytes| bytes == number).unwrap();
    not_finite[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(refused(&not_finite).contains("images[4]: a texel is not finite"));
}

#[test]
fn damaged_files_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bottega");
    let options = LoadOptions { max_memory_bytes: 64 << 20, ..LoadOptions::default() };
    let box_scene = read(&scenes_of_others()[0]);
    for (name, scene) in [("saved images", images_and_grids()), ("saved box", box_scene.scene)] {
        save_scene(&path, &scene, &box_scene.hints).unwrap();
        let file = std::fs::read(&path).unwrap();
        let mutated = |random: &mut Random| {
            let mut file = file.clone();
            for _ in 0..=random.below(3) {
                let at = random.below(file.len().max(1));
                if !file.is_empty() {
                    damage(&mut file, at, random);
                }
            }
            file
        };
        let good = survive(name, 1000, mutated, |bytes| {
            std::fs::write(&path, bytes).unwrap();
            load(&path, &options).is_ok()
        });
        assert!(good > 0.0, "no mutation of {name} was a scene");
    }
}
