//! Files as chunks named by content hash, and the chunks that a store lacks.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{Read, Seek, SeekFrom},
    path::{Path, PathBuf},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};

use fastcdc::v2020::{ChunkData, StreamCDC};

use crate::{
    error::Error,
    files::chunks::{CHUNK_BYTES, ChunkStore, Contents, PREFIX, blob_name, hash_of, several},
};

/// The smallest size of the chunks of a file, in bytes.
const CUT_MIN: usize = 256 << 10;
/// The mean size of the chunks of a file, in bytes. Smaller chunks find more that is unchanged, but each costs a request.
const CUT_MEAN: usize = 1 << 20;

/// A chunk of a file on disk.
#[derive(Debug)]
pub(crate) struct Piece {
    path: PathBuf,
    at: u64,
    pub(crate) bytes: usize,
}

impl Piece {
    /// Reads the chunk, and checks that the file has not changed.
    fn read(&self, hash: &str) -> Result<Vec<u8>, Error> {
        let mut bytes = vec![0; self.bytes];
        let read = File::open(&self.path)
            .and_then(|mut file| file.seek(SeekFrom::Start(self.at)).map(|_| file))
            .and_then(|mut file| file.read_exact(&mut bytes));
        read.map_err(|source| Error::read(self.path.clone(), source))?;
        if hash_of(&bytes) != hash {
            let problem = format!("`{}` was changed while it was sent", self.path.display());
            return Err(Error::failed(problem, "try again when no program writes to it"));
        }
        Ok(bytes)
    }
}

/// The chunks of the files to send, by content hash.
#[derive(Debug, Default)]
pub(crate) struct Pieces {
    pieces: BTreeMap<String, Piece>,
}

impl Pieces {
    /// Adds the chunks of a file. It is cut where its contents say so (FastCDC, Xia et al. 2016), so a file that differs in a few
    /// places has most chunks of the old one, also after an insertion.
    pub(crate) fn add(&mut self, path: &Path) -> Result<Contents, Error> {
        let read_error = |source| Error::read(path.to_owned(), source);
        let file = File::open(path).map_err(read_error)?;
        let (mut hasher, mut chunks) = (blake3::Hasher::new(), Vec::new());
        for cut in StreamCDC::new(file, CUT_MIN, CUT_MEAN, CHUNK_BYTES) {
            let ChunkData { offset: at, data, .. } = cut.map_err(|error| read_error(error.into()))?;
            hasher.update(&data);
            let hash = hash_of(&data);
            self.pieces.insert(hash.clone(), Piece { path: path.to_owned(), at, bytes: data.len() });
            chunks.push(hash);
        }
        Ok(Contents::new(hasher.finalize().to_hex().to_string(), chunks))
    }

    /// Returns true if a blob name in a store is one of these chunks.
    pub(crate) fn includes(&self, name: &str) -> bool {
        name.strip_prefix(PREFIX).is_some_and(|hash| self.pieces.contains_key(hash))
    }

    /// Returns the chunks that a store lacks.
    pub(crate) fn missing(&self, store: &dyn ChunkStore) -> Result<Vec<(&str, &Piece)>, Error> {
        let all: Vec<(&str, &Piece)> = self.pieces.iter().map(|(hash, piece)| (&**hash, piece)).collect();
        let lacking = Mutex::new(Vec::new());
        several(all.len(), &|i| {
            if !store.has(&blob_name(all[i].0)).map_err(Error::Blob)? {
                lacking.lock().unwrap_or_else(PoisonError::into_inner).push(all[i]);
            }
            Ok(())
        })?;
        let mut lacking = lacking.into_inner().unwrap_or_else(PoisonError::into_inner);
        // In the order of the files, so that the disk reads them once.
        lacking.sort_by_key(|&(_, piece)| (&piece.path, piece.at));
        Ok(lacking)
    }

