//! Sending the files of a scene to a farm: what is there already is left out, room is seen to, progress is told; and what was sent is
//! taken back when no job comes of it.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{Read, Seek, SeekFrom},
    path::{Path, PathBuf},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::BlobError;
use bottega_farm::StopSwitch;
use serde::{Deserialize, Serialize};

use crate::{
    chunks::{CHUNK_BYTES, ChunkStore, Contents, PREFIX, blob_name, hash_of, several},
    job_board::JobBoard,
    patience::{meanwhile, patiently},
    room::{MAKE_ROOM, bytes_said},
};
use bottega::{Event, session::Reporter};

use crate::error::Error;

/// How often others are told that a scene is being sent.
const ANNOUNCE_EVERY: Duration = Duration::from_secs(1);
/// What does not take so long is not told.
const TOLD_AFTER: Duration = Duration::from_secs(2);
/// Beside a scene there must be room for the first rows of its job; and pieces take a little more than they hold.
const ROOM_BESIDE: u64 = 512 << 10;
const ROOM_SHARE: u64 = 64;
/// How often pieces are sent again that somebody let go meanwhile.
const ROUNDS_MAX: u32 = 3;

/// A part of a file.
#[derive(Debug)]
struct Piece {
    path: PathBuf,
    at: u64,
    bytes: usize,
}

impl Piece {
    /// What is in it, if the file is as it was.
    fn read(&self, hash: &str) -> Result<Vec<u8>, Error> {
        let mut bytes = vec![0; self.bytes];
        let read = File::open(&self.path)
            .and_then(|mut file| file.seek(SeekFrom::Start(self.at)).map(|_| file))
            .and_then(|mut file| file.read_exact(&mut bytes));
        read.map_err(|source| Error::read(self.path.clone(), source))?;
        if hash_of(&bytes) != hash {
            let problem = format!("`{}` was changed while it was sent", self.path.display());
            return Err(Error::failed(problem, "ask again when nobody writes to it"));
        }
        Ok(bytes)
    }
}

/// Files that are to be sent, as pieces by what is in them.
#[derive(Debug, Default)]
pub(crate) struct Transfer {
    pieces: BTreeMap<String, Piece>,
}

impl Transfer {
    /// Notes the pieces of a file.
    pub(crate) fn add(&mut self, path: &Path) -> Result<Contents, Error> {
        let wrong = |source| Error::read(path.to_owned(), source);
        let mut file = File::open(path).map_err(wrong)?;
        let (mut hasher, mut chunks, mut at) = (blake3::Hasher::new(), Vec::new(), 0);
        loop {
            let mut bytes = Vec::new();
            Read::by_ref(&mut file).take(CHUNK_BYTES as u64).read_to_end(&mut bytes).map_err(wrong)?;
            if bytes.is_empty() {
                return Ok(Contents::new(hasher.finalize().to_hex().to_string(), chunks));
            }
            hasher.update(&bytes);
            let hash = hash_of(&bytes);
            self.pieces.insert(hash.clone(), Piece { path: path.to_owned(), at, bytes: bytes.len() });
            chunks.push(hash);
            at += bytes.len() as u64;
        }
    }

    /// Whether a piece of this name in a store is one of them.
    fn includes(&self, name: &str) -> bool {
        name.strip_prefix(PREFIX).is_some_and(|hash| self.pieces.contains_key(hash))
    }

    /// The pieces that a store lacks.
    fn missing(&self, store: &dyn ChunkStore) -> Result<Vec<(&str, &Piece)>, Error> {
        let all: Vec<(&str, &Piece)> = self.pieces.iter().map(|(hash, piece)| (&**hash, piece)).collect();
        let lacking = Mutex::new(Vec::new());
        several(all.len(), &|i| {
            if !store.has(&blob_name(all[i].0)).map_err(Error::Blob)? {
                lacking.lock().unwrap_or_else(PoisonError::into_inner).push(all[i]);
            }
            Ok(())
        })?;
        let mut lacking = lacking.into_inner().unwrap_or_else(PoisonError::into_inner);
        // In the order of the files: the disk reads them once.
        lacking.sort_by_key(|&(_, piece)| (&piece.path, piece.at));
        Ok(lacking)
    }

