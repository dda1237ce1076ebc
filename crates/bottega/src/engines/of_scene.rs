//! The choice of an external engine for scenes that the built-in engine does not read.

use std::path::Path;

use bottega_engines::external::ShelfEntry;

use super::shelf;
use crate::{
    formats::{READ, end_of},
    request::Request,
};

impl Request {
    /// Returns the request with the first external engine that reads the scene, if the built-in engine does not and no engine
    /// is named: Cycles for `.blend`. The engine may still turn out not to be installed when it is opened.
    #[must_use]
    pub fn by_engine_of_scene(&self) -> Self {
        let mut request = self.clone();
        if self.engine.is_builtin()
            && let Some(entry) = engine_of(&self.scene.file, &shelf(&self.engine.manifests).iter().collect::<Vec<_>>())
        {
            request.engine.names = vec![entry.manifest.name.clone()];
        }
        request
    }
}

/// Returns the first engine that reads a scene file, if the built-in engine does not.
fn engine_of<'a>(scene: &Path, shelf: &[&'a ShelfEntry]) -> Option<&'a ShelfEntry> {
    let end = end_of(scene).filter(|end| !READ.contains(&end.as_str()))?;
    shelf.iter().find(|entry| entry.manifest.scene.extensions.contains(&end)).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::{BUILTIN, EngineOptions};

    #[test]
    fn a_scene_that_ours_does_not_read_is_painted_by_the_engine_that_does() {
        let names = |file: &str| Request::new(file).by_engine_of_scene().engine.names;
        assert_eq!(names("cube.blend"), ["cycles"]);
        assert_eq!(names("CUBE.BLEND"), ["cycles"]);
        assert_eq!(names("scene.pov"), ["povray"]);
        for file in ["a.glb", "a.gltf", "a.xml", "a.pbrt", "a.obj", "a.usd", "a", ""] {
            assert_eq!(names(file), [BUILTIN], "{file}");
        }
        let engine = EngineOptions { names: vec!["luxcore".to_owned()], ..EngineOptions::default() };
        let named = Request { engine, ..Request::new("a.blend") };
        assert_eq!(named.by_engine_of_scene().engine.names, ["luxcore"]);
    }
}
