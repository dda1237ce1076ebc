//! The known manifests: those of this program, and the user's own.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    error::EngineFault,
    manifest::{Manifest, ManifestError},
    shipped,
};

/// A manifest with its files.
#[derive(Clone, Debug)]
pub struct ShelfEntry {
    /// The parsed manifest.
    pub manifest: Arc<Manifest>,
    /// The folder of the manifest; `None`: it is built into this program.
    pub folder: Option<PathBuf>,
    /// The text of the manifest.
    pub text: Arc<str>,
}

/// Manifests by name; those of later folders replace earlier ones.
#[derive(Clone, Debug, Default)]
pub struct Shelf {
    entries: BTreeMap<String, ShelfEntry>,
    /// The errors of manifests that cannot be read or are invalid. They are only reported if their engine is used.
    pub broken: Vec<ManifestError>,
}

impl Shelf {
    /// Loads the built-in manifests, and all `*.toml` in the given folders that exist. The field `broken` then has the
    /// errors of those that cannot be read or are invalid.
    pub fn open(folders: &[PathBuf]) -> Self {
        let mut shelf = Self::default();
        for (name, text) in shipped::MANIFESTS {
            shelf.add(Path::new(name), text, None);
        }
        for folder in folders {
            let mut files: Vec<PathBuf> =
                fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
            files.retain(|path| path.extension().is_some_and(|it| it == "toml"));
            files.sort();
            for path in files {
                match fs::read_to_string(&path) {
                    Ok(text) => shelf.add(&path, &text, Some(folder.clone())),
                    Err(error) => shelf.broken.push(ManifestError {
                        problem: format!("cannot be read: {error}"),
                        path,
                        line: 1,
                        column: 1,
                        span: 0..0,
                        text: String::new(),
                    }),
                }
            }
        }
        shelf
    }

    fn add(&mut self, path: &Path, text: &str, folder: Option<PathBuf>) {
        match Manifest::parse(path, text) {
            Ok(manifest) => {
                let entry = ShelfEntry { manifest: Arc::new(manifest), folder, text: text.into() };
                self.entries.insert(entry.manifest.name.clone(), entry);
            }
            Err(error) => self.broken.push(error),
        }
    }

    /// Returns the manifest of the engine with this name; `None`: there is none.
    pub fn get(&self, name: &str) -> Option<&ShelfEntry> {
        self.entries.get(name)
    }

    /// Returns all manifests, in the order of their names.
    pub fn iter(&self) -> impl Iterator<Item = &ShelfEntry> {
        self.entries.values()
    }

    /// Returns the error of a broken manifest, by the stem of its file name; `None`: there is no broken one of this
    /// name.
    pub fn broken(&self, name: &str) -> Option<&ManifestError> {
        self.broken.iter().find(|error| error.path.file_stem().is_some_and(|stem| stem == name))
    }
}

impl ShelfEntry {
    /// Parses a manifest that is not in a folder of manifests. Its scripts and rules are sought beside it.
    ///
    /// - `path`: the path of the manifest; its file stem must be the name of the engine.
    /// - `text`: the content of the manifest.
    ///
    /// # Errors
    /// The text is larger than 1 MiB, or invalid: with line and column.
    pub fn from_file(path: &Path, text: &str) -> Result<Self, ManifestError> {
        let manifest = Arc::new(Manifest::parse(path, text)?);
        let folder = path.parent().unwrap_or(Path::new(".")).to_owned();
        Ok(Self { manifest, folder: Some(folder), text: text.into() })
    }

    /// Returns the path of the engine's rules, with their text if they are built in; `None`: it has no rules of its
    /// own.
    pub fn rules(&self) -> Option<(PathBuf, Option<&'static str>)> {
        let name = self.manifest.rules.as_ref()?;
        match &self.folder {
            Some(folder) => Some((folder.join(name), None)),
            None => Some((PathBuf::from(name), shipped::rules(Path::new(name)))),
        }
    }

    /// Copies the files of the manifest into `folder`, which is private to this process.
    pub(super) fn unpack(&self, folder: &Path) -> Result<(), EngineFault> {
        for name in &self.manifest.files {
            let to = folder.join(name);
            let failed = |source| EngineFault::Files { path: to.clone(), source };
            match &self.folder {
                Some(from) => fs::copy(from.join(name), &to).map(drop).map_err(failed)?,
                None => {
                    let missing = || std::io::Error::from(std::io::ErrorKind::NotFound);
                    let text = shipped::file(name).ok_or_else(missing).map_err(failed)?;
                    fs::write(&to, text).map_err(failed)?;
                }
            }
        }
        Ok(())
    }

    /// Returns the bytes of the manifest and of its scripts, which determine the engine's pictures. A script that
    /// cannot be read counts as empty.
    pub fn identity(&self) -> Vec<u8> {
        let mut bytes = self.text.as_bytes().to_vec();
        for name in &self.manifest.files {
            bytes.push(0);
            match &self.folder {
                Some(from) => bytes.extend(fs::read(from.join(name)).unwrap_or_default()),
                None => bytes.extend(shipped::file(name).unwrap_or_default().as_bytes()),
            }
        }
        bytes
    }
}