    /// Puts all that a store lacks into it.
    #[cfg(test)]
    pub(crate) fn send_to(&self, store: &dyn ChunkStore) -> Result<(), Error> {
        let keep = |name: &str, bytes: &[u8]| store.put(name, bytes).map_err(Error::Blob);
        Self::put(&self.missing(store)?, &keep, &Counted::default())
    }

    /// Puts pieces into a store. Their names are noted in `sent` as they are there.
    ///
    /// - `keep`: puts one.
    fn put(pieces: &[(&str, &Piece)], keep: Keep<'_>, sent: &Counted) -> Result<(), Error> {
        several(pieces.len(), &|i| {
            let (hash, piece) = pieces[i];
            let name = blob_name(hash);
            keep(&name, &piece.read(hash)?)?;
            sent.note(name, piece.bytes);
            Ok(())
        })
    }
}

/// Puts a piece into a store.
type Keep<'a> = &'a (dyn Fn(&str, &[u8]) -> Result<(), Error> + Sync);

/// What has been sent so far.
#[derive(Debug, Default)]
struct Counted {
    names: Mutex<Vec<String>>,
    bytes: AtomicU64,
}

impl Counted {
    fn note(&self, name: String, bytes: usize) {
        self.names.lock().unwrap_or_else(PoisonError::into_inner).push(name);
        self.bytes.fetch_add(bytes as u64, Ordering::Relaxed);
    }
}

/// That somebody sends a scene, as others are told.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Announcement {
    /// What is to be sent in all.
    pub bytes: u64,
    /// What is there.
    pub sent: u64,
}

/// Pieces that were sent. They are taken back unless a job came of them.
#[must_use]
pub(crate) struct Sent<'a> {
    board: &'a JobBoard,
    me: &'a str,
    counted: Counted,
    is_kept: bool,
}

impl Sent<'_> {
    /// The job is known.
    pub(crate) fn keep(mut self) {
        self.is_kept = true;
    }
}

impl Drop for Sent<'_> {
    fn drop(&mut self) {
        self.board.stop_announcing(self.me);
        let names = std::mem::take(&mut *self.counted.names.lock().unwrap_or_else(PoisonError::into_inner));
        if !self.is_kept && !names.is_empty() {
            self.board.forget_pieces(self.me, |name| names.iter().any(|it| it == name));
        }
    }
}

/// Sends what a farm lacks of the files.
///
/// - `me`: the process that sends.
pub(crate) fn send<'a>(
    transfer: &Transfer,
    board: &'a JobBoard,
    me: &'a str,
    stop: &StopSwitch,
    reporter: &Reporter,
) -> Result<Sent<'a>, Error> {
    let sent = Sent { board, me, counted: Counted::default(), is_kept: false };
    let (begun, store): (_, &dyn ChunkStore) = (Instant::now(), board.uplink.blobs());
    board.announce(me, &Announcement { bytes: 0, sent: 0 });
    for _ in 0..ROUNDS_MAX {
        let missing = transfer.missing(store)?;
        if missing.is_empty() {
            return Ok(sent);
        }
        let before = sent.counted.bytes.load(Ordering::Relaxed);
        let bytes: u64 = before + missing.iter().map(|(_, piece)| piece.bytes as u64).sum::<u64>();
        see_to_room(transfer, board, me, bytes - before)?;
        let tell = || {
            let done = sent.counted.bytes.load(Ordering::Relaxed);
            board.announce(me, &Announcement { bytes, sent: done });
            if begun.elapsed() > TOLD_AFTER {
                let seconds = begun.elapsed().as_secs_f64();
                let left = seconds * (bytes as f64 / done.max(1) as f64 - 1.0);
                let seconds_left = Some(left).filter(|_| done > 0);
                reporter.tell(Event::Sending { bytes_sent: done, bytes, seconds, seconds_left });
            }
        };
        let keep = |name: &str, piece: &[u8]| {
            patiently(
                stop,
                |line| reporter.say(line),
                || {
                    if stop.is_requested() {
                        return Err(Error::failed("stopped while the scene was sent", "ask again"));
                    }
                    store.put(name, piece).map_err(|error| put_failed(error, board, bytes))
                },
            )
        };
        meanwhile(ANNOUNCE_EVERY, tell, || Transfer::put(&missing, &keep, &sent.counted))?;
    }
    Ok(sent)
}

