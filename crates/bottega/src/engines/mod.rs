//! External engines: other renderers, described by manifests, and pictures by them.

mod layers;
mod of_scene;
mod painter;
mod scene_files;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use bottega_engines::external::{self, LocatedEngine, Shelf, ShelfEntry};
use bottega_platform::folders::{config_folder, state_folder};

pub use self::{
    painter::{ExternalPainter, Mix},
    scene_files::SceneFiles,
};
use crate::{
    error::Error,
    request::{BUILTIN, EngineOptions},
};

impl EngineOptions {
    /// Returns the name of the external engine, and true if the built-in engine renders together with it.
    ///
    /// # Errors
    /// The request names no external engine, or several.
    pub fn other(&self) -> Result<(&str, bool), Error> {
        let others: Vec<&String> = self.names.iter().filter(|name| *name != BUILTIN).collect();
        match (others.as_slice(), self.names.len()) {
            ([name], 1) => Ok((name.as_str(), false)),
            ([name], 2) => Ok((name.as_str(), true)),
            _ => Err(Error::usage(
                "these engines cannot render one picture together",
                "name one engine, or `builtin` and one other that reads the same scene",
            )),
        }
    }

    /// Returns true if only the built-in engine renders.
    pub fn is_builtin(&self) -> bool {
        self.names == [BUILTIN]
    }
}

/// Returns the engine manifests of this machine: those that the program contains, those of the user's configuration folder, and
/// those of `folders`.
pub fn shelf(folders: &[PathBuf]) -> Shelf {
    let user_folder = config_folder().join("engines");
    Shelf::open(&std::iter::once(user_folder).chain(folders.iter().cloned()).collect::<Vec<_>>())
}

/// Makes this process store quarantines of engines in the state folder, so that later processes know which engines not to use on
/// this machine. Without this call they end with the process.
pub fn keep_quarantines() {
    external::keep_quarantines_in(state_folder().join("engines"));
}

/// Returns the manifest of an engine.
///
/// - `folders`: folders of further manifests.
/// - `name`: name of the engine.
///
/// # Errors
/// No manifest has that name, or it is invalid.
pub fn entry(folders: &[PathBuf], name: &str) -> Result<ShelfEntry, Error> {
    let shelf = shelf(folders);
    // A broken manifest is not silently replaced by another one of the same name.
    if let Some(broken) = shelf.broken(name) {
        return Err(Error::Manifest(Box::new(broken.clone())));
    }
    shelf.get(name).cloned().ok_or_else(|| {
        let known: Vec<&str> = shelf.iter().map(|entry| entry.manifest.name.as_str()).collect();
        Error::usage(
            format!("there is no engine `{name}`"),
            format!("there are {BUILTIN}, {}; further manifests are read from --engines FOLDER", known.join(", ")),
        )
    })
}

/// Returns the installation of an engine on this machine; parameters as for [`entry`].
///
/// # Errors
/// Those of [`entry`], or the engine is not installed.
pub fn located(folders: &[PathBuf], name: &str) -> Result<Arc<LocatedEngine>, Error> {
    let entry = entry(folders, name)?;
    let found = LocatedEngine::find(&entry).map(Arc::new);
    found.map_err(|source| Error::External { engine: name.to_owned(), source })
}

/// Returns the parameters of an engine: the defaults of its manifest, overridden by the user's options.
///
/// - `options`: values by name; a text that is valid JSON stands for that value, any other text for itself.
///
/// # Errors
/// The engine has no option of that name.
pub fn parameters(
    engine: &LocatedEngine,
    options: &BTreeMap<String, String>,
) -> Result<BTreeMap<String, serde_json::Value>, Error> {
    let mut parameters = engine.manifest().parameters.clone();
    for (name, text) in options {
        let Some(value) = parameters.get_mut(name) else {
            let known: Vec<&str> = engine.manifest().parameters.keys().map(String::as_str).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            return Err(Error::usage(
                format!("{} has no option `{name}`", engine.manifest().title),
                format!("it has: {known}"),
            ));
        };
        // A text that is valid JSON becomes that value, such as a number; any other text a string.
        *value = serde_json::from_str(text).unwrap_or_else(|_| serde_json::Value::String(text.clone()));
    }
    Ok(parameters)
}

/// Returns the absolute path of a scene file: engines run in folders of their own.
///
/// # Errors
/// The file does not exist, or its folder cannot be read.
pub fn absolute(scene: &Path) -> Result<PathBuf, Error> {
    scene.canonicalize().map_err(|source| Error::Read { path: scene.to_owned(), source })
}
