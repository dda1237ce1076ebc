//! Supervision of a farm's NATS server: restarts it when it dies, hangs or stops storing, and warns when it runs out of space.

use std::{
    fs::{self, File},
    io::{Read, Seek, SeekFrom},
    path::{Path, PathBuf},
    sync::mpsc,
    thread,
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::ServerState;
use bottega_farm::StopSwitch;
use bottega_platform::disk;

use crate::{
    error::Error,
    job::{board::JobBoard, stall_watch::StallWatch},
    server::{
        patience::meanwhile,
        process::{Server, Setup},
        room::{Cure, MAKE_ROOM, Pulse, RoomWarning, RoomWatch, bytes_said},
    },
};

/// Intervals between checks that the process exists, and between queries of its state.
const LOOK_EVERY: Duration = Duration::from_millis(100);
const ASK_EVERY: Duration = Duration::from_secs(2);
/// Uptime after which a death is not blamed on the configuration.
const LIVES_LONG: Duration = Duration::from_secs(5);
/// Interval between checks of the server's storage accounting.
const COUNT_EVERY: Duration = Duration::from_secs(60);
/// The most that is read of its log at a time, in bytes.
const LOG_BYTES_MAX: u64 = 64 << 10;
/// The most early deaths in a row.
const DEATHS_MAX: u32 = 3;

/// A server with everything that restarts it.
pub(crate) struct ServerSupervisor {
    server: Server,
    program: PathBuf,
    config: PathBuf,
    log: PathBuf,
    folder: PathBuf,
    /// The most that the server may store, in bytes; none: no limit.
    limit: Option<u64>,
    board: JobBoard,
    begun: Instant,
    /// Number of early deaths in a row.
    deaths: u32,
    /// The last time at which a connection to the server was up.
    linked: Instant,
    pulse: Pulse,
    room: RoomWatch,
    /// Bytes of the server's log that were read.
    log_read: u64,
    /// The last time at which the server's storage accounting was checked.
    counted: Instant,
}

impl ServerSupervisor {
    /// Returns the supervision of a running server, and publishes its storage limit.
    pub(crate) fn new(server: Server, program: &Path, config: PathBuf, setup: &Setup, board: JobBoard) -> Self {
        let limit = setup.store_bytes;
        if let Some(bytes) = limit
            && let Err(error) = board.tell_limit(bytes)
        {
            tracing::warn!("cannot publish the storage limit of the farm's server: {}", error.error_chain());
        }
        Self {
            server,
            program: program.to_owned(),
            config,
            log: setup.log(),
            folder: setup.folder.clone(),
            limit,
            board,
            begun: Instant::now(),
            deaths: 0,
            linked: Instant::now(),
            pulse: Pulse::begin(),
            room: RoomWatch::default(),
            counted: Instant::now(),
            log_read: fs::metadata(setup.log()).map_or(0, |log| log.len()),
        }
    }

    /// Returns a sentence for display: the folder in which the server stores its data, and the limit if there is one.
    pub(crate) fn room_said(&self) -> String {
        let folder = self.folder.display();
        match self.limit {
            Some(limit) => format!("It stores at most {} in {folder}.", bytes_said(limit)),
            None => format!("It stores its data in {folder}."),
        }
    }

    /// Supervises the server until the user stops.
    pub(crate) fn keep_up(&mut self, stop: &StopSwitch) -> Result<(), Error> {
        let (state_sender, states) = mpsc::channel();
        let (board, mut stalls) = (self.board.clone(), StallWatch::new());
        let ask = move || {
            // The receiver is gone once the user stops.
            _ = state_sender.send(board.uplink.server_state());
            board.clear_presences();
            board.clear_pages();
            stalls.look(&board);
        };
        meanwhile(ASK_EVERY, ask, || {
            while !stop.is_requested() {
                if let Some(wrong) = self.look(&states)? {
                    self.start_again(&wrong)?;
                    // Discard states of the previous server.
                    states.try_iter().for_each(drop);
                }
                thread::sleep(LOOK_EVERY);
            }
            Ok(())
        })
    }

    /// Returns the reason for a restart, if one is needed.
    fn look(&mut self, states: &mpsc::Receiver<ServerState>) -> Result<Option<String>, Error> {
        if let Some(status) = self.server.ended()? {
            let cure = self.see_to_room(&ServerState::Silent);
            return Ok((cure != Cure::Wait).then(|| format!("ended ({status})")));
        }
        if self.board.uplink.is_connected() {
            self.linked = Instant::now();
        }
        // An adopted server is not a child process: only its connection shows if it lives.
        if self.server.is_adopted() && self.linked.elapsed() > LIVES_LONG {
            return Ok(Some("has gone".to_owned()));
        }
        for state in states.try_iter() {
            match self.see_to_room(&state) {
                Cure::Wait => {
                    self.pulse.forgive();
                    continue;
                }
                Cure::StartAgain => return Ok(Some("may have stopped storing, and its disk has room".to_owned())),
                Cure::Nothing => {}
            }
            if self.pulse.take(&state) {
                return Ok(Some("does not answer".to_owned()));
            }
            if self.counts_wrongly(&state) {
                return Ok(Some("counts deleted data as stored, as versions before 2.10 do".to_owned()));
            }
        }
        Ok(None)
    }

    /// Checks from time to time that the server's reported storage use is real, and always while it reports to be full.
    fn counts_wrongly(&mut self, state: &ServerState) -> bool {
        let (ServerState::Stores { bytes }, Some(limit)) = (state, self.limit) else { return false };
        let is_due = self.room.is_full() || *bytes > limit / 2 && self.counted.elapsed() > COUNT_EVERY;
        if is_due {
            self.counted = Instant::now();
        }
        is_due && self.board.counts_wrongly(*bytes, limit)
    }

    fn see_to_room(&mut self, state: &ServerState) -> Cure {
        let log_says_so = self.log_says_full();
        let (warning, cure) = self.room.look(state, self.limit, disk::space(&self.folder), log_says_so);
        if let Some(warning) = warning {
            self.warn(&warning);
        }
        cure
    }

    /// Returns true if the server has logged a full disk since the last call.
    fn log_says_full(&mut self) -> bool {
        let mut new = Vec::new();
        let read = File::open(&self.log).and_then(|mut log| {
            let bytes = log.metadata()?.len();
            // The log may have been truncated.
            let from = self.log_read.min(bytes).max(bytes.saturating_sub(LOG_BYTES_MAX));
            log.seek(SeekFrom::Start(from))?;
            self.log_read = bytes;
            log.take(LOG_BYTES_MAX).read_to_end(&mut new)
        });
        read.is_ok() && String::from_utf8_lossy(&new).contains("no space left on device")
    }

    fn start_again(&mut self, wrong: &str) -> Result<(), Error> {
        self.deaths = if self.begun.elapsed() > LIVES_LONG { 1 } else { self.deaths + 1 };
        if self.deaths > DEATHS_MAX {
            let problem = format!("the NATS server fails whenever it is started: it {wrong}");
            return Err(Error::failed(problem, format!("see {}", self.log.display())));
        }
        tracing::warn!("the NATS server {wrong}; it is started again");
        self.server.end();
        self.server = Server::start(&self.program, &self.config)?;
        (self.begun, self.linked, self.pulse) = (Instant::now(), Instant::now(), Pulse::begin());
        Ok(())
    }

    fn warn(&self, warning: &RoomWarning) {
        let folder = self.folder.display();
        match warning {
            RoomWarning::Full(room) => tracing::warn!(
                "the store is full, {} of at most {}: jobs wait until there is room. {MAKE_ROOM}",
                bytes_said(room.used),
                bytes_said(room.limit)
            ),
            RoomWarning::RoomAgain(room) => {
                tracing::warn!(
                    "the store has room again, {} of at most {} are used: jobs continue",
                    bytes_said(room.used),
                    bytes_said(room.limit)
                );
            }
            RoomWarning::DiskNearlyFull { free } => tracing::warn!(
                "the disk of {folder} has {} left: make room there, or the server will soon store nothing",
                bytes_said(*free)
            ),
            RoomWarning::DiskFull { free } => tracing::warn!(
                "the disk of {folder} is full ({} left), and the server may have stopped storing: make room there; then the server is restarted and jobs continue",
                bytes_said(*free)
            ),
        }
    }
}
