//! Files in chunks named by their content hash: fetched in parallel, each once, each verified. Chunks that have arrived
//! stay when the rest fails.

use std::{
    collections::BTreeSet,
    fs,
    path::Path,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
    time::Duration,
};

use bottega_agents::driver::nats::{BlobError, NatsBlobs};
use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    files::cache::{Cache, write_whole},
};

/// The greatest size of a chunk in bytes; that of all chunks but the last in uploads.
pub(crate) const CHUNK_BYTES: usize = 4 << 20;
/// The most chunks of a file: 4 TiB in all.
const CHUNKS_MAX: usize = 1 << 20;
/// Prefix of chunk names in the store.
pub(crate) const PREFIX: &str = "chunk/";
/// Chunks transferred in parallel.
const AT_ONCE: usize = 8;

/// Age from which chunks without a job are deleted. A sender sends chunks older than half of it again, so that none is
/// deleted before its job is submitted.
const UNUSED_KEPT: Duration = Duration::from_secs(24 * 3600);

/// A store of chunks by name.
pub(crate) trait ChunkStore: Sync {
    /// Returns true if a chunk is stored, and is young enough to stay until its job is submitted.
    fn has(&self, name: &str) -> Result<bool, BlobError>;
    fn put(&self, name: &str, bytes: &[u8]) -> Result<(), BlobError>;
    fn get(&self, name: &str, bytes_max: usize) -> Result<Option<Vec<u8>>, BlobError>;
}

impl ChunkStore for NatsBlobs {
    fn has(&self, name: &str) -> Result<bool, BlobError> {
        Ok(self.age(name)?.is_some_and(|age| age < UNUSED_KEPT / 2))
    }

    fn put(&self, name: &str, bytes: &[u8]) -> Result<(), BlobError> {
        self.put(name, bytes)
    }

    fn get(&self, name: &str, bytes_max: usize) -> Result<Option<Vec<u8>>, BlobError> {
        self.get(name, bytes_max)
    }
}

/// The content hash of a file and of its chunks: BLAKE3, hexadecimal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Contents {
    pub(crate) hash: String,
    chunks: Vec<String>,
}

/// Returns true if a file exists with these contents. A file may be truncated after a power failure.
pub(crate) fn holds(path: &Path, contents: &Contents) -> bool {
    let mut hasher = blake3::Hasher::new();
    let read = fs::File::open(path).and_then(|file| hasher.update_reader(file).map(drop));
    read.is_ok() && hasher.finalize().to_hex().as_str() == contents.hash
}

/// Fetches a file into the cache, unless it is there.
///
/// - `name`: the name of the file for error messages.
///
/// # Errors
/// The store does not answer, a chunk is missing or has another digest, or the cache cannot be read or written.
pub(crate) fn fetch(name: &str, contents: &Contents, cache: &Cache, store: &dyn ChunkStore) -> Result<(), Error> {
    let other = || {
        Error::failed(
            format!("the received data of `{name}` differs from what was sent"),
            "try again; if it fails again, the store of the NATS server is damaged",
        )
    };
    // Validate the hashes
    let all = || std::iter::once(&contents.hash).chain(&contents.chunks);
    if contents.chunks.len() > CHUNKS_MAX || !all().all(|hash| is_hash(hash)) {
        return Err(other());
    }
    // Use the cached file if it is intact
    let file = cache.file(&contents.hash);
    if holds(&file, contents) {
        return Ok(());
    }
    // Fetch and verify the missing chunks
    several(contents.chunks.len(), &|i| {
        let hash = &contents.chunks[i];
        let path = cache.chunk(hash);
        if path.exists() {
            return Ok(());
        }
        let bytes = store.get(&blob_name(hash), CHUNK_BYTES).map_err(Error::Blob)?.ok_or_else(other)?;
        if hash_of(&bytes) == *hash { write_whole(&path, &bytes) } else { Err(other()) }
    })?;
    // Join the chunks, and verify the whole file
    let mut bytes = Vec::new();
    for hash in &contents.chunks {
        let path = cache.chunk(hash);
        bytes.extend(fs::read(&path).map_err(|source| Error::read(path, source))?);
    }
    let is_whole = hash_of(&bytes) == contents.hash;
    if is_whole {
        write_whole(&file, &bytes)?;
    }
    for hash in &contents.chunks {
        // Another thread may have removed a shared chunk.
        _ = fs::remove_file(cache.chunk(hash));
    }
    if is_whole { Ok(()) } else { Err(other()) }
}

