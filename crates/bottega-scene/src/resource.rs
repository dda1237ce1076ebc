//! Files that a scene refers to: found, allowed or refused, counted, and remembered in the scene's digest.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::SceneError;
use crate::file::{hash, read_file};
use crate::load::{LoadOptions, MemoryBudget};
use crate::text::shortened;

/// The remedy for a reference that leads out of the scene's folder.
const OUTSIDE: &str =
    "it lies outside the folder of the scene; copy it there, or allow such files with `--allow-outside`";

/// Reads the files that a scene refers to. Several threads may share it.
///
/// A reference may not lead out of the folder of the scene file, neither by `..`, nor as an absolute path, nor by a
/// symbolic link, unless [`LoadOptions::allow_outside`] says so.
#[derive(Debug)]
pub(crate) struct Resources<'a> {
    path: &'a Path,
    folder: PathBuf,
    allow_outside: bool,
    budget: &'a MemoryBudget,
    /// What was read, by reference.
    hashes: Mutex<BTreeMap<String, (blake3::Hash, PathBuf)>>,
}

/// A file that a scene was read from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneFile {
    /// How the scene refers to it: without detours, relative to the folder of the scene (or absolute).
    pub name: String,
    /// Where it is.
    pub path: PathBuf,
    /// BLAKE3 of what was read.
    pub hash: [u8; 32],
}

/// A reference that was understood and is allowed.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Location {
    /// The reference without detours, relative to the folder of the scene (or absolute): the same for the same file.
    pub(crate) name: String,
    file: PathBuf,
}

impl<'a> Resources<'a> {
    /// For the references of the scene file `path`.
    pub(crate) fn new(path: &'a Path, options: &LoadOptions, budget: &'a MemoryBudget) -> Self {
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
            _ => PathBuf::from("."),
        };
        Self { path, folder, allow_outside: options.allow_outside, budget, hashes: Mutex::default() }
    }

    /// The memory that the scene may take.
    pub(crate) fn budget(&self) -> &'a MemoryBudget {
        self.budget
    }

    /// Understands a reference: a path as it stands in the file, relative to the folder of the scene. Backslashes
    /// separate too. The file need not exist.
    ///
    /// - `place`: where the reference stands, for messages.
    pub(crate) fn locate(&self, reference: &str, place: &str) -> Result<Location, SceneError> {
        let invalid = |problem: &str| SceneError::Invalid {
            path: self.path.into(),
            place: place.into(),
            problem: format!("cannot follow `{}`: {problem}", shortened(reference)),
        };
        if reference.contains('\0') {
            return Err(invalid("it contains a zero byte"));
        }
        let slashed = reference.replace('\\', "/");
        let is_absolute = slashed.starts_with('/') || slashed.as_bytes().get(1) == Some(&b':');
        let name = without_detours(&slashed);
        if name.is_empty() || name == "/" || name == ".." || name.ends_with("/..") {
            return Err(invalid("it names no file"));
        }
        let leaves = is_absolute || name.starts_with("../");
        if leaves && !self.allow_outside {
            return Err(self.outside(reference, place));
        }
        let mut file = self.folder.join(&name);
        if !self.allow_outside
            && let Ok(real) = file.canonicalize()
        {
            // Symbolic links are followed once, here.
            if !self.folder.canonicalize().is_ok_and(|folder| real.starts_with(folder)) {
                return Err(self.outside(reference, place));
            }
            if real.as_path() != file.as_path() && self.folder.is_absolute() {
                file = real;
            }
        }
        Ok(Location { name, file })
    }

    /// Whether a reference leads back to the scene file itself.
    pub(crate) fn is_scene(&self, location: &Location) -> bool {
        self.path.file_name().is_some_and(|name| name.to_string_lossy() == location.name)
    }

    /// Reads a file. Its hash will be part of the scene's digest.
    pub(crate) fn read(&self, location: &Location) -> Result<Vec<u8>, SceneError> {
        let bytes = read_file(&location.file, self.budget)?;
        let hash = hash(&bytes);
        let mut hashes = self.hashes.lock().unwrap_or_else(PoisonError::into_inner);
        hashes.insert(location.name.clone(), (hash, location.file.clone()));
        Ok(bytes)
    }

    /// Finds and reads a file; see [`locate`](Self::locate).
    pub(crate) fn open(&self, reference: &str, place: &str) -> Result<Vec<u8>, SceneError> {
        self.read(&self.locate(reference, place)?)
    }

    /// Adds what was read to the digest of the scene, in an order that does not depend on when it was read. Returns the
    /// files in the same order.
    pub(crate) fn finish(self, digest: &mut blake3::Hasher) -> Vec<SceneFile> {
        let hashes = self.hashes.into_inner().unwrap_or_else(PoisonError::into_inner);
        let file = |(name, (hash, path)): (String, (blake3::Hash, PathBuf))| {
            digest.update(hash.as_bytes());
            SceneFile { name, path, hash: *hash.as_bytes() }
        };
        hashes.into_iter().map(file).collect()
    }

    fn outside(&self, reference: &str, place: &str) -> SceneError {
        SceneError::ForbiddenReference {
            path: self.path.into(),
            place: place.into(),
            uri: shortened(reference).into_owned(),
            reason: OUTSIDE,
        }
    }
}

impl Location {
    /// The file on disk.
    pub(crate) fn path(&self) -> &Path {
        &self.file
    }

    /// A reference as it stands in this file, whose own folder it starts from, made relative to the folder of the scene.
    pub(crate) fn join(&self, reference: &str) -> String {
        let slashed = reference.replace('\\', "/");
        match self.name.rsplit_once('/') {
            Some((folder, _)) if !slashed.starts_with('/') && slashed.as_bytes().get(1) != Some(&b':') => {
                format!("{folder}/{slashed}")
            }
            _ => slashed,
        }
    }
}

/// Takes `.`, `x/..` and doubled slashes out of a path.
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

    /// `outer/secret`, `outer/scene/scene.x`, `outer/scene/sub/a`.
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
        let budget = MemoryBudget::new(1 << 20);
        let options = LoadOptions { allow_outside, ..LoadOptions::default() };
        check(&Resources::new(&folder.scene, &options, &budget));
    }

    #[test]
    fn detours_within_the_folder_lead_to_the_same_file() {
        with(&folder(), false, |resources| {
            for reference in ["sub/a", "./sub/../sub//a", "sub\\a"] {
                assert_eq!(resources.locate(reference, "").unwrap().name, "sub/a");
                assert_eq!(resources.open(reference, "").unwrap(), b"a");
            }
            assert_eq!(resources.locate("sub/a", "").unwrap().join("../b.png"), "sub/../b.png");
            assert!(resources.is_scene(&resources.locate("./sub/../scene.x", "").unwrap()));
            assert!(!resources.is_scene(&resources.locate("sub/a", "").unwrap()));
            for reference in ["", ".", "a/..", "a\0b"] {
                assert!(matches!(resources.locate(reference, ""), Err(SceneError::Invalid { .. })), "{reference:?}");
            }
            assert!(matches!(resources.open("missing", ""), Err(SceneError::Read { .. })));
        });
    }

    #[test]
    fn what_leaves_the_folder_is_refused_unless_allowed() {
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
            resources.finish(&mut digest);
            digest.finalize()
        };
        assert_eq!(digest(&["b", "sub/a"]), digest(&["sub/a", "./b", "b"]));
        assert_ne!(digest(&["b"]), digest(&["sub/a"]));
    }
}
