//! Small stages, written as text.

use std::path::{Path, PathBuf};

use bottega_scene::{LoadOptions, Loaded, Scene, SceneError, load};
use glam::Vec3;

/// A folder of layers.
pub(crate) struct Folder(tempfile::TempDir);

impl Folder {
    /// Writes files.
    pub(crate) fn new(files: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            let head = if name.contains(".usd") && !text.starts_with('#') { "#usda 1.0\n" } else { "" };
            std::fs::write(path, format!("{head}{text}")).unwrap();
        }
        Self(folder)
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn load(&self, name: &str) -> Result<Loaded, SceneError> {
        load(&self.path(name), &LoadOptions::default())
    }
}

/// Loads a stage of one layer.
pub(crate) fn stage(text: &str) -> Loaded {
    stage_with(text, &LoadOptions::default()).unwrap()
}

pub(crate) fn stage_with(text: &str, options: &LoadOptions) -> Result<Loaded, SceneError> {
    let folder = Folder::new(&[("scene.usda", text)]);
    load(&folder.path("scene.usda"), options)
}

/// Loads a stage of one layer that has no warnings but those about light, camera and surfaces.
pub(crate) fn clean(text: &str) -> Scene {
    let loaded = stage(text);
    let warnings = warnings(&loaded);
    let expected = ["no light", "no surface", "no camera"];
    assert!(warnings.iter().all(|warning| expected.iter().any(|text| warning.contains(text))), "{warnings:?}");
    loaded.scene
}

pub(crate) fn warnings(loaded: &Loaded) -> Vec<String> {
    loaded.warnings.iter().map(ToString::to_string).collect()
}

/// Returns true if a warning holds both texts.
pub(crate) fn warns(loaded: &Loaded, place: &str, text: &str) -> bool {
    let is_there = |warning: &String| warning.contains(place) && warning.contains(text);
    warnings(loaded).iter().any(is_there)
}

/// The corners of all placed triangles, world space.
pub(crate) fn corners(scene: &Scene) -> Vec<Vec3> {
    let mut corners = Vec::new();
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh as usize];
        let place = |&vertex: &u32| instance.world_from_object.transform_point3(mesh.positions[vertex as usize]);
        corners.extend(mesh.triangles.iter().flatten().map(place));
    }
    corners
}

/// The least and greatest coordinates of all placed triangles.
pub(crate) fn bounds(scene: &Scene) -> (Vec3, Vec3) {
    let corners = corners(scene);
    let least = corners.iter().copied().reduce(Vec3::min).unwrap();
    (least, corners.iter().copied().reduce(Vec3::max).unwrap())
}

/// The folder of larger scenes; `None`: it is not there.
pub(crate) fn scenes(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("BOTTEGA_SCENES").filter(|folder| !folder.is_empty()).map(PathBuf::from);
    let folder = folder.map(|folder| folder.join(name)).filter(|folder| folder.is_dir());
    if folder.is_none() {
        eprintln!("SKIPPED: BOTTEGA_SCENES does not name a folder with {name}");
    }
    folder
}

/// All files below a folder whose extension is one of USD.
pub(crate) fn stages(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut pending = vec![folder.to_path_buf()];
    while let Some(folder) = pending.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                pending.push(path);
            } else if path.extension().is_some_and(|end| end.to_string_lossy().starts_with("usd")) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// A triangle in the plane z = 0 with its front towards +z, as the properties of a Mesh.
pub(crate) const TRIANGLE: &str = "int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]\n\
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\nuniform token subdivisionScheme = \"none\"\n";
