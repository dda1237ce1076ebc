//! Storage of a farm's server: its limit, its use, and warnings when it runs out.

use std::{fs, path::Path};

use bottega_agents::driver::nats::ServerState;
use bottega_platform::disk::DiskSpace;
use serde::{Deserialize, Serialize};

use crate::{error::Error, job::board::JobBoard};

/// The notice in which `bottega up` publishes its server's limit.
const NOTICE: &str = "room";
/// The reserve that stays free is the disk's size divided by this, within these bounds: a server that fills its disk stops
/// storing.
const RESERVE_SHARE: u64 = 20;
const RESERVE_BYTES: (u64, u64) = (256 << 20, 10 << 30);
/// On a small disk, the reserve is at most the disk's size divided by this.
const RESERVE_SHARE_MAX: u64 = 4;
/// Free bytes (or, on a small disk, its size divided by this) below which a disk counts as full: the next write may fail.
const END_OF_DISK: u64 = 8 << 20;
const END_SHARE: u64 = 16;
/// The first NATS server version with correct storage accounting.
const COUNTS_RIGHTLY: (u64, u64) = (2, 10);
/// The limit divided by this must be miscounted before a restart.
const WRONG_SHARE: u64 = 4;
/// Used shares of the limit from which a store counts as full, and below which it has room again.
const FULL_FROM: f64 = 0.97;
const ROOM_FROM: f64 = 0.9;

/// The storage limit of a farm's server, readable by all members.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Limit {
    /// The limit in bytes.
    pub bytes: u64,
}

/// The storage of a server: its use and its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Bytes that are used.
    pub used: u64,
    /// Bytes that may be used.
    pub limit: u64,
}

impl Room {
    /// Returns the number of free bytes; 0 if more than the limit is used.
    pub fn free(&self) -> u64 {
        self.limit.saturating_sub(self.used)
    }

    /// Returns true if at least 90 % of the limit is used, so that data should be deleted.
    pub fn is_scarce(&self) -> bool {
        self.used as f64 >= ROOM_FROM * self.limit as f64
    }
}

impl JobBoard {
    /// Returns the bytes that the farm's server really stores, without rows and notices.
    fn kept_bytes(&self) -> u64 {
        let blobs: u64 = self.uplink.blobs().list().iter().map(|blob| blob.bytes).sum();
        blobs + self.uplink.payloads().bytes_by_folder().values().sum::<u64>()
    }

    /// Returns true if the server counts many deleted bytes as used: versions before 2.10 do until they are
    /// restarted.
    pub(crate) fn counts_wrongly(&self, counted: u64, limit: u64) -> bool {
        is_older(&self.uplink.server_version(), COUNTS_RIGHTLY) && miscounts(counted, self.kept_bytes(), limit)
    }

    /// Returns the storage of the farm's server. `None`: unknown, because another operator runs it, it does not answer or stores
    /// nothing, or this machine is a guest.
    pub fn room(&self) -> Option<Room> {
        let Limit { bytes: limit } = self.read_notice(NOTICE)?;
        if self.uplink.is_guest() {
            return None;
        }
        match self.uplink.server_state() {
            ServerState::Stores { bytes } => Some(Room { used: bytes, limit }),
            ServerState::Silent | ServerState::StoresNothing { .. } => None,
        }
    }

    /// Publishes the limit of the server, in bytes.
    pub(crate) fn tell_limit(&self, bytes: u64) -> Result<(), Error> {
        self.put_notice(NOTICE, &Limit { bytes })
    }
}

/// Returns true if a version is older than another; an unreadable version is not.
fn is_older(version: &str, than: (u64, u64)) -> bool {
    let mut numbers = version.split('.').map_while(|part| part.parse().ok());
    numbers.next().zip(numbers.next()).is_some_and(|version: (u64, u64)| version < than)
}

/// Returns true if so much is miscounted that a restart is worthwhile.
fn miscounts(counted: u64, kept: u64, limit: u64) -> bool {
    counted.saturating_sub(kept) > limit / WRONG_SHARE
}

/// Returns the total size of all files below a folder, in bytes.
pub(crate) fn bytes_below(folder: &Path) -> u64 {
    let Ok(entries) = fs::read_dir(folder) else { return 0 };
    let bytes_of = |entry: fs::DirEntry| match entry.metadata() {
        Ok(metadata) if metadata.is_dir() => bytes_below(&entry.path()),
        Ok(metadata) => metadata.len(),
        // The file was just deleted.
        Err(_) => 0,
    };
    entries.flatten().map(bytes_of).sum()
}

/// Returns how many bytes of a disk must stay free.
fn reserve(disk_bytes: u64) -> u64 {
    let (least, most) = RESERVE_BYTES;
    (disk_bytes / RESERVE_SHARE).clamp(least, most).min(disk_bytes / RESERVE_SHARE_MAX)
}

/// Returns the default limit of a server: what it stores already, and the free space of its disk without the reserve.
pub(crate) fn fitting_limit(used: u64, disk: DiskSpace) -> u64 {
    used + disk.free.saturating_sub(reserve(disk.total))
}

