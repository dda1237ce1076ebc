//! Access to the files that a scene refers to: path resolution, permission, memory, and their share in the scene's
//! digest.
//!
//! Exporters write paths as on their own machine. If a reference leads to no file, it is tried without enclosing
//! quotes, in another letter case and, for an absolute path from another machine, by its trailing parts beside the
//! scene. A file found that way gets a warning.

mod spelling;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use spelling::Spellings;

use crate::budget::MemoryBudget;
use crate::error::{SceneError, Warnings};
use crate::file::{hash, read_file};
use crate::options::LoadOptions;
use crate::text::shortened;

/// The remedy for a reference that leads out of the scene's folder.
const OUTSIDE: &str = "it lies outside the folder of the scene; copy it there, name its folder with `--asset-root`, or allow \
    all such files with `--allow-outside`";

/// Reads the files that a scene refers to. Several threads may share it.
///
/// A reference must not leave the folder of the scene file, by `..`, by an absolute path or by a symbolic link, except
/// into a folder of [`LoadOptions::asset_roots`] or with [`LoadOptions::allow_outside`].
#[derive(Debug)]
pub(crate) struct Resources<'a> {
    path: &'a Path,
    folder: PathBuf,
    allow_outside: bool,
    /// Canonical paths of the scene's folder and of the asset roots.
    roots: Vec<PathBuf>,
    budget: &'a MemoryBudget,
    /// Hash and path of each file that was read, by name.
    hashes: Mutex<BTreeMap<String, (blake3::Hash, PathBuf)>>,
    /// Location in the scene file of the first reference to each name.
    places: Mutex<BTreeMap<String, String>>,
    spellings: Spellings,
    /// Warnings about references.
    news: Mutex<Warnings>,
}

/// A file that a scene refers to and that was read with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneFile {
    /// The reference in normal form: relative to the folder of the scene, or absolute.
    pub name: String,
    /// Path on this machine.
    pub path: PathBuf,
    /// BLAKE3 of the bytes that were read.
    pub hash: [u8; 32],
}

/// A resolved reference.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Location {
    /// The reference in normal form, relative to the folder of the scene or absolute: equal for equal files.
    pub(crate) name: String,
    file: PathBuf,
    /// `true`: the scene may read it.
    is_allowed: bool,
}

