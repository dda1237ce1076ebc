//! Scenes in temporary folders.

use std::path::PathBuf;

use bottega_scene::{LoadOptions, Loaded, SceneError, load};

/// A folder with files.
pub(crate) struct Folder {
    dir: tempfile::TempDir,
}

impl Folder {
    pub(crate) fn new() -> Self {
        Self { dir: tempfile::tempdir().expect("a folder for the test") }
    }

    pub(crate) fn with(self, name: &str, bytes: impl AsRef<[u8]>) -> Self {
        let path = self.dir.path().join(name);
        std::fs::create_dir_all(path.parent().expect("within the folder")).expect("a folder within");
        std::fs::write(path, bytes).expect("a file of the test");
        self
    }

    /// Adds a scene of Mitsuba 3 with this content.
    pub(crate) fn scene(self, content: &str) -> Self {
        self.with("scene.xml", format!("<scene version=\"3.0.0\">\n{content}\n</scene>"))
    }

    pub(crate) fn path(&self) -> PathBuf {
        self.dir.path().join("scene.xml")
    }

    pub(crate) fn load(&self, options: &LoadOptions) -> Result<Loaded, SceneError> {
        load(&self.path(), options)
    }
}

/// Options that add nothing to the scene.
pub(crate) fn bare() -> LoadOptions {
    LoadOptions { add_sky: false, ..LoadOptions::default() }
}

/// Reads a scene of Mitsuba 3 with this content.
pub(crate) fn read(content: &str) -> Loaded {
    Folder::new().scene(content).load(&bare()).unwrap_or_else(|error| panic!("{error}\n{content}"))
}

/// Reads a scene of Mitsuba 0.6 with this content.
pub(crate) fn read_old(content: &str) -> Loaded {
    let folder = Folder::new().with("scene.xml", format!("<scene version=\"0.6.0\">\n{content}\n</scene>"));
    folder.load(&bare()).unwrap_or_else(|error| panic!("{error}\n{content}"))
}

/// The error of reading a scene of Mitsuba 3 with this content.
pub(crate) fn refuse(content: &str) -> String {
    match Folder::new().scene(content).load(&bare()) {
        Ok(_) => panic!("it was read: {content}"),
        Err(error) => error.to_string(),
    }
}

/// The warnings about a scene, except that it has no camera, no light or no surface.
pub(crate) fn warnings(loaded: &Loaded) -> Vec<String> {
    let is_trivial = |message: &str| message.starts_with("the scene has no ");
    loaded.warnings.iter().filter(|warning| !is_trivial(&warning.message)).map(ToString::to_string).collect()
}

/// Reads a scene that must give no warnings.
pub(crate) fn silent(content: &str) -> Loaded {
    let loaded = read(content);
    assert_eq!(warnings(&loaded), Vec::<String>::new(), "{content}");
    loaded
}