/// A warning for the user of `bottega up`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum RoomWarning {
    /// The store is full.
    Full(Room),
    /// The store has room again.
    RoomAgain(Room),
    /// The disk is nearly full.
    DiskNearlyFull { free: u64 },
    /// The disk is full.
    DiskFull { free: u64 },
}

/// The action that a server needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cure {
    Nothing,
    /// Wait: a restart is useless before its disk has space.
    Wait,
    /// Restart: it may have stopped storing, and its disk has space.
    StartAgain,
}

/// Watches the storage of a server.
///
/// A server whose disk was full stops storing for good, whatever it reports: 2.9 does not answer; 2.15 answers, but a
/// stream that failed to write once accepts no more.
#[derive(Debug, Default)]
pub(crate) struct RoomWatch {
    is_full: bool,
    is_disk_low: bool,
    /// True if the disk may have been full.
    has_met_end: bool,
    /// Number of reports in a row that it stores nothing.
    nothing: u32,
}

/// The number of such reports in a row that count: a server that starts or reloads its configuration stores nothing for a
/// moment.
const NOTHING_FROM: u32 = 3;

impl RoomWatch {
    /// Returns the warning for the user, if any, and the action that the server needs.
    ///
    /// - `disk`: the space on the disk of its folder; `None`: unknown.
    /// - `log_says_so`: `true` if the server has logged a full disk.
    pub(crate) fn look(
        &mut self,
        state: &ServerState,
        limit: Option<u64>,
        disk: Option<DiskSpace>,
        log_says_so: bool,
    ) -> (Option<RoomWarning>, Cure) {
        let of_disk = |disk: DiskSpace| (disk.free, reserve(disk.total) / 2, END_OF_DISK.min(disk.total / END_SHARE));
        let (free, enough, end) = disk.map_or((u64::MAX, 0, 0), of_disk);
        if free < end || log_says_so {
            let is_new = !std::mem::replace(&mut self.has_met_end, true);
            if free < enough {
                return (is_new.then_some(RoomWarning::DiskFull { free }), Cure::Wait);
            }
        }
        if self.has_met_end {
            self.has_met_end = free < enough;
            return (None, if self.has_met_end { Cure::Wait } else { Cure::StartAgain });
        }
        match state {
            ServerState::Silent => (None, Cure::Nothing),
            ServerState::StoresNothing { .. } => {
                self.nothing = (self.nothing + 1) % NOTHING_FROM;
                (None, if self.nothing == 0 { Cure::StartAgain } else { Cure::Nothing })
            }
            ServerState::Stores { bytes } => {
                self.nothing = 0;
                let room = Room { used: *bytes, limit: limit.unwrap_or(u64::MAX) };
                (self.room_warning(room).or_else(|| self.disk_warning(free, enough)), Cure::Nothing)
            }
        }
    }

    /// Returns true if the store is full.
    pub(crate) fn is_full(&self) -> bool {
        self.is_full
    }

    fn room_warning(&mut self, room: Room) -> Option<RoomWarning> {
        let share = room.used as f64 / room.limit.max(1) as f64;
        if share >= FULL_FROM && !std::mem::replace(&mut self.is_full, true) {
            return Some(RoomWarning::Full(room));
        }
        (share < ROOM_FROM && std::mem::replace(&mut self.is_full, false)).then_some(RoomWarning::RoomAgain(room))
    }

    fn disk_warning(&mut self, free: u64, enough: u64) -> Option<RoomWarning> {
        if free >= enough {
            self.is_disk_low = false;
        }
        (free < enough / 2 && !std::mem::replace(&mut self.is_disk_low, true))
            .then_some(RoomWarning::DiskNearlyFull { free })
    }
}

/// Detects a server that hangs: its process exists, but does not answer.
#[derive(Debug)]
pub(crate) struct Pulse {
    /// True once the server has answered since its start: a starting server may have much to read.
    has_answered: bool,
    silent: u32,
}

/// The number of unanswered queries in a row, of two seconds each, after which a server counts as hanging.
const SILENT_MAX: u32 = 5;

impl Pulse {
    /// Returns the state of a server that has just started.
    pub(crate) fn begin() -> Self {
        Self { has_answered: false, silent: 0 }
    }

    /// Forgets the unanswered queries so far.
    pub(crate) fn forgive(&mut self) {
        self.silent = 0;
    }

    /// Records the answer to a query. Returns `true` if the server hangs.
    pub(crate) fn take(&mut self, state: &ServerState) -> bool {
        if *state != ServerState::Silent {
            (self.has_answered, self.silent) = (true, 0);
        } else if self.has_answered {
            self.silent += 1;
        }
        self.silent >= SILENT_MAX
    }
}

/// Returns a number of bytes as text for display, such as `3.4 MB`.
pub fn bytes_said(bytes: u64) -> String {
    let bytes = bytes as f64;
    match bytes {
        ..1e6 => format!("{:.0} kB", (bytes / 1e3).ceil()),
        ..10e6 => format!("{:.1} MB", bytes / 1e6),
        ..1e9 => format!("{:.0} MB", bytes / 1e6),
        _ => format!("{:.1} GB", bytes / 1e9),
    }
}