impl<'a> Resources<'a> {
    /// Makes the access for the scene file `path`.
    pub(crate) fn new(path: &'a Path, options: &LoadOptions, budget: &'a MemoryBudget) -> Self {
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
            _ => PathBuf::from("."),
        };
        let roots = std::iter::once(&folder).chain(&options.asset_roots);
        Self {
            roots: roots.filter_map(|root| root.canonicalize().ok()).collect(),
            path,
            folder,
            allow_outside: options.allow_outside,
            budget,
            hashes: Mutex::default(),
            places: Mutex::default(),
            spellings: Spellings::default(),
            news: Mutex::default(),
        }
    }

    /// Returns the memory budget of the scene.
    pub(crate) fn budget(&self) -> &'a MemoryBudget {
        self.budget
    }

    /// Resolves a reference: a path as in the file, relative to the folder of the scene. Backslashes also separate. The
    /// file need not exist; [`read`](Self::read) reports a forbidden one.
    ///
    /// - `place`: location of the reference, for messages.
    pub(crate) fn locate(&self, reference: &str, place: &str) -> Result<Location, SceneError> {
        self.locate_in(&[""], reference, place)
    }

    /// Resolves a reference that is relative to the first of several folders that has it.
    ///
    /// - `folders`: relative to the folder of the scene, at least one; empty text is that folder.
    pub(crate) fn locate_in(&self, folders: &[&str], reference: &str, place: &str) -> Result<Location, SceneError> {
        let location = self.find(folders, reference, place)?;
        let mut places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        if !places.contains_key(&location.name) {
            places.insert(location.name.clone(), place.into());
        }
        Ok(location)
    }

    fn find(&self, folders: &[&str], reference: &str, place: &str) -> Result<Location, SceneError> {
        let invalid = |problem: &str| SceneError::Invalid {
            path: self.path.into(),
            place: place.into(),
            problem: format!("cannot follow `{}`: {problem}", shortened(reference)),
        };
        if reference.contains('\0') {
            return Err(invalid("it contains a zero byte"));
        }
        let slashed = reference.replace('\\', "/");
        let bare = without_quotes(&slashed);
        let mut first = None;
        for text in if bare == slashed { vec![bare] } else { vec![slashed.as_str(), bare] } {
            for folder in folders {
                let name = without_detours(&within(folder, text));
                if name.is_empty() || name == "/" || name == ".." || name.ends_with("/..") {
                    return Err(invalid("it names no file"));
                }
                let location = self.at(name);
                if location.is_file() {
                    return Ok(location);
                }
                first.get_or_insert(location);
            }
        }
        let first = first.ok_or_else(|| invalid("it names no file"))?;
        for folder in folders.iter().filter(|_| !is_absolute(bare)) {
            if let Some(found) = self.other_spelling(&without_detours(&within(folder, bare))) {
                let message = format!("there is no `{}`; `{}` is used", shortened(reference), shortened(&found.name));
                self.tell(place, message, false);
                return Ok(found);
            }
        }
        match self.end_of_foreign_path(folders, bare) {
            Some(found) => {
                let problem = if first.is_allowed { "is not there" } else { "may not be read" };
                let (reference, name) = (shortened(reference), shortened(&found.name));
                self.tell(place, format!("`{reference}` {problem}; `{name}` beside the scene is used"), true);
                Ok(found)
            }
            None => Ok(first),
        }
    }

    /// Returns the location of a normalized name.
    fn at(&self, mut name: String) -> Location {
        let mut file = self.folder.join(&name);
        let mut is_allowed = self.allow_outside;
        if !is_allowed {
            match file.canonicalize() {
                // Resolve symbolic links once, here.
                Ok(real) => {
                    is_allowed = self.roots.iter().any(|root| real.starts_with(root));
                    // Name everything below the scene's folder relative to it, whatever path led there.
                    let below = self.roots.first().and_then(|folder| real.strip_prefix(folder).ok());
                    if is_absolute(&name)
                        && let Some(below) = below.and_then(Path::to_str)
                    {
                        name = below.replace('\\', "/");
                    }
                    if real != file && self.folder.is_absolute() && is_allowed {
                        file = real;
                    }
                }
                Err(_) => is_allowed = self.would_be_allowed(&name),
            }
        }
        Location { name, file, is_allowed }
    }

    /// Returns true if a missing file of that name may be read if it appears.
    fn would_be_allowed(&self, name: &str) -> bool {
        let leaves = is_absolute(name) || name.starts_with("../");
        // A drive letter is a location only on the system that has drives.
        let is_place = !is_absolute(name) || Path::new(name).is_absolute();
        let whole = self.roots.first().map(|folder| folder.join(name).to_string_lossy().replace('\\', "/"));
        let is_below = |whole: String| {
            let whole = PathBuf::from(without_detours(&whole));
            self.roots.iter().any(|root| whole.starts_with(root))
        };
        !leaves || is_place && whole.is_some_and(is_below)
    }

    /// Finds a file whose name differs only in letter case.
    fn other_spelling(&self, name: &str) -> Option<Location> {
        let name = self.spellings.find(&self.folder, name)?;
        Some(self.at(name)).filter(Location::is_file)
    }

    /// Finds a file by the longest tail of an absolute path from another machine.
    fn end_of_foreign_path(&self, folders: &[&str], path: &str) -> Option<Location> {
        const PARTS_MAX: usize = 32;
        if !is_absolute(path) {
            return None;
        }
        let parts: Vec<&str> = path.split('/').filter(|part| !matches!(*part, "" | "." | "..")).collect();
        let from = parts.len().saturating_sub(PARTS_MAX);
        (from..parts.len()).find_map(|start| {
            let end = parts[start..].join("/");
            folders.iter().find_map(|folder| {
                let name = without_detours(&within(folder, &end));
                let exact = self.at(name.clone());
                if exact.is_file() { Some(exact) } else { self.other_spelling(&name) }
            })
        })
    }

    fn tell(&self, place: &str, message: String, is_strict: bool) {
        let mut news = self.news.lock().unwrap_or_else(PoisonError::into_inner);
        if is_strict { news.unsupported(place, message) } else { news.add(place, message) }
    }

    /// Returns true if the location is the scene file itself.
    pub(crate) fn is_scene(&self, location: &Location) -> bool {
        self.path.file_name().is_some_and(|name| name.to_string_lossy() == location.name)
    }

    /// Reads a file and adds its hash to the scene's digest.
    pub(crate) fn read(&self, location: &Location) -> Result<Vec<u8>, SceneError> {
        if !location.is_allowed {
            let place = self.place_of(location);
            let mut news = self.news.lock().unwrap_or_else(PoisonError::into_inner);
            news.unsupported_silently(place.as_str(), format!("refuses to read `{}`", shortened(&location.name)));
            return Err(SceneError::ForbiddenReference {
                path: self.path.into(),
                place,
                uri: shortened(&location.name).into_owned(),
                reason: OUTSIDE,
            });
        }
        let bytes = self.attribute(location, read_file(&location.file, self.budget))?;
        let hash = hash(&bytes);
        let mut hashes = self.hashes.lock().unwrap_or_else(PoisonError::into_inner);
        hashes.insert(location.name.clone(), (hash, location.file.clone()));
        Ok(bytes)
    }

    /// Adds the location of the reference to an error about a missing or too large file.
    pub(crate) fn attribute<T>(&self, location: &Location, result: Result<T, SceneError>) -> Result<T, SceneError> {
        result.map_err(|error| {
            let scene = self.path.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
            let place = self.place_of(location);
            if place.is_empty() || place.starts_with(&*scene) {
                return error.requested_by(if place.is_empty() { &scene } else { &place });
            }
            error.requested_by(&format!("{scene}, {place}"))
        })
    }

    /// Returns where a location was first referred to.
    fn place_of(&self, location: &Location) -> String {
        let places = self.places.lock().unwrap_or_else(PoisonError::into_inner);
        places.get(&location.name).cloned().unwrap_or_default()
    }

    /// Resolves a reference and reads the file; see [`locate`](Self::locate).
    pub(crate) fn open(&self, reference: &str, place: &str) -> Result<Vec<u8>, SceneError> {
        self.read(&self.locate(reference, place)?)
    }

    /// Adds the hashes of all files to the digest of the scene, sorted by name and so independent of the reading order.
    /// Returns the files in the same order.
    pub(crate) fn finish(self, digest: &mut blake3::Hasher, warnings: &mut Warnings) -> Vec<SceneFile> {
        warnings.append(self.news.into_inner().unwrap_or_else(PoisonError::into_inner));
        let hashes = self.hashes.into_inner().unwrap_or_else(PoisonError::into_inner);
        let file = |(name, (hash, path)): (String, (blake3::Hash, PathBuf))| {
            digest.update(hash.as_bytes());
            SceneFile { name, path, hash: *hash.as_bytes() }
        };
        hashes.into_iter().map(file).collect()
    }
}

