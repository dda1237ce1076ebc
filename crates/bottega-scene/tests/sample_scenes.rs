//! The importer on scenes of other people's exporters. They are read from the folder in `BOTTEGA_SCENES`.

use std::path::{Path, PathBuf};

use bottega_scene::{LoadOptions, Loaded, load};

fn scenes() -> Option<PathBuf> {
    let folder = std::env::var_os("BOTTEGA_SCENES").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("skipped: set BOTTEGA_SCENES to the folder of the sample scenes");
    }
    folder
}

fn read(folder: &Path, name: &str) -> Loaded {
    let path = folder.join("gltf").join(name);
    load(&path, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_cornell_box_is_read() {
    let Some(folder) = scenes() else { return };
    let loaded = read(&folder, "CornellBox/CornellBox.glb");
    let scene = &loaded.scene;
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.materials.len()), (6, 6, 5));
    assert_eq!(scene.materials[0].emission.factor, glam::Vec3::splat(100.0));
    for w in &loaded.warnings { eprintln!("{w}"); }
    eprintln!("{:?} {:?} {}", scene.bounds(), scene.cameras, scene.triangle_count());
}
