//! A size-limited cache of fetched scenes; the least recently used files are removed first.

use std::{
    fs, io,
    path::{Path, PathBuf},
    time::SystemTime,
};

use bottega_platform::folders::state_folder;

use crate::error::Error;

/// Default size of a machine's cache, in bytes.
pub(crate) const CACHE_BYTES: u64 = 20 << 30;

/// The cache of scene files of this machine: a folder with `files` and `chunks`, both named by content hash, and `scenes`,
/// folders of links to files.
#[derive(Clone, Debug)]
pub struct Cache {
    root: PathBuf,
    bytes_max: u64,
}

/// A removable entry of the cache.
struct CachedItem {
    path: PathBuf,
    used: SystemTime,
    bytes: u64,
}

impl Cache {
    /// Returns a cache with a size limit in bytes.
    pub(crate) fn new(root: PathBuf, bytes_max: u64) -> Self {
        Self { root, bytes_max }
    }

    /// Returns the default cache of this user: the folder `cache` in Bottega's state folder, of at most 20 GiB.
    pub fn of_user() -> Self {
        Self::new(state_folder().join("cache"), CACHE_BYTES)
    }

    /// Returns the folder of the cache.
    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    /// Locks the cache against other processes of this machine until the result is dropped. Waits while another one has the lock.
    ///
    /// # Errors
    /// The lock file cannot be written.
    pub(crate) fn lock(&self) -> Result<fs::File, Error> {
        let path = self.root.join("lock");
        let write_error = |source| Error::write(path.clone(), source);
        fs::create_dir_all(&self.root).map_err(write_error)?;
        let file = fs::File::create(&path).map_err(write_error)?;
        file.lock().map_err(write_error)?;
        Ok(file)
    }

    /// Removes a file from the cache, if it exists.
    pub(crate) fn remove(&self, path: &Path) {
        if path.starts_with(&self.root) && path.exists() {
            remove(path);
        }
    }

    /// Returns the path of a file in the cache, present or not.
    pub(crate) fn file(&self, hash: &str) -> PathBuf {
        self.root.join("files").join(hash)
    }

    /// Returns the path of a chunk, kept while its file is incomplete.
    pub(crate) fn chunk(&self, hash: &str) -> PathBuf {
        self.root.join("chunks").join(hash)
    }

    /// Returns the path of a scene's folder.
    pub(crate) fn scene(&self, hash: &str) -> PathBuf {
        self.root.join("scenes").join(hash)
    }

    /// Marks an entry as just used.
    pub(crate) fn touch(path: &Path) {
        let touched = fs::File::open(path).and_then(|file| file.set_modified(SystemTime::now()));
        if let Err(error) = touched {
            tracing::debug!(%error, path = %path.display(), "cannot update the time of its last use");
        }
    }

    /// Removes the least recently used entries until the cache fits its size, except the scene `but` and the files
    /// `in_use`. Scenes are links and take no room, so a scene is removed before its files.
    pub(crate) fn trim(&self, but: &Path, in_use: &[PathBuf]) {
        let mut entries = self.entries("files").unwrap_or_default();
        entries.extend(self.entries("chunks").unwrap_or_default());
        entries.retain(|entry| !in_use.contains(&entry.path));
        entries.sort_by_key(|entry| entry.used);
        let used: u64 = in_use.iter().filter_map(|path| Some(fs::metadata(path).ok()?.len())).sum();
        let mut bytes = used + entries.iter().map(|entry| entry.bytes).sum::<u64>();
        if bytes <= self.bytes_max {
            return;
        }
        // Space is only freed when no scene links to the file any more.
        for scene in self.entries("scenes").unwrap_or_default() {
            if scene.path != but {
                remove(&scene.path);
            }
        }
        for entry in entries {
            if bytes <= self.bytes_max {
                return;
            }
            remove(&entry.path);
            bytes -= entry.bytes;
        }
    }

    fn entries(&self, folder: &str) -> io::Result<Vec<CachedItem>> {
        let mut entries = Vec::new();
        for entry in fs::read_dir(self.root.join(folder))? {
            let entry = entry?;
            let metadata = entry.metadata()?;
            let used = metadata.modified().unwrap_or(SystemTime::UNIX_EPOCH);
            entries.push(CachedItem { path: entry.path(), used, bytes: metadata.len() });
        }
        Ok(entries)
    }
}

fn remove(path: &Path) {
    let removed = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
    if let Err(error) = removed {
        tracing::warn!(%error, path = %path.display(), "cannot shrink the cache");
    }
}

/// Writes a file atomically: completely or not at all.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let write_error = |source| Error::write(path.to_owned(), source);
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(write_error)?;
    let part = path.with_extension(format!("part-{}", std::process::id()));
    fs::write(&part, bytes).and_then(|()| fs::rename(&part, path)).map_err(write_error)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn what_was_used_longest_ago_goes_first_and_what_is_in_use_stays() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path().to_owned(), 250);
        let file = |hash: &str, age: u64| {
            let path = cache.file(hash);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, [0; 100]).unwrap();
            let at = SystemTime::now() - Duration::from_secs(age);
            fs::File::open(&path).unwrap().set_modified(at).unwrap();
            path
        };
        let (oldest, old, young) = (file("a", 300), file("b", 200), file("c", 100));
        let (scene, other) = (cache.scene("s"), cache.scene("t"));
        fs::create_dir_all(&scene).unwrap();
        fs::create_dir_all(&other).unwrap();
        cache.trim(&scene, std::slice::from_ref(&oldest));
        assert!(oldest.exists() && !old.exists() && young.exists() && scene.exists() && !other.exists());
        Cache::touch(&oldest);
        file("d", 50);
        cache.trim(&scene, &[]);
        assert!(oldest.exists() && !young.exists());
        cache.trim(&scene, &[]);
        assert!(oldest.exists() && cache.file("d").exists(), "there is room for them");
    }
}
