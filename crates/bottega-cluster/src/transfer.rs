//! Sending the files of a scene to a farm: what is there already is left out, room is seen to, progress is told; and what was sent is
//! taken back when no job comes of it.

use std::{
    sync::{PoisonError, atomic::Ordering},
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::BlobError;
use bottega_farm::StopSwitch;
use serde::{Deserialize, Serialize};

use bottega::{Event, session::Reporter};

use crate::{
    chunks::ChunkStore,
    error::Error,
    job_board::JobBoard,
    patience::{meanwhile, patiently},
    pieces::{Pieces, SentCount},
    room::{MAKE_ROOM, bytes_said},
};

/// How often others are told that a scene is being sent.
const ANNOUNCE_EVERY: Duration = Duration::from_secs(1);
/// What does not take so long is not told.
const TOLD_AFTER: Duration = Duration::from_secs(2);
/// Beside a scene there must be room for the first rows of its job; and pieces take a little more than they hold.
const ROOM_BESIDE: u64 = 512 << 10;
const ROOM_SHARE: u64 = 64;
/// How often pieces are sent again that somebody let go meanwhile.
const ROUNDS_MAX: u32 = 3;

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
pub(crate) struct SentPieces<'a> {
    board: &'a JobBoard,
    me: &'a str,
    counted: SentCount,
    is_kept: bool,
}

impl SentPieces<'_> {
    /// The job is known.
    pub(crate) fn keep(mut self) {
        self.is_kept = true;
    }
}

impl Drop for SentPieces<'_> {
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
    pieces: &Pieces,
    board: &'a JobBoard,
    me: &'a str,
    stop: &StopSwitch,
    reporter: &Reporter,
) -> Result<SentPieces<'a>, Error> {
    let sent = SentPieces { board, me, counted: SentCount::default(), is_kept: false };
    let (begun, store): (_, &dyn ChunkStore) = (Instant::now(), board.uplink.blobs());
    board.announce(me, &Announcement { bytes: 0, sent: 0 });
    for _ in 0..ROUNDS_MAX {
        let missing = pieces.missing(store)?;
        if missing.is_empty() {
            return Ok(sent);
        }
        let before = sent.counted.bytes.load(Ordering::Relaxed);
        let bytes: u64 = before + missing.iter().map(|(_, piece)| piece.bytes as u64).sum::<u64>();
        see_to_room(pieces, board, me, bytes - before)?;
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
        meanwhile(ANNOUNCE_EVERY, tell, || Pieces::put(&missing, &keep, &sent.counted))?;
    }
    Ok(sent)
}

/// Why a piece was not taken: that there is no room does not pass while this process waits.
fn put_failed(error: BlobError, board: &JobBoard, bytes: u64) -> Error {
    if error.is_full { no_room(board, bytes) } else { Error::Blob(error) }
}

/// Refuses a scene for which there is no room, before any of it is sent.
fn see_to_room(pieces: &Pieces, board: &JobBoard, me: &str, bytes: u64) -> Result<(), Error> {
    let needed = bytes + bytes / ROOM_SHARE + ROOM_BESIDE;
    // What is not known is found out.
    let has_room = || board.room().is_none_or(|room| room.free() >= needed);
    if has_room() {
        return Ok(());
    }
    board.make_room(me, |name| pieces.includes(name));
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
