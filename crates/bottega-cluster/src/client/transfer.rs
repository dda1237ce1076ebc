//! Sending the files of a scene to a farm: skips what the farm has, checks for space, reports progress, and withdraws the
//! files if no job is submitted.

use std::{
    sync::{PoisonError, atomic::Ordering},
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::BlobError;
use bottega_farm::StopSwitch;

use bottega::{Event, session::Reporter};

use crate::{
    error::Error,
    files::{
        chunks::ChunkStore,
        pieces::{Pieces, SentCount},
    },
    job::board::JobBoard,
    server::{
        patience::{meanwhile, patiently},
        room::{MAKE_ROOM, bytes_said},
        upkeep::Announcement,
    },
};

/// Interval between announcements that a scene is being sent.
const ANNOUNCE_EVERY: Duration = Duration::from_secs(1);
/// Time after which progress is reported.
const REPORT_AFTER: Duration = Duration::from_secs(2);
/// Space needed in addition to a scene: for the first rows of its job, and (a divisor of its size) for the overhead of chunks.
const ROOM_BESIDE: u64 = 512 << 10;
const ROOM_SHARE: u64 = 64;
/// The most attempts to send chunks again that were deleted meanwhile.
const ROUNDS_MAX: u32 = 3;

/// The chunks just sent. They are withdrawn when this is dropped without [`Self::keep`].
#[must_use]
pub(crate) struct SentPieces<'a> {
    board: &'a JobBoard,
    me: &'a str,
    counted: SentCount,
    is_kept: bool,
}

impl SentPieces<'_> {
    /// Keeps the chunks: their job is submitted.
    pub(crate) fn keep(mut self) {
        self.is_kept = true;
    }
}

impl Drop for SentPieces<'_> {
    fn drop(&mut self) {
        self.board.stop_announcing(self.me);
        let names = std::mem::take(&mut *self.counted.names.lock().unwrap_or_else(PoisonError::into_inner));
        if !self.is_kept && !names.is_empty() {
            self.board.forget_pieces(self.me, |name| names.iter().any(|known| known == name));
        }
    }
}

/// Sends the chunks that the farm lacks.
///
/// - `me`: the name of this process.
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
        // Determine the missing chunks
        let missing = pieces.missing(store)?;
        if missing.is_empty() {
            return Ok(sent);
        }
        let before = sent.counted.bytes.load(Ordering::Relaxed);
        let bytes: u64 = before + missing.iter().map(|(_, piece)| piece.bytes as u64).sum::<u64>();
        // Check for space
        see_to_room(pieces, board, me, bytes - before)?;
        let tell = || {
            let done = sent.counted.bytes.load(Ordering::Relaxed);
            board.announce(me, &Announcement { bytes, sent: done });
            if begun.elapsed() > REPORT_AFTER {
                let seconds = begun.elapsed().as_secs_f64();
                let left = seconds * (bytes as f64 / done.max(1) as f64 - 1.0);
                let seconds_left = Some(left).filter(|_| done > 0);
                reporter.tell(Event::Sending { bytes_sent: done, bytes, seconds, seconds_left });
            }
        };
        // Send the chunks
        let keep = |name: &str, piece: &[u8]| {
            patiently(
                stop,
                |line| reporter.say(line),
                || {
                    if stop.is_requested() {
                        return Err(Error::failed("stopped while sending the scene", "ask again"));
                    }
                    store.put(name, piece).map_err(|error| put_failed(error, board, bytes))
                },
            )
        };
        meanwhile(ANNOUNCE_EVERY, tell, || Pieces::put(&missing, &keep, &sent.counted))?;
    }
    Ok(sent)
}

/// Returns the error for a chunk that was not stored. A full server is not worth waiting for here.
fn put_failed(error: BlobError, board: &JobBoard, bytes: u64) -> Error {
    if error.is_full { no_room(board, bytes) } else { Error::Blob(error) }
}

/// Refuses a scene for which there is no space, before sending it.
fn see_to_room(pieces: &Pieces, board: &JobBoard, me: &str, bytes: u64) -> Result<(), Error> {
    let needed = bytes + bytes / ROOM_SHARE + ROOM_BESIDE;
    // If the free space is unknown, try.
    let has_room = || board.room().is_none_or(|room| room.free() >= needed);
    if has_room() {
        return Ok(());
    }
    board.make_room(me, |name| pieces.includes(name));
    if has_room() { Ok(()) } else { Err(no_room(board, bytes)) }
}

fn no_room(board: &JobBoard, bytes: u64) -> Error {
    let kept = board.room().map_or_else(String::new, |room| {
        format!("; it stores {} of at most {}", bytes_said(room.used), bytes_said(room.limit))
    });
    Error::failed(
        format!("the farm's server has no room for the scene: {} to send{kept}", bytes_said(bytes)),
        MAKE_ROOM,
    )
}
