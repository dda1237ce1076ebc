//! Keeps the server of a farm up: starts it again when it dies, hangs or has stopped storing, and tells its user when it has no room.

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

use crate::error::Error;
use crate::{
    job_board::JobBoard,
    patience::meanwhile,
    room::{Cure, MAKE_ROOM, Pulse, RoomNews, RoomWatch, bytes_said},
    server::{Server, Setup},
    stall_watch::StallWatch,
};

/// How often is looked whether the process is there, and how often it is asked how it is.
const LOOK_EVERY: Duration = Duration::from_millis(100);
const ASK_EVERY: Duration = Duration::from_secs(2);
/// A server that lived for so long has not died of its configuration.
const LIVES_LONG: Duration = Duration::from_secs(5);
/// How often is looked whether it counts rightly.
const COUNT_EVERY: Duration = Duration::from_secs(60);
/// So much of its log is read at a time.
const LOG_BYTES_MAX: u64 = 64 << 10;
/// How often in turn it may die sooner.
const DEATHS_MAX: u32 = 3;

/// A server and what is needed to start it again.
pub(crate) struct Keeper {
    server: Server,
    program: PathBuf,
    config: PathBuf,
    log: PathBuf,
    folder: PathBuf,
    /// What it may keep.
    limit: Option<u64>,
    board: JobBoard,
    begun: Instant,
    /// How often in turn it has died soon.
    deaths: u32,
    /// When there was a link to it the last time.
    linked: Instant,
    pulse: Pulse,
    room: RoomWatch,
    /// How much of its log was read.
    log_read: u64,
    /// When it was looked what it keeps.
    counted: Instant,
}

impl Keeper {
    pub(crate) fn new(server: Server, program: &Path, config: PathBuf, setup: &Setup, board: JobBoard) -> Self {
        let limit = setup.store_bytes;
        if let Some(bytes) = limit
            && let Err(error) = board.tell_limit(bytes)
        {
            tracing::warn!("the farm is not told how much its server keeps: {}", error.error_chain());
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

    /// How much the server keeps, for its user.
    pub(crate) fn room_said(&self) -> String {
        let folder = self.folder.display();
        match self.limit {
            Some(limit) => format!("It keeps at most {} in {folder}.", bytes_said(limit)),
            None => format!("It keeps what it is given in {folder}."),
        }
    }

    /// Until the user wants to stop.
    pub(crate) fn keep_up(&mut self, stop: &StopSwitch) -> Result<(), Error> {
        let (tell, told) = mpsc::channel();
        let (board, mut stalls) = (self.board.clone(), StallWatch::new());
        let ask = move || {
            // Nobody listens any more when the user wants to stop.
            _ = tell.send(board.uplink.server_state());
            board.clear_seats();
            board.clear_pages();
            stalls.look(&board);
        };
        meanwhile(ASK_EVERY, ask, || {
            while !stop.is_requested() {
                if let Some(wrong) = self.look(&told)? {
                    self.start_again(&wrong)?;
                    // What was said of the one before.
                    told.try_iter().for_each(drop);
                }
                thread::sleep(LOOK_EVERY);
            }
            Ok(())
        })
    }

    /// Why the server is to be started again, if it is.
    fn look(&mut self, told: &mpsc::Receiver<ServerState>) -> Result<Option<String>, Error> {
        if let Some(status) = self.server.ended()? {
            let cure = self.see_to_room(&ServerState::Silent);
            return Ok((cure != Cure::Wait).then(|| format!("ended ({status})")));
        }
        if self.board.uplink.is_connected() {
            self.linked = Instant::now();
        }
        // Of one that was adopted nothing else can be known.
        if self.server.is_adopted() && self.linked.elapsed() > LIVES_LONG {
            return Ok(Some("has gone".to_owned()));
        }
        for state in told.try_iter() {
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
                return Ok(Some("counts as kept what it has let go of, as those before 2.10 do".to_owned()));
            }
        }
        Ok(None)
    }

    /// Looks now and then whether what the server says that it keeps is there, and always when it says that it is full.
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
        let (news, cure) = self.room.look(state, self.limit, disk::space(&self.folder), log_says_so);
        if let Some(news) = news {
            self.say(&news);
        }
        cure
    }

    /// Whether the server has written since the last call that its disk is full.
    fn log_says_full(&mut self) -> bool {
        let mut new = Vec::new();
        let read = File::open(&self.log).and_then(|mut log| {
            let bytes = log.metadata()?.len();
            // It may have been begun anew.
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

    fn say(&self, news: &RoomNews) {
        let folder = self.folder.display();
        match news {
            RoomNews::Full(room) => tracing::warn!(
                "the store is full, {} of at most {}: jobs wait until there is room. {MAKE_ROOM}",
                bytes_said(room.used),
                bytes_said(room.limit)
            ),
            RoomNews::RoomAgain(room) => {
                tracing::warn!(
                    "the store has room again, {} of at most {} are kept: jobs go on",
                    bytes_said(room.used),
                    bytes_said(room.limit)
                );
            }
            RoomNews::DiskNearlyFull { free } => tracing::warn!(
                "the disk of {folder} has {} left: make room there, or the server will soon store nothing",
                bytes_said(*free)
            ),
            RoomNews::DiskFull { free } => tracing::warn!(
                "the disk of {folder} is full ({} left), and the server may have stopped storing: make room there; it is \
                 started again then, and jobs go on by themselves",
                bytes_said(*free)
            ),
        }
    }
}