    /// Sends the chunks that a store lacks.
    #[cfg(test)]
    pub(crate) fn send_to(&self, store: &dyn ChunkStore) -> Result<(), Error> {
        let keep = |name: &str, bytes: &[u8]| store.put(name, bytes).map_err(Error::Blob);
        Self::put(&self.missing(store)?, &keep, &SentCount::default())
    }

    /// Sends chunks to a store, and records their names in `sent`.
    ///
    /// - `keep`: stores a chunk.
    pub(crate) fn put(pieces: &[(&str, &Piece)], keep: Keep<'_>, sent: &SentCount) -> Result<(), Error> {
        several(pieces.len(), &|i| {
            let (hash, piece) = pieces[i];
            let name = blob_name(hash);
            keep(&name, &piece.read(hash)?)?;
            sent.note(name, piece.bytes);
            Ok(())
        })
    }
}

/// A function that stores a chunk.
pub(crate) type Keep<'a> = &'a (dyn Fn(&str, &[u8]) -> Result<(), Error> + Sync);

/// The chunks sent so far.
#[derive(Debug, Default)]
pub(crate) struct SentCount {
    pub(crate) names: Mutex<Vec<String>>,
    pub(crate) bytes: AtomicU64,
}

impl SentCount {
    fn note(&self, name: String, bytes: usize) {
        self.names.lock().unwrap_or_else(PoisonError::into_inner).push(name);
        self.bytes.fetch_add(bytes as u64, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::chunks::tests::{Shelf, bytes};

    fn keep_in(shelf: &Shelf) -> impl Fn(&str, &[u8]) -> Result<(), Error> + Sync + '_ {
        |name, bytes| shelf.put(name, bytes).map_err(Error::Blob)
    }

    #[test]
    fn pieces_are_sent_once_and_counted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f");
        let content = bytes(2 * CHUNK_BYTES + 17);
        std::fs::write(&path, &content).unwrap();
        let (mut pieces, shelf, counted) = (Pieces::default(), Shelf::default(), SentCount::default());
        let contents = pieces.add(&path).unwrap();
        assert_eq!(pieces.add(&path).unwrap(), contents, "the same file twice is one");
        assert_eq!(contents.hash, hash_of(&content));
        let missing = pieces.missing(&shelf).unwrap();
        let ends = missing.iter().map(|(_, piece)| piece.at + piece.bytes as u64);
        let starts = missing.iter().skip(1).map(|(_, piece)| piece.at).chain([content.len() as u64]);
        assert!(missing.len() > 2 && ends.eq(starts), "the chunks follow each other");
        Pieces::put(&missing, &keep_in(&shelf), &counted).unwrap();
        assert_eq!(counted.bytes.into_inner(), content.len() as u64);
        assert!(pieces.missing(&shelf).unwrap().is_empty());
    }

    #[test]
    fn what_an_insertion_leaves_unchanged_is_not_sent_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f");
        let mut content = bytes(8 * CHUNK_BYTES);
        std::fs::write(&path, &content).unwrap();
        let (mut before, shelf) = (Pieces::default(), Shelf::default());
        before.add(&path).unwrap();
        before.send_to(&shelf).unwrap();
        content.splice(9_000_000..9_000_010, *b"another length");
        std::fs::write(&path, &content).unwrap();
        let mut after = Pieces::default();
        after.add(&path).unwrap();
        let missing: usize = after.missing(&shelf).unwrap().iter().map(|(_, piece)| piece.bytes).sum();
        assert!((1..=2 * CHUNK_BYTES).contains(&missing), "{missing} bytes of {}", content.len());
    }

    #[test]
    fn a_file_that_changes_meanwhile_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f");
        std::fs::write(&path, [1; 100]).unwrap();
        let (mut pieces, shelf) = (Pieces::default(), Shelf::default());
        pieces.add(&path).unwrap();
        std::fs::write(&path, [2; 100]).unwrap();
        let missing = pieces.missing(&shelf).unwrap();
        let error = Pieces::put(&missing, &keep_in(&shelf), &SentCount::default()).unwrap_err();
        assert!(error.to_string().contains("was changed"), "{error}");
    }
}