/// Calls `work` for each number below `count`, several in parallel, until one fails. Returns the first failure.
pub(crate) fn several(count: usize, work: &(dyn Fn(usize) -> Result<(), Error> + Sync)) -> Result<(), Error> {
    let (next, failure) = (AtomicUsize::new(0), Mutex::new(None));
    thread::scope(|scope| {
        for _ in 0..AT_ONCE.min(count) {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i >= count {
                        return;
                    }
                    if let Err(error) = work(i) {
                        next.store(count, Ordering::Relaxed);
                        failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
                        return;
                    }
                }
            });
        }
    });
    failure.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
}

/// Returns the hash of bytes, in hexadecimal.
pub(crate) fn hash_of(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// Returns true if a text is a hash in lower-case hexadecimal.
pub(crate) fn is_hash(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte))
}

/// Returns the name of a chunk in the store.
pub(crate) fn blob_name(hash: &str) -> String {
    format!("{PREFIX}{hash}")
}

impl Contents {
    /// Returns the contents of a file.
    ///
    /// - `hash`: the hash of the file.
    /// - `chunks`: the hashes of its chunks, in order.
    pub(crate) fn new(hash: String, chunks: Vec<String>) -> Self {
        Self { hash, chunks }
    }

    /// Returns the names of its chunks in the store.
    pub(crate) fn blobs(&self) -> impl Iterator<Item = String> {
        self.chunks.iter().map(|hash| blob_name(hash))
    }
}

/// Returns true if a blob is a chunk that no job needs any more.
///
/// - `age`: the time since it was stored.
/// - `needed`: the chunks of all jobs that are not over.
pub(crate) fn is_unused(name: &str, age: Duration, needed: &BTreeSet<String>) -> bool {
    name.starts_with(PREFIX) && age > UNUSED_KEPT && !needed.contains(name)
}

