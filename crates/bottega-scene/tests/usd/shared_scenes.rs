//! Stages of other programs, from the folder that `BOTTEGA_SCENES` names.

use bottega_scene::{LoadOptions, SceneError, load};

use super::support::{scenes, stages};

#[test]
fn all_stages_are_read_but_those_that_are_wrong() {
    let Some(folder) = scenes("usd") else { return };
    let stages = stages(&folder);
    assert!(stages.len() > 150, "{}", stages.len());
    let mut failed = Vec::new();
    for path in &stages {
        if let Err(error) = load(path, &LoadOptions::default()) {
            failed.push(format!("{}: {error}", path.display()));
        }
    }
    assert_eq!(failed, Vec::<String>::new());
}

#[test]
fn text_binary_and_package_of_a_stage_are_the_same_scene() {
    let Some(folder) = scenes("usd/tinyusdz") else { return };
    for (one, others) in [
        ("cube-previewsurface.usda", &["cube-previewsurface.usdc"][..]),
        ("texture-cat-plane.usda", &["texture-cat-plane.usdc", "texture-cat-plane.usdz"]),
        ("blendshape.usda", &["blendshape.usdc"]),
        ("cube.usdc", &["cube.usdz"]),
    ] {
        let read =
            |name: &str| -> Result<_, SceneError> { Ok(load(&folder.join(name), &LoadOptions::default())?.scene) };
        let first = read(one).unwrap();
        assert!(!first.instances.is_empty(), "{one}");
        for other in others {
            let second = read(other).unwrap();
            assert_eq!(first.meshes, second.meshes, "{one} {other}");
            assert_eq!((&first.instances, &first.lights), (&second.instances, &second.lights), "{one} {other}");
            assert_eq!((&first.materials, &first.cameras), (&second.materials, &second.cameras), "{one} {other}");
            let texels =
                |scene: &bottega_scene::Scene| scene.images.iter().map(|image| image.mean()).collect::<Vec<_>>();
            assert_eq!(texels(&first), texels(&second), "{one} {other}");
        }
    }
}
