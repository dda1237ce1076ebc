//! The files of a scene, its engine and its agents' rules, which a farm needs to render it.

use std::{
    collections::BTreeSet,
    path::{Component, Path, PathBuf},
};

use bottega_engines::external::Files;
use bottega_scene::SceneFile;

use super::{absolute, located};
use crate::{agent_rules::RuleTexts, error::Error, loaded_scene::LoadedScene, method::Method, request::Request};

/// The files of a scene, the engine that renders it, and the rules of its agents.
#[derive(Clone, Debug, Default)]
pub struct SceneFiles {
    /// Files that the scene refers to, without the scene file itself.
    pub files: Vec<SceneFile>,
    /// Identity of the external engine that all machines must have; `None`: the built-in engine.
    pub engine: Option<String>,
    /// The texts of the agents' rules, as they were checked.
    pub rules: RuleTexts,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Readable name of the method of the built-in engine; `None` with an external engine.
    pub method: Option<String>,
}

impl SceneFiles {
    /// Returns the files of a scene that the built-in engine has loaded.
    ///
    /// - `method`: the integrator planned for the scene.
    /// - `rules`: the texts of the agents' rules.
    pub fn of(subject: &LoadedScene, method: &Method, rules: RuleTexts) -> Self {
        let warnings = subject.warnings.iter().map(ToString::to_string).chain(method.note.clone()).collect();
        let method = method.note.clone().unwrap_or_else(|| format!("painted by {}", method.name()));
        Self { files: subject.files.clone(), engine: None, rules, warnings, method: Some(method) }
    }

    /// Asks the external engine of a request for the files that its scene refers to, and returns them. Files that are missing, or
    /// that the scene may not use, are left out with a warning.
    ///
    /// - `rules`: the texts of the agents' rules.
    ///
    /// # Errors
    /// The scene file does not exist, or the engine is not installed or cannot list the files.
    pub fn gather(request: &Request, rules: RuleTexts) -> Result<Self, Error> {
        // Ask the engine for the files of the scene
        let (name, _) = request.engine.other()?;
        let engine = located(&request.engine.manifests, name)?;
        let scene = absolute(&request.scene.file)?;
        let allow_outside = request.scene.allow_outside;
        let outside = if allow_outside { vec![PathBuf::from("/")] } else { request.scene.asset_roots.clone() };
        let found = engine.scene_files(&scene, &outside);
        let Files { files, missing } = found.map_err(|source| Error::External { engine: name.to_owned(), source })?;
        // Keep files in the folder of the scene, and in folders that the user allows
        let folder = scene.parent().unwrap_or(Path::new("/"));
        let own = scene.file_name().map(PathBuf::from);
        let files: BTreeSet<PathBuf> = files.into_iter().filter_map(|file| file.canonicalize().ok()).collect();
        let roots: Vec<PathBuf> = outside.iter().filter_map(|root| root.canonicalize().ok()).collect();
        let is_allowed = |file: &PathBuf| file.starts_with(folder) || roots.iter().any(|root| file.starts_with(root));
        let (files, kept_back): (Vec<PathBuf>, Vec<PathBuf>) =
            files.into_iter().filter(|file| *file != scene).partition(is_allowed);
        let files = files.into_iter().map(|path| SceneFile { name: relative(folder, &path), path, hash: [0; 32] });
        let warnings = missing.iter().map(|file| {
            format!(
                "`{file}`, to which {} refers, does not exist",
                own.as_deref().unwrap_or(Path::new("the scene")).display()
            )
        });
        // As with the built-in engine: a scene must not decide which other files of this disk are sent.
        let kept_back = kept_back.iter().map(|file| {
            format!(
                "`{}` lies outside the folder of the scene and is not sent; copy it there, or allow such files with \
                 `--allow-outside`, or those of its folder with `--asset-root`",
                file.display()
            )
        });
        let warnings = warnings.chain(kept_back).collect();
        Ok(Self { files: files.collect(), engine: Some(engine.identity()), rules, warnings, method: None })
    }
}

/// Returns the relative path from a folder to a file. Both paths are canonical.
fn relative(folder: &Path, file: &Path) -> String {
    let (from, to): (Vec<_>, Vec<_>) = (folder.components().collect(), file.components().collect());
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = from[shared..].iter().map(|_| Component::ParentDir);
    let path: PathBuf = up.chain(to[shared..].iter().copied()).collect();
    path.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_referred_to_from_the_folder_of_the_scene() {
        let name = |file: &str| relative(Path::new("/a/b"), Path::new(file));
        assert_eq!(name("/a/b/c.ply"), "c.ply");
        assert_eq!(name("/a/b/m/c.ply"), "m/c.ply");
        assert_eq!(name("/a/c.ply"), "../c.ply");
        assert_eq!(name("/x/c.ply"), "../../x/c.ply");
    }
}