#[cfg(test)]
pub(crate) mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::files::pieces::Pieces;

    /// An in-memory store that can be made to fail.
    #[derive(Default)]
    pub(crate) struct Shelf {
        chunks: Mutex<BTreeMap<String, Vec<u8>>>,
        gets: AtomicUsize,
        gets_max: Option<usize>,
    }

    impl ChunkStore for Shelf {
        fn has(&self, name: &str) -> Result<bool, BlobError> {
            Ok(self.chunks.lock().unwrap().contains_key(name))
        }

        fn put(&self, name: &str, bytes: &[u8]) -> Result<(), BlobError> {
            let before = self.chunks.lock().unwrap().insert(name.to_owned(), bytes.to_owned());
            assert!(before.is_none(), "what is there is not sent again");
            Ok(())
        }

        fn get(&self, name: &str, _: usize) -> Result<Option<Vec<u8>>, BlobError> {
            let gets = self.gets.fetch_add(1, Ordering::Relaxed);
            if self.gets_max.is_some_and(|max| gets >= max) {
                return Err(BlobError {
                    name: name.to_owned(),
                    reason: "it is away".to_owned(),
                    is_lasting: false,
                    is_full: false,
                });
            }
            Ok(self.chunks.lock().unwrap().get(name).cloned())
        }
    }

    /// Sends a file to a store.
    fn send(path: &Path, shelf: &Shelf) -> Result<Contents, Error> {
        let mut pieces = Pieces::default();
        let contents = pieces.add(path)?;
        pieces.send_to(shelf)?;
        Ok(contents)
    }

    /// Returns bytes without a pattern.
    pub(crate) fn bytes(count: usize) -> Vec<u8> {
        let mut bytes = vec![0; count];
        blake3::Hasher::new().finalize_xof().fill(&mut bytes);
        bytes
    }

    #[test]
    fn a_file_comes_as_it_was_and_goes_on_where_it_was_interrupted() {
        let folder = tempfile::tempdir().unwrap();
        let (path, cache) = (folder.path().join("f"), Cache::new(folder.path().join("cache"), u64::MAX));
        let content = bytes(5 * CHUNK_BYTES + 17);
        fs::write(&path, &content).unwrap();
        let mut shelf = Shelf { gets_max: Some(3), ..Shelf::default() };
        let contents = send(&path, &shelf).unwrap();
        assert_eq!(send(&path, &shelf).unwrap(), contents);
        let count = contents.chunks.len();
        assert!(count > 5, "{count} chunks");
        assert!(fetch("f", &contents, &cache, &shelf).is_err());
        shelf.gets_max = None;
        *shelf.gets.get_mut() = 0;
        fetch("f", &contents, &cache, &shelf).unwrap();
        assert_eq!(shelf.gets.load(Ordering::Relaxed), count - 3, "what had come is not fetched again");
        assert_eq!(fs::read(cache.file(&contents.hash)).unwrap(), content);
        fetch("f", &contents, &cache, &shelf).unwrap();
        assert_eq!(shelf.gets.load(Ordering::Relaxed), count - 3);
    }

    #[test]
    fn what_was_damaged_in_the_cache_comes_again() {
        let folder = tempfile::tempdir().unwrap();
        let (path, cache) = (folder.path().join("f"), Cache::new(folder.path().join("cache"), u64::MAX));
        fs::write(&path, bytes(100)).unwrap();
        let shelf = Shelf::default();
        let contents = send(&path, &shelf).unwrap();
        fetch("f", &contents, &cache, &shelf).unwrap();
        fs::write(cache.file(&contents.hash), b"half").unwrap();
        assert!(!holds(&cache.file(&contents.hash), &contents));
        fetch("f", &contents, &cache, &shelf).unwrap();
        assert!(holds(&cache.file(&contents.hash), &contents));
    }

    #[test]
    fn what_is_not_what_was_sent_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let (path, cache) = (folder.path().join("f"), Cache::new(folder.path().join("cache"), u64::MAX));
        fs::write(&path, bytes(CHUNK_BYTES + 1)).unwrap();
        let shelf = Shelf::default();
        let contents = send(&path, &shelf).unwrap();
        let wrong = |contents: &Contents| {
            let error = fetch("f", contents, &cache, &shelf).unwrap_err().to_string();
            assert!(error.contains("differs from what was sent"), "{error}");
            assert!(!cache.file(&contents.hash).exists());
        };
        let mut swapped = contents.clone();
        swapped.chunks.swap(0, 1);
        wrong(&swapped);
        wrong(&Contents { hash: "../../x".to_owned(), ..contents.clone() });
        wrong(&Contents { chunks: vec!["0".repeat(64)], ..contents.clone() });
        shelf.chunks.lock().unwrap().values_mut().for_each(|bytes| bytes[0] ^= 1);
        wrong(&contents);
    }

    #[test]
    fn only_old_pieces_that_no_job_needs_are_let_go() {
        let contents: Contents = serde_json::from_str(r#"{"hash":"","chunks":["aa"]}"#).unwrap();
        let needed: BTreeSet<String> = contents.blobs().collect();
        let day = Duration::from_secs(24 * 3600);
        assert!(is_unused("chunk/bb", 2 * day, &needed));
        assert!(!is_unused("chunk/bb", day / 2, &needed), "its job may be on the way");
        assert!(!is_unused("chunk/aa", 99 * day, &needed), "a job needs it");
        assert!(!is_unused("job-7/order", 99 * day, &needed), "it is not a piece");
    }

    #[test]
    fn an_empty_file_is_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let (path, cache) = (folder.path().join("f"), Cache::new(folder.path().join("cache"), u64::MAX));
        fs::write(&path, b"").unwrap();
        let shelf = Shelf::default();
        let contents = send(&path, &shelf).unwrap();
        fetch("f", &contents, &cache, &shelf).unwrap();
        assert_eq!(fs::read(cache.file(&contents.hash)).unwrap(), b"");
    }
}
