//! Stages of other programs, from the folder that `BOTTEGA_SCENES` names.

use bottega_scene::{LoadOptions, load};

use super::composition::zip;
use super::support::{Folder, scenes, stages};

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
    let packages = Folder::new(&[]);
    for name in ["cube-previewsurface", "blendshape", "skintest"] {
        let binary = folder.join(format!("{name}.usdc"));
        let package = packages.path(&format!("{name}.usdz"));
        std::fs::write(&package, zip(&[("root.usdc", &std::fs::read(&binary).unwrap())])).unwrap();
        let options = LoadOptions { at: Some(0.4), ..LoadOptions::default() };
        let first = load(&folder.join(format!("{name}.usda")), &options).unwrap().scene;
        assert!(!first.instances.is_empty() && !first.cameras.is_empty(), "{name}");
        for other in [binary, package] {
            let second = load(&other, &options).unwrap().scene;
            assert_eq!(first.meshes, second.meshes, "{}", other.display());
            assert_eq!((&first.instances, &first.lights), (&second.instances, &second.lights), "{}", other.display());
            assert_eq!((&first.materials, &first.cameras), (&second.materials, &second.cameras), "{}", other.display());
        }
    }
}