impl Location {
    /// Returns the path on this machine.
    pub(crate) fn path(&self) -> &Path {
        &self.file
    }

    /// Returns true if the file exists and may be read.
    pub(crate) fn is_file(&self) -> bool {
        self.is_allowed && self.file.is_file()
    }

    /// Returns the file's folder, relative to the folder of the scene; empty for that folder.
    pub(crate) fn folder(&self) -> &str {
        self.name.rsplit_once('/').map_or("", |(folder, _)| folder)
    }
}

/// Returns true for a path that is absolute on any system.
fn is_absolute(slashed: &str) -> bool {
    slashed.starts_with('/') || slashed.as_bytes().get(1) == Some(&b':')
}

/// Joins a path to the folder that it is relative to.
fn within(folder: &str, path: &str) -> String {
    if folder.is_empty() || is_absolute(path) { path.into() } else { format!("{folder}/{path}") }
}

fn without_quotes(text: &str) -> &str {
    let trimmed = text.trim();
    let inner = ['"', '\''].iter().find_map(|&quote| trimmed.strip_prefix(quote)?.strip_suffix(quote));
    inner.unwrap_or(text)
}

/// Removes `.`, `x/..` and repeated slashes from a path.
fn without_detours(path: &str) -> String {
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." if parts.last().is_some_and(|&last| last != "..") => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    let root = if path.starts_with('/') { "/" } else { "" };
    root.to_owned() + &parts.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Folder {
        outer: tempfile::TempDir,
        scene: PathBuf,
    }

    /// Creates the files `outer/secret`, `outer/scene/scene.x` and `outer/scene/sub/a`.
    fn folder() -> Folder {
        let outer = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(outer.path().join("scene/sub")).unwrap();
        std::fs::write(outer.path().join("secret"), "secret").unwrap();
        std::fs::write(outer.path().join("scene/sub/a"), "a").unwrap();
        let scene = outer.path().join("scene/scene.x");
        std::fs::write(&scene, "").unwrap();
        Folder { outer, scene }
    }

    fn with(folder: &Folder, allow_outside: bool, check: impl FnOnce(&Resources<'_>)) {
        with_options(folder, &LoadOptions { allow_outside, ..LoadOptions::default() }, check);
    }

    fn with_options(folder: &Folder, options: &LoadOptions, check: impl FnOnce(&Resources<'_>)) {
        let budget = MemoryBudget::new(1 << 20);
        check(&Resources::new(&folder.scene, options, &budget));
    }

    /// Returns the warnings, and the number of features that strict mode refuses.
    fn warnings(resources: &Resources<'_>) -> (Vec<String>, usize) {
        let mut news = std::mem::take(&mut *resources.news.lock().unwrap());
        let strict = news.take_unsupported().len();
        (news.finish().iter().map(ToString::to_string).collect(), strict)
    }

    #[test]
    fn detours_within_the_folder_lead_to_the_same_file() {
        with(&folder(), false, |resources| {
            for reference in ["sub/a", "./sub/../sub//a", "sub\\a"] {
                assert_eq!(resources.locate(reference, "").unwrap().name, "sub/a");
                assert_eq!(resources.open(reference, "").unwrap(), b"a");
            }
            let folder = resources.locate("sub/a", "").unwrap().folder().to_owned();
            assert_eq!(resources.locate_in(&[&folder], "../b.png", "").unwrap().name, "b.png");
            assert!(resources.is_scene(&resources.locate("./sub/../scene.x", "").unwrap()));
            assert!(!resources.is_scene(&resources.locate("sub/a", "").unwrap()));
            for reference in ["", ".", "a/..", "a\0b"] {
                assert!(matches!(resources.locate(reference, ""), Err(SceneError::Invalid { .. })), "{reference:?}");
            }
            assert!(matches!(resources.open("missing", ""), Err(SceneError::Read { .. })));
        });
    }

    #[test]
    fn files_outside_the_folder_are_refused_unless_allowed() {
        let folder = folder();
        let absolute = folder.outer.path().join("secret").display().to_string();
        for reference in ["../secret", "sub/../../secret", "..\\secret", &absolute] {
            with(&folder, false, |resources| {
                let refused = resources.open(reference, "line 7");
                assert!(matches!(refused, Err(SceneError::ForbiddenReference { .. })), "{reference}");
            });
            with(&folder, true, |resources| assert_eq!(resources.open(reference, "").unwrap(), b"secret"));
        }
        for reference in ["C:\\a", "c:a", "//host/a"] {
            with(&folder, false, |resources| {
                assert!(matches!(resources.open(reference, ""), Err(SceneError::ForbiddenReference { .. })));
            });
        }
    }

    #[cfg(unix)]
    #[test]
    fn symbolic_links_do_not_lead_out() {
        let folder = folder();
        std::os::unix::fs::symlink("../../secret", folder.outer.path().join("scene/sub/link")).unwrap();
        std::os::unix::fs::symlink("a", folder.outer.path().join("scene/sub/inner")).unwrap();
        with(&folder, false, |resources| {
            assert!(matches!(resources.open("sub/link", ""), Err(SceneError::ForbiddenReference { .. })));
            assert_eq!(resources.open("sub/inner", "").unwrap(), b"a");
        });
        with(&folder, true, |resources| assert_eq!(resources.open("sub/link", "").unwrap(), b"secret"));
    }

    #[test]
    fn the_digest_does_not_depend_on_the_order_of_reading() {
        let folder = folder();
        std::fs::write(folder.outer.path().join("scene/b"), "b").unwrap();
        let digest = |references: &[&str]| {
            let mut digest = blake3::Hasher::new();
            let budget = MemoryBudget::new(1 << 20);
            let resources = Resources::new(&folder.scene, &LoadOptions::default(), &budget);
            references.iter().for_each(|reference| drop(resources.open(reference, "").unwrap()));
            resources.finish(&mut digest, &mut Warnings::default());
            digest.finalize()
        };
        assert_eq!(digest(&["b", "sub/a"]), digest(&["sub/a", "./b", "b"]));
        assert_ne!(digest(&["b"]), digest(&["sub/a"]));
    }

    #[test]
    fn names_of_other_machines_are_found_beside_the_scene() {
        let folder = folder();
        let absolute = folder.outer.path().join("elsewhere/sub/a").display().to_string();
        for (reference, is_strict) in [
            ("SUB/A", 0),
            ("\"Sub\\A\"", 0),
            ("C:\\Users\\x\\sub\\a", 1),
            ("c:/SUB/A", 1),
            ("\\\\host\\share\\sub\\a", 1),
            ("/home/x/sub/a", 1),
            (&absolute, 1),
        ] {
            with(&folder, false, |resources| {
                let found = resources.locate(reference, "line 7").unwrap();
                assert_eq!(
                    (found.name.as_str(), resources.read(&found).unwrap()),
                    ("sub/a", b"a".to_vec()),
                    "{reference}"
                );
                let (warnings, strict) = warnings(resources);
                assert_eq!((warnings.len(), strict), (1, is_strict), "{reference}: {warnings:?}");
                assert!(warnings[0].starts_with("line 7: ") && warnings[0].contains("sub/a"), "{warnings:?}");
            });
        }
        with(&folder, false, |resources| {
            // Quotes around a name are dropped without a warning, unless the file name has them.
            assert_eq!(resources.locate("\"sub/a\"", "").unwrap().name, "sub/a");
            assert_eq!(resources.locate_in(&["x", "sub"], "a", "").unwrap().name, "sub/a");
            assert!(warnings(resources).0.is_empty());
        });
    }

    #[test]
    fn errors_about_missing_files_name_the_line_that_needs_them() {
        with(&folder(), false, |resources| {
            let error = resources.open("sub/b", "line 7").unwrap_err().to_string();
            assert!(error.contains("sub/b` (requested by scene.x, line 7)"), "{error}");
            let error = resources.open("sub", "scene.x:2:3").unwrap_err().to_string();
            assert!(error.contains("sub` (requested by scene.x:2:3) is a folder"), "{error}");
        });
    }

    #[cfg(unix)]
    #[test]
    fn other_roots_are_allowed_by_name() {
        let folder = folder();
        let shared = tempfile::tempdir().unwrap();
        std::fs::write(shared.path().join("b"), "b").unwrap();
        std::os::unix::fs::symlink(shared.path(), folder.outer.path().join("scene/link")).unwrap();
        let absolute = shared.path().join("b").display().to_string();
        let options = LoadOptions { asset_roots: vec![shared.path().into()], ..LoadOptions::default() };
        for reference in ["link/b", &absolute] {
            with(&folder, false, |resources| {
                let error = resources.open(reference, "line 7").unwrap_err();
                let remedy = "--asset-root";
                assert!(matches!(&error, SceneError::ForbiddenReference { place, .. } if place == "line 7"));
                assert!(error.to_string().contains(remedy), "{error}");
                assert_eq!(warnings(resources).1, 1);
            });
            with_options(&folder, &options, |resources| {
                assert_eq!(resources.open(reference, "").unwrap(), b"b");
                // A folder beside the root is still forbidden.
                assert!(matches!(resources.open("../secret", ""), Err(SceneError::ForbiddenReference { .. })));
            });
        }
    }
}