/// The advice to a user when the store is full.
pub const MAKE_ROOM: &str = "`bottega jobs list` shows how much each job holds: remove finished jobs with `bottega jobs remove`, or cancel some; or start `bottega up` with a larger --store-size";

#[cfg(test)]
mod tests {
    use super::*;

    const GB: u64 = 1 << 30;

    fn stores(bytes: u64) -> ServerState {
        ServerState::Stores { bytes }
    }

    #[test]
    fn some_of_a_disk_stays_free() {
        for (disk_bytes, expected) in
            [(100 * GB, 5 * GB), (1000 * GB, 10 * GB), (2 * GB, 256 << 20), (GB / 16, GB / 64)]
        {
            assert_eq!(reserve(disk_bytes), expected, "{disk_bytes}");
        }
        assert_eq!(fitting_limit(3 * GB, DiskSpace { free: 20 * GB, total: 100 * GB }), 18 * GB);
        assert_eq!(fitting_limit(3 * GB, DiskSpace { free: GB, total: 100 * GB }), 3 * GB, "what is there stays");
    }

    #[test]
    fn a_full_store_is_reported_once_and_again_after_it_had_room() {
        let mut watch = RoomWatch::default();
        let mut look = |bytes| watch.look(&stores(bytes), Some(100), None, false).0;
        assert_eq!(look(50), None);
        assert_eq!(look(98), Some(RoomWarning::Full(Room { used: 98, limit: 100 })));
        assert_eq!((look(99), look(93)), (None, None));
        assert_eq!(look(20), Some(RoomWarning::RoomAgain(Room { used: 20, limit: 100 })));
        assert!(look(100).is_some());
    }

    #[test]
    fn a_server_that_met_the_end_of_its_disk_is_started_again_when_there_is_room() {
        let all = 100 * GB;
        for state in [stores(1), ServerState::Silent, ServerState::StoresNothing { reason: "x".to_owned() }] {
            let mut watch = RoomWatch::default();
            let mut look = |free, log| watch.look(&state, None, Some(DiskSpace { free, total: all }), log);
            assert_eq!(look(50 * GB, false).1, Cure::Nothing);
            assert_eq!(look(0, false), (Some(RoomWarning::DiskFull { free: 0 }), Cure::Wait));
            assert_eq!(look(GB, false), (None, Cure::Wait), "that is too little to begin with");
            assert_eq!(look(3 * GB, false), (None, Cure::StartAgain));
            assert_eq!(look(3 * GB, false).1, Cure::Nothing);
            assert_eq!(look(3 * GB, true), (None, Cure::StartAgain), "it was full for a moment");
        }
    }

    #[test]
    fn a_server_that_stores_nothing_is_restarted_and_a_low_disk_is_reported() {
        let (mut watch, nothing) = (RoomWatch::default(), ServerState::StoresNothing { reason: "x".to_owned() });
        let disk = Some(DiskSpace { free: GB, total: 100 * GB });
        assert!((1..NOTHING_FROM).all(|_| watch.look(&nothing, None, disk, false) == (None, Cure::Nothing)));
        assert_eq!(watch.look(&nothing, None, disk, false), (None, Cure::StartAgain));
        assert_eq!(watch.look(&stores(1), None, disk, false).0, Some(RoomWarning::DiskNearlyFull { free: GB }));
        assert_eq!(watch.look(&stores(1), None, disk, false).0, None);
    }

    #[test]
    fn a_server_hangs_that_answered_and_does_not_any_more() {
        let mut pulse = Pulse::begin();
        assert!((0..100).all(|_| !pulse.take(&ServerState::Silent)), "it may read for long when it begins");
        assert!(!pulse.take(&stores(1)));
        assert!((1..SILENT_MAX).all(|_| !pulse.take(&ServerState::Silent)));
        assert!(!pulse.take(&stores(1)));
        assert!((1..SILENT_MAX).all(|_| !pulse.take(&ServerState::Silent)));
        assert!(pulse.take(&ServerState::Silent));
    }

    #[test]
    fn a_server_is_started_again_for_much_that_it_counts_wrongly() {
        assert!(miscounts(98, 10, 100) && miscounts(50, 20, 100));
        assert!(!miscounts(98, 90, 100) && !miscounts(10, 20, 100));
        assert!(
            is_older("2.9.10", COUNTS_RIGHTLY) && !is_older("2.15.1", COUNTS_RIGHTLY) && !is_older("x", COUNTS_RIGHTLY)
        );
    }

    #[test]
    fn bytes_are_said_as_people_do() {
        for (bytes, said) in [(1, "1 kB"), (1_234_567, "1.2 MB"), (300_000_000, "300 MB"), (37_400_000_000, "37.4 GB")]
        {
            assert_eq!(bytes_said(bytes), said);
        }
    }
}