/// Why a piece was not taken: that there is no room does not pass while this process waits.
fn put_failed(error: BlobError, board: &JobBoard, bytes: u64) -> Error {
    if error.is_full { no_room(board, bytes) } else { Error::Blob(error) }
}

/// Refuses a scene for which there is no room, before any of it is sent.
fn see_to_room(transfer: &Transfer, board: &JobBoard, me: &str, bytes: u64) -> Result<(), Error> {
    let needed = bytes + bytes / ROOM_SHARE + ROOM_BESIDE;
    // What is not known is found out.
    let has_room = || board.room().is_none_or(|room| room.free() >= needed);
    if has_room() {
        return Ok(());
    }
    board.make_room(me, |name| transfer.includes(name));
    if has_room() { Ok(()) } else { Err(no_room(board, bytes)) }
}

fn no_room(board: &JobBoard, bytes: u64) -> Error {
    let kept = board.room().map_or_else(String::new, |room| {
        format!(", and it keeps {} of at most {}", bytes_said(room.used), bytes_said(room.limit))
    });
    Error::failed(
        format!("the farm's server has no room for the scene: {} are to be sent{kept}", bytes_said(bytes)),
        MAKE_ROOM,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chunks::tests::Shelf;

    fn keep_in(shelf: &Shelf) -> impl Fn(&str, &[u8]) -> Result<(), Error> + Sync + '_ {
        |name, bytes| shelf.put(name, bytes).map_err(Error::Blob)
    }

    #[test]
    fn pieces_are_sent_once_and_counted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f");
        let content: Vec<u8> = (0..2 * CHUNK_BYTES + 17).map(|i| (i / 1000 * 7 + i % 251) as u8).collect();
        std::fs::write(&path, &content).unwrap();
        let (mut transfer, shelf, counted) = (Transfer::default(), Shelf::default(), Counted::default());
        let contents = transfer.add(&path).unwrap();
        assert_eq!(transfer.add(&path).unwrap(), contents, "the same file twice is one");
        assert_eq!(contents.hash, hash_of(&content));
        let missing = transfer.missing(&shelf).unwrap();
        assert_eq!(
            missing.iter().map(|(_, piece)| piece.at).collect::<Vec<_>>(),
            [0, 1, 2].map(|i| i * CHUNK_BYTES as u64)
        );
        Transfer::put(&missing, &keep_in(&shelf), &counted).unwrap();
        assert_eq!(counted.bytes.into_inner(), content.len() as u64);
        assert!(transfer.missing(&shelf).unwrap().is_empty());
    }

    #[test]
    fn a_file_that_changes_meanwhile_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f");
        std::fs::write(&path, [1; 100]).unwrap();
        let (mut transfer, shelf) = (Transfer::default(), Shelf::default());
        transfer.add(&path).unwrap();
        std::fs::write(&path, [2; 100]).unwrap();
        let missing = transfer.missing(&shelf).unwrap();
        let error = Transfer::put(&missing, &keep_in(&shelf), &Counted::default()).unwrap_err();
        assert!(error.to_string().contains("was changed"), "{error}");
    }
}
